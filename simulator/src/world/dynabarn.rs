//! DynaBARN worlds: a walled yard with cylinders on key-framed rounds (Nair et al., SSRR 2022).
//!
//! A block is the line `world N COUNT` and COUNT lines `NAME PERIOD KEYS t,x,y t,x,y …`. Every cylinder has a radius of
//! 0.5 m, is at each key's place at its time, in a straight line between two, and begins anew with the period. The
//! yard's walls are the same in every world; its east side is open, and the cylinders pass through walls.

use super::error::WorldError;
use super::{Course, Person, Sketch, Start};
use crate::geometry::{Point, Pose, Segment};
use std::f64::consts::PI;

const RADIUS_M: f64 = 0.5;
const HALF_YARD_M: f64 = 10.0;
const WALL_M: f64 = 0.5;
const START: Pose = Pose::new(11.0, 0.0, PI);

/// Whether the text's first block is one of these rather than a grid's: its line counts the cylinders.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    let first = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
    std::str::from_utf8(first).is_ok_and(|line| heading(line).is_some())
}

/// Number of the world and of its cylinders.
fn heading(line: &str) -> Option<(u32, usize)> {
    let mut words = line.strip_prefix("world ")?.split_whitespace();
    let found = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    words.next().is_none().then_some(found)
}

/// Adds world `wanted` of a file (the first one when `None`), the yard and the start.
pub(super) fn add(sketch: &mut Sketch, file: &str, bytes: &[u8], wanted: Option<u32>) -> Result<(), WorldError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| WorldError::of_file(file, "it is not UTF-8 text", "give a DynaBARN worlds file"))?;
    let fault = |row: usize, reason: String| WorldError {
        file: file.to_owned(),
        place: Some((row + 1, 1)),
        reason,
        remedy: "a block is `world N COUNT` and COUNT lines `NAME PERIOD KEYS t,x,y …`".to_owned(),
    };
    let mut seen = 0;
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    while let Some((row, line)) = lines.next() {
        let Some((index, count)) = heading(line) else {
            return Err(fault(row, format!("expected `world N COUNT`, found {line:?}")));
        };
        seen += 1;
        let chosen = wanted.is_none_or(|wanted| wanted == index);
        for _ in 0..count {
            let Some((row, line)) = lines.next() else {
                return Err(fault(row, format!("world {index} ends before its {count} cylinders")));
            };
            if chosen {
                sketch.persons.push(cylinder(line).map_err(|reason| fault(row, reason))?);
            }
        }
        if chosen {
            add_yard(sketch);
            if sketch.name.is_empty() {
                sketch.name = format!("DynaBARN {index}");
            }
            return Ok(());
        }
    }
    let wanted = wanted.map_or(String::new(), |wanted| format!(" number {wanted}"));
    Err(WorldError::of_file(file, format!("holds no world{wanted} among its {seen}"), "choose one that it holds"))
}

/// One cylinder's round.
fn cylinder(line: &str) -> Result<Person, String> {
    let mut words = line.split_whitespace().skip(1);
    let mut number = |what: &str| {
        let word = words.next().ok_or_else(|| format!("{what} is missing"))?;
        word.parse::<f64>().map_err(|_| format!("{what} is no number: {word:?}"))
    };
    let (period_s, keys) = (number("the period")?, number("the number of keys")?);
    let (mut path, mut times_s) = (Vec::new(), Vec::new());
    for word in words {
        let numbers: Vec<f64> = word.split(',').filter_map(|part| part.parse().ok()).collect();
        let [time_s, x_m, y_m] = numbers[..] else { return Err(format!("a key is t,x,y, found {word:?}")) };
        let rises = times_s.last().map_or(time_s == 0.0, |last| time_s > *last);
        if !rises || !time_s.is_finite() || !x_m.is_finite() || !y_m.is_finite() {
            return Err(format!("keys begin at 0 and rise, found {word:?}"));
        }
        times_s.push(time_s);
        path.push(Point::new(x_m, y_m));
    }
    if path.len() < 2 || path.len() as f64 != keys {
        return Err(format!("{keys} keys are announced and {} are there; two are the least", path.len()));
    }
    // A round that ends after its last key waits there.
    let last = times_s[times_s.len() - 1];
    if period_s > last
        && let Some(end) = path.last().copied()
    {
        times_s.push(period_s);
        path.push(end);
    }
    Ok(Person {
        path,
        course: Course::Timed,
        speed_m_s: 0.0,
        radius_m: RADIUS_M,
        yields_within_m: None,
        pause_s: 0.0,
        phase: Some(0.0),
        times_s,
        social: None,
    })
}

fn add_yard(sketch: &mut Sketch) {
    let corner = |x: f64, y: f64| Point::new(x * HALF_YARD_M, y * HALF_YARD_M);
    for (a, b) in [((-1.0, -1.0), (-1.0, 1.0)), ((-1.0, 1.0), (1.0, 1.0)), ((-1.0, -1.0), (1.0, -1.0))] {
        sketch.add_slab(Segment::new(corner(a.0, a.1), corner(b.0, b.1)), WALL_M, true);
    }
    sketch.starts.push(Start { pose: START, spread_m: 0.0, spread_rad: 0.0 });
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str =
        "world 3 1\na 4.00 3 0.00,1.0,0.0 1.00,1.0,2.0 4.00,7.0,2.0\nworld 5 1\nb 9.0 2 0.0,0,0 2.0,2,0\n";

    fn read(text: &str, wanted: Option<u32>) -> Result<Sketch, String> {
        let mut sketch = Sketch::default();
        add(&mut sketch, "worlds.txt", text.as_bytes(), wanted).map_err(|error| error.to_string())?;
        Ok(sketch)
    }

    #[test]
    fn a_cylinder_is_at_its_keys_in_time_and_begins_anew() {
        let sketch = read(TWO, Some(3)).unwrap();
        assert_eq!((sketch.persons.len(), sketch.starts.len(), sketch.name.as_str()), (1, 1, "DynaBARN 3"));
        let round = &sketch.persons[0];
        let mut walk = round.start(0.0);
        let mut jumps = 0;
        for step in 1..=450 {
            walk = round.walked(&walk, 0.01);
            jumps += u32::from(walk.jumped);
            let place = walk.disc.centre;
            match step {
                50 => assert!((place - Point::new(1.0, 1.0)).norm() < 1e-9 && walk.velocity == Point::new(0.0, 2.0)),
                250 => assert!((place - Point::new(4.0, 2.0)).norm() < 1e-9 && walk.velocity == Point::new(2.0, 0.0)),
                450 => assert!((place - Point::new(1.0, 1.0)).norm() < 1e-9, "{place:?}"),
                _ => {}
            }
        }
        assert_eq!(jumps, 1);
    }

    #[test]
    fn a_round_longer_than_its_keys_waits_at_the_last() {
        let sketch = read(TWO, Some(5)).unwrap();
        let walk = sketch.persons[0].walked(&sketch.persons[0].start(0.0), 5.0);
        assert_eq!(walk.disc.centre, Point::new(2.0, 0.0));
    }

    #[test]
    fn faults_are_told_with_their_line() {
        for (text, says) in [
            ("world 3\n", "expected `world N COUNT`"),
            ("world 3 2\na 4 2 0,0,0 4,1,1\n", "ends before"),
            ("world 3 1\na 4 3 0,0,0 4,1,1\n", "3 keys are announced"),
            ("world 3 1\na 4 2 0,0,0 0,1,1\n", "begin at 0 and rise"),
            ("world 3 1\na x 2 0,0,0 4,1,1\n", "the period is no number"),
            ("world 3 1\na 4 2 0,0,0 4,1\n", "a key is t,x,y"),
            ("world 3 1\na 4 2 0,0,0 4,nan,1\n", "begin at 0 and rise"),
        ] {
            let why = read(text, None).unwrap_err();
            assert!(why.contains(says), "{why}");
        }
        assert!(read(TWO, Some(4)).unwrap_err().contains("holds no world number 4"));
    }

    #[test]
    fn the_kinds_of_text_are_told_apart_by_their_first_line() {
        assert!(is_one(TWO.as_bytes()));
        assert!(!is_one(b"world 1\n####"));
    }
}
