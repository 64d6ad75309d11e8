//! The two static primitives: line segments and circles, and how rays meet them.

use super::Point;

/// A straight piece of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// One end.
    pub a: Point,
    /// The other end.
    pub b: Point,
}

/// A round thing, solid inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Its centre.
    pub centre: Point,
    /// Its radius [m].
    pub radius_m: f64,
}

impl Segment {
    /// The segment from `a` to `b`.
    pub const fn new(a: Point, b: Point) -> Segment {
        Segment { a, b }
    }

    /// Distance at which a ray from `origin` along the unit vector `direction` meets the segment [m].
    ///
    /// A ray that runs along the segment meets its nearer end.
    #[inline]
    pub fn cast(&self, origin: Point, direction: Point) -> Option<f64> {
        let along = self.b - self.a;
        let to = self.a - origin;
        let across = direction.cross(along);
        if across == 0.0 {
            return cast_along(to, self.b - origin, direction);
        }
        // origin + t·direction = a + s·along; both found by crossing away the other unknown. Most segments are missed:
        // that is seen before anything is divided.
        let (s, t) = (to.cross(direction), to.cross(along));
        let (s, t, size) = if across > 0.0 { (s, t, across) } else { (-s, -t, -across) };
        (s >= 0.0 && s <= size && t >= 0.0).then(|| t / size)
    }

    /// The point of the segment nearest to `point`.
    pub fn nearest_to(&self, point: Point) -> Point {
        let along = self.b - self.a;
        let length2 = along.dot(along);
        if length2 == 0.0 {
            return self.a;
        }
        let t = ((point - self.a).dot(along) / length2).clamp(0.0, 1.0);
        self.a + along * t
    }

    /// Length [m].
    pub fn length_m(&self) -> f64 {
        (self.b - self.a).norm()
    }
}

/// A ray parallel to a segment whose ends are `a` and `b` as seen from the ray's origin.
fn cast_along(a: Point, b: Point, direction: Point) -> Option<f64> {
    const ON_THE_LINE_M: f64 = 1e-12;
    if a.cross(direction).abs() > ON_THE_LINE_M {
        return None;
    }
    let (near, far) = {
        let (ta, tb) = (a.dot(direction), b.dot(direction));
        (ta.min(tb), ta.max(tb))
    };
    (far >= 0.0).then_some(near.max(0.0))
}

impl Circle {
    /// The circle around `centre`.
    pub const fn new(centre: Point, radius_m: f64) -> Circle {
        Circle { centre, radius_m }
    }

    /// Distance at which a ray from `origin` along the unit vector `direction` meets the circle; 0 from inside [m].
    #[inline]
    pub fn cast(&self, origin: Point, direction: Point) -> Option<f64> {
        let to = self.centre - origin;
        let outside2 = to.dot(to) - self.radius_m * self.radius_m;
        let ahead = to.dot(direction);
        // Most circles are missed by the whole line: one branch for them.
        let under = ahead * ahead - outside2;
        if under < 0.0 {
            return None;
        }
        if outside2 <= 0.0 {
            return Some(0.0);
        }
        // The stable form of the smaller root: c / (b + √…) loses no digits when the circle is far.
        (ahead > 0.0).then(|| outside2 / (ahead + under.sqrt()))
    }

    /// Whether `point` lies in it.
    pub fn contains(&self, point: Point) -> bool {
        let to = self.centre - point;
        to.dot(to) <= self.radius_m * self.radius_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: Point = Point::new(1.0, 0.0);

    #[test]
    fn a_ray_meets_a_slanted_wall_where_the_line_equation_says() {
        let wall = Segment::new(Point::new(2.0, -2.0), Point::new(4.0, 2.0));
        assert!((wall.cast(Point::ZERO, X).unwrap() - 3.0).abs() < 1e-12);
        assert_eq!(wall.cast(Point::new(0.0, 2.1), X), None);
        assert_eq!(wall.cast(Point::new(5.0, 0.0), X), None);
    }

    #[test]
    fn a_ray_along_a_wall_meets_its_nearer_end() {
        let wall = Segment::new(Point::new(3.0, 0.0), Point::new(2.0, 0.0));
        assert_eq!(wall.cast(Point::ZERO, X), Some(2.0));
        assert_eq!(wall.cast(Point::new(2.5, 0.0), X), Some(0.0));
        assert_eq!(wall.cast(Point::new(4.0, 0.0), X), None);
        assert_eq!(wall.cast(Point::new(0.0, 0.1), X), None);
    }

    #[test]
    fn a_ray_meets_the_near_side_of_a_circle_and_starts_blocked_inside() {
        let post = Circle::new(Point::new(3.0, 0.3), 0.5);
        assert!((post.cast(Point::ZERO, X).unwrap() - 2.6).abs() < 1e-12);
        assert_eq!(post.cast(Point::new(3.1, 0.3), X), Some(0.0));
        assert_eq!(post.cast(Point::new(0.0, 0.9), X), None);
        assert_eq!(post.cast(Point::new(9.0, 0.3), X), None);
    }
}
