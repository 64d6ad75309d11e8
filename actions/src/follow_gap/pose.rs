//! Points and poses in the plane, as the planner needs them.

use runtime::math;

/// A point or a vector [m].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Point {
    /// Along x [m].
    pub x_m: f64,
    /// Along y [m].
    pub y_m: f64,
}

impl Point {
    /// The point (`x_m`, `y_m`).
    pub const fn new(x_m: f64, y_m: f64) -> Point {
        Point { x_m, y_m }
    }

    /// The vector from here to `other`.
    pub fn to(self, other: Point) -> Point {
        Point::new(other.x_m - self.x_m, other.y_m - self.y_m)
    }

    /// This point moved by `vector` times `factor`.
    pub fn plus(self, vector: Point, factor: f64) -> Point {
        Point::new(self.x_m + vector.x_m * factor, self.y_m + vector.y_m * factor)
    }

    /// Squared length [m²].
    pub fn squared(self) -> f64 {
        self.x_m * self.x_m + self.y_m * self.y_m
    }

    /// Length [m].
    pub fn length_m(self) -> f64 {
        self.squared().sqrt()
    }
}

/// A place and a heading: `odometry_from_body` here.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// The place.
    pub place: Point,
    /// Counter-clockwise from x [rad].
    pub heading_rad: f64,
}

impl Pose {
    /// The pose at (`x_m`, `y_m`) that looks along `heading_rad`.
    pub const fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Pose {
        Pose { place: Point::new(x_m, y_m), heading_rad }
    }

    /// The frame with its sine and cosine worked out.
    pub fn frame(self) -> Frame {
        let (sin, cos) = math::sin_cos(self.heading_rad);
        Frame { place: self.place, sin, cos }
    }

    /// The pose after moving at constant velocities for `dt_s` (midpoint rule, exact to the third order).
    pub fn after(self, forward_m_s: f64, turn_rad_s: f64, dt_s: f64) -> Pose {
        let (sin, cos) = math::sin_cos(self.heading_rad + 0.5 * turn_rad_s * dt_s);
        let way_m = forward_m_s * dt_s;
        Pose {
            place: Point::new(self.place.x_m + way_m * cos, self.place.y_m + way_m * sin),
            heading_rad: self.heading_rad + turn_rad_s * dt_s,
        }
    }
}

/// A pose ready for use on many points.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Origin of the body.
    pub place: Point,
    /// Sine of the heading.
    pub sin: f64,
    /// Cosine of the heading.
    pub cos: f64,
}

impl Frame {
    /// A point of the body in the outer frame.
    pub fn outer(&self, x_m: f64, y_m: f64) -> Point {
        Point::new(self.place.x_m + x_m * self.cos - y_m * self.sin, self.place.y_m + x_m * self.sin + y_m * self.cos)
    }

    /// A point of the outer frame in the body's.
    pub fn inner(&self, point: Point) -> Point {
        let d = self.place.to(point);
        Point::new(d.x_m * self.cos + d.y_m * self.sin, d.y_m * self.cos - d.x_m * self.sin)
    }
}
