//! Jerk-limited velocity profiles: the acceleration itself changes no faster than so.
//!
//! On its way to a wanted speed an axis accelerates with a, |a| ≤ a_max and |da/dt| ≤ j. What is left of the way, e, is
//! still enough to let the acceleration die away as long as |a| ≤ √(2·j·|e|); with steps of h that becomes
//! √((j·h/2)² + 2·j·|e|) − j·h/2, which lands without overshoot. The profile is for what is wanted: whoever must stop
//! brakes on the plain ramp ([`crate::ramp`]), and the profile goes on from there.

/// How fast an axis' velocity and acceleration may change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisLimits {
    /// Greatest gain of speed [m/s² or rad/s²].
    pub up: f64,
    /// Greatest loss of speed [m/s² or rad/s²].
    pub down: f64,
    /// Greatest change of the acceleration [m/s³ or rad/s³].
    pub jerk: f64,
}

/// An axis' speed and acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Profile {
    /// Speed [m/s or rad/s].
    pub speed: f64,
    /// Acceleration [m/s² or rad/s²].
    pub acceleration: f64,
}

impl Profile {
    /// The profile after `dt_s` on the way to the speed `wanted`.
    pub fn towards(self, wanted: f64, limits: &AxisLimits, dt_s: f64) -> Profile {
        if dt_s <= 0.0 {
            return self;
        }
        let left = wanted - self.speed;
        // Towards standing it is the brakes' limit, away from it the motors'.
        let most = if left * self.speed < 0.0 { limits.down } else { limits.up };
        let kick = 0.5 * limits.jerk * dt_s;
        let dying_away = (kick * kick + 2.0 * limits.jerk * left.abs()).sqrt() - kick;
        let aim = most.min(dying_away).copysign(left);
        let change = limits.jerk * dt_s;
        let acceleration = self.acceleration + (aim - self.acceleration).clamp(-change, change);
        let speed = self.speed + acceleration * dt_s;
        // What is left is less than a step's way: it is there. Where a forced stop has left it more of an acceleration than
        // can die away in time, that is dropped, as by brakes at a standstill: never is a body driven beyond what is wanted,
        // nor backwards because it had to brake.
        if (wanted - speed) * left < 0.0 || left == 0.0 {
            return Profile { speed: wanted, acceleration: 0.0 };
        }
        if self.speed * speed < 0.0 && wanted * speed <= 0.0 || self.speed == 0.0 && wanted * speed < 0.0 {
            return Profile::default();
        }
        Profile { speed, acceleration }
    }

    /// The profile when something else set the speed, `dt_s` after the one before.
    pub fn forced(self, speed: f64, dt_s: f64) -> Profile {
        let acceleration = if dt_s > 0.0 { (speed - self.speed) / dt_s } else { 0.0 };
        Profile { speed, acceleration }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: AxisLimits = AxisLimits { up: 0.5, down: 0.8, jerk: 2.0 };
    const STEP_S: f64 = 0.02;

    fn run(from: Profile, wanted: f64, seconds: f64) -> Vec<Profile> {
        let steps = (seconds / STEP_S) as usize;
        std::iter::successors(Some(from), |p| Some(p.towards(wanted, &LIMITS, STEP_S))).take(steps).collect()
    }

    #[test]
    fn an_s_curve_takes_the_time_that_jerk_and_acceleration_leave() {
        // 0 → 0.5 m/s: the acceleration grows for 0.25 s, holds, and dies away for 0.25 s: v/a + a/j = 1.25 s.
        let all = run(Profile::default(), 0.5, 3.0);
        let arrived = all.iter().position(|p| p.speed == 0.5).unwrap() as f64 * STEP_S;
        assert!((arrived - 1.25).abs() < 0.06, "{arrived} s");
        assert!(all.iter().all(|p| p.acceleration <= LIMITS.up + 1e-12));
    }

    #[test]
    fn after_a_forced_stop_it_goes_on_from_there() {
        let braking = Profile { speed: 0.4, acceleration: 0.0 }.forced(0.384, STEP_S);
        assert!((braking.acceleration + 0.8).abs() < 1e-9);
        let all = run(braking, 0.5, 3.0);
        assert_eq!(all.last().unwrap().speed, 0.5);
    }

    #[test]
    fn after_braking_to_a_standstill_it_does_not_drive_backwards() {
        for (before, after, wanted) in [(0.016, 0.0, 0.0), (0.03, 0.014, 0.0), (0.02, 0.004, 0.3), (0.0, 0.0, 0.3)] {
            let stopped = Profile { speed: before, acceleration: 0.0 }.forced(after, STEP_S);
            let all = run(stopped, wanted, 3.0);
            assert!(all.iter().all(|p| p.speed >= 0.0), "{before} {after} {wanted}: {all:?}");
            assert_eq!(all.last().unwrap().speed, wanted);
        }
    }

    proptest! {
        #[test]
        fn acceleration_and_jerk_keep_to_their_limits_and_nothing_overshoots(from in -0.6..0.6f64, wanted in -0.6..0.6f64) {
            let all = run(Profile { speed: from, acceleration: 0.0 }, wanted, 6.0);
            let (least, most) = (from.min(wanted), from.max(wanted));
            for pair in all.windows(2) {
                prop_assert!(pair[1].speed >= least - 1e-9 && pair[1].speed <= most + 1e-9, "{:?}", pair[1]);
                prop_assert!(pair[1].acceleration.abs() <= LIMITS.down + 1e-9);
                // Arriving, the last bit of acceleration is dropped: less than two steps' worth.
                let jump = (pair[1].acceleration - pair[0].acceleration).abs();
                prop_assert!(jump <= 2.0 * LIMITS.jerk * STEP_S + 1e-9, "{pair:?}");
            }
            prop_assert_eq!(all.last().unwrap().speed, wanted);
        }
    }
}
