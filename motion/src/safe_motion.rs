//! What may be sent to the wheels: one decision per step, without ports.

use crate::drive::DriveConfig;
use crate::footprint::{Footprint, Point, Velocity};
use crate::guard_zone::{GuardZone, Mover};
use crate::obstacles::Seen;
use crate::profile::{AxisLimits, Profile};
use crate::protection::{Protection, Release};
use crate::ramp::Limits;
use crate::zone::{Allowed, Braking, Zone};
use messages::{BaseState, Link, MotionState, Stop, Twist};
use runtime::{Body, Time};

/// What is around the body now.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Points that the body must not touch, in its frame.
    pub points: &'a [Point],
    /// Where the rangers look, and since when.
    pub seen: Seen,
    /// What moves, in the body frame.
    pub movers: &'a [Mover],
}

/// Limits and protection, and what they remember from step to step.
#[derive(Debug, Clone)]
pub struct SafeMotion {
    zone: Zone,
    guard: GuardZone,
    limits: Limits,
    profiles: [Profile; 2],
    blind_cap_m_s: f64,
    config: DriveConfig,
    protection: Protection,
    sent: Velocity,
    stopped: bool,
    stops: u32,
}

impl SafeMotion {
    /// A body at rest.
    pub fn new(body: &Body, config: &DriveConfig) -> SafeMotion {
        let footprint = Footprint::of(body, config.cut_corners_m);
        SafeMotion {
            guard: GuardZone {
                config: config.guard_zone,
                radius_m: footprint.corner_radius_m(),
                delay_s: config.sense_s + config.react_s,
                deceleration_m_s2: body.deceleration_m_s2,
            },
            profiles: [Profile::default(); 2],
            zone: Zone {
                footprint,
                braking: Braking {
                    delay_s: config.sense_s + config.react_s,
                    deceleration_m_s2: body.deceleration_m_s2,
                    turn_deceleration_rad_s2: body.turn_acceleration_rad_s2,
                    margin_m: config.margin_m,
                    creep_m_s: config.creep_m_s,
                    creep_margin_m: config.creep_margin_m.min(config.margin_m),
                },
                side_margin_m: config.side_margin_m,
                speed_margin_m: config.speed_margin_m,
                turn_margin_m: config.turn_margin_m,
            },
            limits: Limits {
                forward_m_s: body.max_forward_m_s,
                backward_m_s: body.max_backward_m_s,
                turn_rad_s: body.max_turn_rad_s,
                acceleration_m_s2: body.acceleration_m_s2,
                deceleration_m_s2: body.deceleration_m_s2,
                turn_acceleration_rad_s2: body.turn_acceleration_rad_s2,
            },
            blind_cap_m_s: body.blind_cap_m_s,
            config: config.clone(),
            protection: Protection::default(),
            sent: Velocity::ZERO,
            stopped: false,
            stops: 0,
        }
    }

    /// The velocity that was last sent.
    pub fn sent(&self) -> Velocity {
        self.sent
    }

    /// From an obstacle's appearance to the wheels' first slowing, as of now [s].
    pub fn reckon_with(&mut self, delay_s: f64) {
        self.zone.braking.delay_s = delay_s;
    }

    /// The body stands at once, whatever the ramps say: the stop latch does not allow motion. What `decide` told before
    /// it becomes what is sent now.
    pub fn halt(&mut self, state: MotionState) -> MotionState {
        self.sent = Velocity::ZERO;
        MotionState { sent: Twist::default(), stop: Stop::Latch as u32, ..state }
    }

    /// What to send at `now`, `dt_s` after the last time. `wanted` and `base` are `None` when there is nothing fresh;
    /// a wanted velocity that is no number counts as none.
    pub fn decide(
        &mut self,
        now: Time,
        dt_s: f64,
        wanted: Option<Velocity>,
        base: Option<&BaseState>,
        around: &Surroundings<'_>,
    ) -> MotionState {
        let wanted = wanted.filter(|v| v.is_finite());
        let asked = wanted.unwrap_or(Velocity::ZERO);
        if let Some(base) = base {
            let release = Release { after_s: self.config.release_after_s, by_itself: self.config.release_by_itself };
            self.protection.update(now, base, self.sent, asked, release);
        }
        let clamped = self.limits.clamp(asked);
        let clamped = self.config.kinematics.map_or(clamped, |kinematics| kinematics.within(clamped));
        let (open, protected) = self.protection.hold(clamped, self.config.way_out_m_s);
        let seeing = self.cap_blind(open, around.seen);
        let timely = self.guard.allow(around.movers, seeing);
        let judged = self.zone.allow(around.points, timely);
        let allowed = Allowed { held: judged.held || timely != seeing, ..judged };
        let ready = base.is_some_and(is_ready);
        let target = if ready { allowed.velocity } else { Velocity::ZERO };
        // What the ramps make of it is another arc than the one that was judged: it is judged, too.
        let forced = !ready || protected.is_some() || wanted.is_none() || allowed.held || seeing != open;
        let ramped = if forced { self.limits.ramp(self.sent, target, dt_s) } else { self.smooth(target, dt_s) };
        let kept = if ramped == timely { judged } else { self.zone.allow(around.points, ramped) };
        let before = self.sent;
        self.sent = if kept.held { self.limits.ramp(self.sent, kept.velocity, dt_s) } else { ramped };
        self.remember(before, dt_s);
        let stop = match protected {
            _ if !ready => Stop::Base,
            Some(cause) => cause,
            None if wanted.is_none() => Stop::StaleVelocity,
            None if allowed.held => Stop::Zone,
            None if seeing != open => Stop::Blind,
            None => Stop::None,
        };
        self.count(stop, target);
        let pace_m_s = match seeing.forward_m_s.abs() {
            0.0 => seeing.turn_rad_s.abs() * self.zone.footprint.corner_radius_m(),
            v => v,
        };
        let (forward_limit_m_s, backward_limit_m_s) = self.zone.straight_limits_m_s(around.points);
        MotionState {
            wanted: twist(asked),
            sent: twist(self.sent),
            forward_limit_m_s,
            backward_limit_m_s,
            clear_m: if allowed.contact_s.is_finite() { allowed.contact_s * pace_m_s } else { f64::INFINITY },
            stop: stop as u32,
            stops: self.stops,
        }
    }

    /// The velocity after `dt_s` towards `target`: without jerks where they are bounded.
    fn smooth(&self, target: Velocity, dt_s: f64) -> Velocity {
        let ramped = self.limits.ramp(self.sent, target, dt_s);
        let turn = self.limits.turn_acceleration_rad_s2;
        let along = |profile: &Profile, wanted: f64, up: f64, down: f64, jerk: Option<f64>, plain: f64| {
            jerk.map_or(plain, |jerk| profile.towards(wanted, &AxisLimits { up, down, jerk }, dt_s).speed)
        };
        let [forward, turning] = &self.profiles;
        let (up, down) = (self.limits.acceleration_m_s2, self.limits.deceleration_m_s2);
        Velocity {
            forward_m_s: along(forward, target.forward_m_s, up, down, self.config.max_jerk_m_s3, ramped.forward_m_s),
            turn_rad_s: along(
                turning,
                target.turn_rad_s,
                turn,
                turn,
                self.config.max_turn_jerk_rad_s3,
                ramped.turn_rad_s,
            ),
        }
    }

    /// Takes the accelerations of what was sent over into the profiles.
    fn remember(&mut self, before: Velocity, dt_s: f64) {
        let forced = |before: f64, speed: f64| Profile { speed: before, acceleration: 0.0 }.forced(speed, dt_s);
        self.profiles =
            [forced(before.forward_m_s, self.sent.forward_m_s), forced(before.turn_rad_s, self.sent.turn_rad_s)];
    }

    /// Holds the speed down where no ranger looks, and the turn where none sees anything at all.
    fn cap_blind(&self, wanted: Velocity, seen: Seen) -> Velocity {
        let age_s = self.config.looks_max_age_s;
        let mut capped = wanted;
        let looks_s = if wanted.forward_m_s >= 0.0 { seen.ahead_s } else { seen.behind_s };
        // Also holds when the age is no number.
        let sees = |looks_s: f64| looks_s <= age_s;
        if !sees(looks_s) {
            capped.forward_m_s = capped.forward_m_s.clamp(-self.blind_cap_m_s, self.blind_cap_m_s);
        }
        if !sees(seen.anywhere_s) {
            let cap = self.config.blind_turn_rad_s;
            capped.turn_rad_s = capped.turn_rad_s.clamp(-cap, cap);
        }
        capped
    }

    /// Counts a protective stop when it begins: full rest for a reason that lies around the body.
    fn count(&mut self, stop: Stop, target: Velocity) {
        let around = matches!(stop, Stop::Zone | Stop::Bumper | Stop::Stall);
        let stopped = around && target.forward_m_s == 0.0;
        if stopped && !self.stopped {
            self.stops = self.stops.saturating_add(1);
        }
        self.stopped = stopped;
    }
}

fn is_ready(base: &BaseState) -> bool {
    base.link == Link::Up as u32 && base.motors_enabled != 0 && base.stop_button == 0
}

fn twist(velocity: Velocity) -> Twist {
    Twist { linear_x_m_s: velocity.forward_m_s, linear_y_m_s: 0.0, angular_z_rad_s: velocity.turn_rad_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const STEP_S: f64 = 0.05;

    fn ready() -> BaseState {
        BaseState { link: Link::Up as u32, motors_enabled: 1, ..BaseState::default() }
    }

    fn everywhere() -> Seen {
        Seen { ahead_s: 0.0, behind_s: 0.0, anywhere_s: 0.0 }
    }

    fn safe() -> SafeMotion {
        SafeMotion::new(&Body::default(), &DriveConfig::default())
    }

    /// The state after wanting the same for two seconds.
    fn settled(wanted: Option<Velocity>, base: &BaseState, points: &[Point], seen: Seen) -> MotionState {
        let mut safe = safe();
        let around = Surroundings { points, seen, movers: &[] };
        let mut state = MotionState::default();
        for step in 0..40 {
            state = safe.decide(Time::from_seconds(STEP_S * f64::from(step)), STEP_S, wanted, Some(base), &around);
        }
        state
    }

    const FORWARD: Option<Velocity> = Some(Velocity::new(0.25, 0.0));

    #[test]
    fn what_is_wanted_in_the_open_is_sent_after_the_ramp() {
        let state = settled(FORWARD, &ready(), &[], everywhere());
        assert_eq!(state.sent.linear_x_m_s, 0.25);
        assert_eq!(state.stop, Stop::None as u32);
        assert_eq!(state.forward_limit_m_s, f64::INFINITY);
    }

    #[test]
    fn a_stale_velocity_ramps_to_zero_within_the_deceleration() {
        let mut safe = safe();
        let around = Surroundings { points: &[], seen: everywhere(), movers: &[] };
        for step in 0..40 {
            safe.decide(Time::from_seconds(STEP_S * f64::from(step)), STEP_S, FORWARD, Some(&ready()), &around);
        }
        let state = safe.decide(Time::from_seconds(2.0), STEP_S, None, Some(&ready()), &around);
        assert!((state.sent.linear_x_m_s - (0.25 - 0.3 * STEP_S)).abs() < 1e-12);
        assert_eq!(state.stop, Stop::StaleVelocity as u32);
    }

    #[test]
    fn a_velocity_that_is_no_number_counts_as_none() {
        let state = settled(Some(Velocity::new(f64::NAN, 0.1)), &ready(), &[], everywhere());
        assert_eq!(state.sent, Twist::default());
        assert_eq!(state.stop, Stop::StaleVelocity as u32);
    }

    #[test]
    fn a_body_that_sees_nothing_creeps_at_the_blind_cap() {
        let state = settled(FORWARD, &ready(), &[], Seen::NOTHING);
        assert_eq!(state.sent.linear_x_m_s, Body::default().blind_cap_m_s);
        assert_eq!(state.stop, Stop::Blind as u32);
    }

    #[test]
    fn a_body_without_rear_rangers_reverses_at_the_blind_cap() {
        let ahead_only = Seen { behind_s: f64::INFINITY, ..everywhere() };
        let state = settled(Some(Velocity::new(-0.1, 0.0)), &ready(), &[], ahead_only);
        assert_eq!(state.sent.linear_x_m_s, -Body::default().blind_cap_m_s);
        assert_eq!(settled(FORWARD, &ready(), &[], ahead_only).sent.linear_x_m_s, 0.25);
    }

    #[test]
    fn an_obstacle_in_the_way_stops_and_one_beside_it_does_not() {
        let ahead = Point { x_m: 0.22, y_m: 0.1 };
        let beside = Point { x_m: 0.25, y_m: 0.25 };
        let state = settled(FORWARD, &ready(), &[ahead], everywhere());
        assert_eq!((state.sent.linear_x_m_s, state.stop, state.stops), (0.0, Stop::Zone as u32, 1));
        assert_eq!(settled(FORWARD, &ready(), &[beside], everywhere()).sent.linear_x_m_s, 0.25);
    }

    #[test]
    fn nothing_moves_while_the_base_is_not_ready() {
        for base in [
            BaseState { link: Link::Lost as u32, ..ready() },
            BaseState { motors_enabled: 0, ..ready() },
            BaseState { stop_button: 1, ..ready() },
        ] {
            let state = settled(FORWARD, &base, &[], everywhere());
            assert_eq!((state.sent, state.stop), (Twist::default(), Stop::Base as u32));
        }
    }

    fn any_number() -> impl Strategy<Value = f64> {
        prop_oneof![4 => -2.0..2.0f64, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(-1e300)]
    }

    proptest! {
        #[test]
        fn limits_hold_and_nothing_is_ever_no_number(
            wanted in prop::collection::vec((any_number(), any_number()), 1..40),
            points in prop::collection::vec((any_number(), any_number()), 0..20),
            bumpers in 0..3u32, ahead_s in any_number(),
        ) {
            let mut safe = safe();
            let body = Body::default();
            let points: Vec<Point> = points.into_iter().map(|(x_m, y_m)| Point { x_m, y_m }).collect();
            let seen = Seen { ahead_s, ..everywhere() };
            let around = Surroundings { points: &points, seen, movers: &[] };
            let base = BaseState { front_bumpers: bumpers, ..ready() };
            let mut before = Velocity::ZERO;
            for (step, (v, w)) in wanted.into_iter().enumerate() {
                let now = Time::from_seconds(STEP_S * step as f64);
                let state = safe.decide(now, STEP_S, Some(Velocity::new(v, w)), Some(&base), &around);
                let (v, w) = (state.sent.linear_x_m_s, state.sent.angular_z_rad_s);
                prop_assert!(v <= body.max_forward_m_s && v >= -body.max_backward_m_s && w.abs() <= body.max_turn_rad_s);
                prop_assert!((v - before.forward_m_s).abs() <= body.deceleration_m_s2 * STEP_S + 1e-12);
                prop_assert!((w - before.turn_rad_s).abs() <= body.turn_acceleration_rad_s2 * STEP_S + 1e-12);
                prop_assert!(!state.clear_m.is_nan() && !state.forward_limit_m_s.is_nan());
                before = Velocity::new(v, w);
            }
        }

        #[test]
        fn one_more_obstacle_ahead_never_makes_straight_driving_faster(
            xs in prop::collection::vec(0.2..1.5f64, 0..8), more in 0.2..1.5f64, y in -0.2..0.2f64,
        ) {
            let mut points: Vec<Point> = xs.into_iter().map(|x_m| Point { x_m, y_m: y }).collect();
            let before = settled(FORWARD, &ready(), &points, everywhere());
            points.push(Point { x_m: more, y_m: y });
            let after = settled(FORWARD, &ready(), &points, everywhere());
            prop_assert!(after.sent.linear_x_m_s <= before.sent.linear_x_m_s);
            prop_assert!(after.forward_limit_m_s <= before.forward_limit_m_s);
        }
    }
}
