//! Speed and acceleration limits.

use crate::footprint::Velocity;

/// How fast a body may go and how fast its velocity may change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Greatest forward speed [m/s].
    pub forward_m_s: f64,
    /// Greatest backward speed [m/s].
    pub backward_m_s: f64,
    /// Greatest turn rate [rad/s].
    pub turn_rad_s: f64,
    /// Greatest gain of speed [m/s²].
    pub acceleration_m_s2: f64,
    /// Greatest loss of speed [m/s²].
    pub deceleration_m_s2: f64,
    /// Greatest change of the turn rate [rad/s²].
    pub turn_acceleration_rad_s2: f64,
}

impl Limits {
    /// `velocity` within the greatest speeds.
    pub fn clamp(&self, velocity: Velocity) -> Velocity {
        Velocity {
            forward_m_s: velocity.forward_m_s.clamp(-self.backward_m_s, self.forward_m_s),
            turn_rad_s: velocity.turn_rad_s.clamp(-self.turn_rad_s, self.turn_rad_s),
        }
    }

    /// The velocity after `dt_s` on the way from `from` to `to`.
    pub fn ramp(&self, from: Velocity, to: Velocity, dt_s: f64) -> Velocity {
        let turn = self.turn_acceleration_rad_s2;
        Velocity {
            forward_m_s: ramp(from.forward_m_s, to.forward_m_s, self.acceleration_m_s2, self.deceleration_m_s2, dt_s),
            turn_rad_s: ramp(from.turn_rad_s, to.turn_rad_s, turn, turn, dt_s),
        }
    }
}

/// One axis: losing speed at `down` per second, gaining it at `up`; a change of sign does both in turn.
fn ramp(from: f64, to: f64, up: f64, down: f64, dt_s: f64) -> f64 {
    let same_sign = from * to >= 0.0;
    let through = if same_sign { to } else { 0.0 };
    if from != 0.0 && through.abs() < from.abs() {
        let left = from.abs() - down * dt_s;
        if left >= through.abs() {
            return left * from.signum();
        }
        let rest_s = (dt_s - (from.abs() - through.abs()) / down).max(0.0);
        return if same_sign { to } else { ramp(0.0, to, up, down, rest_s) };
    }
    if (to - from).abs() <= up * dt_s { to } else { from + up * dt_s * (to - from).signum() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: Limits = Limits {
        forward_m_s: 0.4,
        backward_m_s: 0.1,
        turn_rad_s: 0.8,
        acceleration_m_s2: 0.3,
        deceleration_m_s2: 0.6,
        turn_acceleration_rad_s2: 1.5,
    };

    #[test]
    fn speed_is_gained_slowly_and_lost_quickly() {
        let up = LIMITS.ramp(Velocity::ZERO, Velocity::new(0.4, 0.0), 0.1);
        assert!((up.forward_m_s - 0.03).abs() < 1e-12);
        let down = LIMITS.ramp(Velocity::new(0.4, 0.0), Velocity::ZERO, 0.1);
        assert!((down.forward_m_s - 0.34).abs() < 1e-12);
    }

    #[test]
    fn a_change_of_direction_brakes_first_and_then_speeds_up() {
        let v = LIMITS.ramp(Velocity::new(0.06, 0.0), Velocity::new(-0.1, 0.0), 0.2);
        assert!((v.forward_m_s + 0.03).abs() < 1e-12, "{v:?}");
    }

    proptest! {
        #[test]
        fn no_step_changes_the_velocity_faster_than_the_limits(
            from in -0.4..0.4f64, to in -0.4..0.4f64, turn_from in -0.8..0.8f64, turn_to in -0.8..0.8f64, dt in 0.0..0.3f64,
        ) {
            let a = Velocity::new(from, turn_from);
            let b = LIMITS.ramp(a, Velocity::new(to, turn_to), dt);
            prop_assert!((b.forward_m_s - from).abs() <= 0.6 * dt + 1e-12);
            prop_assert!((b.turn_rad_s - turn_from).abs() <= 1.5 * dt + 1e-12);
            prop_assert!(b.forward_m_s.abs() - from.abs() <= 0.3 * dt + 1e-12);
        }

        #[test]
        fn the_ramp_arrives(from in -0.4..0.4f64, to in -0.4..0.4f64) {
            let mut v = Velocity::new(from, 0.0);
            for _ in 0..60 {
                v = LIMITS.ramp(v, Velocity::new(to, 0.0), 0.05);
            }
            prop_assert_eq!(v.forward_m_s, to);
        }

        #[test]
        fn clamped_is_within_the_limits(v in -9.0..9.0f64, w in -9.0..9.0f64) {
            let out = LIMITS.clamp(Velocity::new(v, w));
            prop_assert!(out.forward_m_s <= 0.4 && out.forward_m_s >= -0.1 && out.turn_rad_s.abs() <= 0.8);
        }
    }
}
