//! What was seen near the body and is out of sight now: a laser that looks ahead forgets what it drives past.
//!
//! A bounded list of points in the odometry frame. A scan of narrow beams settles all that lies within its field: what
//! was remembered there is dropped, what is seen there now is kept in its stead. What has left the field is remembered
//! for `keep_s`, no farther than `within_m` from the centre of rotation, and never where the body stands. Cones are not
//! remembered: most of an arc is false, and to tell which part is another task.
//!
//! Points are `spacing_m` apart at least, or the body's own way past a wall would fill the list; when it is full the
//! farthest gives way.

use crate::footprint::{Footprint, Point};
use messages::{Beam, Echo};
use runtime::{Time, math};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::TAU;

/// Settings of [`Memory`].
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MemoryConfig {
    /// How long a point that is out of sight is remembered [s].
    pub keep_s: f64,
    /// Points farther away than this from the centre of rotation are forgotten [m].
    pub within_m: f64,
    /// Points are no nearer to one another than this [m].
    pub spacing_m: f64,
    /// Most points.
    pub capacity: usize,
}

impl Default for MemoryConfig {
    fn default() -> MemoryConfig {
        MemoryConfig { keep_s: 10.0, within_m: 1.0, spacing_m: 0.03, capacity: 256 }
    }
}

impl MemoryConfig {
    /// Says which setting is wrong.
    pub fn check(&self) -> Result<(), String> {
        for (key, value) in [("keep_s", self.keep_s), ("within_m", self.within_m), ("spacing_m", self.spacing_m)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(format!("memory.{key} = {value} must be a number, zero or greater"));
            }
        }
        if !(16..=4096).contains(&self.capacity) {
            return Err(format!("memory.capacity = {} must be 16 to 4096 points", self.capacity));
        }
        Ok(())
    }
}

/// A place and heading in the odometry frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    x_m: f64,
    y_m: f64,
    sin: f64,
    cos: f64,
}

impl Place {
    /// At (`x_m`, `y_m`), heading `heading_rad`.
    pub fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Place {
        let (sin, cos) = math::sin_cos(heading_rad);
        Place { x_m, y_m, sin, cos }
    }

    fn out(&self, p: Point) -> Point {
        Point {
            x_m: self.x_m + self.cos * p.x_m - self.sin * p.y_m,
            y_m: self.y_m + self.sin * p.x_m + self.cos * p.y_m,
        }
    }

    fn inward(&self, p: Point) -> Point {
        let (dx, dy) = (p.x_m - self.x_m, p.y_m - self.y_m);
        Point { x_m: self.cos * dx + self.sin * dy, y_m: self.cos * dy - self.sin * dx }
    }
}

/// Two points nearer than a beam's width at its end count as seen along that beam [rad].
const BESIDE_RAD: f64 = 0.02;
/// A ranger with wider beams than this is none of narrow beams [rad].
pub const NARROW_RAD: f64 = 0.05;

/// Most rangers of narrow beams.
const RANGERS: usize = 4;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Spot {
    /// In the odometry frame.
    at: Point,
    seen: Time,
    ranger: usize,
}

/// The memory.
#[derive(Debug)]
pub struct Memory {
    config: MemoryConfig,
    spots: Vec<Spot>,
    /// Time of each ranger's scan that was taken in last: what it saw before is out of its sight.
    newest: [Time; RANGERS],
    frame: Option<(u64, u64)>,
}

impl Memory {
    /// Empty, with all the room that it will ever take.
    pub fn new(config: MemoryConfig) -> Memory {
        Memory { spots: Vec::with_capacity(config.capacity), newest: [Time::ZERO; RANGERS], frame: None, config }
    }

    /// Forgets everything when the odometry frame is another one than before.
    pub fn keep_to_frame(&mut self, generation: u64, origin: u64) {
        if self.frame.replace((generation, origin)).is_some_and(|frame| frame != (generation, origin)) {
            self.spots.clear();
        }
    }

    /// Takes in a scan of the `ranger` with this number, stamped `stamp`, when the body stood at `place`.
    pub fn take(&mut self, ranger: usize, stamp: Time, place: &Place, beams: &[Beam]) {
        match self.newest.get_mut(ranger) {
            Some(newest) if stamp > *newest => *newest = stamp,
            _ => return,
        }
        let field = Field::of(beams);
        self.spots.retain(|spot| !field.covers(place.inward(spot.at), beams));
        let (within_m, spacing_m) = (self.config.within_m, self.config.spacing_m);
        let mut last = Point { x_m: f64::INFINITY, y_m: 0.0 };
        for beam in beams {
            let range_m = f64::from(beam.range_m);
            let numbers = [beam.bearing_rad, beam.origin_x_m, beam.origin_y_m, beam.range_m];
            // First by the range alone: a sine costs more than all the rest.
            if beam.echo != Echo::Value as u32 || !numbers.iter().all(|n| n.is_finite()) || range_m > 2.0 * within_m {
                continue;
            }
            let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
            let point = Point {
                x_m: f64::from(beam.origin_x_m) + range_m * cos,
                y_m: f64::from(beam.origin_y_m) + range_m * sin,
            };
            if squared(point) > within_m * within_m || apart_m2(point, last) < spacing_m * spacing_m {
                continue;
            }
            last = point;
            self.add(Spot { at: place.out(point), seen: stamp, ranger }, place);
        }
    }

    fn add(&mut self, spot: Spot, place: &Place) {
        if self.spots.len() < self.spots.capacity() {
            self.spots.push(spot);
            return;
        }
        let far = |spot: &Spot| squared(place.inward(spot.at));
        let farthest = self.spots.iter_mut().max_by(|a, b| far(a).total_cmp(&far(b)));
        if let Some(old) = farthest.filter(|old| far(old) > far(&spot)) {
            *old = spot;
        }
    }

    /// Hands what is out of sight at `now` to `each`, in the frame of the body at `place`; what is too old, too far away,
    /// or where the `body` stands is forgotten.
    pub fn recall(&mut self, now: Time, place: &Place, body: &Footprint, mut each: impl FnMut(Point)) {
        let (config, newest) = (&self.config, self.newest);
        self.spots.retain(|spot| {
            let point = place.inward(spot.at);
            let kept = now.since(spot.seen) <= config.keep_s
                && squared(point) <= config.within_m * config.within_m
                && !body.holds(point);
            if kept && spot.seen < newest[spot.ranger] {
                each(point);
            }
            kept
        });
    }
}

fn squared(p: Point) -> f64 {
    p.x_m * p.x_m + p.y_m * p.y_m
}

fn apart_m2(a: Point, b: Point) -> f64 {
    squared(Point { x_m: a.x_m - b.x_m, y_m: a.y_m - b.y_m })
}

/// Where a scan looks.
#[derive(Debug, Clone, Copy)]
struct Field {
    origin: Point,
    first_rad: f64,
    step_rad: f64,
}

impl Field {
    fn of(beams: &[Beam]) -> Field {
        let (first, last) = (beams.first().copied().unwrap_or_default(), beams.last().copied().unwrap_or_default());
        let first_rad = f64::from(first.bearing_rad);
        let steps = beams.len().saturating_sub(1).max(1) as f64;
        Field {
            origin: Point { x_m: f64::from(first.origin_x_m), y_m: f64::from(first.origin_y_m) },
            first_rad,
            step_rad: (f64::from(last.bearing_rad) - first_rad) / steps,
        }
    }

    /// Whether a beam looked towards `point` and told something, so that the scan knows better than the memory.
    fn covers(&self, point: Point, beams: &[Beam]) -> bool {
        if self.step_rad == 0.0 || !self.step_rad.is_finite() {
            return false;
        }
        let bearing = math::atan2(point.y_m - self.origin.y_m, point.x_m - self.origin.x_m);
        let mut turn_rad = bearing - self.first_rad;
        // The bearing may lie a turn away from the first beam's.
        if turn_rad * self.step_rad < 0.0 && turn_rad.abs() > BESIDE_RAD {
            turn_rad += TAU.copysign(self.step_rad);
        }
        let nearest = (turn_rad / self.step_rad).round();
        if !(0.0..beams.len() as f64).contains(&nearest) {
            return false;
        }
        let beam = &beams[nearest as usize];
        let even = math::wrap_angle(f64::from(beam.bearing_rad) - bearing).abs() < BESIDE_RAD.max(self.step_rad.abs());
        even && (beam.echo == Echo::Value as u32 || beam.echo == Echo::Clear as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    const BODY: Footprint = Footprint { ahead_m: 0.25, behind_m: 0.25, half_width_m: 0.25, cut_m: 0.0 };

    /// A half circle of beams that all saw `range_m`, the one at `index` something at `there_m`.
    fn scan(range_m: f32, index: usize, there_m: f32) -> Vec<Beam> {
        (0..181)
            .map(|k| Beam {
                origin_x_m: 0.1,
                bearing_rad: ((k as f64).to_radians() - FRAC_PI_2) as f32,
                range_m: if k == index { there_m } else { range_m },
                echo: Echo::Value as u32,
                ..Beam::default()
            })
            .collect()
    }

    fn recalled(memory: &mut Memory, now_s: f64, place: &Place) -> Vec<Point> {
        let mut points = Vec::new();
        memory.recall(Time::from_seconds(now_s), place, &BODY, |point| points.push(point));
        points
    }

    /// Something 0.5 m to the left is passed; the laser looks ahead alone.
    fn passed() -> (Memory, Place) {
        let mut memory = Memory::new(MemoryConfig::default());
        memory.take(0, Time::from_seconds(1.0), &Place::new(0.0, 0.0, 0.0), &scan(5.0, 179, 0.5));
        let place = Place::new(0.3, 0.0, 0.0);
        memory.take(0, Time::from_seconds(2.0), &place, &scan(5.0, 999, 0.0));
        (memory, place)
    }

    #[test]
    fn what_has_been_passed_is_remembered_where_it_stands() {
        let (mut memory, place) = passed();
        let points = recalled(&mut memory, 2.0, &place);
        assert_eq!(points.len(), 1, "{points:?}");
        assert!((points[0].x_m + 0.19).abs() < 0.01 && (points[0].y_m - 0.5).abs() < 0.01, "{points:?}");
        let turned = recalled(&mut memory, 2.5, &Place::new(0.3, 0.0, FRAC_PI_2));
        assert!((turned[0].x_m - 0.5).abs() < 0.01, "{turned:?}");
    }

    #[test]
    fn it_is_forgotten_in_time_far_away_and_under_the_body() {
        let (mut memory, place) = passed();
        assert!(recalled(&mut memory, 11.5, &place).is_empty());
        let (mut memory, _) = passed();
        assert!(recalled(&mut memory, 2.0, &Place::new(1.5, 0.0, 0.0)).is_empty());
        let (mut memory, _) = passed();
        assert!(recalled(&mut memory, 2.0, &Place::new(0.1, 0.5, 0.0)).is_empty());
    }

    #[test]
    fn what_is_seen_again_is_known_by_the_scan_alone() {
        let (mut memory, _) = passed();
        // It turns to where the thing was, and sees through.
        let place = Place::new(0.3, 0.0, FRAC_PI_2);
        memory.take(0, Time::from_seconds(3.0), &place, &scan(5.0, 999, 0.0));
        assert!(recalled(&mut memory, 3.0, &place).is_empty());
        let (mut memory, place) = passed();
        memory.keep_to_frame(1, 1);
        memory.keep_to_frame(1, 2);
        assert!(recalled(&mut memory, 2.0, &place).is_empty(), "another frame");
    }

    #[test]
    fn beams_that_failed_settle_nothing() {
        let (mut memory, _) = passed();
        let place = Place::new(0.3, 0.0, FRAC_PI_2);
        let mut beams = scan(5.0, 999, 0.0);
        beams.iter_mut().for_each(|beam| beam.echo = Echo::Fault as u32);
        memory.take(0, Time::from_seconds(3.0), &place, &beams);
        assert_eq!(recalled(&mut memory, 3.0, &place).len(), 1);
    }

    #[test]
    fn it_never_grows_and_keeps_what_is_nearest() {
        let config = MemoryConfig { capacity: 16, spacing_m: 0.0, ..MemoryConfig::default() };
        let mut memory = Memory::new(config);
        let mut beams = scan(0.9, 90, 0.3);
        memory.take(0, Time::from_seconds(1.0), &Place::new(0.0, 0.0, 0.0), &beams);
        assert_eq!(memory.spots.len(), 16);
        assert!(memory.spots.iter().any(|spot| (spot.at.x_m - 0.4).abs() < 0.01));
        beams.clear();
        memory.take(0, Time::from_seconds(2.0), &Place::new(0.0, 0.0, 0.0), &beams);
        assert_eq!(recalled(&mut memory, 2.0, &Place::new(0.0, 0.0, 0.0)).len(), 16, "an empty scan settles nothing");
    }
}
