//! A fan of evenly spaced rays from one place, and which of them may meet a thing of known width.
//!
//! Bearings here are polynomials: atan z = z·P(z²) for 0 ≤ z ≤ 1 is true to 1e-5 rad (Abramowitz and Stegun, Handbook of
//! Mathematical Functions, 4.4.49). That only chooses the rays to be asked, with room for the error; what a ray reads is
//! computed exactly.

use super::Point;
use runtime::math;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::Range;

/// Greatest error of [`bearing_rad`], with a little room [rad].
const ROOM_RAD: f64 = 2e-5;

/// Rays in the frame of whatever carries them.
#[derive(Debug, Clone, PartialEq)]
pub struct Fan {
    /// Where they begin.
    pub place: Point,
    /// Bearing of the first ray, in [−π, π] [rad].
    pub first_rad: f64,
    /// From one ray to the next, counter-clockwise; all of them together at most once around [rad].
    pub step_rad: f64,
    /// The directions (unit vectors).
    pub directions: Vec<Point>,
    per_rad: f64,
    once_around: f64,
    /// The direction of its middle, where all of it lies within a quarter turn of that.
    front: Option<Point>,
}

impl Fan {
    /// `rays` of them, at least one.
    pub fn new(place: Point, first_rad: f64, step_rad: f64, rays: usize) -> Fan {
        let directions = (0..rays).map(|k| Point::unit(first_rad + k as f64 * step_rad)).collect();
        let per_rad = 1.0 / step_rad;
        let wide_rad = rays.saturating_sub(1) as f64 * step_rad;
        let front = (wide_rad <= PI + 1e-9).then(|| Point::unit(first_rad + 0.5 * wide_rad));
        Fan {
            place,
            first_rad: math::wrap_angle(first_rad),
            step_rad,
            directions,
            per_rad,
            once_around: TAU * per_rad,
            front,
        }
    }

    /// Whether a disc, or a point where it has no radius, lies behind all of the rays; seldom no for one that does.
    #[inline]
    pub(crate) fn is_behind(&self, to: Point, radius_m: f64) -> bool {
        self.front.is_some_and(|front| front.dot(to) < -radius_m - 1e-6)
    }

    /// Hands the numbers of the rays between two bearings to `each`, in at most two runs, with those besides that may be
    /// between them but for the error of [`bearing_rad`]. `from_rad` is in [−2π, 2π] and `to_rad` within 2π above it.
    #[inline]
    pub(crate) fn between(&self, from_rad: f64, to_rad: f64, mut each: impl FnMut(Range<usize>)) {
        let from = (from_rad - ROOM_RAD - self.first_rad) * self.per_rad;
        let to = (to_rad + ROOM_RAD - self.first_rad) * self.per_rad;
        let last = self.directions.len() as f64 - 1.0;
        for turn in [-self.once_around, 0.0, self.once_around] {
            let (from, to) = (from + turn, to + turn);
            if to >= 0.0 && from <= last {
                let begin = if from <= 0.0 { 0 } else { from as usize + 1 };
                let end = if to >= last { self.directions.len() } else { to as usize + 1 };
                if begin < end {
                    each(begin..end);
                }
            }
        }
    }

    /// The same for the rays that a disc may lie across; `to` is its centre as seen from the fan's place.
    #[inline]
    pub(crate) fn across(&self, to: Point, radius_m: f64, each: impl FnMut(Range<usize>)) {
        let (from_rad, to_rad) = sides_rad(to, radius_m);
        self.between(from_rad, to_rad, each);
    }
}

/// Bearings of the right and the left side of a disc, to the precision of [`bearing_rad`]; all around from inside.
#[inline]
pub(crate) fn sides_rad(to: Point, radius_m: f64) -> (f64, f64) {
    let outside2 = to.dot(to) - radius_m * radius_m;
    if outside2 <= 0.0 {
        return (-PI, PI);
    }
    let middle_rad = bearing_rad(to);
    let half_rad = bearing_rad(Point::new(outside2.sqrt(), radius_m));
    (middle_rad - half_rad, middle_rad + half_rad)
}

/// Direction of a vector to within 1e-5 rad; 0 for none.
#[inline]
pub(crate) fn bearing_rad(to: Point) -> f64 {
    let (x, y) = (to.x_m.abs(), to.y_m.abs());
    let steep = y > x;
    let (low, high) = if steep { (x, y) } else { (y, x) };
    let z = low / high.max(f64::MIN_POSITIVE);
    let s = z * z;
    let atan = z * (0.999_866_0 + s * (-0.330_299_5 + s * (0.180_141_0 + s * (-0.085_133_0 + s * 0.020_835_1))));
    let in_quarter = if steep { FRAC_PI_2 - atan } else { atan };
    let in_half = if to.x_m < 0.0 { PI - in_quarter } else { in_quarter };
    in_half.copysign(to.y_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bearings_are_true_to_a_hundred_thousandth() {
        for k in -200_000..=200_000 {
            let angle_rad = PI * f64::from(k) / 200_000.0;
            let off = (bearing_rad(Point::unit(angle_rad) * 3.0) - angle_rad).abs();
            assert!(off.min(TAU - off) < 1.2e-5, "{angle_rad} {off}");
        }
        assert_eq!(bearing_rad(Point::ZERO), 0.0);
    }

    #[test]
    fn the_rays_between_two_bearings_are_found_across_the_back_too() {
        let runs = |fan: &Fan, from_rad: f64, to_rad: f64| {
            let mut runs = Vec::new();
            fan.between(from_rad, to_rad, |run| runs.push((run.start, run.end)));
            runs
        };
        let half = Fan::new(Point::ZERO, -FRAC_PI_2, PI / 180.0, 181);
        assert_eq!(runs(&half, -0.01, 0.01), [(90, 91)]);
        assert_eq!(runs(&half, 1.0, 4.0), [(148, 181)]);
        assert_eq!(runs(&half, 2.0, 4.0), []);
        assert_eq!(runs(&half, 2.0, 5.0), [(0, 17)]);
        let around = Fan::new(Point::ZERO, 0.0, TAU / 12.0, 12);
        assert_eq!(runs(&around, -0.1, 0.1), [(0, 1)]);
        assert_eq!(runs(&around, -0.6, 0.6), [(0, 2), (11, 12)]);
        assert_eq!(runs(&around, 3.0, 3.3), [(6, 7)]);
        assert_eq!(runs(&around, -3.3, -3.0), [(6, 7)]);
    }
}
