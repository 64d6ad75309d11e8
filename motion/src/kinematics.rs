//! What the wheels do at a body's velocity, and what of it they can do.
//!
//! Differential drive, wheels W apart: left = v − ω·W/2, right = v + ω·W/2. Synchro drive, all wheels steered together:
//! every wheel drives at v and turns at ω about its vertical axis. Where a wheel would have to be too fast, forward speed
//! and turn rate are cut by one common factor, so that the path stays.

use crate::footprint::Velocity;
use messages::WheelVelocities;
use schemars::JsonSchema;
use serde::Deserialize;

/// How a body is driven.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, tag = "drive", rename_all = "snake_case")]
pub enum Kinematics {
    /// Two driven wheels on one axle.
    Differential {
        /// Distance between the wheels [m].
        wheel_distance_m: f64,
        /// Greatest speed of a wheel over the ground [m/s].
        max_wheel_m_s: f64,
    },
    /// All wheels driven and steered together.
    Synchro {
        /// Greatest speed of the wheels over the ground [m/s].
        max_wheel_m_s: f64,
        /// Greatest rate at which they are steered [rad/s].
        max_steer_rad_s: f64,
    },
}

impl Kinematics {
    /// Says which figure is wrong.
    pub fn check(&self) -> Result<(), String> {
        let figures = match *self {
            Kinematics::Differential { wheel_distance_m, max_wheel_m_s } => {
                [("wheel_distance_m", wheel_distance_m), ("max_wheel_m_s", max_wheel_m_s)]
            }
            Kinematics::Synchro { max_wheel_m_s, max_steer_rad_s } => {
                [("max_wheel_m_s", max_wheel_m_s), ("max_steer_rad_s", max_steer_rad_s)]
            }
        };
        match figures.into_iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            Some((key, value)) => Err(format!("kinematics.{key} = {value} must be a number above 0")),
            None => Ok(()),
        }
    }

    /// What the wheels do at `velocity`.
    pub fn wheels(&self, velocity: Velocity) -> WheelVelocities {
        let Velocity { forward_m_s, turn_rad_s } = velocity;
        match *self {
            Kinematics::Differential { wheel_distance_m, .. } => {
                let aside_m_s = 0.5 * turn_rad_s * wheel_distance_m;
                let (left_m_s, right_m_s) = (forward_m_s - aside_m_s, forward_m_s + aside_m_s);
                WheelVelocities { left_m_s, right_m_s, ..WheelVelocities::default() }
            }
            Kinematics::Synchro { .. } => {
                WheelVelocities { drive_m_s: forward_m_s, steer_rad_s: turn_rad_s, ..WheelVelocities::default() }
            }
        }
    }

    /// The body's velocity at which the wheels do so.
    pub fn velocity(&self, wheels: &WheelVelocities) -> Velocity {
        match *self {
            Kinematics::Differential { wheel_distance_m, .. } => Velocity::new(
                0.5 * (wheels.left_m_s + wheels.right_m_s),
                (wheels.right_m_s - wheels.left_m_s) / wheel_distance_m,
            ),
            Kinematics::Synchro { .. } => Velocity::new(wheels.drive_m_s, wheels.steer_rad_s),
        }
    }

    /// `velocity` on the same path, no faster than the wheels can.
    pub fn within(&self, velocity: Velocity) -> Velocity {
        let wheels = self.wheels(velocity);
        let over = match *self {
            Kinematics::Differential { max_wheel_m_s, .. } => {
                wheels.left_m_s.abs().max(wheels.right_m_s.abs()) / max_wheel_m_s
            }
            Kinematics::Synchro { max_wheel_m_s, max_steer_rad_s } => {
                (wheels.drive_m_s.abs() / max_wheel_m_s).max(wheels.steer_rad_s.abs() / max_steer_rad_s)
            }
        };
        if over > 1.0 { velocity.scaled(1.0 / over) } else { velocity }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DIFFERENTIAL: Kinematics = Kinematics::Differential { wheel_distance_m: 0.4, max_wheel_m_s: 0.8 };
    const SYNCHRO: Kinematics = Kinematics::Synchro { max_wheel_m_s: 0.8, max_steer_rad_s: 1.0 };

    #[test]
    fn a_left_turn_makes_the_right_wheel_faster() {
        let wheels = DIFFERENTIAL.wheels(Velocity::new(0.3, 0.5));
        assert!((wheels.left_m_s - 0.2).abs() < 1e-12 && (wheels.right_m_s - 0.4).abs() < 1e-12);
        let synchro = SYNCHRO.wheels(Velocity::new(0.3, 0.5));
        assert_eq!((synchro.drive_m_s, synchro.steer_rad_s), (0.3, 0.5));
    }

    #[test]
    fn figures_that_are_none_are_named() {
        assert_eq!(DIFFERENTIAL.check(), Ok(()));
        let wrong = Kinematics::Synchro { max_wheel_m_s: 0.8, max_steer_rad_s: f64::NAN };
        assert!(wrong.check().unwrap_err().starts_with("kinematics.max_steer_rad_s"));
    }

    proptest! {
        #[test]
        fn wheels_and_velocity_are_each_other_s_inverse(v in -1.0..1.0f64, w in -3.0..3.0f64) {
            for kinematics in [DIFFERENTIAL, SYNCHRO] {
                let back = kinematics.velocity(&kinematics.wheels(Velocity::new(v, w)));
                prop_assert!((back.forward_m_s - v).abs() < 1e-12 && (back.turn_rad_s - w).abs() < 1e-12);
            }
        }

        #[test]
        fn no_wheel_is_too_fast_and_the_path_stays(v in -2.0..2.0f64, w in -6.0..6.0f64) {
            for kinematics in [DIFFERENTIAL, SYNCHRO] {
                let cut = kinematics.within(Velocity::new(v, w));
                let wheels = kinematics.wheels(cut);
                let fastest = wheels.left_m_s.abs().max(wheels.right_m_s.abs()).max(wheels.drive_m_s.abs());
                prop_assert!(fastest <= 0.8 + 1e-12 && wheels.steer_rad_s.abs() <= 1.0 + 1e-12);
                prop_assert!((cut.forward_m_s * w - cut.turn_rad_s * v).abs() < 1e-9);
            }
        }
    }
}
