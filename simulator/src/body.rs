//! A differential-drive body: what its wheels do to its pose, and what its encoders count.
//!
//! The wheels turn as the controller says; the ground sees something slightly else. Per run: an error of scale for ways
//! and one for turns, and a drift of the heading with the way (unequal wheels). Per step: each wheel slips by a random
//! part that grows with the root of the way. The encoders count the wheels, not the ground, so the odometry drifts.

use crate::geometry::{Footprint, Pose};
use crate::noise::{Chance, Purpose};
use crate::realism::WheelRealism;
use messages::Twist;

/// Slower than this counts as standing [m/s].
pub(crate) const STANDING_M_S: f64 = 0.01;

/// What the wheels were told, as way and turn over one step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Stride {
    pub way_m: f64,
    pub turn_rad: f64,
}

impl Stride {
    pub fn is_none(&self) -> bool {
        self.way_m == 0.0 && self.turn_rad == 0.0
    }

    pub fn part(&self, share: f64) -> Stride {
        Stride { way_m: self.way_m * share, turn_rad: self.turn_rad * share }
    }

    /// Greatest way that any point within `radius_m` of the centre travels [m].
    pub fn reach_m(&self, radius_m: f64) -> f64 {
        self.way_m.abs() + self.turn_rad.abs() * radius_m
    }
}

/// What a body's mechanics are made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub footprint: Footprint,
    /// Heading per half the difference of the wheels' ways [rad/m].
    pub turn_rad_per_m: f64,
    pub ticks_per_m: f64,
    /// Speed that no wheel exceeds, whatever it is told [m/s].
    pub max_wheel_m_s: f64,
}

/// A body's mechanics.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    pub footprint: Footprint,
    pub pose: Pose,
    /// True velocity over the last step.
    pub velocity: Twist,
    turn_rad_per_m: f64,
    ticks_per_m: f64,
    max_wheel_m_s: f64,
    left_m: f64,
    right_m: f64,
    distance_scale: f64,
    turn_scale: f64,
    drift_rad_per_m: f64,
    realism: WheelRealism,
    chance: Chance,
}

impl Body {
    pub fn new(frame: Frame, realism: WheelRealism, seed: u64, index: usize) -> Body {
        let Frame { footprint, turn_rad_per_m, ticks_per_m, max_wheel_m_s } = frame;
        let mut chance = Chance::new(seed, Purpose::Wheels, index);
        let distance_scale = (1.0 + realism.distance_error * chance.either_way()) / realism.odometry_scale;
        let turn_scale = 1.0 + realism.turn_error * chance.either_way();
        let drift_rad_per_m = realism.drift_rad_per_m * chance.either_way();
        let (pose, velocity) = (Pose::default(), Twist::default());
        Body {
            footprint,
            pose,
            velocity,
            turn_rad_per_m,
            ticks_per_m,
            max_wheel_m_s,
            left_m: 0.0,
            right_m: 0.0,
            distance_scale,
            turn_scale,
            drift_rad_per_m,
            realism,
            chance,
        }
    }

    /// What the wheels do when told to move so for `dt_s`: both slowed down alike when one would turn too fast.
    pub fn stride(&self, speed_m_s: f64, turn_rad_s: f64, dt_s: f64) -> Stride {
        let fastest = speed_m_s.abs() + turn_rad_s.abs() / self.turn_rad_per_m;
        let share = if fastest > self.max_wheel_m_s { self.max_wheel_m_s / fastest } else { 1.0 };
        Stride { way_m: speed_m_s * dt_s * share, turn_rad: turn_rad_s * dt_s * share }
    }

    /// What the ground sees of the wheels' stride.
    pub fn on_ground(&mut self, wheels: Stride) -> Stride {
        if wheels.is_none() {
            return wheels;
        }
        let mut ground = Stride {
            way_m: wheels.way_m * self.distance_scale,
            turn_rad: wheels.turn_rad * self.turn_scale + wheels.way_m * self.drift_rad_per_m,
        };
        if self.realism.slip_m > 0.0 {
            let aside_m = wheels.turn_rad / self.turn_rad_per_m;
            let left_m = (wheels.way_m - aside_m).abs().sqrt() * self.realism.slip_m * self.chance.normal();
            let right_m = (wheels.way_m + aside_m).abs().sqrt() * self.realism.slip_m * self.chance.normal();
            ground.way_m += 0.5 * (left_m + right_m);
            ground.turn_rad += 0.5 * (right_m - left_m) * self.turn_rad_per_m;
        }
        ground
    }

    /// Turns the wheels by what they really did; gives the encoders' counts.
    pub fn turn_wheels(&mut self, wheels: Stride) -> (i64, i64) {
        let aside_m = wheels.turn_rad / self.turn_rad_per_m;
        self.left_m += wheels.way_m - aside_m;
        self.right_m += wheels.way_m + aside_m;
        let noise = if wheels.is_none() { 0.0 } else { self.realism.encoder_ticks };
        (self.count(self.left_m, noise), self.count(self.right_m, noise))
    }

    fn count(&mut self, way_m: f64, noise: f64) -> i64 {
        let jitter = if noise > 0.0 { noise * self.chance.normal() } else { 0.0 };
        (way_m * self.ticks_per_m + jitter).floor() as i64
    }

    /// Ways of the left and the right wheel in a stride [m].
    pub fn wheel_ways_m(&self, stride: Stride) -> (f64, f64) {
        let aside_m = stride.turn_rad / self.turn_rad_per_m;
        (stride.way_m - aside_m, stride.way_m + aside_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realism::Realism;

    fn body(realism: WheelRealism, seed: u64) -> Body {
        let outline = Footprint::cut_rectangle(0.21, 0.3, 0.2, 0.1).unwrap();
        let frame = Frame { footprint: outline, turn_rad_per_m: 5.6, ticks_per_m: 128_000.0, max_wheel_m_s: 1.2 };
        Body::new(frame, realism, seed, 0)
    }

    #[test]
    fn perfect_wheels_do_on_the_ground_what_they_are_told() {
        let mut body = body(Realism::none().wheels, 1);
        let stride = body.stride(0.3, 0.4, 0.01);
        assert_eq!(body.on_ground(stride), Stride { way_m: 0.003, turn_rad: 0.004 });
        // 3 mm ± 4 mrad / 5.6 rad/m.
        assert_eq!(body.turn_wheels(stride), (292, 475));
    }

    #[test]
    fn wheels_have_a_greatest_speed_and_keep_the_path_when_it_binds() {
        let body = body(Realism::none().wheels, 1);
        let stride = body.stride(2.0, 2.8, 0.01);
        let (_, right_m) = body.wheel_ways_m(stride);
        assert!((right_m - 0.012).abs() < 1e-12);
        assert!((stride.turn_rad / stride.way_m - 1.4).abs() < 1e-12);
    }

    #[test]
    fn slip_and_calibration_move_the_ground_but_not_the_count() {
        let run = |seed| {
            let mut body = body(WheelRealism { encoder_ticks: 0.0, ..WheelRealism::default() }, seed);
            let stride = body.stride(0.5, 0.0, 0.01);
            let (mut way_m, mut turn_rad, mut ticks) = (0.0, 0.0, (0, 0));
            for _ in 0..2000 {
                let ground = body.on_ground(stride);
                (way_m, turn_rad) = (way_m + ground.way_m, turn_rad + ground.turn_rad);
                ticks = body.turn_wheels(stride);
            }
            assert!((ticks.0 - 1_280_000).abs() <= 1 && ticks.0 == ticks.1);
            (way_m, turn_rad)
        };
        for seed in 0..20 {
            let (way_m, turn_rad) = run(seed);
            // 10 m: 0.75 % of scale and 6 mm of slip; 75 mrad of drift and 0.05 rad of slip.
            assert!((way_m - 10.0).abs() < 0.1 && turn_rad.abs() < 0.25, "{way_m} {turn_rad}");
            assert_ne!((way_m, turn_rad), (10.0, 0.0));
        }
        assert_eq!(run(3), run(3));
        assert_ne!(run(3), run(4));
    }
}
