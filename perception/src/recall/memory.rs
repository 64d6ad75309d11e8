//! Places near the body where something was seen, in the odometry frame, bounded.

use super::config::RecallConfig;
use crate::place::Place;
use messages::{Beam, Echo};
use runtime::{Time, math};
use std::f64::consts::TAU;

/// Two directions nearer than this are the same one [rad].
const SAME_RAD: f64 = 0.02;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Spot {
    /// In the odometry frame [m].
    x_m: f64,
    y_m: f64,
    /// Since when something has been seen there.
    since: Time,
    seen: Time,
    /// The newest scan looked there.
    in_sight: bool,
}

/// The memory.
#[derive(Debug)]
pub struct Memory {
    config: RecallConfig,
    spots: Vec<Spot>,
}

impl Memory {
    /// Empty, with all the room that it will ever take.
    pub fn new(config: RecallConfig) -> Memory {
        Memory { spots: Vec::with_capacity(config.capacity), config }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.spots.clear();
    }

    /// Takes in a scan, stamped `stamp`, when the body stood at `place`: it settles what lies within its field.
    pub fn take(&mut self, stamp: Time, place: &Place, beams: &[Beam]) {
        let field = Field::of(beams);
        for spot in &mut self.spots {
            spot.in_sight = field.covers(place.inward(spot.x_m, spot.y_m), beams);
        }
        let (within_m, spacing_m) = (self.config.within_m, self.config.spacing_m);
        let mut last = (f64::INFINITY, 0.0);
        for beam in beams {
            let range_m = f64::from(beam.range_m);
            let numbers = [beam.bearing_rad, beam.origin_x_m, beam.origin_y_m, beam.range_m];
            // First by the range alone: a sine costs more than all the rest.
            if beam.echo != Echo::Value as u32 || !numbers.iter().all(|n| n.is_finite()) || range_m > 2.0 * within_m {
                continue;
            }
            let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
            let at = (f64::from(beam.origin_x_m) + range_m * cos, f64::from(beam.origin_y_m) + range_m * sin);
            if squared(at.0, at.1) > within_m * within_m
                || squared(at.0 - last.0, at.1 - last.1) < spacing_m * spacing_m
            {
                continue;
            }
            last = at;
            self.see(place.out(at.0, at.1), stamp, place);
        }
        // What was looked at and not seen is not there any more.
        self.spots.retain(|spot| !spot.in_sight || spot.seen == stamp);
    }

    fn see(&mut self, (x_m, y_m): (f64, f64), stamp: Time, place: &Place) {
        let near =
            |spot: &&mut Spot| squared(spot.x_m - x_m, spot.y_m - y_m) < self.config.spacing_m * self.config.spacing_m;
        let mut since = stamp;
        if let Some(spot) = self.spots.iter_mut().find(near) {
            // The place is where it was seen last: a surface seen better now.
            since = spot.since;
            *spot = Spot { x_m, y_m, since, seen: stamp, in_sight: true };
            return;
        }
        // A surface that is looked at askance is hit elsewhere each time: it is the neighbour's.
        let wide = 2.5 * self.config.spacing_m;
        let beside = self.spots.iter().filter(|spot| squared(spot.x_m - x_m, spot.y_m - y_m) < wide * wide);
        since = beside.fold(since, |since, spot| since.min(spot.since));
        let spot = Spot { x_m, y_m, since, seen: stamp, in_sight: true };
        if self.spots.len() < self.spots.capacity() {
            self.spots.push(spot);
            return;
        }
        let far = |spot: &Spot| {
            let (x, y) = place.inward(spot.x_m, spot.y_m);
            squared(x, y)
        };
        let farthest = self.spots.iter_mut().max_by(|a, b| far(a).total_cmp(&far(b)));
        if let Some(old) = farthest.filter(|old| far(old) > far(&spot)) {
            *old = spot;
        }
    }

    /// Hands what is out of sight at `now` to `each`, as beams of the body at `place`; what is too old, too far away, or
    /// where the body stands (`is_body`, in its frame) is forgotten.
    pub fn recall(&mut self, now: Time, place: &Place, is_body: impl Fn(f64, f64) -> bool, mut each: impl FnMut(Beam)) {
        let config = &self.config;
        self.spots.retain(|spot| {
            let (x_m, y_m) = place.inward(spot.x_m, spot.y_m);
            let stood = spot.seen.since(spot.since) >= config.stands_after_s;
            let keep_s = if stood { config.keep_s } else { config.keep_new_s };
            let age_s = now.since(spot.seen);
            let kept = age_s <= keep_s && squared(x_m, y_m) <= config.within_m * config.within_m && !is_body(x_m, y_m);
            if kept && !spot.in_sight {
                each(Beam {
                    bearing_rad: math::atan2(y_m, x_m) as f32,
                    range_m: math::hypot(x_m, y_m) as f32,
                    age_s: age_s as f32,
                    echo: Echo::Value as u32,
                    ..Beam::default()
                });
            }
            kept
        });
    }
}

fn squared(x: f64, y: f64) -> f64 {
    x * x + y * y
}

/// Where a scan looks.
#[derive(Debug, Clone, Copy)]
struct Field {
    x_m: f64,
    y_m: f64,
    first_rad: f64,
    step_rad: f64,
}

impl Field {
    fn of(beams: &[Beam]) -> Field {
        let (first, last) = (beams.first().copied().unwrap_or_default(), beams.last().copied().unwrap_or_default());
        let first_rad = f64::from(first.bearing_rad);
        let steps = beams.len().saturating_sub(1).max(1) as f64;
        Field {
            x_m: f64::from(first.origin_x_m),
            y_m: f64::from(first.origin_y_m),
            first_rad,
            step_rad: (f64::from(last.bearing_rad) - first_rad) / steps,
        }
    }

    /// Whether a beam looked towards a place and told something, so that the scan knows better than the memory.
    fn covers(&self, (x_m, y_m): (f64, f64), beams: &[Beam]) -> bool {
        if self.step_rad == 0.0 || !self.step_rad.is_finite() {
            return false;
        }
        let bearing = math::atan2(y_m - self.y_m, x_m - self.x_m);
        let mut turn_rad = bearing - self.first_rad;
        // The bearing may lie a turn away from the first beam's.
        if turn_rad * self.step_rad < 0.0 && turn_rad.abs() > SAME_RAD {
            turn_rad += TAU.copysign(self.step_rad);
        }
        let nearest = (turn_rad / self.step_rad).round();
        if !(0.0..beams.len() as f64).contains(&nearest) {
            return false;
        }
        let beam = &beams[nearest as usize];
        let even = math::wrap_angle(f64::from(beam.bearing_rad) - bearing).abs() < SAME_RAD.max(self.step_rad.abs());
        even && (beam.echo == Echo::Value as u32 || beam.echo == Echo::Clear as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    const ORIGIN: Place = Place { x_m: 0.0, y_m: 0.0, sin: 0.0, cos: 1.0 };

    /// A half circle of beams that all saw `range_m`, the one at `index` something at `there_m`.
    fn scan(range_m: f32, index: usize, there_m: f32) -> Vec<Beam> {
        let beam = |k: usize| Beam {
            origin_x_m: 0.1,
            bearing_rad: ((k as f64).to_radians() - FRAC_PI_2) as f32,
            range_m: if k == index { there_m } else { range_m },
            echo: Echo::Value as u32,
            ..Beam::default()
        };
        (0..181).map(beam).collect()
    }

    fn nowhere(_: f64, _: f64) -> bool {
        false
    }

    fn recalled(memory: &mut Memory, now_s: f64, place: &Place) -> Vec<(f64, f64)> {
        let mut points = Vec::new();
        memory.recall(Time::from_seconds(now_s), place, nowhere, |beam| {
            let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
            points.push((f64::from(beam.range_m) * cos, f64::from(beam.range_m) * sin));
        });
        points
    }

    /// Something stands 0.5 m to the left for a second; the body passes it, and looks ahead alone.
    fn passed() -> (Memory, Place) {
        let mut memory = Memory::new(RecallConfig::default());
        for k in 0..20 {
            memory.take(Time::from_seconds(0.05 * f64::from(k)), &ORIGIN, &scan(5.0, 179, 0.5));
        }
        let place = Place::new(0.3, 0.0, 0.0);
        memory.take(Time::from_seconds(2.0), &place, &scan(5.0, 999, 0.0));
        (memory, place)
    }

    #[test]
    fn what_has_been_passed_is_remembered_where_it_stands() {
        let (mut memory, place) = passed();
        let points = recalled(&mut memory, 2.0, &place);
        assert_eq!(points.len(), 1, "{points:?}");
        assert!((points[0].0 + 0.19).abs() < 0.01 && (points[0].1 - 0.5).abs() < 0.01, "{points:?}");
        let turned = recalled(&mut memory, 2.5, &Place::new(0.3, 0.0, FRAC_PI_2));
        assert!((turned[0].0 - 0.5).abs() < 0.01, "{turned:?}");
        assert_eq!(recalled(&mut memory, 30.0, &place).len(), 1, "a body that waits does not forget");
    }

    #[test]
    fn it_is_forgotten_in_time_far_away_and_where_the_body_stands() {
        let (mut memory, place) = passed();
        assert!(recalled(&mut memory, 62.5, &place).is_empty());
        let (mut memory, _) = passed();
        assert!(recalled(&mut memory, 2.0, &Place::new(1.5, 0.0, 0.0)).is_empty());
        let (mut memory, place) = passed();
        memory.recall(Time::from_seconds(2.0), &place, |_, _| true, |_| ());
        assert!(recalled(&mut memory, 2.0, &place).is_empty());
    }

    #[test]
    fn what_had_only_just_come_is_forgotten_soon() {
        let mut memory = Memory::new(RecallConfig::default());
        memory.take(Time::from_seconds(1.0), &ORIGIN, &scan(5.0, 179, 0.5));
        let place = Place::new(0.3, 0.0, 0.0);
        memory.take(Time::from_seconds(1.1), &place, &scan(5.0, 999, 0.0));
        assert_eq!(recalled(&mut memory, 2.5, &place).len(), 1);
        assert!(recalled(&mut memory, 3.5, &place).is_empty());
    }

    #[test]
    fn what_is_seen_again_is_known_by_the_scan_alone() {
        let (mut memory, _) = passed();
        // It turns to where the thing was, and sees through.
        let place = Place::new(0.3, 0.0, FRAC_PI_2);
        memory.take(Time::from_seconds(3.0), &place, &scan(5.0, 999, 0.0));
        assert!(recalled(&mut memory, 3.0, &ORIGIN).is_empty());
        let (mut memory, _) = passed();
        // There it still is: no longer a memory, until it is out of sight again.
        memory.take(Time::from_seconds(3.0), &ORIGIN, &scan(5.0, 179, 0.5));
        assert!(recalled(&mut memory, 3.0, &ORIGIN).is_empty());
    }

    #[test]
    fn beams_that_failed_settle_nothing() {
        let (mut memory, _) = passed();
        let place = Place::new(0.3, 0.0, FRAC_PI_2);
        let mut beams = scan(5.0, 999, 0.0);
        beams.iter_mut().for_each(|beam| beam.echo = Echo::Fault as u32);
        memory.take(Time::from_seconds(3.0), &place, &beams);
        assert_eq!(recalled(&mut memory, 3.0, &place).len(), 1);
    }

    #[test]
    fn it_never_grows_and_keeps_what_is_nearest() {
        let config = RecallConfig { capacity: 16, spacing_m: 0.001, ..RecallConfig::default() };
        let mut memory = Memory::new(config);
        memory.take(Time::from_seconds(1.0), &ORIGIN, &scan(0.9, 150, 0.3));
        assert_eq!((memory.spots.len(), memory.spots.capacity()), (16, 16));
        assert!(memory.spots.iter().any(|spot| squared(spot.x_m - 0.1, spot.y_m) < 0.1));
    }
}
