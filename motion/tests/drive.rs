//! The node `drive` on a bench: what comes in, what goes out.
#![allow(clippy::unwrap_used, reason = "tests")]

use messages::{
    BaseState, Beam, Command, Echo, Link, MotionState, Odometry, Ranges, Stop, Track, TrackMotion, TrackState, Tracks,
    Twist, WheelVelocities,
};
use motion::drive::Drive;
use runtime::{Bench, OpenError, Time};

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

fn beam(bearing_rad: f32, range_m: f32) -> Beam {
    let echo = if range_m < 5.0 { Echo::Value } else { Echo::Clear } as u32;
    Beam { origin_x_m: 0.0, origin_y_m: 0.0, bearing_rad, range_m, age_s: 0.0, echo }
}

struct Rig {
    bench: Bench<Drive>,
    now_s: f64,
}

impl Rig {
    fn new(config: &str) -> Rig {
        Rig { bench: Bench::<Drive>::builder(config).build().unwrap(), now_s: 10.0 }
    }

    fn base(&mut self) {
        let state = BaseState { link: Link::Up as u32, motors_enabled: 1, ..BaseState::default() };
        self.bench.feed("base", at(self.now_s), &state, &[]);
    }

    fn velocity(&mut self, forward_m_s: f64) {
        let twist = Twist { linear_x_m_s: forward_m_s, ..Twist::default() };
        self.bench.feed("velocity", at(self.now_s), &twist, &[]);
    }

    fn ranges(&mut self, ahead_m: f32) {
        let ranges = Ranges { min_range_m: 0.1, max_range_m: 5.0, beam_width_rad: 0.0, span_s: 0.0 };
        self.bench.feed("ranges", at(self.now_s), &ranges, &[beam(0.0, ahead_m), beam(3.1, 5.0)]);
    }

    fn step(&mut self) -> (Command, MotionState) {
        self.bench.step(at(self.now_s)).unwrap();
        self.now_s += 0.05;
        let (_, command, _) = self.bench.read::<Command>("command").unwrap();
        let (_, state, _) = self.bench.read::<MotionState>("state").unwrap();
        (command, state)
    }

    /// Two seconds of wanting 0.25 m/s with an obstacle `ahead_m` ahead.
    fn drive(&mut self, ahead_m: f32) -> (Command, MotionState) {
        for _ in 0..39 {
            self.base();
            self.velocity(0.25);
            self.ranges(ahead_m);
            self.step();
        }
        self.base();
        self.velocity(0.25);
        self.ranges(ahead_m);
        self.step()
    }
}

#[test]
fn drives_when_all_is_well() {
    let (command, state) = Rig::new("").drive(4.0);
    assert_eq!(command.velocity.linear_x_m_s, 0.25);
    assert_eq!((command.enable, command.valid_for_s), (1, 0.3));
    assert_eq!(state.stop, Stop::None as u32);
}

#[test]
fn stops_for_what_is_in_the_way() {
    let (command, state) = Rig::new("").drive(0.22);
    assert_eq!(command.velocity.linear_x_m_s, 0.0);
    assert_eq!((state.stop, state.stops), (Stop::Zone as u32, 1));
}

#[test]
fn a_silent_coordinator_stops_the_body_on_the_deceleration_ramp() {
    let mut rig = Rig::new("");
    rig.drive(4.0);
    let mut speeds = Vec::new();
    for _ in 0..40 {
        rig.base();
        rig.ranges(4.0);
        speeds.push(rig.step().0.velocity.linear_x_m_s);
    }
    assert_eq!(speeds.last(), Some(&0.0));
    assert!(speeds.windows(2).all(|pair| pair[1] <= pair[0] && pair[0] - pair[1] <= 0.3 * 0.05 + 1e-9));
}

#[test]
fn a_silent_ranger_leaves_the_blind_cap() {
    let mut rig = Rig::new("");
    rig.drive(4.0);
    let mut last = None;
    for _ in 0..40 {
        rig.base();
        rig.velocity(0.25);
        last = Some(rig.step());
    }
    let (command, state) = last.unwrap();
    assert!((command.velocity.linear_x_m_s - 0.05).abs() < 1e-12);
    assert_eq!(state.stop, Stop::Blind as u32);
}

#[test]
fn while_the_set_is_silent_the_fallback_is_asked() {
    let mut rig = Rig::new("");
    rig.drive(4.0);
    let sonar = Ranges { min_range_m: 0.1, max_range_m: 5.0, beam_width_rad: 0.5, span_s: 0.3 };
    let mut last = None;
    for _ in 0..40 {
        rig.base();
        rig.velocity(0.25);
        rig.bench.feed("fallback", at(rig.now_s), &sonar, &[beam(0.0, 2.0), beam(3.1, 5.0)]);
        last = Some(rig.step());
    }
    let (command, state) = last.unwrap();
    assert_eq!((command.velocity.linear_x_m_s, state.stop), (0.25, Stop::None as u32));
}

#[test]
fn a_silent_base_is_sent_zero() {
    let mut rig = Rig::new("");
    rig.drive(4.0);
    let mut last = None;
    for _ in 0..40 {
        rig.velocity(0.25);
        rig.ranges(4.0);
        last = Some(rig.step());
    }
    let (command, state) = last.unwrap();
    assert_eq!(command.velocity, Twist::default());
    assert_eq!(state.stop, Stop::Base as u32);
}

#[test]
fn what_was_seen_is_carried_on_by_the_odometry() {
    let limit = |speed_m_s: f64| {
        let mut rig = Rig::new("");
        rig.base();
        rig.ranges(0.6);
        rig.now_s += 0.3;
        let odometry = Odometry {
            x_m: 0.0,
            y_m: 0.0,
            heading_rad: 0.0,
            velocity: Twist { linear_x_m_s: speed_m_s, ..Twist::default() },
            pose_covariance: [0.0; 9],
            velocity_covariance: [0.0; 9],
            origin: 0,
        };
        rig.bench.feed("odometry", at(rig.now_s), &odometry, &[]);
        rig.step().1.forward_limit_m_s
    };
    assert!(limit(0.5) < limit(0.0), "a moving body is nearer by now");
}

#[test]
fn a_setting_that_makes_no_sense_is_refused_with_its_name() {
    for (config, name) in
        [("margin_m = -0.1", "margin_m"), ("command_valid_s = 0.0", "command_valid_s"), ("capacity = 3", "capacity")]
    {
        match Bench::<Drive>::builder(config).build() {
            Err(OpenError::Config { reason }) => assert!(reason.contains(name), "{reason}"),
            other => panic!("{name} was accepted: {:?}", other.map(|_| ())),
        }
    }
}

#[test]
fn a_jerk_limit_makes_the_start_soft_and_a_stop_for_an_obstacle_as_hard_as_ever() {
    let mut rig = Rig::new("max_jerk_m_s3 = 0.5");
    let mut speeds = Vec::new();
    for _ in 0..40 {
        rig.base();
        rig.velocity(0.25);
        rig.ranges(4.0);
        speeds.push(rig.step().0.velocity.linear_x_m_s);
    }
    let gains: Vec<f64> = speeds.windows(2).map(|pair| (pair[1] - pair[0]) / 0.05).collect();
    // The last of the acceleration is dropped on arrival: two steps' worth of jerk.
    assert!(gains.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= 2.0 * 0.5 * 0.05 + 1e-9), "{gains:?}");
    assert_eq!(speeds.last(), Some(&0.25));
    rig.base();
    rig.velocity(0.25);
    rig.ranges(0.22);
    let braking = rig.step().0.velocity.linear_x_m_s;
    assert!((0.25 - braking) / 0.05 > 0.29, "the whole deceleration at once: {braking}");
}

#[test]
fn the_wheels_are_told_and_kept_within_what_they_can() {
    let config = "kinematics = { drive = \"differential\", wheel_distance_m = 0.4, max_wheel_m_s = 0.15 }";
    let mut rig = Rig::new(config);
    let (command, _) = rig.drive(4.0);
    assert!((command.velocity.linear_x_m_s - 0.15).abs() < 1e-9);
    let (_, wheels, _) = rig.bench.read::<WheelVelocities>("wheels").unwrap();
    assert!((wheels.left_m_s - 0.15).abs() < 1e-9 && (wheels.right_m_s - 0.15).abs() < 1e-9);
    let wrong = "kinematics = { drive = \"synchro\", max_wheel_m_s = 0.0, max_steer_rad_s = 1.0 }";
    assert!(matches!(Bench::<Drive>::builder(wrong).build(), Err(OpenError::Config { .. })));
}

#[test]
fn it_slows_for_somebody_who_walks_towards_it_before_any_ranger_would() {
    let mut rig = Rig::new("");
    let walker = Track {
        state: TrackState::Confirmed as u32,
        motion: TrackMotion::Moving as u32,
        x_m: 1.6,
        velocity_x_m_s: -1.0,
        ..Track::default()
    };
    rig.drive(4.0);
    rig.bench.feed("tracks", at(rig.now_s), &Tracks::default(), &[walker]);
    let (command, state) = rig.drive(4.0);
    assert_eq!(command.velocity.linear_x_m_s, 0.25, "the track is old by now");
    assert_eq!(state.stop, Stop::None as u32);
    for _ in 0..20 {
        rig.base();
        rig.velocity(0.25);
        rig.ranges(4.0);
        rig.bench.feed("tracks", at(rig.now_s), &Tracks::default(), &[walker]);
        rig.step();
    }
    let (command, state) = rig.step();
    assert_eq!((command.velocity.linear_x_m_s, state.stop), (0.0, Stop::Zone as u32));
}
