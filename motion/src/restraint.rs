//! What the supervisor lets through: everything, limp mode's speed, or nothing.
//!
//! Hold and emergency stop make the wanted velocity zero, limp mode scales it down to its limits so that the arc stays the
//! same. The ramps and the stop zone come after this and know nothing of it.

use crate::footprint::Velocity;
use messages::{MotionState, Stop, SupervisorState, Twist};
use runtime::robot::Limp;

/// Limits of limp mode; the cautious ones where the robot file has none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimpLimits {
    /// Greatest speed in either direction [m/s].
    pub speed_m_s: f64,
    /// Greatest turn rate [rad/s].
    pub turn_rad_s: f64,
}

impl LimpLimits {
    /// What `[limp]` says; without it, a robot that is told to limp goes no faster than blind.
    pub fn of(limp: Option<&Limp>, blind_cap_m_s: f64) -> LimpLimits {
        match limp {
            Some(limp) => {
                LimpLimits { speed_m_s: limp.max_speed_m_s, turn_rad_s: limp.max_turn_rad_s.unwrap_or(f64::INFINITY) }
            }
            None => LimpLimits { speed_m_s: blind_cap_m_s, turn_rad_s: f64::INFINITY },
        }
    }
}

/// What of `wanted` remains under `state`, and why less, if so.
pub fn restrain(wanted: Velocity, state: Option<&SupervisorState>, limp: LimpLimits) -> (Velocity, Option<Stop>) {
    let Some(state) = state else { return (wanted, None) };
    if state.hold != 0 || state.stop != 0 {
        return (Velocity::ZERO, Some(Stop::Held));
    }
    if state.limp == 0 {
        return (wanted, None);
    }
    let share = |is: f64, most: f64| if is.abs() > most { most / is.abs() } else { 1.0 };
    let k = share(wanted.forward_m_s, limp.speed_m_s).min(share(wanted.turn_rad_s, limp.turn_rad_s));
    if k < 1.0 { (wanted.scaled(k), Some(Stop::Limp)) } else { (wanted, None) }
}

/// `state` as it is told: with what was really wanted, and the restraint where nothing else held the body back.
pub fn explain(state: MotionState, wanted: Option<Velocity>, restrained: Option<Stop>) -> MotionState {
    let mut told = state;
    if let Some(v) = wanted.filter(|v| v.is_finite()) {
        told.wanted = Twist { linear_x_m_s: v.forward_m_s, linear_y_m_s: 0.0, angular_z_rad_s: v.turn_rad_s };
    }
    if let Some(stop) = restrained
        && state.stop == Stop::None as u32
    {
        told.stop = stop as u32;
    }
    told
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMP: LimpLimits = LimpLimits { speed_m_s: 0.1, turn_rad_s: 0.4 };

    fn state(limp: u32, hold: u32, stop: u32) -> SupervisorState {
        SupervisorState { limp, hold, stop, ..SupervisorState::default() }
    }

    #[test]
    fn nobody_who_supervises_and_nothing_wrong_let_everything_through() {
        let v = Velocity::new(0.3, 0.5);
        assert_eq!(restrain(v, None, LIMP), (v, None));
        assert_eq!(restrain(v, Some(&state(0, 0, 0)), LIMP), (v, None));
    }

    #[test]
    fn hold_and_emergency_stop_let_nothing_through_whatever_else_is_said() {
        for state in [state(0, 1, 0), state(1, 1, 0), state(0, 0, 1), state(1, 0, 7)] {
            assert_eq!(restrain(Velocity::new(0.3, 0.5), Some(&state), LIMP), (Velocity::ZERO, Some(Stop::Held)));
        }
    }

    proptest! {
        #[test]
        fn limping_keeps_the_arc_and_its_limits(v in -1.0..1.0f64, w in -2.0..2.0f64) {
            let (out, _) = restrain(Velocity::new(v, w), Some(&state(1, 1 - 1, 0)), LIMP);
            prop_assert!(out.forward_m_s.abs() <= 0.1 + 1e-12 && out.turn_rad_s.abs() <= 0.4 + 1e-12);
            prop_assert!((out.forward_m_s * w - out.turn_rad_s * v).abs() < 1e-9, "another arc");
            prop_assert!(out.forward_m_s * v >= 0.0 && out.forward_m_s.abs() <= v.abs());
        }
    }
}
