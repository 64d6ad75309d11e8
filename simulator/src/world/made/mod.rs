//! Worlds made from a seed: `KIND:SEED`, or `KIND:SEED:WIDTHxHEIGHT` in metres, as in `office:7` or `rooms:3:40x20`; with
//! `:people=N` behind it so many people walk about in it who give way to one another and to robots.
//!
//! | kind | what |
//! |---|---|
//! | office | rooms of uneven width with doors along corridors, furnished here and there ([`office`]) |
//! | corridors | corridors of 2 m that wind and fork, a spanning tree with a few loops ([`cells`]) |
//! | rooms | rooms of 4 m with doors of 0.9 m to some of their neighbours ([`cells`]) |
//! | cave | one ragged chamber with ragged pillars ([`cave`]) |
//!
//! Every made world is closed all round, all of it can be reached from its starts, and the same name makes the same
//! world on every machine.

mod cave;
mod cells;
mod office;

use super::crowd::{self, Crowd};
use super::error::nearest_word;
use super::{Sketch, Start, WorldError};
use crate::geometry::{Point, Pose, Segment};
use crate::noise::{Chance, Purpose};

/// The kinds, in the order in which messages list them.
const KINDS: [&str; 4] = ["office", "corridors", "rooms", "cave"];
/// No made world is narrower [m].
const LEAST_M: f64 = 6.0;
/// No made world is wider [m].
const MOST_M: f64 = 1000.0;
/// Starts that a made world has, where there is room.
const STARTS: usize = 16;

/// Width and height [m].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Size {
    width_m: f64,
    height_m: f64,
}

/// Makes the world of that name; `None` where the name is a file's.
pub(super) fn world(name: &str) -> Option<Result<Sketch, WorldError>> {
    let (kind, rest) = name.split_once(':')?;
    if kind.is_empty() || !kind.bytes().all(|byte| byte.is_ascii_lowercase()) {
        return None;
    }
    Some(make(name, kind, rest))
}

fn make(name: &str, kind: &str, rest: &str) -> Result<Sketch, WorldError> {
    let remedy = "write KIND:SEED or KIND:SEED:WIDTHxHEIGHT, as in office:7 or rooms:3:40x20";
    let mut parts = rest.split(':');
    let seed = parts.next().unwrap_or_default();
    let (mut size, mut people) = (None, 0);
    for part in parts {
        match part.strip_prefix("people=") {
            Some(count) => {
                let count = count.parse().ok().filter(|count| *count <= crowd::MOST);
                let reason = format!("\"{part}\": a world has at most {} people", crowd::MOST);
                people =
                    count.ok_or_else(|| WorldError::of_file(name, reason, "write for example office:7:people=12"))?;
            }
            None if size.is_none() => size = Some(part),
            None => return Err(WorldError::of_file(name, format!("\"{part}\" is one word too many"), remedy)),
        }
    }
    let usual = match kind {
        "office" => Size { width_m: 32.0, height_m: 14.0 },
        "corridors" => Size { width_m: 20.0, height_m: 20.0 },
        "rooms" => Size { width_m: 24.0, height_m: 16.0 },
        "cave" => Size { width_m: 16.0, height_m: 16.0 },
        _ => {
            let meant = nearest_word(kind, KINDS.into_iter()).map(|word| format!("; did you mean {word}?"));
            let reason = format!("there is no kind \"{kind}\" of made world{}", meant.unwrap_or_default());
            return Err(WorldError::of_file(name, reason, format!("kinds are {}", KINDS.join(", "))));
        }
    };
    let seed: u64 = seed.parse().map_err(|_| WorldError::of_file(name, format!("\"{seed}\" is no seed"), remedy))?;
    let size = match size {
        None => usual,
        Some(text) => {
            let pair = text.split_once('x').and_then(|(w, h)| Some((w.parse::<f64>().ok()?, h.parse::<f64>().ok()?)));
            let (width_m, height_m) =
                pair.ok_or_else(|| WorldError::of_file(name, format!("\"{text}\" is no size"), remedy))?;
            let fits = |length_m: f64| (LEAST_M..=MOST_M).contains(&length_m);
            if !fits(width_m) || !fits(height_m) {
                let reason = format!("{text}: either side must measure from {LEAST_M} to {MOST_M} m");
                return Err(WorldError::of_file(name, reason, remedy));
            }
            Size { width_m, height_m }
        }
    };
    let mut sketch = Sketch { name: name.to_owned(), ..Sketch::default() };
    let mut chance = Chance::new(seed, Purpose::Layout, KINDS.iter().position(|known| *known == kind).unwrap_or(0));
    match kind {
        "office" => office::add(&mut sketch, size, &mut chance),
        "corridors" => cells::add(&mut sketch, size, cells::CORRIDORS, &mut chance),
        "rooms" => cells::add(&mut sketch, size, cells::ROOMS, &mut chance),
        _ => cave::add(&mut sketch, size, &mut chance),
    }
    if people > 0 {
        sketch.crowds.push(Crowd { count: people, seed, sees_robots: true });
    }
    Ok(sketch)
}

/// A start at `place` with any heading.
fn start(place: Point, spread_m: f64) -> Start {
    Start { pose: Pose::new(place.x_m, place.y_m, 0.0), spread_m, spread_rad: std::f64::consts::PI }
}

/// Walls around all of it.
fn add_bounds(sketch: &mut Sketch, size: Size) {
    let Size { width_m: w, height_m: h } = size;
    let corners = [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)].map(|(x, y)| Point::new(x, y));
    for k in 0..4 {
        sketch.add_line(Segment::new(corners[k], corners[(k + 1) % 4]), false);
    }
}

/// From `low` to `high`.
fn between(chance: &mut Chance, low: f64, high: f64) -> f64 {
    low + (high - low) * chance.share()
}

#[cfg(test)]
mod tests;
