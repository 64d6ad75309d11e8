//! What lies ahead, by direction: the nearest thing in each half degree, seen from the body's centre (S2, Avoid).
//!
//! S2 counts angles from the robot's right: 0 is right, π/2 ahead, π left. Here `bearing` is the usual one, 0 ahead and
//! counter-clockwise; S2's angle is bearing + π/2. A ranger at the distance L ahead of the axle that measures d at the
//! angle α gives d_obs = √(d² + L² − 2dL·cos α′), α′ the interior angle at the ranger: the length of the sum of two
//! vectors, which is how it is computed here, for rangers anywhere on the body.

use messages::{Beam, Echo, Ranges, Track};
use runtime::math;
use std::f64::consts::{FRAC_PI_2, PI};

/// Directions from the right to the left.
pub const DIRECTIONS: usize = 361;
/// From one direction to the next [rad].
pub const SPACING_RAD: f64 = PI / (DIRECTIONS - 1) as f64;

/// The nearest thing in each direction, from −π/2 to π/2.
#[derive(Debug, Clone)]
pub struct Horizon {
    distance_m: Box<[f64; DIRECTIONS]>,
    /// Sine and cosine of each direction.
    axes: Box<[(f64, f64); DIRECTIONS]>,
    /// Of the ranger's beams, kept while their bearings stay the same: a sine costs more than all the rest.
    beams: Box<[Sighting]>,
}

/// The direction of a beam.
#[derive(Debug, Clone, Copy)]
struct Sighting {
    bearing_rad: f32,
    sin: f64,
    cos: f64,
}

/// Directions of so many beams are kept; those behind are computed each time.
const KEPT_BEAMS: usize = 1200;

impl Default for Horizon {
    fn default() -> Horizon {
        let axes = std::array::from_fn(|k| math::sin_cos(bearing_rad(k)));
        let unknown = Sighting { bearing_rad: f32::NAN, sin: 0.0, cos: 0.0 };
        Horizon {
            distance_m: Box::new([f64::INFINITY; DIRECTIONS]),
            axes: Box::new(axes),
            beams: vec![unknown; KEPT_BEAMS].into(),
        }
    }
}

/// Bearing of direction `index` [rad].
pub fn bearing_rad(index: usize) -> f64 {
    index as f64 * SPACING_RAD - FRAC_PI_2
}

/// The direction nearest to `bearing_rad`, if it is one ahead.
pub fn index_of(bearing_rad: f64) -> Option<usize> {
    let at = ((bearing_rad + FRAC_PI_2) / SPACING_RAD).round();
    (at >= 0.0 && at < DIRECTIONS as f64).then_some(at as usize)
}

/// The bearing of a point, to 10⁻⁵ rad: enough to round to a quarter of a degree, at a tenth of the exact one's cost
/// (Abramowitz and Stegun 4.4.49).
fn about_rad(y_m: f64, x_m: f64) -> f64 {
    let (ahead, aside) = (x_m.abs(), y_m.abs());
    let share = ahead.min(aside) / ahead.max(aside).max(f64::MIN_POSITIVE);
    let s = share * share;
    let atan = share * (0.999_866_0 + s * (-0.330_299_5 + s * (0.180_141_0 + s * (-0.085_133_0 + s * 0.020_835_1))));
    let quarter = if aside > ahead { FRAC_PI_2 - atan } else { atan };
    let half = if x_m < 0.0 { PI - quarter } else { quarter };
    if y_m < 0.0 { -half } else { half }
}

impl Horizon {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.distance_m.fill(f64::INFINITY);
    }

    /// Distance of the nearest thing in direction `index`; +∞ when there is none [m].
    pub fn distance_m(&self, index: usize) -> f64 {
        self.distance_m[index]
    }

    /// The nearest point in direction `index`, in the body frame [m]; `None` when there is none.
    pub fn point(&self, index: usize) -> Option<(f64, f64)> {
        let (distance_m, (sin, cos)) = (self.distance_m[index], self.axes[index]);
        distance_m.is_finite().then_some((distance_m * cos, distance_m * sin))
    }

    /// All points: direction, x and y in the body frame [m].
    pub fn points(&self) -> impl Iterator<Item = (usize, f64, f64)> + '_ {
        (0..DIRECTIONS).filter_map(|index| self.point(index).map(|(x, y)| (index, x, y)))
    }

    /// Adds the beams of a sample.
    pub fn take(&mut self, ranges: &Ranges, beams: &[Beam]) {
        let steps = (0.5 * f64::from(ranges.beam_width_rad) / SPACING_RAD).floor().clamp(0.0, 720.0) as i32;
        for (k, beam) in beams.iter().enumerate() {
            let range_m = match beam.echo {
                e if e == Echo::Value as u32 => f64::from(beam.range_m),
                e if e == Echo::TooNear as u32 => 0.5 * f64::from(ranges.min_range_m),
                _ => continue,
            };
            if !(range_m >= 0.0 && range_m.is_finite() && beam.bearing_rad.is_finite()) {
                continue;
            }
            let (origin_x, origin_y) = (f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
            let (sin, cos) = self.direction(k, beam.bearing_rad);
            self.add_point(origin_x + range_m * cos, origin_y + range_m * sin);
            // Anything on a cone's arc may have answered.
            for step in 1..=steps {
                for aside in [SPACING_RAD, -SPACING_RAD] {
                    let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad) + aside * f64::from(step));
                    self.add_point(origin_x + range_m * cos, origin_y + range_m * sin);
                }
            }
        }
    }

    /// Sine and cosine of beam `k`'s bearing.
    fn direction(&mut self, k: usize, bearing_rad: f32) -> (f64, f64) {
        let Some(kept) = self.beams.get_mut(k) else { return math::sin_cos(f64::from(bearing_rad)) };
        // By bits, so that the initial NaN counts as different from everything.
        if kept.bearing_rad.to_bits() != bearing_rad.to_bits() {
            let (sin, cos) = math::sin_cos(f64::from(bearing_rad));
            *kept = Sighting { bearing_rad, sin, cos };
        }
        (kept.sin, kept.cos)
    }

    fn add_point(&mut self, x_m: f64, y_m: f64) {
        let distance_m = (x_m * x_m + y_m * y_m).sqrt();
        if let Some(index) = index_of(about_rad(y_m, x_m))
            && distance_m < self.distance_m[index]
        {
            self.distance_m[index] = distance_m;
        }
    }

    /// Adds a disc: what of it would be seen from the body's centre.
    pub fn add_disc(&mut self, x_m: f64, y_m: f64, radius_m: f64) {
        let away_m = math::hypot(x_m, y_m);
        if !(away_m.is_finite() && radius_m >= 0.0) {
            return;
        }
        if away_m <= radius_m {
            // The centre is inside it: it is everywhere.
            self.distance_m.fill(0.0);
            return;
        }
        let half_rad = math::asin((radius_m / away_m).min(1.0));
        let middle = (math::atan2(y_m, x_m) + FRAC_PI_2) / SPACING_RAD;
        // A direction that just touches it, to the last digit, is not in it, on either side.
        let steps = half_rad / SPACING_RAD - 1e-9;
        // Thin as it may be, it is in one direction.
        let (first, last) = ((middle - steps).ceil().min(middle.round()), (middle + steps).floor().max(middle.round()));
        let last = last.min(DIRECTIONS as f64 - 1.0);
        let mut index = first.max(0.0);
        while index <= last {
            let (sin, cos) = self.axes[index as usize];
            let (along_m, aside_m) = (x_m * cos + y_m * sin, y_m * cos - x_m * sin);
            let chord_m = (radius_m * radius_m - aside_m * aside_m).max(0.0).sqrt();
            // Its nearest point is in the direction of its centre, wherever the grid lies.
            let is_m = if index == middle.round() { away_m - radius_m } else { along_m - chord_m };
            let distance_m = &mut self.distance_m[index as usize];
            *distance_m = distance_m.min(is_m);
            index += 1.0;
        }
    }

    /// Adds where a moving thing will be, up to `ahead_s` from now; `radius_m` is the least that it is taken for.
    pub fn add_path(&mut self, track: &Track, step_s: f64, ahead_s: f64, radius_m: f64) {
        let radius_m = track.radius_m.max(radius_m);
        for (k, (&x, &y)) in track.path_x_m.iter().zip(&track.path_y_m).enumerate() {
            if (k as f64 + 1.0) * step_s <= ahead_s + 1e-9 {
                self.add_disc(x, y, radius_m);
            }
        }
    }

    /// How far a body of half width `half_width_m` can go along `bearing_rad` before it touches something; at most
    /// `most_m` [m].
    pub fn free_m(&self, bearing_rad: f64, half_width_m: f64, most_m: f64) -> f64 {
        let (sin, cos) = math::sin_cos(bearing_rad);
        let ahead = self.points().filter_map(|(_, x, y)| {
            let (along, aside) = (x * cos + y * sin, y * cos - x * sin);
            (along > 0.0 && aside.abs() < half_width_m).then_some(along)
        });
        ahead.fold(most_m, f64::min)
    }

    /// Mean free distance on the right and on the left, each direction counted up to `most_m` [m].
    pub fn room_m(&self, most_m: f64) -> (f64, f64) {
        let mean = |part: &[f64]| part.iter().map(|d| d.min(most_m)).sum::<f64>() / part.len() as f64;
        (mean(&self.distance_m[..DIRECTIONS / 2]), mean(&self.distance_m[DIRECTIONS / 2 + 1..]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LASER: Ranges = Ranges { min_range_m: 0.05, max_range_m: 8.0, beam_width_rad: 0.0, span_s: 0.0 };

    fn beam(bearing_rad: f64, range_m: f64) -> Beam {
        Beam {
            origin_x_m: 0.2,
            bearing_rad: bearing_rad as f32,
            range_m: range_m as f32,
            echo: Echo::Value as u32,
            ..Beam::default()
        }
    }

    #[test]
    fn a_laser_ahead_of_the_axle_is_seen_from_the_centre_by_the_law_of_cosines() {
        let (d, l) = (1.3_f64, 0.2_f64);
        for alpha in [-1.5, -0.7, -0.1, 0.0, 0.4, 1.2, 1.5] {
            let mut horizon = Horizon::default();
            horizon.take(&LASER, &[beam(alpha, d)]);
            // S2's α counts from the right; the interior angle at the laser is π less the bearing's magnitude.
            let s2 = alpha + FRAC_PI_2;
            let interior = if s2 < FRAC_PI_2 { s2 + FRAC_PI_2 } else { 1.5 * PI - s2 };
            let expected = (d * d + l * l - 2.0 * d * l * math::cos(interior)).sqrt();
            let (_, x, y) = horizon.points().next().unwrap();
            assert!((math::hypot(x, y) - expected).abs() < 1e-6, "α = {alpha}");
            // sin θ / d = sin α′ / d_obs, by the law of sines; the grid rounds to a quarter of a degree.
            let theta = math::asin(d * math::sin(interior) / expected).copysign(alpha);
            assert!((math::atan2(y, x) - theta).abs() <= 0.5 * SPACING_RAD + 1e-6, "α = {alpha}");
        }
    }

    #[test]
    fn the_nearest_thing_of_a_direction_counts_and_no_numbers_do_not() {
        let mut horizon = Horizon::default();
        let nan = Beam { range_m: f32::NAN, ..beam(0.0, 1.0) };
        let clear = Beam { echo: Echo::Clear as u32, ..beam(0.0, 0.1) };
        horizon.take(&LASER, &[beam(0.0, 2.0), beam(0.0, 1.0), nan, clear]);
        assert!((horizon.distance_m(180) - 1.2).abs() < 1e-6);
        assert_eq!(horizon.points().count(), 1);
        horizon.clear();
        assert_eq!(horizon.points().count(), 0);
    }

    #[test]
    fn the_quick_bearing_is_that_of_the_exact_one() {
        for k in 0..3600 {
            let bearing = f64::from(k) * 0.1_f64.to_radians() - PI + 1e-6;
            let (sin, cos) = math::sin_cos(bearing);
            assert!((about_rad(0.7 * sin, 0.7 * cos) - bearing).abs() < 1.2e-5, "{bearing}");
        }
        assert_eq!(about_rad(0.0, 0.0), 0.0);
    }

    #[test]
    fn a_cone_fills_every_direction_that_it_may_have_answered_from() {
        let mut horizon = Horizon::default();
        horizon.take(&Ranges { beam_width_rad: 0.5, ..LASER }, &[beam(0.0, 1.0)]);
        // Seen from the centre, 0.2 m behind, the arc is narrower.
        let seen = horizon.points().count();
        assert!((40..=57).contains(&seen), "{seen}");
    }

    #[test]
    fn a_disc_hides_what_its_angle_covers() {
        let mut horizon = Horizon::default();
        horizon.add_disc(0.0, 2.0, 0.3);
        assert_eq!(horizon.distance_m(0), f64::INFINITY);
        assert!((horizon.distance_m(DIRECTIONS - 1) - 1.7).abs() < 1e-12);
        let mut ahead = Horizon::default();
        ahead.add_disc(1.0, 0.0, 0.3);
        let half = (0..DIRECTIONS).filter(|&k| ahead.distance_m(k).is_finite()).count() as f64 * SPACING_RAD / 2.0;
        assert!((half - math::asin(0.3)).abs() < 0.01);
    }

    #[test]
    fn room_to_go_is_judged_along_the_width_of_the_body() {
        let mut horizon = Horizon::default();
        horizon.add_disc(1.0, 0.5, 0.1);
        assert_eq!(horizon.free_m(0.0, 0.3, 3.0), 3.0);
        assert!(horizon.free_m(0.0, 0.45, 3.0) < 1.05);
        assert!(horizon.free_m(0.46, 0.1, 3.0) < 1.1);
        let (right, left) = horizon.room_m(3.0);
        assert!(left < right && right == 3.0);
    }

    #[test]
    fn a_walker_counts_where_it_will_be() {
        let track = Track {
            path_x_m: [1.0, 1.0, 1.0, 1.0],
            path_y_m: [1.0, 0.5, 0.0, -0.5],
            radius_m: 0.2,
            ..Track::default()
        };
        let mut horizon = Horizon::default();
        horizon.add_path(&track, 0.5, 1.0, 0.1);
        assert_eq!(horizon.free_m(0.0, 0.1, 9.0), 9.0, "it will be ahead only after 1.5 s");
        horizon.add_path(&track, 0.5, 1.5, 0.1);
        assert!((horizon.free_m(0.0, 0.1, 9.0) - 0.8).abs() < 0.01);
    }
}
