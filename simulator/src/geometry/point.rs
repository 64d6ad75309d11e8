//! Points, vectors and poses.

use runtime::math;
use std::ops::{Add, Mul, Neg, Sub};

/// A point or a vector in the plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Point {
    /// Along x [m].
    pub x_m: f64,
    /// Along y [m].
    pub y_m: f64,
}

impl Point {
    /// The origin.
    pub const ZERO: Point = Point { x_m: 0.0, y_m: 0.0 };

    /// The point (`x_m`, `y_m`).
    pub const fn new(x_m: f64, y_m: f64) -> Point {
        Point { x_m, y_m }
    }

    /// The unit vector at `angle_rad`.
    pub fn unit(angle_rad: f64) -> Point {
        let (sin, cos) = math::sin_cos(angle_rad);
        Point::new(cos, sin)
    }

    /// Inner product [m²].
    pub fn dot(self, other: Point) -> f64 {
        self.x_m * other.x_m + self.y_m * other.y_m
    }

    /// Third component of the outer product [m²]: positive when `other` lies to the left of `self`.
    pub fn cross(self, other: Point) -> f64 {
        self.x_m * other.y_m - self.y_m * other.x_m
    }

    /// Length [m].
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// The vector turned left by a quarter.
    pub fn left(self) -> Point {
        Point::new(-self.y_m, self.x_m)
    }

    /// The vector turned by the angle whose cosine and sine are given.
    pub fn turned(self, cos: f64, sin: f64) -> Point {
        Point::new(self.x_m * cos - self.y_m * sin, self.x_m * sin + self.y_m * cos)
    }

    /// Direction of the vector [rad].
    pub fn angle(self) -> f64 {
        math::atan2(self.y_m, self.x_m)
    }
}

impl Add for Point {
    type Output = Point;
    fn add(self, other: Point) -> Point {
        Point::new(self.x_m + other.x_m, self.y_m + other.y_m)
    }
}

impl Sub for Point {
    type Output = Point;
    fn sub(self, other: Point) -> Point {
        Point::new(self.x_m - other.x_m, self.y_m - other.y_m)
    }
}

impl Mul<f64> for Point {
    type Output = Point;
    fn mul(self, factor: f64) -> Point {
        Point::new(self.x_m * factor, self.y_m * factor)
    }
}

impl Neg for Point {
    type Output = Point;
    fn neg(self) -> Point {
        Point::new(-self.x_m, -self.y_m)
    }
}

/// A place and a heading: `world_from_body` when it is a body's pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// Along x [m].
    pub x_m: f64,
    /// Along y [m].
    pub y_m: f64,
    /// Counter-clockwise from x, in (−π, π] [rad].
    pub heading_rad: f64,
}

impl Pose {
    /// The pose at (`x_m`, `y_m`) that looks along `heading_rad`.
    pub const fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Pose {
        Pose { x_m, y_m, heading_rad }
    }

    /// The place alone.
    pub fn place(self) -> Point {
        Point::new(self.x_m, self.y_m)
    }

    /// A point of the body in the frame that this pose is given in.
    pub fn world_from_body(self, point: Point) -> Point {
        let (sin, cos) = math::sin_cos(self.heading_rad);
        self.place() + point.turned(cos, sin)
    }

    /// A point of that frame in the body's.
    pub fn body_from_world(self, point: Point) -> Point {
        let (sin, cos) = math::sin_cos(self.heading_rad);
        (point - self.place()).turned(cos, -sin)
    }

    /// The pose after an arc of length `way_m` that turns by `turn_rad` (closed form, exact for constant velocities).
    pub fn after_arc(self, way_m: f64, turn_rad: f64) -> Pose {
        let half = 0.5 * turn_rad;
        // The chord is the arc times sin(h)/h; the series is exact to 1e-13 for the turns of one step.
        let squared = half * half;
        let shrink = if squared < 1e-4 { 1.0 - squared / 6.0 * (1.0 - squared / 20.0) } else { math::sin(half) / half };
        let chord = way_m * shrink;
        let (sin, cos) = math::sin_cos(self.heading_rad + half);
        Pose {
            x_m: self.x_m + chord * cos,
            y_m: self.y_m + chord * sin,
            heading_rad: math::wrap_angle(self.heading_rad + turn_rad),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn a_half_circle_ends_a_diameter_to_the_left() {
        let end = Pose::default().after_arc(PI * 2.0, PI);
        assert!((end.x_m).abs() < 1e-12 && (end.y_m - 4.0).abs() < 1e-12, "{end:?}");
        assert!((end.heading_rad - PI).abs() < 1e-12);
    }

    #[test]
    fn the_series_of_small_turns_meets_the_closed_form() {
        for turn in [1e-9, 1e-4, 0.019_99, 0.020_01, 0.1] {
            let one = Pose::new(1.0, 2.0, 0.3).after_arc(0.5, turn);
            let half = Pose::new(1.0, 2.0, 0.3).after_arc(0.25, turn / 2.0).after_arc(0.25, turn / 2.0);
            assert!((one.x_m - half.x_m).abs() < 1e-12 && (one.y_m - half.y_m).abs() < 1e-12, "{turn}");
        }
    }

    #[test]
    fn frames_invert_each_other() {
        let pose = Pose::new(3.0, -1.0, FRAC_PI_2);
        let world = pose.world_from_body(Point::new(1.0, 0.0));
        assert!((world - Point::new(3.0, 0.0)).norm() < 1e-12);
        assert!((pose.body_from_world(world) - Point::new(1.0, 0.0)).norm() < 1e-12);
    }
}
