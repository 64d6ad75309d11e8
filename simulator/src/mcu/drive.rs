//! The firmware's motion control: two axes, translation and rotation, each with a goal and a trapezoidal ramp.
//!
//! A goal is a speed or a place. Towards a place the speed is the largest from which the deceleration still stops in
//! time, v = √((d·h/2)² + 2·d·r) − d·h/2 with r the way that will be left when the speed counts, d the deceleration and
//! h the step (which makes it exact for the sampled ramp). A speed goal is a place far ahead. Commands re-plan at once;
//! a watchdog that ran out holds both axes at zero *without forgetting the goals*, as the manual has it.

/// What an axis is to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Goal {
    /// Move at this speed [m/s or rad/s].
    Speed(f64),
    /// Stop at this place [m or rad].
    Place(f64),
}

/// Limits of an axis [m/s, m/s² or rad/s, rad/s²].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub speed: f64,
    pub acceleration: f64,
    pub deceleration: f64,
}

/// One axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    pub goal: Goal,
    /// Commanded speed now [m/s or rad/s].
    pub speed: f64,
    /// Greatest speed, taken over from the settings with each motion command.
    pub top_speed: f64,
}

impl Axis {
    pub const STILL: Axis = Axis { goal: Goal::Speed(0.0), speed: 0.0, top_speed: 0.0 };

    /// Sets a goal; the speed limit of this moment holds for it.
    pub fn pursue(&mut self, goal: Goal, limits: &Limits) {
        self.goal = goal;
        self.top_speed = limits.speed;
    }

    /// Whether the axis has come to rest where it should be.
    pub fn rests(&self) -> bool {
        self.speed == 0.0 && matches!(self.goal, Goal::Speed(0.0))
    }

    /// One step of `dt_s`: the mean speed over it. `place` is where the axis is, `hold` takes the goal for zero speed.
    pub fn advance(&mut self, limits: &Limits, place: f64, hold: bool, dt_s: f64) -> f64 {
        let before = self.speed;
        let wanted = match self.goal {
            _ if hold => 0.0,
            Goal::Speed(speed) => speed.clamp(-self.top_speed, self.top_speed),
            Goal::Place(goal) => {
                // Half of this step is still travelled at the speed of before.
                let left = goal - place - 0.5 * before * dt_s;
                let half_kick = 0.5 * limits.deceleration * dt_s;
                let speed = (half_kick * half_kick + 2.0 * limits.deceleration * left.abs()).sqrt() - half_kick;
                // Nearer than the resolution of the odometry the axis stays.
                if left.abs() < CLOSE_ENOUGH { 0.0 } else { speed.min(self.top_speed).copysign(left) }
            }
        };
        self.speed = ramp(before, wanted, limits, dt_s);
        0.5 * (before + self.speed)
    }

    /// Brakes with `deceleration` whatever the goal.
    pub fn brake(&mut self, deceleration: f64, dt_s: f64) -> f64 {
        let before = self.speed;
        self.speed -= before.clamp(-deceleration * dt_s, deceleration * dt_s);
        0.5 * (before + self.speed)
    }
}

/// Way or angle at which a place counts as reached: half a millimetre, 0.03°.
const CLOSE_ENOUGH: f64 = 0.0005;

/// The speed after one step towards `wanted`; a change of direction passes through zero.
fn ramp(speed: f64, wanted: f64, limits: &Limits, dt_s: f64) -> f64 {
    let reverses = wanted * speed < 0.0;
    let target = if reverses { 0.0 } else { wanted };
    let rate = if reverses || wanted.abs() < speed.abs() { limits.deceleration } else { limits.acceleration };
    speed + (target - speed).clamp(-rate * dt_s, rate * dt_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { speed: 0.5, acceleration: 0.3, deceleration: 0.6 };
    const STEP_S: f64 = 0.01;

    /// Runs an axis for `seconds`; gives the place and the greatest speed on the way.
    fn run(axis: &mut Axis, place: f64, hold: bool, seconds: f64) -> (f64, f64) {
        let steps = (seconds / STEP_S).round() as usize;
        (0..steps).fold((place, 0.0), |(place, top), _| {
            let mean = axis.advance(&LIMITS, place, hold, STEP_S);
            (place + mean * STEP_S, f64::max(top, axis.speed.abs()))
        })
    }

    #[test]
    fn a_speed_is_reached_on_the_acceleration_ramp_and_left_on_the_deceleration_ramp() {
        let mut axis = Axis::STILL;
        axis.pursue(Goal::Speed(0.3), &LIMITS);
        let (place, _) = run(&mut axis, 0.0, false, 1.0);
        assert!((axis.speed - 0.3).abs() < 1e-12 && (place - 0.15).abs() < 1e-9, "{place}");
        axis.pursue(Goal::Speed(0.0), &LIMITS);
        let (place, _) = run(&mut axis, 0.0, false, 0.5);
        assert!(axis.rests() && (place - 0.075).abs() < 1e-9, "{place}");
    }

    #[test]
    fn speeds_are_capped_by_the_limit_of_the_moment_of_the_command() {
        let mut axis = Axis::STILL;
        axis.pursue(Goal::Speed(-2.0), &LIMITS);
        run(&mut axis, 0.0, false, 5.0);
        assert!((axis.speed + 0.5).abs() < 1e-12);
        let slower = Limits { speed: 0.1, ..LIMITS };
        axis.advance(&slower, 0.0, false, STEP_S);
        assert!((axis.speed + 0.5).abs() < 1e-12, "a later limit waits for the next command");
    }

    #[test]
    fn a_place_is_reached_without_overshoot() {
        for goal in [0.004, 0.05, 0.3, 2.0, -1.0] {
            let mut axis = Axis::STILL;
            axis.pursue(Goal::Place(goal), &LIMITS);
            let (mut place, mut beyond) = (0.0, 0.0_f64);
            for _ in 0..1000 {
                place += axis.advance(&LIMITS, place, false, STEP_S) * STEP_S;
                beyond = beyond.max((place - goal) * goal.signum());
            }
            assert!((place - goal).abs() < 0.002 && beyond < 0.001 && axis.speed == 0.0, "{goal}: {place} {beyond}");
        }
    }

    #[test]
    fn a_held_axis_stops_and_resumes_its_goal() {
        let mut axis = Axis::STILL;
        axis.pursue(Goal::Speed(0.2), &LIMITS);
        run(&mut axis, 0.0, false, 2.0);
        run(&mut axis, 0.0, true, 2.0);
        assert_eq!(axis.speed, 0.0);
        run(&mut axis, 0.0, false, 2.0);
        assert!((axis.speed - 0.2).abs() < 1e-12);
    }

    #[test]
    fn a_change_of_direction_passes_through_zero_on_the_deceleration_ramp() {
        let mut axis = Axis { goal: Goal::Speed(-0.3), speed: 0.3, top_speed: 0.5 };
        run(&mut axis, 0.0, false, 0.5);
        assert!(axis.speed.abs() < 1e-9, "0.6 m/s² take half a second from 0.3 m/s");
        run(&mut axis, 0.0, false, 1.0);
        assert!((axis.speed + 0.3).abs() < 1e-9);
    }
}
