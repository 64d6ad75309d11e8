//! The body's rectangle, and when it touches a point on its way along an arc.
//!
//! In the body frame a resting point moves with dp/dt = −v·x̂ − ω·ẑ×p: along a straight line when ω = 0, else on a circle
//! about the body's centre of turning c = (0, v/ω). The rectangle is touched where that path first crosses one of its
//! four edges, which is exact for any arc; no step size, no sampled poses.

use runtime::Body;
use runtime::math;
use std::f64::consts::TAU;

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

/// A rectangle about the centre of rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// From the centre of rotation to the front edge [m].
    pub ahead_m: f64,
    /// From the centre of rotation to the rear edge [m].
    pub behind_m: f64,
    /// From the centre line to either side [m].
    pub half_width_m: f64,
}

impl Footprint {
    /// The footprint of `body`, wider by `side_margin_m` on either side.
    pub fn of(body: &Body, side_margin_m: f64) -> Footprint {
        Footprint {
            ahead_m: body.length_ahead_m,
            behind_m: body.length_behind_m,
            half_width_m: body.half_width_m + side_margin_m,
        }
    }
    /// Distance of the farthest corner from the centre of rotation [m].
    pub fn corner_radius_m(&self) -> f64 {
        math::hypot(self.ahead_m.max(self.behind_m), self.half_width_m)
    }

    /// Whether `p` is inside or on the edge.
    pub fn holds(&self, p: Point) -> bool {
        p.x_m <= self.ahead_m && p.x_m >= -self.behind_m && p.y_m.abs() <= self.half_width_m
    }

    /// Distance from the edge to a point outside; 0 inside [m].
    pub fn distance_m(&self, p: Point) -> f64 {
        let dx = (p.x_m - self.ahead_m).max(-self.behind_m - p.x_m).max(0.0);
        let dy = (p.y_m.abs() - self.half_width_m).max(0.0);
        math::hypot(dx, dy)
    }

    /// Time until the body, moving at `velocity`, touches the resting point `p`; +∞ when it never does [s].
    ///
    /// A point that is inside already is touched at once if the motion would press it deeper, and never if it lets go.
    pub fn contact_s(&self, velocity: Velocity, p: Point) -> f64 {
        let Velocity { forward_m_s: v, turn_rad_s: w } = velocity;
        if v == 0.0 && w == 0.0 {
            return f64::INFINITY;
        }
        if self.holds(p) {
            return if self.deepens(velocity, p) { 0.0 } else { f64::INFINITY };
        }
        if w.abs() * STRAIGHT_RADIUS_M <= v.abs() { self.contact_straight_s(v, p) } else { self.contact_arc_s(v, w, p) }
    }

    fn contact_straight_s(&self, v: f64, p: Point) -> f64 {
        if p.y_m.abs() > self.half_width_m {
            return f64::INFINITY;
        }
        let gap_m = if v > 0.0 { p.x_m - self.ahead_m } else { -self.behind_m - p.x_m };
        if gap_m < 0.0 { f64::INFINITY } else { gap_m / v.abs() }
    }

    fn contact_arc_s(&self, v: f64, w: f64, p: Point) -> f64 {
        let centre_y = v / w;
        let (px, py) = (p.x_m, p.y_m - centre_y);
        let radius_sq = px * px + py * py;
        if !self.circle_meets(centre_y, radius_sq) {
            return f64::INFINITY;
        }
        let from = math::atan2(py, px);
        let mut least_turn = f64::INFINITY;
        let mut consider = |x: f64, y: f64| {
            // The point runs against the body's own turning.
            let turn = (from - math::atan2(y, x)) * w.signum();
            // Rounding at the very edge must read as a touch now, not after a full turn.
            let turn = if turn < -1e-9 { turn + TAU } else { turn.max(0.0) };
            least_turn = least_turn.min(turn);
        };
        for x in [self.ahead_m, -self.behind_m] {
            let rest = radius_sq - x * x;
            if rest >= 0.0 {
                let root = rest.sqrt();
                for y in [root, -root] {
                    if (y + centre_y).abs() <= self.half_width_m {
                        consider(x, y);
                    }
                }
            }
        }
        for side in [self.half_width_m, -self.half_width_m] {
            let y = side - centre_y;
            let rest = radius_sq - y * y;
            if rest >= 0.0 {
                let root = rest.sqrt();
                for x in [root, -root] {
                    if x <= self.ahead_m && x >= -self.behind_m {
                        consider(x, y);
                    }
                }
            }
        }
        least_turn / w.abs()
    }

    /// Whether the circle about (0, `centre_y`) can meet the rectangle at all: cheap, and true for few points.
    fn circle_meets(&self, centre_y: f64, radius_sq: f64) -> bool {
        let near_y = (centre_y.abs() - self.half_width_m).max(0.0);
        let far_y = centre_y.abs() + self.half_width_m;
        let far_x = self.ahead_m.max(self.behind_m);
        radius_sq >= near_y * near_y && radius_sq <= far_y * far_y + far_x * far_x
    }

    /// Whether moving at `velocity` brings a point inside the rectangle farther from the nearest edge.
    fn deepens(&self, velocity: Velocity, p: Point) -> bool {
        let dx = -velocity.forward_m_s + velocity.turn_rad_s * p.y_m;
        let dy = -velocity.turn_rad_s * p.x_m;
        // Depth below each edge, and the speed at which that depth grows.
        let edges = [
            (self.ahead_m - p.x_m, -dx),
            (p.x_m + self.behind_m, dx),
            (self.half_width_m - p.y_m, -dy),
            (p.y_m + self.half_width_m, dy),
        ];
        let nearest = edges.into_iter().reduce(|a, b| if b.0 < a.0 { b } else { a });
        nearest.is_some_and(|(_, growth)| growth > 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PIONEER: Footprint = Footprint { ahead_m: 0.21, behind_m: 0.30, half_width_m: 0.20 };

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
            v in -0.5..0.5f64, w in -1.5..1.5f64, x in -1.0..1.0f64, y in -1.0..1.0f64,
        ) {
            let p = at(x, y);
            prop_assume!(!PIONEER.holds(p));
            let horizon_s = 2.0;
            let velocity = Velocity::new(v, w);
            let exact = PIONEER.contact_s(velocity, p);
            let stepped = contact_by_stepping_s(&PIONEER, velocity, p, horizon_s);
            if stepped.is_finite() {
                prop_assert!((exact - stepped).abs() < 2e-3, "exact {exact}, stepped {stepped}");
            } else {
                // A corner that is grazed between two steps is the only way to miss a contact.
                let grazed = Footprint { ahead_m: 0.2095, behind_m: 0.2995, half_width_m: 0.1995 };
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
