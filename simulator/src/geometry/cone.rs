//! The nearest point of a surface inside a cone: what a sonar disc hears first.
//!
//! A disc hears the nearest surface within its opening angle. That point is found in closed form instead of by
//! sampling rays, so that a chair leg between two samples cannot hide. How squarely the sound meets the surface there
//! (the incidence) decides whether it comes back or glances off.

use super::{Circle, Point, Segment};
use runtime::math;

/// A cone of sound: apex, axis and half opening angle (below 90°), out to a greatest distance.
#[derive(Debug, Clone, Copy)]
pub struct Cone {
    /// Where the disc sits.
    pub apex: Point,
    /// Unit vector of the axis.
    pub axis: Point,
    /// Unit vector of the left boundary.
    pub left: Point,
    /// Unit vector of the right boundary.
    pub right: Point,
    /// Cosine of the half opening angle.
    pub cos_half: f64,
    /// Greatest distance [m].
    pub reach_m: f64,
}

/// Where a cone meets a surface first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConeHit {
    /// Distance from the apex [m].
    pub distance_m: f64,
    /// The point of the surface.
    pub point: Point,
    /// Cosine of the angle between the sound and the surface's normal; 1 for an edge, which scatters every way.
    pub cos_incidence: f64,
}

impl Cone {
    /// The cone at `apex` that looks along `bearing_rad` and opens `half_angle_rad` to either side.
    pub fn new(apex: Point, bearing_rad: f64, half_angle_rad: f64, reach_m: f64) -> Cone {
        let axis = Point::unit(bearing_rad);
        let (sin, cos) = math::sin_cos(half_angle_rad);
        Cone { apex, axis, left: axis.turned(cos, sin), right: axis.turned(cos, -sin), cos_half: cos, reach_m }
    }

    /// Whether `point` (seen from the apex) lies between the boundaries.
    pub fn holds(&self, point: Point) -> bool {
        self.right.cross(point) >= 0.0 && point.cross(self.left) >= 0.0
    }

    /// The nearest point of a segment inside the cone and within reach.
    pub fn meet_segment(&self, segment: &Segment) -> Option<ConeHit> {
        let a = segment.a - self.apex;
        let along = segment.b - segment.a;
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        // Both boundaries are lines through the apex: the signed areas are linear in t.
        for (start, slope) in
            [(self.right.cross(a), self.right.cross(along)), (a.cross(self.left), along.cross(self.left))]
        {
            if slope > 0.0 {
                from = from.max(-start / slope);
            } else if slope < 0.0 {
                to = to.min(-start / slope);
            } else if start < 0.0 {
                return None;
            }
        }
        if from > to {
            return None;
        }
        let length2 = along.dot(along);
        let foot = if length2 > 0.0 { -a.dot(along) / length2 } else { 0.0 };
        let t = foot.clamp(from, to);
        let nearest = a + along * t;
        let distance2 = nearest.dot(nearest);
        if distance2 > self.reach_m * self.reach_m {
            return None;
        }
        let distance_m = distance2.sqrt();
        let edge = t == 0.0 || t == 1.0;
        let cos_incidence = if edge || distance_m == 0.0 {
            1.0
        } else {
            (a.cross(along).abs() / (length2.sqrt() * distance_m)).min(1.0)
        };
        Some(ConeHit { distance_m, point: self.apex + nearest, cos_incidence })
    }

    /// The nearest point of a circle inside the cone and within reach.
    pub fn meet_circle(&self, circle: &Circle) -> Option<ConeHit> {
        let to = circle.centre - self.apex;
        let away = to.norm();
        if away <= circle.radius_m {
            return Some(ConeHit { distance_m: 0.0, point: self.apex, cos_incidence: 1.0 });
        }
        if away - circle.radius_m > self.reach_m {
            return None;
        }
        if self.holds(to) {
            let distance_m = away - circle.radius_m;
            return Some(ConeHit { distance_m, point: self.apex + to * (distance_m / away), cos_incidence: 1.0 });
        }
        // The centre lies outside: the nearest visible point lies on the boundary that faces it.
        let boundary = if self.axis.cross(to) > 0.0 { self.left } else { self.right };
        let distance_m = circle.cast(self.apex, boundary).filter(|distance| *distance <= self.reach_m)?;
        let point = boundary * distance_m;
        let cos_incidence = ((to - point).dot(boundary) / circle.radius_m).clamp(0.0, 1.0);
        Some(ConeHit { distance_m, point: self.apex + point, cos_incidence })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const DEG: f64 = PI / 180.0;

    fn ahead() -> Cone {
        Cone::new(Point::ZERO, 0.0, 15.0 * DEG, 5.0)
    }

    #[test]
    fn a_square_wall_is_heard_at_its_perpendicular_foot() {
        let hit = ahead().meet_segment(&Segment::new(Point::new(2.0, -3.0), Point::new(2.0, 3.0))).unwrap();
        assert!((hit.distance_m - 2.0).abs() < 1e-12);
        assert!((hit.cos_incidence - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_slanted_wall_is_heard_at_the_boundary_nearest_to_its_foot() {
        // The wall x + y = 2 has its foot at 45°; the left boundary (15°) comes nearest to it.
        let hit = ahead().meet_segment(&Segment::new(Point::new(4.0, -2.0), Point::new(-2.0, 4.0))).unwrap();
        let expected = 2.0 / (math::cos(15.0 * DEG) + math::sin(15.0 * DEG));
        assert!((hit.distance_m - expected).abs() < 1e-12);
        assert!((hit.cos_incidence - math::cos(30.0 * DEG)).abs() < 1e-12);
    }

    #[test]
    fn an_edge_scatters_and_what_lies_outside_or_behind_is_silent() {
        let edge = ahead().meet_segment(&Segment::new(Point::new(2.0, 0.1), Point::new(4.0, 3.0))).unwrap();
        assert_eq!(edge.cos_incidence, 1.0);
        assert!(ahead().meet_segment(&Segment::new(Point::new(-2.0, -3.0), Point::new(-2.0, 3.0))).is_none());
        assert!(ahead().meet_segment(&Segment::new(Point::new(1.0, 1.0), Point::new(1.0, 3.0))).is_none());
        assert!(ahead().meet_segment(&Segment::new(Point::new(5.1, -3.0), Point::new(5.1, 3.0))).is_none());
    }

    #[test]
    fn a_thin_leg_anywhere_in_the_cone_is_heard() {
        for degrees in -15..=15 {
            let centre = Point::unit(degrees as f64 * DEG) * 3.0;
            let hit = ahead().meet_circle(&Circle::new(centre, 0.01)).unwrap();
            assert!((hit.distance_m - 2.99).abs() < 1e-9, "{degrees}");
        }
    }

    #[test]
    fn closed_form_agrees_with_many_sampled_rays() {
        let cone = Cone::new(Point::new(0.2, -0.1), 0.7, 15.0 * DEG, 5.0);
        let wall = Segment::new(Point::new(1.0, 3.0), Point::new(3.0, 0.2));
        let post = Circle::new(Point::new(1.2, 2.0), 0.4);
        let sampled = |cast: &dyn Fn(Point) -> Option<f64>| {
            (0..=20_000)
                .filter_map(|k| cast(Point::unit(0.7 + (k as f64 / 10_000.0 - 1.0) * 15.0 * DEG)))
                .fold(f64::INFINITY, f64::min)
        };
        let wall_hit = cone.meet_segment(&wall).unwrap().distance_m;
        assert!((wall_hit - sampled(&|d| wall.cast(cone.apex, d))).abs() < 1e-4);
        let post_hit = cone.meet_circle(&post).unwrap().distance_m;
        assert!((post_hit - sampled(&|d| post.cast(cone.apex, d))).abs() < 1e-3);
    }
}
