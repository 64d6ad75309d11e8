//! Where the body stood at some time, ready for carrying points in and out of its frame.

use messages::Odometry;
use runtime::{Reader, Time, math};

/// A pose is carried on by its velocity for no longer than this [s].
const LONGEST_EXTRAPOLATION_S: f64 = 0.3;

/// A place and heading in the odometry frame, ready for use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// x [m].
    pub x_m: f64,
    /// y [m].
    pub y_m: f64,
    /// Sine of the heading.
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

    /// A point of the body frame in the odometry frame.
    pub fn out(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (x, y) = self.turned_out(x_m, y_m);
        (self.x_m + x, self.y_m + y)
    }

    /// A point of the odometry frame in the body frame.
    pub fn inward(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        self.turned_inward(x_m - self.x_m, y_m - self.y_m)
    }

    /// A vector of the body frame in the odometry frame.
    pub fn turned_out(&self, x: f64, y: f64) -> (f64, f64) {
        (self.cos * x - self.sin * y, self.sin * x + self.cos * y)
    }

    /// A vector of the odometry frame in the body frame.
    pub fn turned_inward(&self, x: f64, y: f64) -> (f64, f64) {
        (self.cos * x + self.sin * y, self.cos * y - self.sin * x)
    }
}

/// Where the body was at `time`: between two samples, or carried on from the newest; `None` when that is not known.
pub fn place_at(odometry: &mut Reader<Odometry>, time: Time) -> Option<Place> {
    if let Some((before, after)) = odometry.around(time) {
        let whole_s = after.stamp.since(before.stamp);
        let share = if whole_s > 0.0 { time.since(before.stamp) / whole_s } else { 0.0 };
        let turned_rad = math::wrap_angle(after.heading_rad - before.heading_rad);
        return Some(Place::new(
            before.x_m + share * (after.x_m - before.x_m),
            before.y_m + share * (after.y_m - before.y_m),
            before.heading_rad + share * turned_rad,
        ));
    }
    let newest = odometry.at(time)?;
    let ahead_s = time.since(newest.stamp);
    if ahead_s > LONGEST_EXTRAPOLATION_S {
        return None;
    }
    let turned_rad = newest.velocity.angular_z_rad_s * ahead_s;
    let way_m = newest.velocity.linear_x_m_s * ahead_s;
    let (sin, cos) = math::sin_cos(newest.heading_rad + 0.5 * turned_rad);
    Some(Place::new(newest.x_m + way_m * cos, newest.y_m + way_m * sin, newest.heading_rad + turned_rad))
}
