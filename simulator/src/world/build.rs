//! From a world file's words to a world: checks every number and says where a wrong one stands.

use super::crowd::{self, Crowd};
use super::error::{WorldError, nearest_word};
use super::file::{BoxTable, CircleTable, CrowdTable, PersonTable, PolygonTable, StartTable, WallTable, WorldFile};
use super::{Course, Person, Sketch, Social, Solid, Start, barn, bitmap, dynabarn};
use crate::geometry::{Circle, Point, Segment};
use std::f64::consts::PI;
use toml::Spanned;

const DEG: f64 = PI / 180.0;

/// Reads a further file that a world file names.
pub(super) type Loader<'a> = dyn FnMut(&str) -> Result<Vec<u8>, String> + 'a;

/// Builds the world that the TOML `text` of `file` describes.
pub(super) fn from_toml(file: &str, text: &str, load: &mut Loader) -> Result<Sketch, WorldError> {
    let words: WorldFile = toml::from_str(text).map_err(|error| refused(file, text, &error))?;
    let at = Source { file, text };
    let mut sketch = Sketch { name: words.name, ..Sketch::default() };
    if let Some(bounds) = &words.bounds_m {
        let [left, bottom, right, top] = *bounds.get_ref();
        at.require(
            bounds,
            left < right && bottom < top && (right - left).is_finite() && (top - bottom).is_finite(),
            "bounds_m must be [left, bottom, right, top] with left < right and bottom < top",
            "order the four numbers so",
        )?;
        let corners = [(left, bottom), (right, bottom), (right, top), (left, top)].map(|(x, y)| Point::new(x, y));
        for k in 0..4 {
            sketch.add_line(Segment::new(corners[k], corners[(k + 1) % 4]), false);
        }
    }
    for wall in &words.wall {
        add_wall(&mut sketch, &at, wall)?;
    }
    for table in &words.r#box {
        add_box(&mut sketch, &at, table)?;
    }
    for polygon in &words.polygon {
        add_polygon(&mut sketch, &at, polygon)?;
    }
    for circle in &words.circle {
        add_circle(&mut sketch, &at, circle)?;
    }
    if let Some(table) = &words.bitmap {
        let name = beside(file, &table.get_ref().file);
        let bytes = at.load(load, table, &name)?;
        bitmap::add(&mut sketch, &name, &bytes, table.get_ref().rough, load)?;
    }
    if let Some(table) = &words.barn {
        let name = beside(file, &table.get_ref().file);
        let bytes = at.load(load, table, &name)?;
        barn::add(&mut sketch, &name, &bytes, table.get_ref().world)?;
    }
    if let Some(table) = &words.dynabarn {
        let name = beside(file, &table.get_ref().file);
        let bytes = at.load(load, table, &name)?;
        dynabarn::add(&mut sketch, &name, &bytes, table.get_ref().world)?;
    }
    for start in &words.start {
        sketch.starts.push(read_start(&at, start)?);
    }
    for person in &words.person {
        sketch.persons.push(read_person(&at, person)?);
    }
    for table in &words.crowd {
        let CrowdTable { count, seed, sees_robots } = *table.get_ref();
        let reason = format!("a crowd has 1 to {} people", crowd::MOST);
        at.require(table, (1..=crowd::MOST).contains(&count), &reason, "write for example count = 12")?;
        sketch.crowds.push(Crowd { count, seed, sees_robots });
    }
    Ok(sketch)
}

/// `name` as seen from the folder of `file`.
pub(super) fn beside(file: &str, name: &str) -> String {
    match file.rsplit_once('/') {
        Some((folder, _)) if !name.starts_with('/') && !name.starts_with("~/") => format!("{folder}/{name}"),
        _ => name.to_owned(),
    }
}

fn add_wall(sketch: &mut Sketch, at: &Source, table: &Spanned<WallTable>) -> Result<(), WorldError> {
    let wall = table.get_ref();
    let points = at.points(table, &wall.points_m, 2)?;
    at.require(
        table,
        wall.thickness_m >= 0.0 && wall.thickness_m.is_finite(),
        "thickness_m must not be negative",
        "leave it out for a bare line",
    )?;
    let mut corners = points.clone();
    if wall.closed {
        corners.push(points[0]);
    }
    let length_m: f64 = corners.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    let mut gaps = Vec::new();
    for door in &wall.doors {
        let (from, to) =
            (door.get_ref().at_m - 0.5 * door.get_ref().width_m, door.get_ref().at_m + 0.5 * door.get_ref().width_m);
        at.require(door, from < to, "a door needs a width_m above zero", "write for example width_m = 0.9")?;
        let reason =
            format!("the door from {from:.3} m to {to:.3} m lies outside the wall, which is {length_m:.3} m long");
        at.require(door, from >= 0.0 && to <= length_m, &reason, "move it or make it narrower")?;
        gaps.push((from, to));
    }
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(pair) = gaps.windows(2).find(|pair| pair[0].1 > pair[1].0) {
        let reason = format!("the doors at {:.3} m and {:.3} m overlap", pair[0].0, pair[1].0);
        return Err(at.fault(table, &reason, "move one of them"));
    }
    let mut begun_m = 0.0;
    for pair in corners.windows(2) {
        let (from, along) = (pair[0], pair[1] - pair[0]);
        let piece_m = along.norm();
        for (start, end) in solid_runs(begun_m, begun_m + piece_m, &gaps) {
            let point = |way_m: f64| from + along * ((way_m - begun_m) / piece_m);
            sketch.add_slab(Segment::new(point(start), point(end)), wall.thickness_m, wall.rough);
        }
        begun_m += piece_m;
    }
    Ok(())
}

/// What is left of the way from `from` to `to` between the gaps, which are sorted and apart.
fn solid_runs(from: f64, to: f64, gaps: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut runs = Vec::new();
    let mut begin = from;
    for (gap_from, gap_to) in gaps {
        if *gap_to <= begin || *gap_from >= to {
            continue;
        }
        if *gap_from > begin {
            runs.push((begin, *gap_from));
        }
        begin = begin.max(*gap_to);
    }
    if begin < to {
        runs.push((begin, to));
    }
    runs
}

fn add_box(sketch: &mut Sketch, at: &Source, table: &Spanned<BoxTable>) -> Result<(), WorldError> {
    let BoxTable { centre_m, size_m, heading_deg, rough } = table.get_ref();
    let finite = centre_m.iter().chain(size_m).chain([heading_deg]).all(|number| number.is_finite());
    at.require(
        table,
        finite && size_m[0] > 0.0 && size_m[1] > 0.0,
        "a box needs a size_m of two lengths above zero",
        "write for example size_m = [1.6, 0.8]",
    )?;
    let (along, across) =
        (Point::unit(heading_deg * DEG) * (0.5 * size_m[0]), Point::unit(heading_deg * DEG).left() * (0.5 * size_m[1]));
    let centre = Point::new(centre_m[0], centre_m[1]);
    sketch.add_solid(
        Solid {
            outline: vec![
                centre - along - across,
                centre + along - across,
                centre + along + across,
                centre - along + across,
            ],
        },
        *rough,
    );
    Ok(())
}

fn add_polygon(sketch: &mut Sketch, at: &Source, table: &Spanned<PolygonTable>) -> Result<(), WorldError> {
    let outline = at.points(table, &table.get_ref().points_m, 3)?;
    sketch.add_solid(Solid { outline }, table.get_ref().rough);
    Ok(())
}

fn add_circle(sketch: &mut Sketch, at: &Source, table: &Spanned<CircleTable>) -> Result<(), WorldError> {
    let CircleTable { centre_m, radius_m, rough } = table.get_ref();
    let finite = centre_m.iter().chain([radius_m]).all(|number| number.is_finite());
    at.require(
        table,
        finite && *radius_m > 0.0,
        "a circle needs a radius_m above zero",
        "write for example radius_m = 0.2",
    )?;
    sketch.add_post(Circle::new(Point::new(centre_m[0], centre_m[1]), *radius_m), *rough);
    Ok(())
}

fn read_start(at: &Source, table: &Spanned<StartTable>) -> Result<Start, WorldError> {
    let start = table.get_ref();
    let numbers = [start.x_m, start.y_m, start.heading_deg, start.spread_m, start.spread_deg];
    at.require(
        table,
        numbers.iter().all(|number| number.is_finite()),
        "a start needs finite numbers",
        "replace nan and inf",
    )?;
    at.require(
        table,
        start.spread_m >= 0.0 && start.spread_deg >= 0.0,
        "a spread must not be negative",
        "leave it out for none",
    )?;
    Ok(Start {
        pose: crate::geometry::Pose::new(start.x_m, start.y_m, runtime::math::wrap_angle(start.heading_deg * DEG)),
        spread_m: start.spread_m,
        spread_rad: start.spread_deg * DEG,
    })
}

fn read_person(at: &Source, table: &Spanned<PersonTable>) -> Result<Person, WorldError> {
    let words = table.get_ref();
    let path = at.points_named(table, &words.path_m, 2, "path_m")?;
    let positive = |number: f64| number > 0.0 && number.is_finite();
    let timed = words.course == Course::Timed;
    at.require(
        table,
        timed || positive(words.speed_m_s),
        "a person needs a speed_m_s above zero",
        "people walk at 0.5 to 1.5 m/s",
    )?;
    let times = &words.at_s;
    at.require(
        table,
        timed != times.is_empty(),
        "at_s belongs to course = \"timed\", which cannot do without",
        "give a time for every point of path_m, or another course",
    )?;
    let rises = times.windows(2).all(|pair| pair[0] < pair[1]) && times.iter().all(|time| time.is_finite());
    at.require(
        table,
        !timed || (times.len() == path.len() && times[0] == 0.0 && rises),
        "at_s needs a time for every point of path_m, rising from 0",
        "write for example at_s = [0.0, 2.5, 4.0]",
    )?;
    at.require(table, positive(words.radius_m), "a person needs a radius_m above zero", "leave it out for 0.25 m")?;
    at.require(
        table,
        words.pause_s >= 0.0 && words.pause_s.is_finite(),
        "pause_s must not be negative",
        "leave it out for none",
    )?;
    at.require(
        table,
        words.yields_within_m.is_none_or(|m| m >= 0.0 && m.is_finite()),
        "yields_within_m must not be negative",
        "leave it out for somebody who does not yield",
    )?;
    at.require(
        table,
        words.phase.is_none_or(|phase| (0.0..=1.0).contains(&phase)),
        "phase is a share of the round, 0 to 1",
        "leave it out to draw it from the seed",
    )?;
    at.require(
        table,
        !(words.social && timed),
        "a timed person keeps to the times and gives way to nobody",
        "leave out social or the times",
    )?;
    at.require(
        table,
        words.social || words.sees_robots.is_none(),
        "sees_robots belongs to social = true",
        "add that, or say yields_within_m for somebody who stands still before a robot",
    )?;
    Ok(Person {
        path,
        course: words.course,
        speed_m_s: words.speed_m_s,
        radius_m: words.radius_m,
        yields_within_m: words.yields_within_m,
        pause_s: words.pause_s,
        phase: words.phase,
        times_s: words.at_s.clone(),
        social: words.social.then_some(Social { sees_robots: words.sees_robots.unwrap_or(true) }),
    })
}

/// The text that faults point into.
struct Source<'a> {
    file: &'a str,
    text: &'a str,
}

impl Source<'_> {
    fn fault<T>(&self, table: &Spanned<T>, reason: &str, remedy: &str) -> WorldError {
        WorldError::at(self.file, self.text, table.span().start, reason, remedy)
    }

    fn require<T>(&self, table: &Spanned<T>, holds: bool, reason: &str, remedy: &str) -> Result<(), WorldError> {
        if holds { Ok(()) } else { Err(self.fault(table, reason, remedy)) }
    }

    fn points<T>(&self, table: &Spanned<T>, pairs: &[[f64; 2]], least: usize) -> Result<Vec<Point>, WorldError> {
        self.points_named(table, pairs, least, "points_m")
    }

    fn points_named<T>(
        &self,
        table: &Spanned<T>,
        pairs: &[[f64; 2]],
        least: usize,
        key: &str,
    ) -> Result<Vec<Point>, WorldError> {
        let enough = format!("{key} needs at least {least} points, here are {}", pairs.len());
        self.require(table, pairs.len() >= least, &enough, "add points as [x, y] in metres")?;
        self.require(
            table,
            pairs.iter().flatten().all(|number| number.is_finite()),
            &format!("{key} holds a number that is not finite"),
            "replace nan and inf",
        )?;
        self.require(
            table,
            pairs.windows(2).all(|pair| pair[0] != pair[1]),
            &format!("{key} holds the same point twice in a row"),
            "remove one of them",
        )?;
        Ok(pairs.iter().map(|[x, y]| Point::new(*x, *y)).collect())
    }

    fn load<T>(&self, load: &mut Loader, table: &Spanned<T>, name: &str) -> Result<Vec<u8>, WorldError> {
        load(name).map_err(|why| {
            self.fault(table, &format!("cannot read {name}: {why}"), "correct the name, which is relative to this file")
        })
    }
}

/// What the TOML reader refused, with the nearest valid key when a key is unknown.
fn refused(file: &str, text: &str, error: &toml::de::Error) -> WorldError {
    let offset = error.span().map_or(0, |span| span.start);
    let message = error.message();
    let mut quoted = message.split('`').skip(1).step_by(2);
    let remedy = match (message.starts_with("unknown field"), quoted.next()) {
        (true, Some(word)) => {
            let known: Vec<&str> = quoted.collect();
            match nearest_word(word, known.iter().copied()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("valid here: {}", known.join(", ")),
            }
        }
        _ => "correct it there".to_owned(),
    };
    let reason = message.split(", expected one of").next().unwrap_or(message).trim().replace('\n', " ");
    WorldError::at(file, text, offset, reason, remedy)
}
