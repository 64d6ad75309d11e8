//! Convex outlines of bodies: distance to points, segments, circles and one another.

use super::{Circle, Point, Pose, Segment};

/// Greatest number of corners of a [`Footprint`].
pub const MAX_CORNERS: usize = 12;

/// Convex outline of a body about its centre of rotation, corners counter-clockwise, in the body's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    corners: [Point; MAX_CORNERS],
    count: usize,
    radius_m: f64,
}

impl Footprint {
    /// The outline through `corners`; `None` unless they are 3 to [`MAX_CORNERS`], convex and counter-clockwise.
    pub fn new(corners: &[Point]) -> Option<Footprint> {
        let count = corners.len();
        if !(3..=MAX_CORNERS).contains(&count) {
            return None;
        }
        for k in 0..count {
            let (a, b, c) = (corners[k], corners[(k + 1) % count], corners[(k + 2) % count]);
            // The negation also refuses NaN.
            let turns_left = (b - a).cross(c - b) > 0.0;
            if !turns_left {
                return None;
            }
        }
        let mut own = [Point::ZERO; MAX_CORNERS];
        own[..count].copy_from_slice(corners);
        let radius_m = corners.iter().map(|corner| corner.norm()).fold(0.0, f64::max);
        Some(Footprint { corners: own, count, radius_m })
    }

    /// A rectangle whose corners are cut off by `cut_m` along both sides (0: a plain rectangle).
    pub fn cut_rectangle(ahead_m: f64, behind_m: f64, half_width_m: f64, cut_m: f64) -> Option<Footprint> {
        let (f, b, w, c) = (ahead_m, -behind_m, half_width_m, cut_m);
        if c == 0.0 {
            return Footprint::new(&[Point::new(f, -w), Point::new(f, w), Point::new(b, w), Point::new(b, -w)]);
        }
        Footprint::new(&[
            Point::new(f - c, -w),
            Point::new(f, -w + c),
            Point::new(f, w - c),
            Point::new(f - c, w),
            Point::new(b + c, w),
            Point::new(b, w - c),
            Point::new(b, -w + c),
            Point::new(b + c, -w),
        ])
    }

    /// Radius of the circle about the centre of rotation that holds the whole outline [m].
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The corners in the body's frame, counter-clockwise.
    pub fn corners(&self) -> &[Point] {
        &self.corners[..self.count]
    }

    /// The outline as it lies in the world when the body is at `pose`.
    pub fn placed(&self, pose: Pose) -> Placed {
        let (sin, cos) = runtime::math::sin_cos(pose.heading_rad);
        let mut corners = [Point::ZERO; MAX_CORNERS];
        for (placed, corner) in corners.iter_mut().zip(self.corners()) {
            *placed = pose.place() + corner.turned(cos, sin);
        }
        Placed { corners, count: self.count, centre: pose.place(), radius_m: self.radius_m }
    }
}

/// A [`Footprint`] in the world.
#[derive(Debug, Clone, Copy)]
pub struct Placed {
    corners: [Point; MAX_CORNERS],
    count: usize,
    /// The centre of rotation.
    pub centre: Point,
    /// All of the outline lies within this distance of `centre` [m].
    pub radius_m: f64,
}

/// Two points, one on the outline and one on the other thing, and their distance (0 when they overlap).
pub(crate) type Gap = (f64, Point, Point);

impl Placed {
    /// The corners in the world, counter-clockwise.
    pub fn corners(&self) -> &[Point] {
        &self.corners[..self.count]
    }

    /// The sides in the world, counter-clockwise.
    pub fn sides(&self) -> impl Iterator<Item = Segment> + '_ {
        (0..self.count).map(|k| Segment::new(self.corners[k], self.corners[(k + 1) % self.count]))
    }

    /// Whether `point` lies in the outline.
    pub fn contains(&self, point: Point) -> bool {
        self.sides().all(|side| (side.b - side.a).cross(point - side.a) >= 0.0)
    }

    /// Gap to a segment.
    pub(crate) fn gap_to_segment(&self, segment: &Segment) -> Gap {
        let along = segment.b - segment.a;
        let length2 = along.dot(along);
        let inverse = if length2 > 0.0 { 1.0 / length2 } else { 0.0 };
        let nearest_to = |point: Point| segment.a + along * ((point - segment.a).dot(along) * inverse).clamp(0.0, 1.0);
        let from_centre = nearest_to(self.centre) - self.centre;
        // Only what comes within the outline's circle can cross it.
        if from_centre.dot(from_centre) <= self.radius_m * self.radius_m
            && let Some(inside) = self.clip(segment)
        {
            return (0.0, inside, inside);
        }
        let mut best = (f64::INFINITY, Point::ZERO, Point::ZERO);
        for corner in self.corners() {
            keep_nearer(&mut best, *corner, nearest_to(*corner));
        }
        for end in [segment.a, segment.b] {
            // Most ends are farther from the whole circle than a corner is from the segment.
            let least_m = (end - self.centre).norm() - self.radius_m;
            if least_m > 0.0 && least_m * least_m >= best.0 {
                continue;
            }
            self.keep_nearest_to(&mut best, end);
        }
        (best.0.sqrt(), best.1, best.2)
    }

    /// Gap to a circle.
    pub(crate) fn gap_to_circle(&self, circle: &Circle) -> Gap {
        if self.contains(circle.centre) {
            return (0.0, circle.centre, circle.centre);
        }
        let mut best = (f64::INFINITY, Point::ZERO, Point::ZERO);
        self.keep_nearest_to(&mut best, circle.centre);
        let away = best.0.sqrt();
        let towards = if away > 0.0 { (best.1 - circle.centre) * (1.0 / away) } else { Point::ZERO };
        ((away - circle.radius_m).max(0.0), best.1, circle.centre + towards * circle.radius_m.min(away))
    }

    /// Keeps what is nearest to a point outside: it lies on a side that faces the point.
    fn keep_nearest_to(&self, best: &mut Gap, point: Point) {
        for side in self.sides().filter(|side| (side.b - side.a).cross(point - side.a) < 0.0) {
            keep_nearer(best, side.nearest_to(point), point);
        }
    }

    /// Gap to another outline.
    pub(crate) fn gap_to_placed(&self, other: &Placed) -> Gap {
        let mut best = (f64::INFINITY, Point::ZERO, Point::ZERO);
        for side in other.sides() {
            let gap = self.gap_to_segment(&side);
            if gap.0 < best.0 {
                best = gap;
            }
        }
        if other.contains(self.corners[0]) {
            return (0.0, self.corners[0], self.corners[0]);
        }
        best
    }

    /// A point of the segment inside the outline, if there is one (Cyrus and Beck's clipping).
    fn clip(&self, segment: &Segment) -> Option<Point> {
        let along = segment.b - segment.a;
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for side in self.sides() {
            let edge = side.b - side.a;
            let start = edge.cross(segment.a - side.a);
            let slope = edge.cross(along);
            if slope > 0.0 {
                from = from.max(-start / slope);
            } else if slope < 0.0 {
                to = to.min(-start / slope);
            } else if start < 0.0 {
                return None;
            }
            if from > to {
                return None;
            }
        }
        Some(segment.a + along * (0.5 * (from + to)))
    }
}

/// Keeps the nearer pair; the first member of `best` holds the squared distance meanwhile.
fn keep_nearer(best: &mut Gap, on_body: Point, on_thing: Point) {
    let apart = on_thing - on_body;
    let squared = apart.dot(apart);
    if squared < best.0 {
        *best = (squared, on_body, on_thing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_4;

    fn square() -> Placed {
        Footprint::cut_rectangle(1.0, 1.0, 1.0, 0.0).unwrap().placed(Pose::default())
    }

    #[test]
    fn outlines_that_are_not_convex_or_run_clockwise_are_refused() {
        let p = Point::new;
        assert!(Footprint::new(&[p(0.0, 0.0), p(0.0, 1.0), p(1.0, 1.0)]).is_none());
        assert!(Footprint::new(&[p(0.0, 0.0), p(2.0, 0.0), p(0.5, 0.5), p(0.0, 2.0)]).is_none());
        assert!(Footprint::new(&[p(0.0, 0.0), p(f64::NAN, 0.0), p(1.0, 1.0)]).is_none());
        assert!(Footprint::new(&[p(0.0, 0.0), p(1.0, 0.0)]).is_none());
    }

    #[test]
    fn the_gap_to_a_wall_is_found_at_a_side_at_a_corner_and_at_the_walls_end() {
        let side = square().gap_to_segment(&Segment::new(Point::new(3.0, -5.0), Point::new(3.0, 5.0)));
        assert!((side.0 - 2.0).abs() < 1e-12);
        let corner = square().gap_to_segment(&Segment::new(Point::new(4.0, 0.0), Point::new(0.0, 4.0)));
        assert!((corner.0 - 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(corner.1, Point::new(1.0, 1.0));
        let end = square().gap_to_segment(&Segment::new(Point::new(1.5, 0.2), Point::new(9.0, 0.3)));
        assert!((end.0 - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_wall_through_or_inside_the_outline_leaves_no_gap() {
        assert_eq!(square().gap_to_segment(&Segment::new(Point::new(-3.0, 0.1), Point::new(3.0, 0.2))).0, 0.0);
        assert_eq!(square().gap_to_segment(&Segment::new(Point::new(-0.1, 0.1), Point::new(0.1, 0.2))).0, 0.0);
        assert!(square().gap_to_segment(&Segment::new(Point::new(-3.0, 2.2), Point::new(2.2, -3.0))).0 == 0.0);
        assert!(square().gap_to_segment(&Segment::new(Point::new(-1.0, 1.5), Point::new(1.5, 1.5))).0 > 0.0);
    }

    #[test]
    fn the_gap_to_a_circle_and_to_another_body_is_measured_between_surfaces() {
        let gap = square().gap_to_circle(&Circle::new(Point::new(3.0, 0.0), 0.5));
        assert!((gap.0 - 1.5).abs() < 1e-12);
        assert!((gap.2 - Point::new(2.5, 0.0)).norm() < 1e-12);
        assert_eq!(square().gap_to_circle(&Circle::new(Point::new(0.9, 0.9), 0.01)).0, 0.0);
        let other = Footprint::cut_rectangle(1.0, 1.0, 1.0, 0.0).unwrap().placed(Pose::new(4.0, 0.0, FRAC_PI_4));
        assert!((square().gap_to_placed(&other).0 - (3.0 - 2.0_f64.sqrt())).abs() < 1e-12);
        assert_eq!(square().gap_to_placed(&square()).0, 0.0);
    }
}
