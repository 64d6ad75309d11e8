//! Occupancy maps in map_server's format: a YAML file that names an image (PGM or PNG), a resolution and an origin.
//!
//! Darkness p = (255 − v)/255, or v/255 with `negate`; a cell is an obstacle when p ≥ `occupied_thresh` (`raw` mode:
//! when the value itself, 0…100, reaches 100 · `occupied_thresh`). Unknown and transparent cells are free. Row 0 of
//! the image is the top, the largest y. Source: nav2's map_server.
//!
//! The borders of the occupied cells become walls, neighbouring ones joined: exact, and indexed as all else.

use super::build::{Loader, beside};
use super::error::{WorldError, nearest_word};
use super::image::{self, Image};
use super::{Sketch, Solid};
use crate::geometry::{Point, Pose, Segment};

const KEYS: [&str; 7] = ["image", "resolution", "origin", "occupied_thresh", "free_thresh", "negate", "mode"];

/// What a map_server YAML says.
#[derive(Debug, Clone, PartialEq)]
struct Sheet {
    image: String,
    resolution_m: f64,
    origin: Pose,
    occupied_thresh: f64,
    negate: bool,
    raw: bool,
}

/// Adds the occupied cells of the map whose YAML is given.
pub(super) fn add(
    sketch: &mut Sketch,
    file: &str,
    yaml: &[u8],
    rough: bool,
    load: &mut Loader,
) -> Result<(), WorldError> {
    let text = std::str::from_utf8(yaml)
        .map_err(|_| WorldError::of_file(file, "it is not UTF-8 text", "give the map's YAML file, not its image"))?;
    let sheet = parse(file, text)?;
    let name = beside(file, &sheet.image);
    let bytes = load(&name)
        .map_err(|why| WorldError::of_file(file, format!("cannot read its image {name}: {why}"), "correct `image`"))?;
    let image = image::decode(&name, &bytes)?;
    let cells = Cells::of(&image, |shade| is_occupied(shade, &sheet));
    let (cos, sin) = (runtime::math::cos(sheet.origin.heading_rad), runtime::math::sin(sheet.origin.heading_rad));
    let place = |column: usize, row: usize| {
        let corner = Point::new(column as f64 * sheet.resolution_m, row as f64 * sheet.resolution_m);
        sheet.origin.place() + corner.turned(cos, sin)
    };
    for [from, to] in cells.borders() {
        sketch.add_line(Segment::new(place(from.0, from.1), place(to.0, to.1)), rough);
    }
    for [low, high] in cells.blocks() {
        let outline = vec![place(low.0, low.1), place(high.0, low.1), place(high.0, high.1), place(low.0, high.1)];
        sketch.solids.push(Solid { outline });
    }
    Ok(())
}

fn parse(file: &str, text: &str) -> Result<Sheet, WorldError> {
    let mut found: [Option<(usize, &str)>; 7] = [None; 7];
    let mut offset = 0;
    for line in text.split_inclusive('\n') {
        let bare = line.split('#').next().unwrap_or_default();
        let start = offset + (bare.len() - bare.trim_start().len());
        offset += line.len();
        let bare = bare.trim();
        if bare.is_empty() || bare == "---" {
            continue;
        }
        let fault = |reason: String, remedy: String| WorldError::at(file, text, start, reason, remedy);
        let Some((key, value)) = bare.split_once(':') else {
            return Err(fault(format!("expected `key: value`, found `{bare}`"), "write one key in a line".to_owned()));
        };
        let Some(index) = KEYS.iter().position(|known| *known == key.trim()) else {
            let remedy = match nearest_word(key.trim(), KEYS.into_iter()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("valid here: {}", KEYS.join(", ")),
            };
            return Err(fault(format!("unknown key `{}`", key.trim()), remedy));
        };
        found[index] = Some((start, value.trim().trim_matches(|quote| quote == '"' || quote == '\'')));
    }
    let missing = |key: &str| WorldError::of_file(file, format!("it lacks `{key}`"), "add it");
    let wrong = |at: usize, key: &str, what: &str| {
        WorldError::at(file, text, at, format!("`{key}` must be {what}"), "correct it there")
    };
    let number = |index: usize, default: Option<f64>| match (found[index], default) {
        (Some((at, value)), _) => {
            value.parse().ok().filter(|number: &f64| number.is_finite()).ok_or(wrong(at, KEYS[index], "a number"))
        }
        (None, Some(default)) => Ok(default),
        (None, None) => Err(missing(KEYS[index])),
    };
    let (_, image) = found[0].ok_or_else(|| missing("image"))?;
    let resolution_m = number(1, None)?;
    let (at, _) = found[1].unwrap_or_default();
    if resolution_m <= 0.0 {
        return Err(wrong(at, "resolution", "above zero [m per pixel]"));
    }
    let (at, origin) = found[2].ok_or_else(|| missing("origin"))?;
    let parts: Option<Vec<f64>> = origin.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).and_then(|rest| {
        rest.split(',').map(|part| part.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect()
    });
    let origin = match parts.as_deref() {
        Some([x, y, yaw]) => Pose::new(*x, *y, *yaw),
        _ => return Err(wrong(at, "origin", "[x, y, yaw]")),
    };
    let negate = match found[5] {
        None | Some((_, "0" | "false")) => false,
        Some((_, "1" | "true")) => true,
        Some((at, _)) => return Err(wrong(at, "negate", "0, 1, false or true")),
    };
    let raw = match found[6] {
        None | Some((_, "trinary" | "scale")) => false,
        Some((_, "raw")) => true,
        Some((at, _)) => return Err(wrong(at, "mode", "trinary, scale or raw")),
    };
    number(4, Some(0.25))?;
    Ok(Sheet { image: image.to_owned(), resolution_m, origin, occupied_thresh: number(3, Some(0.65))?, negate, raw })
}

/// Whether a cell of that shade is occupied.
fn is_occupied(shade: Option<f32>, sheet: &Sheet) -> bool {
    match (shade.map(f64::from), sheet.raw) {
        (None, _) => false,
        (Some(value), true) => value <= 100.0 && value >= 100.0 * sheet.occupied_thresh,
        (Some(value), false) => {
            let dark = if sheet.negate { value / 255.0 } else { (255.0 - value) / 255.0 };
            dark >= sheet.occupied_thresh
        }
    }
}

/// Occupied cells; corners of cells are counted in whole columns and rows.
pub(super) struct Cells {
    columns: usize,
    rows: usize,
    /// From the lower left corner in rows.
    occupied: Vec<bool>,
}

pub(super) type Corner = (usize, usize);

impl Cells {
    /// A picture's cells; its first row is the topmost.
    pub fn of(image: &Image, is_occupied: impl Fn(Option<f32>) -> bool) -> Cells {
        let rows = image.shades.chunks_exact(image.width).rev();
        let occupied = rows.flatten().map(|shade| is_occupied(*shade)).collect();
        Cells { columns: image.width, rows: image.height, occupied }
    }

    /// Whether the cell left of and below the corner (`column`, `row`) is occupied; free outside.
    fn at(&self, column: usize, row: usize) -> bool {
        (1..=self.columns).contains(&column)
            && (1..=self.rows).contains(&row)
            && self.occupied[(row - 1) * self.columns + column - 1]
    }

    /// Borders between occupied and free, joined along rows and columns.
    pub fn borders(&self) -> Vec<[Corner; 2]> {
        let mut found = Vec::new();
        for row in 0..=self.rows {
            let differs = |column: usize| self.at(column + 1, row) != self.at(column + 1, row + 1);
            runs(self.columns, differs, |from, to| found.push([(from, row), (to, row)]));
        }
        for column in 0..=self.columns {
            let differs = |row: usize| self.at(column, row + 1) != self.at(column + 1, row + 1);
            runs(self.rows, differs, |from, to| found.push([(column, from), (column, to)]));
        }
        found
    }

    /// Rectangles that cover the occupied cells exactly once, for drawing and for telling inside from outside.
    pub fn blocks(&self) -> Vec<[Corner; 2]> {
        let mut open: Vec<[Corner; 2]> = Vec::new();
        let mut found = Vec::new();
        for row in 0..=self.rows {
            let mut next: Vec<[Corner; 2]> = Vec::new();
            runs(
                self.columns,
                |column| self.at(column + 1, row + 1),
                |from, to| {
                    // A run as wide as one in the row below continues it.
                    let below = open.iter().position(|[low, high]| low.0 == from && high.0 == to);
                    let low = below.map_or((from, row), |at| open.swap_remove(at)[0]);
                    next.push([low, (to, row + 1)]);
                },
            );
            found.append(&mut open);
            open = next;
        }
        found
    }
}

/// Calls `found` for every longest run of `true` among 0..count.
fn runs(count: usize, holds: impl Fn(usize) -> bool, mut found: impl FnMut(usize, usize)) {
    let mut begun = None;
    for at in 0..=count {
        match (begun, at < count && holds(at)) {
            (None, true) => begun = Some(at),
            (Some(from), false) => {
                found(from, at);
                begun = None;
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::World;

    const YAML: &str =
        "image: m.pgm\nresolution: 0.5\norigin: [1.0, 2.0, 0.0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\nnegate: 0\n";
    // Top row first: one cell in the upper left corner, two in the lower right.
    const PGM: &str = "P2\n3 2\n255\n0 255 255\n255 0 0\n";

    fn world(yaml: &str) -> Result<World, WorldError> {
        let mut sketch = Sketch::default();
        add(&mut sketch, "maps/m.yaml", yaml.as_bytes(), false, &mut |name| {
            assert_eq!(name, "maps/m.pgm");
            Ok(PGM.into())
        })?;
        Ok(sketch.finish())
    }

    #[test]
    fn the_pictures_first_row_is_the_worlds_top() {
        let world = world(YAML).unwrap();
        assert!(world.is_solid(Point::new(1.25, 2.75)));
        assert!(world.is_solid(Point::new(1.75, 2.25)) && world.is_solid(Point::new(2.25, 2.25)));
        assert!(!world.is_solid(Point::new(1.25, 2.25)) && !world.is_solid(Point::new(2.25, 2.75)));
        // Looking right from the free lower left cell: the occupied pair begins half a metre on.
        assert_eq!(world.map.cast(Point::new(1.25, 2.25), Point::new(1.0, 0.0), 9.0), Some(0.25));
        assert_eq!(world.map.cast(Point::new(1.25, 2.25), Point::new(0.0, 1.0), 9.0), Some(0.25));
        assert_eq!(world.map.cast(Point::new(1.25, 2.25), Point::new(0.0, -1.0), 9.0), None);
    }

    #[test]
    fn neighbouring_borders_are_joined() {
        let world = world(YAML).unwrap();
        // Outlines of 1×1 and 2×1 cells that touch in a corner have 8 sides; those that lie on one line are joined.
        assert_eq!(world.map.segments().len(), 6);
    }

    #[test]
    fn negate_and_yaw_are_obeyed() {
        let negated = world(&YAML.replace("negate: 0", "negate: true")).unwrap();
        assert!(!negated.is_solid(Point::new(1.25, 2.75)) && negated.is_solid(Point::new(1.25, 2.25)));
        let turned = world(&YAML.replace("0.0]", "1.5707963267948966]")).unwrap();
        assert!(turned.is_solid(Point::new(0.25, 2.25)));
    }

    #[test]
    fn faults_name_line_and_column_and_the_nearest_key() {
        let said = |yaml: &str| world(yaml).unwrap_err().to_string();
        assert_eq!(
            said(&YAML.replace("resolution", "  resolutoin")),
            "maps/m.yaml:2:3: unknown key `resolutoin`; did you mean `resolution`?"
        );
        assert!(said(&YAML.replace("0.5", "-1")).contains("m.yaml:2:1: `resolution` must be above zero"));
        assert!(said(&YAML.replace("[1.0, 2.0, 0.0]", "[1.0, 2.0]")).contains("`origin` must be [x, y, yaw]"));
        assert!(said("resolution: 1\n").contains("it lacks `image`"));
        assert!(said("just words").contains("expected `key: value`"));
    }
}
