//! From the robot's own position counters to [`Odometry`].
//!
//! The robot integrates its wheels itself; XPOS and YPOS have 15 bits and wrap. Their steps are summed and turned into
//! the frame whose zero the operator set. A step that no robot can make (the controller was reset, somebody sent
//! SETO) is replaced by what the wheel speeds say, and `origin` is counted up: the frame is not quite the old one.
//!
//! Covariance, with the way ds and the turn dθ of one SIP, grows as P ← F P Fᵀ + G Q Gᵀ,
//! F = ∂pose/∂pose, Q = diag(k_d·|ds|, k_r·|dθ| + k_h·|ds|): variances proportional to the way, as for a random walk
//! (Thrun, Burgard, Fox: Probabilistic Robotics, ch. 5).

use super::model::{Model, TURN_RATE_RAD_S_PER_UNIT};
use super::sip::{Sip, Unwrap15};
use messages::{Odometry, Twist};
use runtime::{Time, math};

/// How fast the odometry's uncertainty grows.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Drift {
    /// Variance of the way per metre driven [m²/m].
    pub way_m2_per_m: f64,
    /// Variance of the heading per radian turned [rad²/rad].
    pub heading_rad2_per_rad: f64,
    /// Variance of the heading per metre driven [rad²/m].
    pub heading_rad2_per_m: f64,
}

impl Default for Drift {
    /// Of the order of 1 % of the way and 3 % of the turn, carpet to vinyl.
    fn default() -> Drift {
        Drift { way_m2_per_m: 1e-4, heading_rad2_per_rad: 1e-3, heading_rad2_per_m: 2e-4 }
    }
}

/// Standard deviations of the reported velocities: a count of the wheel encoders, about [m/s, rad/s].
const SPEED_SIGMA_M_S: f64 = 0.01;
const TURN_SIGMA_RAD_S: f64 = 0.02;

/// Time after SETO in which the counters may or may not be at zero already [s].
const REBASE_S: f64 = 0.5;
/// Longest silence through which the wheel speeds are believed, and the least time that a step is given [s].
const LONGEST_GAP_S: f64 = 0.3;

/// Velocity in the body frame that a SIP reports; `None` when it is too short.
pub fn velocity(sip: &Sip, model: &Model) -> Option<Twist> {
    let left_m_s = f64::from(sip.left_speed?) * model.speed_m_s_per_unit;
    let right_m_s = f64::from(sip.right_speed?) * model.speed_m_s_per_unit;
    let from_wheels = (right_m_s - left_m_s) / 2.0 * model.turn_rad_per_m;
    Some(Twist {
        linear_x_m_s: (left_m_s + right_m_s) / 2.0,
        linear_y_m_s: 0.0,
        angular_z_rad_s: sip.turn_rate_decideg_s.map_or(from_wheels, |raw| f64::from(raw) * TURN_RATE_RAD_S_PER_UNIT),
    })
}

/// Pose and its uncertainty, from SIP to SIP.
#[derive(Debug, Clone)]
pub struct DeadReckoning {
    drift: Drift,
    pose: [f64; 3],
    covariance: [[f64; 3]; 3],
    origin: u64,
    x: Unwrap15,
    y: Unwrap15,
    /// Heading of the last SIP in the robot's own frame.
    heading: Option<f64>,
    last: Time,
    rebase_until: Time,
}

impl DeadReckoning {
    /// At zero, where the first SIP finds the robot.
    pub fn new(drift: Drift) -> DeadReckoning {
        DeadReckoning {
            drift,
            pose: [0.0; 3],
            covariance: [[0.0; 3]; 3],
            origin: 0,
            x: Unwrap15::default(),
            y: Unwrap15::default(),
            heading: None,
            last: Time::ZERO,
            rebase_until: Time::ZERO,
        }
    }

    /// The link is new: nobody knows what the robot did meanwhile. The next SIP is the frame's zero.
    pub fn connected(&mut self, first: bool) {
        *self = DeadReckoning { origin: self.origin + u64::from(!first), ..DeadReckoning::new(self.drift) };
    }

    /// Makes the robot's present place the frame's zero. SETO is on its way to the robot; until it has surely arrived,
    /// steps are taken from the wheel speeds, so that it does not matter with which SIP the counters fall to zero.
    pub fn set_origin(&mut self, now: Time) {
        self.pose = [0.0; 3];
        self.covariance = [[0.0; 3]; 3];
        self.origin += 1;
        self.rebase_until = now.after_s(REBASE_S);
    }

    /// Takes one SIP that came at `now`; `None` when it is too short to say where the robot is.
    pub fn update(&mut self, now: Time, sip: &Sip, model: &Model) -> Option<Odometry> {
        let velocity = velocity(sip, model)?;
        let heading = f64::from(sip.heading?) * model.heading_rad_per_unit;
        let told = [
            f64::from(self.x.step(sip.x?)) * model.distance_m_per_unit,
            f64::from(self.y.step(sip.y?)) * model.distance_m_per_unit,
        ];
        if let Some(before) = self.heading.replace(heading) {
            let elapsed_s = now.since(self.last);
            let turn = math::wrap_angle(heading - before);
            let way = math::hypot(told[0], told[1]);
            // After a stall of this process several SIPs are read at one time.
            let time_s = elapsed_s.max(LONGEST_GAP_S);
            let is_possible = way <= model.max_speed_m_s * time_s && turn.abs() <= model.max_turn_rad_s * time_s;
            if now < self.rebase_until || !is_possible {
                self.origin += u64::from(now >= self.rebase_until);
                self.advance_by_velocity(&velocity, elapsed_s);
            } else {
                // The frame's zero is turned against the robot's own by the difference of the headings.
                let (sin, cos) = math::sin_cos(self.pose[2] - before);
                self.advance([cos * told[0] - sin * told[1], sin * told[0] + cos * told[1]], turn);
            }
        }
        self.last = now;
        Some(self.odometry(velocity))
    }

    /// Times that the frame's zero was moved.
    pub fn origin(&self) -> u64 {
        self.origin
    }

    fn advance_by_velocity(&mut self, velocity: &Twist, elapsed_s: f64) {
        // A late SIP does not make the robot drive through its silence.
        let elapsed_s = elapsed_s.min(LONGEST_GAP_S);
        let turn = velocity.angular_z_rad_s * elapsed_s;
        let way = velocity.linear_x_m_s * elapsed_s;
        let (sin, cos) = math::sin_cos(self.pose[2] + turn / 2.0);
        self.advance([way * cos, way * sin], turn);
    }

    fn advance(&mut self, step: [f64; 2], turn: f64) {
        let way = math::hypot(step[0], step[1]);
        // F = I but for the column of the heading: a heading error carries the whole step sideways.
        let f = [-step[1], step[0]];
        let p = &mut self.covariance;
        for row in p.iter_mut() {
            row[0] += f[0] * row[2];
            row[1] += f[1] * row[2];
        }
        let by_heading = p[2];
        for (row, factor) in p.iter_mut().zip(f) {
            for (element, by_heading) in row.iter_mut().zip(by_heading) {
                *element += factor * by_heading;
            }
        }
        // The way's noise acts along the step.
        if way > 0.0 {
            let along = [step[0] / way, step[1] / way];
            let variance = self.drift.way_m2_per_m * way;
            for row in 0..2 {
                for column in 0..2 {
                    p[row][column] += along[row] * along[column] * variance;
                }
            }
        }
        p[2][2] += self.drift.heading_rad2_per_rad * turn.abs() + self.drift.heading_rad2_per_m * way;
        self.pose[0] += step[0];
        self.pose[1] += step[1];
        self.pose[2] = math::wrap_angle(self.pose[2] + turn);
    }

    fn odometry(&self, velocity: Twist) -> Odometry {
        let mut pose_covariance = [0.0; 9];
        for (to, from) in pose_covariance.iter_mut().zip(self.covariance.as_flattened()) {
            *to = *from;
        }
        let mut velocity_covariance = [0.0; 9];
        velocity_covariance[0] = SPEED_SIGMA_M_S * SPEED_SIGMA_M_S;
        velocity_covariance[8] = TURN_SIGMA_RAD_S * TURN_SIGMA_RAD_S;
        Odometry {
            x_m: self.pose[0],
            y_m: self.pose[1],
            heading_rad: self.pose[2],
            velocity,
            pose_covariance,
            velocity_covariance,
            origin: self.origin,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::p2os::model;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn sip(x: i32, y: i32, heading_units: i32) -> Sip {
        Sip {
            kind: 0x33,
            x: Some(x as u16 & 0x7FFF),
            y: Some(y as u16 & 0x7FFF),
            heading: Some(heading_units as i16),
            left_speed: Some(0),
            right_speed: Some(0),
            ..Sip::default()
        }
    }

    fn moving(x: i32, y: i32, heading_units: i32, speed: i16) -> Sip {
        Sip { left_speed: Some(speed), right_speed: Some(speed), ..sip(x, y, heading_units) }
    }

    struct Robot(DeadReckoning, Time);

    impl Robot {
        fn new() -> Robot {
            Robot(DeadReckoning::new(Drift::default()), Time::from_seconds(50.0))
        }

        fn hears(&mut self, sip: Sip) -> Odometry {
            self.1 = self.1.after_s(0.1);
            self.0.update(self.1, &sip, model::named("p3dx-sh").unwrap()).unwrap()
        }
    }

    fn assert_at(odometry: &Odometry, x_m: f64, y_m: f64, heading_rad: f64) {
        let apart = [odometry.x_m - x_m, odometry.y_m - y_m, math::wrap_angle(odometry.heading_rad - heading_rad)];
        assert!(apart.iter().all(|apart| apart.abs() < 2e-3), "{odometry:?} is not at {x_m} {y_m} {heading_rad}");
    }

    #[test]
    fn the_first_packet_is_the_zero_wherever_the_robot_thinks_it_is() {
        let mut robot = Robot::new();
        assert_at(&robot.hears(sip(12_345, -700, 1024)), 0.0, 0.0, 0.0);
        // The robot's own frame: it drives along its y. Ours: straight ahead.
        assert_at(&robot.hears(sip(12_345, -500, 1024)), 0.2, 0.0, 0.0);
    }

    #[test]
    fn positions_run_on_through_the_counters_wrap() {
        let mut robot = Robot::new();
        robot.hears(sip(0, 0, 0));
        let mut last = robot.hears(sip(0, 0, 0));
        for metre in 1..=200 {
            for fifth in 1..=5 {
                last = robot.hears(sip((metre - 1) * 1000 + fifth * 200, 0, 0));
            }
        }
        assert_at(&last, 200.0, 0.0, 0.0);
        assert_eq!(last.origin, 0);
    }

    #[test]
    fn headings_run_through_half_a_turn() {
        let mut robot = Robot::new();
        robot.hears(sip(0, 0, 2000));
        let odometry = robot.hears(sip(0, 0, -2000));
        assert_at(&odometry, 0.0, 0.0, 96.0 * PI / 2048.0);
    }

    #[test]
    fn the_older_controllers_units_are_shorter() {
        let mut reckoning = DeadReckoning::new(Drift::default());
        let model = model::named("p3dx").unwrap();
        let mut last = None;
        for (step, x) in [0, 200, 400, 600, 800, 1000].into_iter().enumerate() {
            last = reckoning.update(Time::from_seconds(1.0 + 0.1 * step as f64), &sip(x, 0, 0), model);
        }
        assert_at(&last.unwrap(), 0.485, 0.0, 0.0);
    }

    #[test]
    fn the_operators_zero_holds_whenever_the_controller_follows() {
        for late in 1..=3 {
            let mut robot = Robot::new();
            robot.hears(moving(0, 0, 1024, 500));
            robot.hears(moving(0, 50, 1024, 500));
            robot.0.set_origin(robot.1);
            let mut last = robot.hears(moving(0, 100, 1024, 500));
            for step in 1..=6 {
                // From the SIP number `late` on the counters say what SETO made of them.
                let way = 50 * (step - late);
                last = robot.hears(if step >= late {
                    moving(way, 0, 0, 500)
                } else {
                    moving(0, 100 + 50 * step, 1024, 500)
                });
            }
            assert_at(&last, 0.35, 0.0, 0.0);
            assert_eq!(last.origin, 1, "late by {late}");
        }
    }

    #[test]
    fn a_step_that_no_robot_can_make_moves_the_origin_not_the_robot() {
        let mut robot = Robot::new();
        robot.hears(sip(0, 0, 0));
        robot.hears(sip(100, 0, 0));
        let odometry = robot.hears(sip(5000, -3000, 0));
        assert_at(&odometry, 0.1, 0.0, 0.0);
        assert_eq!(odometry.origin, 1);
        assert_at(&robot.hears(sip(5100, -3000, 0)), 0.2, 0.0, 0.0);
    }

    #[test]
    fn a_new_connection_begins_a_new_frame() {
        let mut robot = Robot::new();
        robot.0.connected(true);
        robot.hears(sip(0, 0, 0));
        assert_eq!(robot.hears(sip(100, 0, 0)).origin, 0);
        robot.0.connected(false);
        let odometry = robot.hears(sip(9000, 0, 700));
        assert_at(&odometry, 0.0, 0.0, 0.0);
        assert_eq!(odometry.origin, 1);
    }

    #[test]
    fn the_turn_rate_comes_from_the_wheels_where_the_firmware_does_not_tell_it() {
        let model = model::named("p3dx-sh").unwrap();
        let wheels = Sip { left_speed: Some(-100), right_speed: Some(100), ..Sip::default() };
        assert!((velocity(&wheels, model).unwrap().angular_z_rad_s - 0.56).abs() < 1e-12);
        let told = Sip { turn_rate_decideg_s: Some(-900), ..wheels };
        assert!((velocity(&told, model).unwrap().angular_z_rad_s + FRAC_PI_2).abs() < 1e-12);
        assert_eq!(velocity(&Sip { right_speed: None, ..wheels }, model), None);
    }

    #[test]
    fn uncertainty_grows_with_the_way_and_is_symmetric() {
        let mut robot = Robot::new();
        let mut last = robot.hears(sip(0, 0, 0));
        assert_eq!(last.pose_covariance, [0.0; 9]);
        for step in 1..50 {
            let heading = step * 20;
            let next = robot.hears(sip(step * 80, step * 10, heading));
            assert!(next.pose_covariance[8] > last.pose_covariance[8]);
            assert!(
                next.pose_covariance[0] + next.pose_covariance[4] > last.pose_covariance[0] + last.pose_covariance[4]
            );
            last = next;
        }
        let p = last.pose_covariance;
        for (a, b) in [(1, 3), (2, 6), (5, 7)] {
            assert!((p[a] - p[b]).abs() < 1e-12);
        }
        assert!(p[0] * p[4] - p[1] * p[3] > 0.0, "positive definite in x, y");
    }

    #[test]
    fn a_packet_that_is_too_short_says_nothing() {
        let mut reckoning = DeadReckoning::new(Drift::default());
        let short = Sip { kind: 0x32, x: Some(1), ..Sip::default() };
        assert_eq!(reckoning.update(Time::from_seconds(1.0), &short, model::named("p3dx").unwrap()), None);
    }
}
