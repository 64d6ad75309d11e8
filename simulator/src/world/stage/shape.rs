//! What stands where a model of a Stage world is: its bitmap, its blocks, or the box of its size.

use super::words::{Entry, Place, Value};
use super::{Said, Stage};
use crate::geometry::{Point, Pose, Segment};
use crate::world::bitmap::Cells;
use crate::world::build::beside;
use crate::world::error::WorldError;
use crate::world::{Solid, image};

/// A pixel that is no brighter is an obstacle.
const DARK: f32 = 127.0;

/// Whether a property describes blocks in the way of Stage 2 and 3, as in `block[0].point[1]`.
pub(super) fn is_its_word(word: &str) -> bool {
    word.starts_with("block[")
}

/// Stretches a box onto a model.
struct Stretch {
    low: Point,
    scale: Point,
    half: Point,
    pose: Pose,
    origin: Pose,
}

impl Stretch {
    fn place(&self, point: Point) -> Point {
        let to = point - self.low;
        let own = Point::new(to.x_m * self.scale.x_m, to.y_m * self.scale.y_m) - self.half;
        self.pose.world_from_body(self.origin.world_from_body(own))
    }
}

impl<'a> Stage<'a, '_> {
    /// Adds a model's shape.
    pub(super) fn shape(&mut self, said: &Said<'a>, pose: &Pose, place: &'a Place) -> Result<(), WorldError> {
        let size = self.size(said)?;
        let origin = self.pose(said, "origin")?;
        let onto = |low: Point, high: Point| {
            let box_ = high - low;
            let scale = Point::new(size.x_m / box_.x_m, size.y_m / box_.y_m);
            Stretch { low, scale, half: size * 0.5, pose: *pose, origin }
        };
        if said.last("boundary").is_some_and(|(value, _)| *value != Value::Number(0.0)) {
            let stretch = onto(Point::ZERO, Point::new(1.0, 1.0));
            let corners =
                [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| stretch.place(Point::new(x, y)));
            for k in 0..4 {
                self.sketch.add_line(Segment::new(corners[k], corners[(k + 1) % 4]), false);
            }
        }
        if let Some((value, place)) = said.last("bitmap") {
            let Value::Text(name) = value else {
                return Err(place.fault("`bitmap` needs a name in quotes", "write bitmap \"FILE\""));
            };
            return self.picture(name, place, onto);
        }
        let polygons = polygons(said, place)?;
        if polygons.is_empty() {
            let stretch = onto(Point::ZERO, Point::new(1.0, 1.0));
            let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
            let outline = corners.map(|(x, y)| stretch.place(Point::new(x, y))).to_vec();
            self.sketch.add_solid(Solid { outline }, false);
            return Ok(());
        }
        let (low, high) = bounds(polygons.iter().flatten().copied());
        if !(high.x_m > low.x_m && high.y_m > low.y_m) {
            return Err(place.fault("its blocks have no area", "give every block three corners apart"));
        }
        let stretch = onto(low, high);
        for polygon in polygons {
            let outline = polygon.into_iter().map(|point| stretch.place(point)).collect();
            self.sketch.add_solid(Solid { outline }, false);
        }
        Ok(())
    }

    fn picture(&mut self, name: &str, place: &Place, onto: impl Fn(Point, Point) -> Stretch) -> Result<(), WorldError> {
        let (far, near) = (beside(self.file, name), beside(place.file(), name));
        let bytes = (self.load)(&far).or_else(|why| if near == far { Err(why) } else { (self.load)(&near) });
        let bytes = bytes.map_err(|why| {
            place.fault(format!("cannot read {far}: {why}"), "correct the name, which is relative to the world file")
        })?;
        let image = image::decode(&far, &bytes)?;
        let cells = Cells::of(&image, |shade| shade.is_some_and(|shade| shade <= DARK));
        let corner = |(column, row): (usize, usize)| Point::new(column as f64, row as f64);
        let blocks = cells.blocks();
        let (low, high) = bounds(blocks.iter().flatten().map(|at| corner(*at)));
        if blocks.is_empty() {
            self.note(place, &format!("{far} has no dark pixel: the model is nothing at all"));
            return Ok(());
        }
        let stretch = onto(low, high);
        let at = |corners: (usize, usize)| stretch.place(corner(corners));
        for [from, to] in cells.borders() {
            self.sketch.add_line(Segment::new(at(from), at(to)), false);
        }
        for [low, high] in blocks {
            let outline = vec![at(low), at((high.0, low.1)), at(high), at((low.0, high.1))];
            self.sketch.solids.push(Solid { outline });
        }
        Ok(())
    }
}

fn bounds(points: impl Iterator<Item = Point>) -> (Point, Point) {
    let mut low = Point::new(f64::INFINITY, f64::INFINITY);
    let mut high = -low;
    for point in points {
        low = Point::new(low.x_m.min(point.x_m), low.y_m.min(point.y_m));
        high = Point::new(high.x_m.max(point.x_m), high.y_m.max(point.y_m));
    }
    (low, high)
}

/// The corners of all blocks: things `block ( point[0] [x y] ... )`, or properties `block[0].point[0] [x y]`.
fn polygons(said: &Said, place: &Place) -> Result<Vec<Vec<Point>>, WorldError> {
    let mut found: Vec<Vec<(usize, Point)>> = Vec::new();
    for (kind, body, _) in &said.things {
        if *kind == "block" {
            let mut corners = Vec::new();
            for entry in *body {
                if let Entry::Property { word, value, place } = entry
                    && let Some(index) = index_of(word, "point[")
                {
                    corners.push((index, corner(value, place)?));
                }
            }
            found.push(corners);
        }
    }
    let mut numbered: std::collections::BTreeMap<usize, Vec<(usize, Point)>> = Default::default();
    for (word, value, place) in &said.properties {
        if let Some((block, rest)) = word.split_once('.')
            && let (Some(block), Some(index)) = (index_of(block, "block["), index_of(rest, "point["))
        {
            numbered.entry(block).or_default().push((index, corner(value, place)?));
        }
    }
    found.extend(numbered.into_values());
    for corners in &mut found {
        corners.sort_by_key(|(index, _)| *index);
        if corners.len() < 3 {
            return Err(place.fault("a block has fewer than three corners", "give it point[0] to point[2] at least"));
        }
    }
    Ok(found.into_iter().map(|corners| corners.into_iter().map(|(_, point)| point).collect()).collect())
}

fn index_of(word: &str, before: &str) -> Option<usize> {
    word.strip_prefix(before)?.strip_suffix(']')?.parse().ok()
}

fn corner(value: &Value, place: &Place) -> Result<Point, WorldError> {
    match value {
        Value::List(numbers) if numbers.len() >= 2 => Ok(Point::new(numbers[0], numbers[1])),
        _ => Err(place.fault("a corner needs two numbers", "write point[0] [x y]")),
    }
}
