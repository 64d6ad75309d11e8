//! How far the newest scan saw in any direction: whether a place is free, taken, or hidden.
//!
//! Bearings must be evenly spaced and of one origin, as a laser's are; of other rangers it knows nothing and says so.

use messages::{Beam, Echo};
use runtime::math;

/// Bearings may be off an even spacing by this share of it.
const UNEVEN: f64 = 0.25;

/// Ranges by direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    /// +∞ where nothing was in the way, NaN where nobody knows [m].
    ranges_m: Vec<f32>,
    origin_x_m: f64,
    origin_y_m: f64,
    first_rad: f64,
    step_rad: f64,
}

/// What was seen in the direction of a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// How far the beam went [m].
    pub range_m: f64,
    /// How far away the place is from the beam's origin [m].
    pub distance_m: f64,
    /// Index of the beam.
    pub beam: u32,
}

impl Sight {
    /// Room for `most_beams`.
    pub fn new(most_beams: usize) -> Sight {
        Sight {
            ranges_m: Vec::with_capacity(most_beams),
            origin_x_m: 0.0,
            origin_y_m: 0.0,
            first_rad: 0.0,
            step_rad: 0.0,
        }
    }

    /// Takes a scan; beams for which there is no room are not looked along.
    pub fn take(&mut self, beams: &[Beam]) {
        self.ranges_m.clear();
        let (Some(first), Some(last)) = (beams.first(), beams.last()) else { return };
        let steps = (beams.len() - 1) as f64;
        let first_rad = f64::from(first.bearing_rad);
        let step_rad = (f64::from(last.bearing_rad) - first_rad) / steps;
        let even = |k: usize| {
            let off = f64::from(beams[k].bearing_rad) - first_rad - step_rad * k as f64;
            off.abs() <= UNEVEN * step_rad.abs() && beams[k].origin_x_m == first.origin_x_m
        };
        let probes = [beams.len() / 5, beams.len() / 2, beams.len() * 4 / 5];
        if beams.len() < 8 || !step_rad.is_finite() || step_rad == 0.0 || !probes.iter().all(|&k| even(k)) {
            return;
        }
        (self.first_rad, self.step_rad) = (first_rad, step_rad);
        (self.origin_x_m, self.origin_y_m) = (f64::from(first.origin_x_m), f64::from(first.origin_y_m));
        let room = self.ranges_m.capacity();
        self.ranges_m.extend(beams.iter().take(room).map(|beam| match beam.echo {
            echo if echo == Echo::Value as u32 && beam.range_m > 0.0 => beam.range_m,
            echo if echo == Echo::Clear as u32 => f32::INFINITY,
            _ => f32::NAN,
        }));
    }

    /// Looks towards a place in the body frame; `None` where no beam went.
    pub fn towards(&self, x_m: f64, y_m: f64) -> Option<Look> {
        if self.ranges_m.is_empty() {
            return None;
        }
        let (dx, dy) = (x_m - self.origin_x_m, y_m - self.origin_y_m);
        let mut turn_rad = math::atan2(dy, dx) - self.first_rad;
        // A place may lie a turn away from the first beam's bearing.
        if turn_rad * self.step_rad < -0.5 * self.step_rad * self.step_rad {
            turn_rad += std::f64::consts::TAU.copysign(self.step_rad);
        }
        let beam = (turn_rad / self.step_rad).round();
        if !(0.0..self.ranges_m.len() as f64).contains(&beam) {
            return None;
        }
        let range_m = f64::from(self.ranges_m[beam as usize]);
        let distance_m = math::hypot(dx, dy);
        (!range_m.is_nan()).then_some(Look { range_m, distance_m, beam: beam as u32 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sight(from: f64, step: f64, count: usize) -> Sight {
        let beams: Vec<Beam> = (0..count)
            .map(|k| Beam {
                bearing_rad: (from + step * k as f64) as f32,
                range_m: 1.0 + k as f32,
                echo: if k == 3 { Echo::Clear } else { Echo::Value } as u32,
                ..Beam::default()
            })
            .collect();
        let mut sight = Sight::new(1000);
        sight.take(&beams);
        sight
    }

    #[test]
    fn a_place_is_looked_at_along_the_beam_nearest_to_it() {
        for (from, step) in [(-1.0, 0.1), (1.0, -0.1)] {
            let sight = sight(from, step, 20);
            let bearing = from + 5.2 * step;
            let look = sight.towards(2.0 * math::cos(bearing), 2.0 * math::sin(bearing)).unwrap();
            assert_eq!((look.beam, look.range_m), (5, 6.0));
            assert!((look.distance_m - 2.0).abs() < 1e-9);
            let clear = from + 3.0 * step;
            assert_eq!(sight.towards(math::cos(clear), math::sin(clear)).unwrap().range_m, f64::INFINITY);
        }
    }

    #[test]
    fn where_no_beam_goes_nothing_is_known() {
        let sight = sight(-1.0, 0.1, 20);
        assert_eq!(sight.towards(-1.0, 0.0), None);
        assert_eq!(sight.towards(math::cos(-1.2), math::sin(-1.2)), None);
    }

    #[test]
    fn a_field_of_more_than_half_a_turn_is_seen_to_both_ends() {
        let sight = sight(-3.1, 0.0365, 170);
        assert_eq!(sight.towards(math::cos(3.0), math::sin(3.0)).unwrap().beam, 167);
        // From a bearing counted beyond half a turn.
        let shifted = self::sight(0.0, 0.035, 170);
        assert_eq!(shifted.towards(math::cos(-0.5), math::sin(-0.5)).unwrap().beam, 165);
    }

    #[test]
    fn a_ring_of_uneven_beams_knows_nothing() {
        let mut beams = vec![Beam { echo: Echo::Value as u32, range_m: 1.0, ..Beam::default() }; 16];
        for (k, beam) in beams.iter_mut().enumerate() {
            beam.bearing_rad = if k < 8 { 0.1 * k as f32 } else { 2.0 + 0.2 * k as f32 };
        }
        let mut sight = Sight::new(64);
        sight.take(&beams);
        assert_eq!(sight.towards(1.0, 0.0), None);
    }
}
