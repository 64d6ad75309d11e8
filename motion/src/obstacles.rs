//! Beams to the points that the body must not touch, carried along while the body moves on.
//!
//! A beam of a ranger with a cone is an arc of places where its echo may have come from; all of it counts. Ages matter
//! twice: points are carried from the sample's stamp to now with the body's velocity, and a direction counts as seen
//! only by beams young enough.

use crate::footprint::{Point, Velocity};
use messages::{Beam, Echo, Ranges};
use runtime::{Time, math};
use std::f64::consts::PI;

/// Points along a cone's arc stand no farther apart than this [m].
const ARC_SPACING_M: f64 = 0.05;
/// Most points of one arc.
const ARC_POINTS: usize = 9;
/// A beam within this angle of a direction looks in that direction [rad].
const LOOKS_ALONG_RAD: f64 = 0.45;

/// Age of the youngest beam that looks somewhere; +∞ when none does [s].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Ahead [s].
    pub ahead_s: f64,
    /// Behind [s].
    pub behind_s: f64,
    /// Anywhere [s].
    pub anywhere_s: f64,
}

impl Seen {
    /// Nothing is seen.
    pub const NOTHING: Seen = Seen { ahead_s: f64::INFINITY, behind_s: f64::INFINITY, anywhere_s: f64::INFINITY };

    fn younger(self, other: Seen) -> Seen {
        Seen {
            ahead_s: self.ahead_s.min(other.ahead_s),
            behind_s: self.behind_s.min(other.behind_s),
            anywhere_s: self.anywhere_s.min(other.anywhere_s),
        }
    }

    fn older_by(self, age_s: f64) -> Seen {
        Seen { ahead_s: self.ahead_s + age_s, behind_s: self.behind_s + age_s, anywhere_s: self.anywhere_s + age_s }
    }
}

/// Points of one sample, in the body frame at its stamp.
#[derive(Debug, Clone, Copy)]
struct Batch {
    stamp: Time,
    end: usize,
    seen: Seen,
}

/// All points of a set of rangers, bounded.
#[derive(Debug)]
pub struct Obstacles {
    taken: Vec<Point>,
    batches: Vec<Batch>,
    now: Vec<Point>,
    horizon_m: f64,
}

impl Obstacles {
    /// Room for `capacity` points no farther than `horizon_m` from the centre of rotation.
    pub fn new(capacity: usize, horizon_m: f64) -> Obstacles {
        let batches = Vec::with_capacity(16);
        Obstacles { taken: Vec::with_capacity(capacity), batches, now: Vec::with_capacity(capacity), horizon_m }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.taken.clear();
        self.batches.clear();
        self.now.clear();
    }

    /// Adds the beams of one sample.
    pub fn take(&mut self, stamp: Time, ranges: &Ranges, beams: &[Beam]) {
        if self.batches.len() == self.batches.capacity() {
            return;
        }
        let mut seen = Seen::NOTHING;
        for beam in beams {
            let Some(distance_m) = distance_m(beam, ranges) else { continue };
            seen = seen.younger(seen_by(beam));
            if let Some(distance_m) = distance_m {
                self.take_arc(beam, f64::from(ranges.beam_width_rad), distance_m);
            }
        }
        self.batches.push(Batch { stamp, end: self.taken.len(), seen });
    }

    fn take_arc(&mut self, beam: &Beam, width_rad: f64, distance_m: f64) {
        let (x_m, y_m) = (f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
        if distance_m > self.horizon_m + math::hypot(x_m, y_m) {
            return;
        }
        let wanted = (width_rad * distance_m / ARC_SPACING_M).ceil();
        let count = if wanted > 0.0 { (wanted as usize + 1).clamp(3, ARC_POINTS) } else { 1 };
        if count == 1 {
            // As exact as the bearing itself.
            let (sin, cos) = math::sin_cos_f32(beam.bearing_rad);
            self.keep(Point { x_m: x_m + distance_m * f64::from(cos), y_m: y_m + distance_m * f64::from(sin) });
            return;
        }
        // From the arc's right end to its left, each point turned on from the one before.
        let (mut sin, mut cos) = math::sin_cos(f64::from(beam.bearing_rad) - 0.5 * width_rad);
        let (step_sin, step_cos) = math::sin_cos(width_rad / (count - 1) as f64);
        for _ in 0..count {
            self.keep(Point { x_m: x_m + distance_m * cos, y_m: y_m + distance_m * sin });
            (sin, cos) = (sin * step_cos + cos * step_sin, cos * step_cos - sin * step_sin);
        }
    }

    /// Keeps a point that is near enough, if there is room.
    fn keep(&mut self, point: Point) {
        let near = point.x_m * point.x_m + point.y_m * point.y_m <= self.horizon_m * self.horizon_m;
        if near && self.taken.len() < self.taken.capacity() {
            self.taken.push(point);
        }
    }

    /// Carries all points to `now` with the body's `velocity`, and answers them with how old the youngest looks are.
    /// Samples older than `max_age_s` count as absent: their ranger has fallen silent.
    pub fn carried(&mut self, now: Time, velocity: Velocity, max_age_s: f64) -> (&[Point], Seen) {
        self.now.clear();
        let mut seen = Seen::NOTHING;
        let mut begin = 0;
        for batch in &self.batches {
            let age_s = now.since(batch.stamp);
            let points = begin..batch.end;
            begin = batch.end;
            if age_s > max_age_s {
                continue;
            }
            let shift = Shift::after(velocity, age_s);
            self.now.extend(self.taken[points].iter().map(|&p| shift.seen_from_there(p)));
            seen = seen.younger(batch.seen.older_by(age_s));
        }
        (&self.now, seen)
    }
}

/// `None` for a beam that tells nothing, `Some(None)` for one that saw nothing, else the distance [m].
fn distance_m(beam: &Beam, ranges: &Ranges) -> Option<Option<f64>> {
    let placed = beam.origin_x_m.is_finite() && beam.origin_y_m.is_finite() && beam.bearing_rad.is_finite();
    let range_m = f64::from(beam.range_m);
    match beam.echo {
        e if !placed || !beam.age_s.is_finite() || e == Echo::None as u32 => None,
        // Nearer than can be measured: half of the least range stands for it.
        e if e == Echo::TooNear as u32 => Some(Some(0.5 * f64::from(ranges.min_range_m).max(0.0))),
        e if e == Echo::Value as u32 => (range_m.is_finite() && range_m >= 0.0).then_some(Some(range_m)),
        e if e == Echo::Clear as u32 => Some(None),
        _ => None,
    }
}

fn seen_by(beam: &Beam) -> Seen {
    let bearing = math::wrap_angle(f64::from(beam.bearing_rad)).abs();
    let age_s = f64::from(beam.age_s);
    let along = |off: f64| if off <= LOOKS_ALONG_RAD { age_s } else { f64::INFINITY };
    Seen { ahead_s: along(bearing), behind_s: along(PI - bearing), anywhere_s: age_s }
}

/// Where the body gets to by moving at one velocity for a while.
struct Shift {
    x_m: f64,
    y_m: f64,
    sin: f64,
    cos: f64,
}

impl Shift {
    fn after(velocity: Velocity, time_s: f64) -> Shift {
        let turned_rad = velocity.turn_rad_s * time_s;
        let way_m = velocity.forward_m_s * time_s;
        let (half_sin, half_cos) = math::sin_cos(turned_rad / 2.0);
        // The chord of the arc; for the short times here its length is the way's.
        Shift {
            x_m: way_m * half_cos,
            y_m: way_m * half_sin,
            sin: 2.0 * half_sin * half_cos,
            cos: half_cos * half_cos - half_sin * half_sin,
        }
    }

    fn seen_from_there(&self, p: Point) -> Point {
        let (dx, dy) = (p.x_m - self.x_m, p.y_m - self.y_m);
        Point { x_m: self.cos * dx + self.sin * dy, y_m: self.cos * dy - self.sin * dx }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beam(bearing_rad: f32, range_m: f32, echo: Echo) -> Beam {
        Beam { origin_x_m: 0.1, origin_y_m: 0.0, bearing_rad, range_m, age_s: 0.1, echo: echo as u32 }
    }

    fn ranges(beam_width_rad: f32) -> Ranges {
        Ranges { min_range_m: 0.1, max_range_m: 5.0, beam_width_rad, span_s: 0.3 }
    }

    #[test]
    fn a_laser_beam_is_a_point_and_a_sonar_beam_an_arc() {
        let mut obstacles = Obstacles::new(64, 2.0);
        obstacles.take(Time::ZERO, &ranges(0.0), &[beam(0.0, 1.0, Echo::Value)]);
        let (points, _) = obstacles.carried(Time::ZERO, Velocity::ZERO, 1.0);
        assert!(points.len() == 1 && (points[0].x_m - 1.1).abs() < 1e-6 && points[0].y_m == 0.0);
        obstacles.clear();
        obstacles.take(Time::ZERO, &ranges(0.5), &[beam(0.0, 1.0, Echo::Value)]);
        let (points, _) = obstacles.carried(Time::ZERO, Velocity::ZERO, 1.0);
        assert_eq!(points.len(), ARC_POINTS);
        assert!((points[0].y_m + math::sin(0.25)).abs() < 1e-6);
        assert!((points[ARC_POINTS - 1].y_m - math::sin(0.25)).abs() < 1e-6);
    }

    #[test]
    fn points_come_nearer_while_the_body_moves_on() {
        let mut obstacles = Obstacles::new(64, 2.0);
        obstacles.take(Time::from_seconds(1.0), &ranges(0.0), &[beam(0.0, 0.9, Echo::Value)]);
        let (points, seen) = obstacles.carried(Time::from_seconds(1.5), Velocity::new(0.2, 0.0), 1.0);
        assert!((points[0].x_m - 0.9).abs() < 1e-6);
        assert!((seen.ahead_s - 0.6).abs() < 1e-6);
        let (points, _) = obstacles.carried(Time::from_seconds(2.0), Velocity::new(0.0, PI / 2.0), 1.0);
        assert!((points[0].y_m + 1.0).abs() < 1e-6, "a left turn moves what was ahead to the right");
    }

    #[test]
    fn a_beam_that_saw_nothing_covers_its_direction_and_one_without_a_reading_does_not() {
        let mut obstacles = Obstacles::new(64, 2.0);
        obstacles.take(Time::ZERO, &ranges(0.5), &[beam(0.1, 0.0, Echo::Clear), beam(3.0, 0.0, Echo::LinkLost)]);
        let (points, seen) = obstacles.carried(Time::ZERO, Velocity::ZERO, 1.0);
        assert!(points.is_empty());
        assert!(seen.ahead_s < 0.2 && seen.behind_s == f64::INFINITY);
    }

    #[test]
    fn something_too_near_to_measure_is_taken_to_be_very_near() {
        let mut obstacles = Obstacles::new(64, 2.0);
        obstacles.take(Time::ZERO, &ranges(0.0), &[beam(0.0, 0.0, Echo::TooNear)]);
        assert!((obstacles.carried(Time::ZERO, Velocity::ZERO, 1.0).0[0].x_m - 0.15).abs() < 1e-6);
    }

    #[test]
    fn numbers_that_are_none_are_no_obstacles_and_no_looks() {
        let mut obstacles = Obstacles::new(64, 2.0);
        obstacles.take(Time::ZERO, &ranges(0.0), &[beam(0.0, f32::NAN, Echo::Value), beam(f32::NAN, 1.0, Echo::Value)]);
        let (points, seen) = obstacles.carried(Time::ZERO, Velocity::ZERO, 1.0);
        assert!(points.is_empty());
        assert_eq!(seen, Seen::NOTHING);
    }

    #[test]
    fn a_ranger_that_has_fallen_silent_sees_nothing() {
        let mut obstacles = Obstacles::new(8, 2.0);
        obstacles.take(Time::ZERO, &ranges(0.0), &[beam(0.0, 1.0, Echo::Value)]);
        let (points, seen) = obstacles.carried(Time::from_seconds(1.1), Velocity::ZERO, 1.0);
        assert!(points.is_empty());
        assert_eq!(seen, Seen::NOTHING);
    }

    #[test]
    fn more_points_than_there_is_room_for_are_left_out_and_never_grow_the_memory() {
        let mut obstacles = Obstacles::new(8, 2.0);
        obstacles.take(Time::ZERO, &ranges(0.5), &[beam(0.0, 1.0, Echo::Value); 20]);
        assert_eq!(obstacles.carried(Time::ZERO, Velocity::ZERO, 1.0).0.len(), 8);
    }
}
