//! A beam of a ranger in the odometry frame: where it looked from, and what it heard.

use messages::{Beam, Echo, Ranges};
use runtime::math;

/// A ranger that clamps reads no less than its least range: within this of it nothing is known but "nearer" [m].
const TOO_NEAR_M: f64 = 0.002;

/// A place and heading in the odometry frame, ready for use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// x [m].
    pub x_m: f64,
    /// y [m].
    pub y_m: f64,
    /// Sine and cosine of the heading.
    pub sin: f64,
    /// Cosine of the heading.
    pub cos: f64,
}

impl Place {
    /// At (`x_m`, `y_m`), heading `heading_rad`.
    pub fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Place {
        let (sin, cos) = math::sin_cos(heading_rad);
        Place { x_m, y_m, sin, cos }
    }

    pub(super) fn out(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        (self.x_m + self.cos * x_m - self.sin * y_m, self.y_m + self.sin * x_m + self.cos * y_m)
    }

    pub(super) fn inward(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        (self.cos * dx + self.sin * dy, self.cos * dy - self.sin * dx)
    }
}

/// What a beam heard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Heard {
    Nothing,
    /// Something at this distance [m].
    At(f64),
    /// Something nearer than can be measured, which is this [m].
    Within(f64),
}

/// A beam in the odometry frame.
pub(super) struct Reading {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) axis_x: f64,
    pub(super) axis_y: f64,
    pub(super) half_width_rad: f64,
    pub(super) echo: Heard,
    /// Nothing is nearer than this.
    pub(super) free_m: f64,
}

impl Reading {
    pub(super) fn of(ranges: &Ranges, beam: &Beam, place: &Place) -> Option<Reading> {
        let (min_m, max_m) = (f64::from(ranges.min_range_m), f64::from(ranges.max_range_m));
        let range_m = f64::from(beam.range_m);
        let (echo, free_m) = match beam.echo {
            e if e == Echo::TooNear as u32 || (e == Echo::Value as u32 && range_m < min_m + TOO_NEAR_M) => {
                (Heard::Within(min_m), 0.0)
            }
            e if e == Echo::Value as u32 && range_m >= 0.0 => (Heard::At(range_m), range_m),
            e if e == Echo::Clear as u32 => (Heard::Nothing, max_m),
            _ => return None,
        };
        let (origin_x, origin_y) = (f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
        let half_width_rad = 0.5 * f64::from(ranges.beam_width_rad);
        let numbers = [origin_x, origin_y, f64::from(beam.bearing_rad), half_width_rad, free_m, min_m];
        if !numbers.iter().all(|n| n.is_finite()) {
            return None;
        }
        let (x_m, y_m) = place.out(origin_x, origin_y);
        let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
        Some(Reading {
            x_m,
            y_m,
            axis_x: place.cos * cos - place.sin * sin,
            axis_y: place.sin * cos + place.cos * sin,
            half_width_rad,
            echo,
            free_m,
        })
    }
}
