//! Where the body is in the map frame, now.

use messages::Odometry;
use runtime::{Sample, Time, math};

/// A pose in the map frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Position [m].
    pub x_m: f64,
    /// Position [m].
    pub y_m: f64,
    /// Heading, in (−π, π] [rad].
    pub heading_rad: f64,
}

impl Place {
    /// The pose of an odometry sample, carried on by its velocity to `now`; `None` when it holds a number that is none.
    pub fn at(now: Time, sample: &Sample<'_, Odometry>) -> Option<Place> {
        let (velocity, ahead_s) = (sample.velocity, now.since(sample.stamp).max(0.0));
        let turned_rad = velocity.angular_z_rad_s * ahead_s;
        let way_m = velocity.linear_x_m_s * ahead_s;
        let (sin, cos) = math::sin_cos(sample.heading_rad + 0.5 * turned_rad);
        let place = Place {
            x_m: sample.x_m + way_m * cos,
            y_m: sample.y_m + way_m * sin,
            heading_rad: math::wrap_angle(sample.heading_rad + turned_rad),
        };
        place.is_finite().then_some(place)
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite() && self.heading_rad.is_finite()
    }

    /// The point (`x_m`, `y_m`) of the map frame in the body frame [m].
    pub fn body_from_map(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (sin, cos) = math::sin_cos(self.heading_rad);
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        (cos * dx + sin * dy, cos * dy - sin * dx)
    }

    /// Distance to the point (`x_m`, `y_m`) [m].
    pub fn distance_m(&self, x_m: f64, y_m: f64) -> f64 {
        math::hypot(x_m - self.x_m, y_m - self.y_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_point_ahead_in_the_map_lies_on_the_body_s_x_axis() {
        let place = Place { x_m: 1.0, y_m: 2.0, heading_rad: FRAC_PI_2 };
        let (x, y) = place.body_from_map(1.0, 5.0);
        assert!((x - 3.0).abs() < 1e-12 && y.abs() < 1e-12);
        let (x, y) = place.body_from_map(0.0, 2.0);
        assert!(x.abs() < 1e-12 && (y - 1.0).abs() < 1e-12, "the map's west is the body's left");
        assert_eq!(place.distance_m(1.0, 5.0), 3.0);
    }
}
