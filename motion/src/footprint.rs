//! The body's outline, and when it touches a point on its way along an arc.
//!
//! In the body frame a resting point moves with dp/dt = −v·x̂ − ω·ẑ×p: along a straight line when ω = 0, else on a circle
//! about the body's centre of turning c = (0, v/ω). The outline is touched where that path first crosses one of its
//! edges, which is exact for any arc; no step size, no sampled poses.

use runtime::Body;
use runtime::math;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Arcs wider than this differ from a straight line by less than the footprint's own uncertainty.
const STRAIGHT_RADIUS_M: f64 = 1e4;

/// Forward speed and turn rate of a body that cannot move sideways.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Velocity {
    /// Forward speed [m/s].
    pub forward_m_s: f64,
    /// Turn rate, counter-clockwise [rad/s].
    pub turn_rad_s: f64,
}

impl Velocity {
    /// Standing still.
    pub const ZERO: Velocity = Velocity { forward_m_s: 0.0, turn_rad_s: 0.0 };

    /// A forward speed [m/s] and a turn rate [rad/s].
    pub const fn new(forward_m_s: f64, turn_rad_s: f64) -> Velocity {
        Velocity { forward_m_s, turn_rad_s }
    }

    /// The same arc at `factor` times the pace.
    pub fn scaled(self, factor: f64) -> Velocity {
        Velocity { forward_m_s: self.forward_m_s * factor, turn_rad_s: self.turn_rad_s * factor }
    }

    /// Whether both numbers are finite.
    pub fn is_finite(self) -> bool {
        self.forward_m_s.is_finite() && self.turn_rad_s.is_finite()
    }
}

/// A point in the body frame [m].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Point {
    /// Ahead of the centre of rotation [m].
    pub x_m: f64,
    /// To the left of it [m].
    pub y_m: f64,
}

/// Most corners of a footprint.
const CORNERS: usize = 8;

/// A rectangle about the centre of rotation, whose four corners may be cut off at 45°.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// From the centre of rotation to the front edge [m].
    pub ahead_m: f64,
    /// From the centre of rotation to the rear edge [m].
    pub behind_m: f64,
    /// From the centre line to either side [m].
    pub half_width_m: f64,
    /// How much of either edge is cut off at a corner [m].
    pub cut_m: f64,
}

impl Footprint {
    /// The footprint of `body` with corners cut by `cut_m`.
    pub fn of(body: &Body, cut_m: f64) -> Footprint {
        Footprint {
            ahead_m: body.length_ahead_m,
            behind_m: body.length_behind_m,
            half_width_m: body.half_width_m,
            cut_m,
        }
    }

    /// Distance of the farthest corner from the centre of rotation [m].
    pub fn corner_radius_m(&self) -> f64 {
        let (far, wide, cut) = (self.ahead_m.max(self.behind_m), self.half_width_m, self.cut_m);
        math::hypot(far, wide - cut).max(math::hypot(far - cut, wide))
    }

    /// Corners, counter-clockwise; the two ends of a cut coincide where nothing is cut off.
    fn corners(&self) -> [Point; CORNERS] {
        let (f, b, w, c) = (self.ahead_m, -self.behind_m, self.half_width_m, self.cut_m);
        [(f - c, -w), (f, -w + c), (f, w - c), (f - c, w), (b + c, w), (b, w - c), (b, -w + c), (b + c, -w)]
            .map(|(x_m, y_m)| Point { x_m, y_m })
    }

    /// How much the front and the rear edge recede at the distance `side_m` from the centre line [m].
    fn recess_m(&self, side_m: f64) -> f64 {
        (side_m - (self.half_width_m - self.cut_m)).max(0.0)
    }

    /// Whether `p` is inside or on the edge.
    pub fn holds(&self, p: Point) -> bool {
        let side_m = p.y_m.abs();
        let recess_m = self.recess_m(side_m);
        side_m <= self.half_width_m && p.x_m <= self.ahead_m - recess_m && p.x_m >= recess_m - self.behind_m
    }

    /// Time until the body, moving at `velocity`, touches the resting point `p`; +∞ when it never does [s].
    ///
    /// A point that is inside already is touched at once if the motion would press it deeper, and never if it lets go.
    pub fn contact_s(&self, velocity: Velocity, p: Point) -> f64 {
        Sweep::new(self, velocity).contact_s(p)
    }

    /// Whether moving at `velocity` brings a point inside the footprint farther from the nearest edge.
    fn deepens(&self, velocity: Velocity, p: Point) -> bool {
        let dx = -velocity.forward_m_s + velocity.turn_rad_s * p.y_m;
        let dy = -velocity.turn_rad_s * p.x_m;
        // Every edge by its outward normal and its distance from the centre of rotation.
        let (wide, slant) = (self.half_width_m, FRAC_1_SQRT_2);
        let front = (self.ahead_m + wide - self.cut_m) * slant;
        let rear = (self.behind_m + wide - self.cut_m) * slant;
        let edges = [
            (1.0, 0.0, self.ahead_m),
            (-1.0, 0.0, self.behind_m),
            (0.0, 1.0, wide),
            (0.0, -1.0, wide),
            (slant, slant, front),
            (slant, -slant, front),
            (-slant, slant, rear),
            (-slant, -slant, rear),
        ];
        let depth = |&(nx, ny, away): &(f64, f64, f64)| away - (nx * p.x_m + ny * p.y_m);
        let nearest = edges.into_iter().reduce(|a, b| if depth(&b) < depth(&a) { b } else { a });
        nearest.is_some_and(|(nx, ny, _)| nx * dx + ny * dy < -1e-9)
    }
}

/// A footprint on its way along one arc: what is asked for many points is worked out once.
#[derive(Debug, Clone, Copy)]
pub struct Sweep<'a> {
    footprint: &'a Footprint,
    velocity: Velocity,
    arc: Option<Arc>,
}

/// The footprint about its centre of turning.
#[derive(Debug, Clone, Copy)]
struct Arc {
    centre_y_m: f64,
    edges: [Edge; CORNERS],
    count: usize,
    /// Only points at squared distances between these meet the footprint.
    near_sq: f64,
    far_sq: f64,
}

impl<'a> Sweep<'a> {
    /// The sweep of `footprint` at `velocity`.
    pub fn new(footprint: &'a Footprint, velocity: Velocity) -> Sweep<'a> {
        let Velocity { forward_m_s: v, turn_rad_s: w } = velocity;
        let turns = w.abs() * STRAIGHT_RADIUS_M > v.abs();
        Sweep { footprint, velocity, arc: turns.then(|| Arc::new(footprint, v / w)) }
    }

    /// Whether `p` is so near to the swept area that its contact must be worked out. Cheap, and true for few points.
    pub fn may_touch(&self, p: Point) -> bool {
        match &self.arc {
            Some(arc) => arc.may_touch(p),
            None => p.y_m.abs() <= self.footprint.half_width_m,
        }
    }

    /// See [`Footprint::contact_s`].
    pub fn contact_s(&self, p: Point) -> f64 {
        if !self.may_touch(p) {
            return f64::INFINITY;
        }
        let moves = self.velocity != Velocity::ZERO;
        if moves && self.footprint.holds(p) {
            return if self.footprint.deepens(self.velocity, p) { 0.0 } else { f64::INFINITY };
        }
        match &self.arc {
            Some(arc) => arc.turn_to_contact_rad(p, self.velocity.turn_rad_s) / self.velocity.turn_rad_s.abs(),
            None if moves => self.straight_s(p),
            None => f64::INFINITY,
        }
    }

    fn straight_s(&self, p: Point) -> f64 {
        let (body, v) = (self.footprint, self.velocity.forward_m_s);
        let side_m = p.y_m.abs();
        if side_m > body.half_width_m {
            return f64::INFINITY;
        }
        let gap_m = if v > 0.0 { p.x_m - body.ahead_m } else { -body.behind_m - p.x_m } + body.recess_m(side_m);
        if gap_m < 0.0 { f64::INFINITY } else { gap_m / v.abs() }
    }
}

impl Arc {
    fn new(footprint: &Footprint, centre_y_m: f64) -> Arc {
        let corners = footprint.corners().map(|p| {
            let y = p.y_m - centre_y_m;
            (p.x_m, y, p.x_m * p.x_m + y * y)
        });
        let far_sq = corners.iter().fold(0.0, |far, corner| f64::max(far, corner.2));
        let inside = footprint.holds(Point { x_m: 0.0, y_m: centre_y_m });
        let (mut edges, mut count) = ([Edge::default(); CORNERS], 0);
        let mut near_sq = f64::INFINITY;
        for k in 0..CORNERS {
            let edge = Edge::new(corners[k], corners[(k + 1) % CORNERS]);
            near_sq = near_sq.min(edge.near_sq());
            if edge.length_sq > 0.0 {
                edges[count] = edge;
                count += 1;
            }
        }
        Arc { centre_y_m, edges, count, near_sq: if inside { 0.0 } else { near_sq }, far_sq }
    }

    /// Whether the circle of `p` meets the footprint; refuses a point that is no number.
    fn may_touch(&self, p: Point) -> bool {
        let y = p.y_m - self.centre_y_m;
        let radius_sq = p.x_m * p.x_m + y * y;
        (radius_sq >= self.near_sq) & (radius_sq <= self.far_sq)
    }

    /// Angle by which the body turns, towards the sign of `w`, until it touches a point outside; +∞ for never [rad].
    fn turn_to_contact_rad(&self, p: Point, w: f64) -> f64 {
        let (px, py) = (p.x_m, p.y_m - self.centre_y_m);
        let radius_sq = px * px + py * py;
        // The point runs against the body's own turning. Directions are told apart by a number that grows with the
        // angle and needs no arc tangent; only the nearest one's angle is worked out.
        let mut nearest = (f64::INFINITY, 0.0, 1.0);
        for edge in &self.edges[..self.count] {
            // An edge whose ends are both nearer is inside the circle.
            if edge.far_sq < radius_sq {
                continue;
            }
            for (x, y) in edge.crossings(radius_sq).into_iter().flatten() {
                let sine = (x * py - y * px) * w.signum();
                let cosine = x * px + y * py;
                // Rounding at the very edge must read as a touch now, not after a full turn.
                let ahead = sine >= if cosine > 0.0 { -1e-9 * radius_sq } else { 0.0 };
                let rank = if ahead { radius_sq - cosine } else { 3.0 * radius_sq + cosine };
                if rank < nearest.0 {
                    nearest = (rank, if ahead { sine.max(0.0) } else { sine }, cosine);
                }
            }
        }
        let (rank, sine, cosine) = nearest;
        if rank.is_infinite() {
            return f64::INFINITY;
        }
        let turn = math::atan2(sine, cosine);
        if turn < 0.0 { turn + TAU } else { turn }
    }
}

/// One side of the footprint, from the centre of turning; what does not depend on the point is worked out once.
#[derive(Debug, Clone, Copy, Default)]
struct Edge {
    x: f64,
    y: f64,
    /// Squared distance of its beginning.
    begin_sq: f64,
    /// Squared distance of its farther end.
    far_sq: f64,
    ex: f64,
    ey: f64,
    length_sq: f64,
    /// Half of the linear coefficient of the squared distance along the edge.
    half: f64,
}

impl Edge {
    /// From corner to corner, each with its squared distance from the centre of turning.
    fn new(a: (f64, f64, f64), b: (f64, f64, f64)) -> Edge {
        let (ex, ey) = (b.0 - a.0, b.1 - a.1);
        let (length_sq, half) = (ex * ex + ey * ey, a.0 * ex + a.1 * ey);
        Edge { x: a.0, y: a.1, begin_sq: a.2, far_sq: a.2.max(b.2), ex, ey, length_sq, half }
    }

    /// Squared distance from the centre of turning [m²].
    fn near_sq(&self) -> f64 {
        let t = if self.length_sq > 0.0 { (-self.half / self.length_sq).clamp(0.0, 1.0) } else { 0.0 };
        let (x, y) = (self.x + t * self.ex, self.y + t * self.ey);
        x * x + y * y
    }

    /// Where it crosses the circle of squared radius `radius_sq` about the centre of turning.
    fn crossings(&self, radius_sq: f64) -> [Option<(f64, f64)>; 2] {
        let root_sq = self.half * self.half - self.length_sq * (self.begin_sq - radius_sq);
        if root_sq < 0.0 {
            return [None, None];
        }
        let root = root_sq.sqrt();
        [-root, root].map(|root| {
            let t = (root - self.half) / self.length_sq;
            (-1e-12..=1.0 + 1e-12).contains(&t).then_some((self.x + t * self.ex, self.y + t * self.ey))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PIONEER: Footprint = Footprint { ahead_m: 0.21, behind_m: 0.30, half_width_m: 0.20, cut_m: 0.0 };
    const CUT: Footprint = Footprint { cut_m: 0.1, ..PIONEER };

    fn at(x_m: f64, y_m: f64) -> Point {
        Point { x_m, y_m }
    }

    #[test]
    fn a_wall_ahead_is_touched_after_the_gap_at_that_speed() {
        assert!((PIONEER.contact_s(Velocity::new(0.2, 0.0), at(0.61, 0.1)) - 2.0).abs() < 1e-12);
        assert!((PIONEER.contact_s(Velocity::new(-0.1, 0.0), at(-0.5, 0.0)) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_stands_beside_the_straight_way_is_never_touched() {
        assert_eq!(PIONEER.contact_s(Velocity::new(0.3, 0.0), at(0.5, 0.201)), f64::INFINITY);
        assert_eq!(PIONEER.contact_s(Velocity::new(0.3, 0.0), at(-0.5, 0.0)), f64::INFINITY);
    }

    #[test]
    fn turning_on_the_spot_swings_the_rear_corner_into_what_stands_beside_it() {
        // Within the rear corner's circle (0.36 m), outside the front corner's (0.29 m).
        let beside = at(-0.1, -0.32);
        assert!(PIONEER.contact_s(Velocity::new(0.0, 0.5), beside).is_finite());
        assert!(PIONEER.contact_s(Velocity::new(0.0, -0.5), beside).is_finite());
        assert_eq!(PIONEER.contact_s(Velocity::new(0.0, 0.5), at(0.0, 0.37)), f64::INFINITY);
    }

    #[test]
    fn a_body_with_cut_corners_turns_where_a_rectangle_cannot() {
        let behind = at(-0.27, 0.23);
        assert!(PIONEER.contact_s(Velocity::new(0.0, 0.5), behind).is_finite());
        assert_eq!(CUT.contact_s(Velocity::new(0.0, 0.5), behind), f64::INFINITY);
        assert!((CUT.contact_s(Velocity::new(0.1, 0.0), at(0.31, 0.15)) - 1.5).abs() < 1e-9);
    }

    #[test]
    fn a_left_arc_touches_on_the_left_and_clears_on_the_right() {
        let left_arc = Velocity::new(0.2, 0.5);
        assert!(PIONEER.contact_s(left_arc, at(0.4, 0.25)).is_finite());
        assert_eq!(PIONEER.contact_s(left_arc, at(0.5, -0.15)), f64::INFINITY);
        assert!(PIONEER.contact_s(Velocity::new(0.2, 0.0), at(0.5, -0.15)).is_finite());
    }

    #[test]
    fn a_point_inside_may_be_left_but_not_pressed() {
        let nose = at(0.20, 0.0);
        assert_eq!(PIONEER.contact_s(Velocity::new(0.1, 0.0), nose), 0.0);
        assert_eq!(PIONEER.contact_s(Velocity::new(-0.1, 0.0), nose), f64::INFINITY);
    }

    #[test]
    fn a_body_at_rest_touches_nothing() {
        assert_eq!(PIONEER.contact_s(Velocity::ZERO, at(0.3, 0.0)), f64::INFINITY);
    }

    /// The same answer by walking along the arc in small steps.
    fn contact_by_stepping_s(footprint: &Footprint, velocity: Velocity, p: Point, horizon_s: f64) -> f64 {
        let steps = 4000;
        let dt = horizon_s / f64::from(steps);
        let (mut x, mut y, mut heading) = (0.0, 0.0, 0.0);
        for step in 0..=steps {
            let (sin, cos) = math::sin_cos(heading);
            let (dx, dy) = (p.x_m - x, p.y_m - y);
            if footprint.holds(at(cos * dx + sin * dy, -sin * dx + cos * dy)) {
                return f64::from(step) * dt;
            }
            let (sin, cos) = math::sin_cos(heading + velocity.turn_rad_s * dt / 2.0);
            x += velocity.forward_m_s * dt * cos;
            y += velocity.forward_m_s * dt * sin;
            heading += velocity.turn_rad_s * dt;
        }
        f64::INFINITY
    }

    proptest! {
        #[test]
        fn the_exact_contact_agrees_with_stepping_along_the_arc(
            v in -0.5..0.5f64, w in -1.5..1.5f64, x in -1.0..1.0f64, y in -1.0..1.0f64, cut in any::<bool>(),
        ) {
            let p = at(x, y);
            let body = if cut { CUT } else { PIONEER };
            prop_assume!(!body.holds(p));
            let horizon_s = 2.0;
            let velocity = Velocity::new(v, w);
            let exact = body.contact_s(velocity, p);
            let stepped = contact_by_stepping_s(&body, velocity, p, horizon_s);
            if stepped.is_finite() {
                prop_assert!((exact - stepped).abs() < 2e-3, "exact {exact}, stepped {stepped}");
            } else {
                // A corner that is grazed between two steps is the only way to miss a contact.
                let grazed = Footprint { ahead_m: 0.2095, behind_m: 0.2995, half_width_m: 0.1995, ..body };
                prop_assert!(grazed.contact_s(velocity, p) > horizon_s - 2e-3, "exact {exact}");
            }
        }

        #[test]
        fn a_larger_footprint_never_touches_later(
            v in -0.5..0.5f64, w in -1.5..1.5f64, x in -1.0..1.0f64, y in -1.0..1.0f64, margin in 0.0..0.1f64,
        ) {
            let p = at(x, y);
            let wide = Footprint { half_width_m: PIONEER.half_width_m + margin, ..PIONEER };
            prop_assume!(!wide.holds(p));
            let velocity = Velocity::new(v, w);
            prop_assert!(wide.contact_s(velocity, p) <= PIONEER.contact_s(velocity, p) + 1e-9);
        }
    }
}
