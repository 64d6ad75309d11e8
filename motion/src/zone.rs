//! The stop zone: how much of a wanted velocity the room along the swept footprint allows.
//!
//! The body goes on for the delay τ (sensing and reacting) and then brakes; all of it must end a margin short of the
//! first contact. With T the time to contact at the wanted velocity, a share k of that velocity needs
//! k·τ + k²/2·max(|v|/a, |ω|/α) ≤ T − margin/(|v| + |ω|·r), which for ω = 0 is the familiar
//! v·τ + v²/2a ≤ clear − margin. r is the corner's radius: no point of the body is faster than |v| + |ω|·r. When even
//! that is slow, the body creeps, and a smaller margin does: what is left to go wrong is less.
//!
//! Where the wanted arc is not free, of the slower and the straighter ones that are, the one that fulfils most of both
//! wishes is taken: before a wall the speed yields and the body turns away; between two door jambs, where a turn would
//! swing a corner into one of them, the turn yields and the body goes straight on.

use crate::footprint::{Footprint, Point, Sweep, Velocity};

/// What the body needs to come to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Braking {
    /// From an obstacle's appearance to the wheels' first slowing [s].
    pub delay_s: f64,
    /// Of the forward speed [m/s²].
    pub deceleration_m_s2: f64,
    /// Of the turn rate [rad/s²].
    pub turn_deceleration_rad_s2: f64,
    /// Room that must be left at rest [m].
    pub margin_m: f64,
    /// No point of the body is faster than this when it creeps [m/s].
    pub creep_m_s: f64,
    /// Room that must be left at rest when it creeps [m].
    pub creep_margin_m: f64,
}

/// A share this much short of the whole is the whole.
const ROUNDING: f64 = 1e-9;
/// Less room than this is none [m].
const NO_ROOM_M: f64 = 1e-3;

impl Braking {
    /// The greatest share 0…1 of `velocity` that comes to rest before a contact `contact_s` away at full pace.
    /// `corner_radius_m` bounds how fast a turn moves the body's outline.
    pub fn share(&self, velocity: Velocity, contact_s: f64, corner_radius_m: f64) -> f64 {
        let (v, w) = (velocity.forward_m_s.abs(), velocity.turn_rad_s.abs());
        let pace_m_s = v + w * corner_radius_m;
        if contact_s == f64::INFINITY || pace_m_s == 0.0 {
            return 1.0;
        }
        let creep = self.share_within(velocity, contact_s, pace_m_s, self.creep_margin_m);
        self.share_within(velocity, contact_s, pace_m_s, self.margin_m).max(creep.min(self.creep_m_s / pace_m_s))
    }

    fn share_within(&self, velocity: Velocity, contact_s: f64, pace_m_s: f64, margin_m: f64) -> f64 {
        let (v, w) = (velocity.forward_m_s.abs(), velocity.turn_rad_s.abs());
        let room_s = contact_s - margin_m / pace_m_s;
        // Also refuses a room that is no number.
        if room_s.is_nan() || room_s * pace_m_s < NO_ROOM_M {
            return 0.0;
        }
        let half_brake_s = 0.5 * (v / self.deceleration_m_s2).max(w / self.turn_deceleration_rad_s2);
        // The positive root of half_brake·k² + delay·k = room, in the form that does not cancel.
        let delay = self.delay_s;
        (2.0 * room_s / (delay + (delay * delay + 4.0 * half_brake_s * room_s).sqrt())).min(1.0)
    }

    /// The greatest speed that comes to rest within `clear_m` of straight way; +∞ when nothing is in it [m/s].
    pub fn speed_limit_m_s(&self, clear_m: f64) -> f64 {
        if clear_m == f64::INFINITY {
            return f64::INFINITY;
        }
        let (a, delay) = (self.deceleration_m_s2, self.delay_s);
        let within = |margin_m: f64| {
            let room_m = Some(clear_m - margin_m).filter(|&room| room >= NO_ROOM_M).unwrap_or(0.0);
            2.0 * room_m / (delay + (delay * delay + 2.0 * room_m / a).sqrt())
        };
        within(self.margin_m).max(within(self.creep_margin_m).min(self.creep_m_s))
    }
}

/// What the zone made of a wanted velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allowed {
    /// The velocity that comes to rest in time.
    pub velocity: Velocity,
    /// Time to contact at the wanted velocity; +∞ when nothing is in its way [s].
    pub contact_s: f64,
    /// Whether the zone changed the wanted velocity.
    pub held: bool,
}

/// Time to the first contact with any of `points` at `velocity`; +∞ when there is none [s].
pub fn first_contact_s(footprint: &Footprint, points: &[Point], velocity: Velocity) -> f64 {
    let sweep = Sweep::new(footprint, velocity);
    let mut first_s = f64::INFINITY;
    // Most points are far from the sweep: several are passed over at once.
    for some in points.chunks(8) {
        if some.iter().fold(false, |any, &p| any | sweep.may_touch(p)) {
            first_s = some.iter().map(|&p| sweep.contact_s(p)).fold(first_s, f64::min);
        }
    }
    first_s
}

/// A body among obstacles.
#[derive(Debug, Clone, Copy)]
pub struct Zone {
    /// Outline, as it is.
    pub footprint: Footprint,
    /// What it needs to come to rest.
    pub braking: Braking,
    /// Added to the sides always: less than half of what the narrowest opening leaves [m].
    pub side_margin_m: f64,
    /// Added to the sides, too, at [`FULL_SPEED_M_S`] or faster, in proportion when slower: places are known the less
    /// exactly the faster they are passed [m].
    pub speed_margin_m: f64,
    /// Added all round when it turns at [`FULL_TURN_RAD_S`] or faster, in proportion when slower: corners swing, and no
    /// path is driven exactly as wanted [m].
    pub turn_margin_m: f64,
}

/// Speed from which on the whole speed margin counts [m/s].
pub const FULL_SPEED_M_S: f64 = 0.15;
/// Turn rate from which on the whole turn margin counts [rad/s].
pub const FULL_TURN_RAD_S: f64 = 0.3;

impl Zone {
    /// The outline with the margins for a velocity.
    fn grown(&self, velocity: Velocity) -> Footprint {
        let turn_m = self.turn_margin_m * (velocity.turn_rad_s.abs() / FULL_TURN_RAD_S).min(1.0);
        let speed_m = self.speed_margin_m * (velocity.forward_m_s.abs() / FULL_SPEED_M_S).min(1.0);
        let body = &self.footprint;
        Footprint {
            ahead_m: body.ahead_m + turn_m,
            behind_m: body.behind_m + turn_m,
            half_width_m: body.half_width_m + (self.side_margin_m + speed_m).max(turn_m),
            cut_m: body.cut_m,
        }
    }

    /// The share 0…1 of `velocity` that comes to rest in time, and the time to contact at the whole of it [s].
    pub fn share(&self, points: &[Point], velocity: Velocity) -> (f64, f64) {
        let footprint = self.grown(velocity);
        let contact_s = first_contact_s(&footprint, points, velocity);
        // Of the body itself: it is the same at every pace, so that what is left at one share is left at a smaller one.
        (self.braking.share(velocity, contact_s, self.footprint.corner_radius_m()), contact_s)
    }

    /// Greatest speeds straight ahead and straight back [m/s].
    pub fn straight_limits_m_s(&self, points: &[Point]) -> (f64, f64) {
        let footprint = self.grown(Velocity::ZERO);
        // At 1 m/s the time to contact is the clear way.
        let [ahead, back] = [1.0, -1.0].map(|direction| Velocity::new(direction, 0.0));
        let [ahead, back] = [Sweep::new(&footprint, ahead), Sweep::new(&footprint, back)];
        let mut clear_m = (f64::INFINITY, f64::INFINITY);
        for &p in points.iter().filter(|&&p| ahead.may_touch(p)) {
            clear_m.0 = clear_m.0.min(ahead.contact_s(p));
            clear_m.1 = clear_m.1.min(back.contact_s(p));
        }
        (self.braking.speed_limit_m_s(clear_m.0), self.braking.speed_limit_m_s(clear_m.1))
    }

    /// As much of `velocity` as comes to rest in time by its own margins: with the pace the outline shrinks, and what
    /// stood within the margin and was let go may stand before the body then.
    fn proven(&self, points: &[Point], mut velocity: Velocity) -> Velocity {
        for _ in 0..4 {
            let (k, _) = self.share(points, velocity);
            if k >= 1.0 - ROUNDING {
                return velocity;
            }
            velocity = velocity.scaled(k);
        }
        Velocity::ZERO
    }

    /// The velocity nearest to `wanted` that the room among `points` allows.
    pub fn allow(&self, points: &[Point], wanted: Velocity) -> Allowed {
        let (whole, contact_s) = self.share(points, wanted);
        if whole >= 1.0 {
            return Allowed { velocity: wanted, contact_s, held: false };
        }
        let mut best = self.proven(points, wanted.scaled(whole));
        let mut best_worth = worth(best, wanted);
        let turns: &[f64] = if wanted.turn_rad_s == 0.0 { &[0.0] } else { &[1.0, 0.5, 0.25, 0.0] };
        for &turn in turns {
            let mut forward_m_s = wanted.forward_m_s;
            // A slower pace at the same turn is a tighter arc, so that its share must be asked for anew.
            for attempt in 0..4 {
                let candidate = Velocity::new(forward_m_s, wanted.turn_rad_s * turn);
                let (k, _) = self.share(points, candidate);
                if k >= 1.0 {
                    let worth = worth(candidate, wanted);
                    // Of equals the one with more turn, which comes first: a body that turns finds its way out.
                    if worth > best_worth {
                        (best, best_worth) = (candidate, worth);
                    }
                    break;
                }
                forward_m_s = if k < 0.1 || attempt == 2 { 0.0 } else { forward_m_s * k };
            }
        }
        Allowed { velocity: best, contact_s, held: true }
    }
}

/// How much of `wanted` a candidate fulfils, axis by axis.
fn worth(candidate: Velocity, wanted: Velocity) -> f64 {
    let part = |is: f64, want: f64| if want == 0.0 { 0.0 } else { is / want };
    part(candidate.forward_m_s, wanted.forward_m_s) + part(candidate.turn_rad_s, wanted.turn_rad_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PIONEER: Footprint = Footprint { ahead_m: 0.21, behind_m: 0.30, half_width_m: 0.20, cut_m: 0.0 };
    const BRAKING: Braking = Braking {
        delay_s: 0.3,
        deceleration_m_s2: 0.3,
        turn_deceleration_rad_s2: 1.5,
        margin_m: 0.05,
        creep_m_s: 0.0,
        creep_margin_m: 0.05,
    };
    const ZONE: Zone =
        Zone { footprint: PIONEER, braking: BRAKING, side_margin_m: 0.01, speed_margin_m: 0.0, turn_margin_m: 0.02 };

    fn at(x_m: f64, y_m: f64) -> Point {
        Point { x_m, y_m }
    }

    fn allowed(points: &[Point], v: f64, w: f64) -> Velocity {
        ZONE.allow(points, Velocity::new(v, w)).velocity
    }

    #[test]
    fn an_empty_room_allows_everything() {
        assert_eq!(allowed(&[], 0.3, 0.5), Velocity::new(0.3, 0.5));
    }

    #[test]
    fn the_speed_falls_with_the_clear_distance_as_the_formula_says() {
        for clear_m in [0.06, 0.1, 0.2, 0.3] {
            let v = allowed(&[at(0.21 + clear_m, 0.0)], 0.5, 0.0).forward_m_s;
            assert!(v * 0.3 + v * v / 0.6 <= clear_m - 0.05 + 1e-9, "{v} at {clear_m}");
            assert!((v - BRAKING.speed_limit_m_s(clear_m)).abs() < 1e-9, "{v} at {clear_m}");
        }
    }

    #[test]
    fn a_wall_at_the_nose_stops_the_speed_and_leaves_the_turn() {
        let near = [at(0.25, -0.2), at(0.25, 0.0), at(0.25, 0.2)];
        assert!(allowed(&near, 0.3, 0.0).forward_m_s == 0.0);
        assert!(allowed(&near, 0.3, 0.5).forward_m_s < 0.03);
        let far = [at(0.36, -0.2), at(0.36, 0.0), at(0.36, 0.2)];
        let turned = allowed(&far, 0.3, 0.5);
        assert!(turned.turn_rad_s >= 0.25 && turned.forward_m_s < 0.3, "{turned:?}");
    }

    #[test]
    fn between_two_jambs_fifty_centimetres_apart_the_body_goes_straight_on() {
        let jambs = [at(-0.1, 0.25), at(-0.1, -0.25), at(0.1, 0.25), at(0.1, -0.25)];
        assert_eq!(allowed(&jambs, 0.2, 0.0), Velocity::new(0.2, 0.0));
        let turning = allowed(&jambs, 0.2, 0.5);
        assert!(turning.forward_m_s >= 0.1, "goes on: {turning:?}");
        assert!(turning.turn_rad_s < 0.3, "with a smaller turn: {turning:?}");
    }

    #[test]
    fn the_last_centimetres_are_crept() {
        let creeping = Braking { creep_m_s: 0.04, creep_margin_m: 0.01, ..BRAKING };
        let limit = |clear_m| creeping.speed_limit_m_s(clear_m);
        assert_eq!((limit(0.005), limit(0.04)), (0.0, 0.04));
        assert_eq!(limit(0.3), BRAKING.speed_limit_m_s(0.3));
    }

    #[test]
    fn backing_out_is_free_when_something_touches_the_nose() {
        assert_eq!(allowed(&[at(0.205, 0.0)], -0.1, 0.0), Velocity::new(-0.1, 0.0));
    }

    fn somewhere() -> impl Strategy<Value = Point> {
        (-1.0..1.0f64, -1.0..1.0f64).prop_map(|(x, y)| at(x, y))
    }

    proptest! {
        #[test]
        fn the_zone_only_ever_takes_away(
            points in prop::collection::vec(somewhere(), 0..20), v in -0.5..0.5f64, w in -1.5..1.5f64,
        ) {
            let out = allowed(&points, v, w);
            prop_assert!(out.is_finite());
            prop_assert!(out.forward_m_s.abs() <= v.abs() && out.forward_m_s * v >= 0.0);
            prop_assert!(out.turn_rad_s.abs() <= w.abs() && out.turn_rad_s * w >= 0.0);
        }

        #[test]
        fn what_is_allowed_comes_to_rest_before_every_point(
            points in prop::collection::vec(somewhere(), 0..20), v in -0.5..0.5f64, w in -1.5..1.5f64,
        ) {
            let out = allowed(&points, v, w);
            prop_assert!(ZONE.share(&points, out).0 >= 1.0 - 1e-9);
        }

        #[test]
        fn one_more_obstacle_never_raises_the_share_of_an_arc(
            points in prop::collection::vec(somewhere(), 0..20), more in somewhere(), v in -0.5..0.5f64, w in -1.5..1.5f64,
        ) {
            let velocity = Velocity::new(v, w);
            let share = |points: &[Point]| ZONE.share(points, velocity).0;
            let before = share(&points);
            let mut all = points;
            all.push(more);
            prop_assert!(share(&all) <= before);
        }

        #[test]
        fn the_straight_limit_grows_with_the_clear_distance(clear in 0.0..5.0f64, more in 0.0..5.0f64) {
            prop_assert!(BRAKING.speed_limit_m_s(clear + more) >= BRAKING.speed_limit_m_s(clear));
        }
    }
}
