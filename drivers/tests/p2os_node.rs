//! The node on its bench, wired to a small robot.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::p2os::protocol::*;
use drivers::p2os::{Encoders, P2os};
use messages::{BaseState, Beam, Command, Done, Echo, Link, Message, Odometry, Ranges, Sound, Switch, Trigger, Twist};
use runtime::calls::TicketState;
use runtime::{Bench, Body, Device, Time};
use std::f64::consts::{FRAC_PI_6, PI};
use support::robot::{Phase, Robot};

const STEP_S: f64 = 0.01;

/// Node and robot, joined by a memory link, on a clock of 10 ms.
struct Rig {
    bench: Bench<P2os>,
    server: Device,
    robot: Robot,
    now: Time,
    /// What motion wants; published every 50 ms.
    wanted: Option<Command>,
    steps: u64,
    faults: u32,
}

impl Rig {
    fn new(config: &str, robot: Robot) -> Rig {
        let bench = Bench::<P2os>::builder(config).body(body()).max_age_s(0.3).build().unwrap();
        let server = bench.links().server(Bench::<P2os>::DEVICE, None);
        Rig { bench, server, robot, now: Time::from_seconds(100.0), wanted: None, steps: 0, faults: 0 }
    }

    fn step(&mut self) {
        self.now = self.now.after_s(STEP_S);
        self.robot.advance(STEP_S);
        let said = std::mem::take(&mut self.robot.out);
        if !said.is_empty() {
            let _ = self.server.send(&said);
        }
        if let Some(command) = self.wanted
            && self.steps.is_multiple_of(5)
        {
            self.bench.feed("command", self.now, &command, &[]);
        }
        self.steps += 1;
        self.faults += u32::from(self.bench.step(self.now).is_err());
        self.hear();
    }

    fn hear(&mut self) {
        let mut buffer = [0; 512];
        let count = self.server.receive(&mut buffer);
        self.robot.hear(&buffer[..count]);
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            self.step();
        }
    }

    fn run_until(&mut self, what: &str, until: impl Fn(&Rig) -> bool) {
        for _ in 0..3000 {
            if until(self) {
                return;
            }
            self.step();
        }
        panic!("30 s without: {what}; state {:?}", self.state());
    }

    /// Calls the node and steps it once: what it answered, or why it refused.
    fn call<Q: Message>(&mut self, command: &str, request: &Q) -> Result<(), String> {
        let ticket = self.bench.call(command, request);
        self.step();
        match self.bench.call_state(ticket) {
            TicketState::Answered(body) if body.len() == size_of::<Done>() => Ok(()),
            TicketState::Refused(why) => Err(format!("{why:?}")),
            other => panic!("{command}: {other:?}"),
        }
    }

    fn state(&self) -> BaseState {
        self.bench.read::<BaseState>("state").unwrap().1
    }

    fn link(&self) -> u32 {
        self.state().link
    }

    fn sonar(&self) -> (Time, Ranges, Vec<Beam>) {
        self.bench.read::<Ranges>("sonar").unwrap()
    }

    fn echoes(&self) -> Vec<u32> {
        self.sonar().2.iter().map(|beam| beam.echo).collect()
    }

    fn odometry(&self) -> Odometry {
        self.bench.read::<Odometry>("odometry").unwrap().1
    }
}

fn body() -> Body {
    Body {
        max_forward_m_s: 0.5,
        max_backward_m_s: 0.2,
        max_turn_rad_s: 1.5,
        acceleration_m_s2: 0.4,
        deceleration_m_s2: 0.6,
        turn_acceleration_rad_s2: 2.0,
        ..Body::default()
    }
}

fn go(forward_m_s: f64, turn_rad_s: f64) -> Option<Command> {
    let velocity = Twist { linear_x_m_s: forward_m_s, linear_y_m_s: 0.0, angular_z_rad_s: turn_rad_s };
    Some(Command { velocity, valid_for_s: 0.25, enable: 1 })
}

/// A robot that is up, with `config`.
fn up_with(config: &str) -> Rig {
    let mut rig = Rig::new(config, Robot::new("p3dx-sh"));
    rig.step();
    rig.run_until("link up", |rig| rig.link() == Link::Up as u32);
    rig.run(0.5);
    rig
}

fn up() -> Rig {
    up_with("")
}

/// A robot that drives at 0.3 m/s.
fn driving() -> Rig {
    let mut rig = up();
    rig.wanted = go(0.3, 0.0);
    rig.run_until("driving", |rig| rig.robot.motion() == (300, 0));
    rig
}

#[test]
fn the_state_shows_the_robot_as_it_is() {
    let mut rig = up();
    rig.robot.front_bumpers = 0b101;
    rig.run(0.3);
    let state = rig.state();
    assert!((state.battery_v - 12.5).abs() < 1e-9);
    assert_eq!((state.front_bumpers, state.rear_bumpers), (0b101, 0));
    assert_eq!((state.motors_enabled, state.sonar_enabled, state.stop_button), (0, 1, 0));
    assert_eq!((state.connections, state.checksum_errors, state.skipped_bytes), (1, 0, 0));
    assert!(state.charge.is_nan());
}

#[test]
fn the_robot_learns_its_limits_from_the_body() {
    let mut rig = up();
    rig.run(0.5);
    for expected in [
        (command::SETV, 500),
        (command::SETA, 400),
        (command::SETA, -600),
        (command::SETRV, 86),
        (command::SETRA, 115),
        (command::SETRA, -115),
        (command::SONAR, 1),
    ] {
        assert!(rig.robot.log.iter().any(|(_, number, value)| (*number, *value) == expected), "{expected:?}");
    }
    let mut own = up_with("sends_limits = false");
    own.run(0.5);
    assert!(!own.robot.numbers_since(0.0).contains(&command::SETV));
}

#[test]
fn nothing_moves_before_a_command_asks_for_motors() {
    let mut rig = up();
    rig.wanted = Some(Command { enable: 0, ..go(0.3, 0.5).unwrap() });
    rig.run(2.0);
    assert!(!rig.robot.motors);
    assert!(rig.robot.log.iter().all(|(_, number, value)| *number != command::VEL || *value == 0));
}

#[test]
fn a_command_reaches_the_wheels_and_odometry_follows() {
    let mut rig = up();
    rig.wanted = go(0.3, FRAC_PI_6);
    rig.run_until("motion", |rig| rig.robot.motion() == (300, 30));
    assert_eq!(rig.state().motors_enabled, 1);
    rig.run(0.5);
    let velocity = rig.odometry().velocity;
    assert!((velocity.linear_x_m_s - 0.3).abs() < 0.002, "{velocity:?}");
    assert!((velocity.angular_z_rad_s - FRAC_PI_6).abs() < 0.002, "{velocity:?}");
    let before = rig.odometry().heading_rad;
    rig.run(1.0);
    let turned = runtime::math::wrap_angle(rig.odometry().heading_rad - before);
    assert!((turned - FRAC_PI_6).abs() < 0.07, "{turned}");
}

#[test]
fn the_watchdog_is_fed_by_repeated_velocities() {
    let mut rig = driving();
    let from_s = rig.robot.now_s;
    rig.run(10.0);
    assert_eq!(rig.robot.motion(), (300, 0));
    let numbers = rig.robot.numbers_since(from_s);
    assert!(!numbers.contains(&command::PULSE));
    let speeds = numbers.iter().filter(|number| **number == command::VEL).count();
    assert!((50..=80).contains(&speeds), "{speeds} times VEL in 10 s");
}

#[test]
fn a_stale_command_stops_the_robot() {
    let mut rig = driving();
    let from_s = rig.robot.now_s;
    rig.wanted = None;
    rig.run_until("standing", |rig| rig.robot.motion() == (0, 0));
    // Valid for 0.25 s, published up to 50 ms ago.
    assert!(rig.robot.now_s - from_s < 0.35, "{}", rig.robot.now_s - from_s);
    rig.run(5.0);
    assert_eq!(rig.robot.motion(), (0, 0));
    assert!(!rig.robot.is_watchdog_stopped(), "it stands because it was told to");
}

#[test]
fn a_command_that_outlives_its_sample_is_stopped_by_the_age_of_the_sample() {
    let mut rig = driving();
    rig.wanted = Some(Command { valid_for_s: 1e9, ..go(0.3, 0.0).unwrap() });
    rig.run(0.1);
    rig.wanted = None;
    rig.run(0.5);
    assert_eq!(rig.robot.motion(), (0, 0));
}

#[test]
fn numbers_that_are_none_stop_the_robot() {
    for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for command in
            [go(odd, 0.0).unwrap(), go(0.3, odd).unwrap(), Command { valid_for_s: f64::NAN, ..go(0.3, 0.0).unwrap() }]
        {
            let mut rig = driving();
            rig.wanted = Some(command);
            rig.run(0.3);
            assert_eq!(rig.robot.motion(), (0, 0), "{command:?}");
            assert!(rig.faults > 0);
        }
    }
}

#[test]
fn a_command_from_the_future_would_never_become_stale_and_stops_the_robot() {
    let mut rig = driving();
    assert_eq!(rig.faults, 0);
    rig.wanted = None;
    rig.bench.feed("command", rig.now.after_s(3600.0), &go(0.3, 0.0).unwrap(), &[]);
    rig.run(0.5);
    assert_eq!(rig.robot.motion(), (0, 0));
    assert!(rig.faults > 0);
}

#[test]
fn speeds_are_cut_to_what_the_robot_says_it_can() {
    let mut rig = up();
    rig.wanted = go(9.0, -90.0);
    rig.run(1.0);
    assert_eq!(rig.robot.motion(), (1500, -300), "the configuration's tops");
}

#[test]
fn sonars_of_several_packets_make_one_ring() {
    let mut rig = up();
    rig.robot.ranges = std::array::from_fn(|number| 1000 + 100 * number as u16);
    rig.robot.ranges[5] = 5000;
    rig.run(0.6);
    let (stamp, ranges, beams) = rig.sonar();
    assert_eq!(beams.len(), 16);
    assert!(rig.now.since(stamp) < 0.11);
    for (number, beam) in beams.iter().enumerate() {
        let (echo, range_m) = if number == 5 { (Echo::Clear, 5.0) } else { (Echo::Value, 1.0 + 0.1 * number as f32) };
        assert_eq!(beam.echo, echo as u32, "beam {number}");
        assert!((beam.range_m - range_m).abs() < 1e-6, "beam {number}: {}", beam.range_m);
        assert!((0.0..0.31).contains(&beam.age_s), "beam {number}: {} s old", beam.age_s);
    }
    assert!(ranges.span_s > 0.05, "not all beams are of one moment");
    assert!(beams[0].bearing_rad > 1.5 && beams[8].bearing_rad < -1.5);
}

#[test]
fn one_array_only_is_published_where_only_one_is_fitted() {
    let mut rig = up_with("sonar_arrays = [\"front\"]");
    rig.run(0.5);
    assert_eq!(rig.sonar().2.len(), 8);
}

#[test]
fn sonar_poses_and_factors_come_from_the_robot_file_where_it_has_them() {
    let poses: Vec<String> =
        (0..16).map(|number| format!("{{ x_m = 0.{number:02}, y_m = 0.0, bearing_rad = 1.0 }}")).collect();
    let config = format!("model = \"p3dx\"\nsonar_poses = [{}]\nconversion.range_m_per_unit = 0.002", poses.join(","));
    let mut rig = up_with(&config);
    rig.run(0.6);
    let beam = rig.sonar().2[7];
    assert!((beam.origin_x_m - 0.07).abs() < 1e-6 && (beam.bearing_rad - 1.0).abs() < 1e-6);
    assert!((beam.range_m - 4.0).abs() < 1e-6, "2000 units");
}

#[test]
fn a_lost_link_says_so_on_every_path_and_comes_back_without_moving_by_itself() {
    let mut rig = driving();
    let link = rig.bench.links().link(Bench::<P2os>::DEVICE).unwrap();
    link.set_up(false);
    rig.wanted = None;
    rig.run(0.05);
    assert_eq!(rig.link(), Link::Lost as u32);
    assert!(rig.echoes().iter().all(|echo| *echo == Echo::LinkLost as u32));
    let mut stamps = Vec::new();
    for _ in 0..300 {
        rig.step();
        stamps.push(rig.sonar().0);
    }
    stamps.dedup();
    assert!(stamps.len() >= 6, "published {} times in 3 s", stamps.len());
    assert!(stamps.is_sorted());
    assert!(rig.state().battery_v.is_nan());
    link.set_up(true);
    rig.run_until("link up", |rig| rig.link() == Link::Up as u32);
    rig.run(2.0);
    assert_eq!(rig.state().connections, 2);
    assert!(rig.echoes().iter().all(|echo| *echo == Echo::Value as u32));
    assert_eq!((rig.robot.motion(), rig.robot.motors), ((0, 0), false));
    assert_eq!(rig.odometry().origin, 1, "nobody knows where it went meanwhile");
    rig.wanted = go(0.2, 0.0);
    rig.run_until("driving again", |rig| rig.robot.motion() == (200, 0));
}

#[test]
fn after_a_loss_the_robot_waits_for_the_operator_where_the_robot_file_says_so() {
    let mut rig = up_with("after_loss = \"operator\"");
    rig.wanted = go(0.3, 0.0);
    rig.run_until("driving", |rig| rig.robot.motion() == (300, 0));
    rig.robot.power_cycle();
    rig.run(5.0);
    assert_eq!(rig.link(), Link::Up as u32);
    assert!(!rig.robot.motors);
}

#[test]
fn a_restarted_driver_stops_a_driving_robot_before_anything_else() {
    let mut first = driving();
    let mut rig = Rig::new("", std::mem::replace(&mut first.robot, Robot::new("p3dx-sh")));
    drop(first);
    rig.robot.log.clear();
    rig.run_until("first words", |rig| !rig.robot.log.is_empty());
    assert_eq!(rig.robot.log[0].1, command::STOP);
    assert_eq!(rig.robot.motion(), (0, 0));
    rig.run_until("link up", |rig| rig.link() == Link::Up as u32);
    rig.run(3.0);
    assert_eq!(rig.robot.motion(), (0, 0));
}

#[test]
fn a_restarted_driver_does_not_wake_a_robot_that_its_watchdog_stopped() {
    let mut first = driving();
    let mut robot = std::mem::replace(&mut first.robot, Robot::new("p3dx-sh"));
    for _ in 0..300 {
        robot.advance(0.01);
    }
    robot.out.clear();
    assert!(robot.is_watchdog_stopped());
    let before_mm = robot.x_mm;
    let mut rig = Rig::new("", robot);
    rig.run(3.0);
    assert_eq!(rig.link(), Link::Up as u32);
    assert_eq!(rig.robot.x_mm, before_mm, "it did not resume its old motion");
}

#[test]
fn an_ordered_stop_leaves_the_robot_standing_and_free() {
    let mut rig = driving();
    rig.bench.stop(rig.now);
    rig.hear();
    let last: Vec<_> = rig.robot.log.iter().rev().take(3).map(|(_, number, value)| (*number, *value)).collect();
    assert_eq!(last, [(command::CLOSE, 1), (command::ENABLE, 0), (command::STOP, 0)]);
    assert_eq!(rig.robot.phase, Phase::Sync(0));
}

#[test]
fn somebody_at_the_robots_motor_button_outranks_the_flow() {
    let mut rig = driving();
    rig.robot.motors = false;
    rig.run(5.0);
    assert_eq!((rig.robot.motors, rig.state().motors_enabled), (false, 0));
    rig.wanted = Some(Command { enable: 0, ..go(0.0, 0.0).unwrap() });
    rig.run(0.2);
    rig.wanted = go(0.1, 0.0);
    rig.run_until("driving again", |rig| rig.robot.motion() == (100, 0));
}

#[test]
fn damaged_packets_are_counted_and_nothing_else_happens() {
    let mut rig = driving();
    let link = rig.bench.links().link(Bench::<P2os>::DEVICE).unwrap();
    let mut count = 0u32;
    link.set_fault(move |_, direction, byte| {
        count += 1;
        match direction {
            runtime::device::Direction::ToClient if count.is_multiple_of(311) => Some(byte ^ 0x40),
            runtime::device::Direction::ToClient if count.is_multiple_of(197) => None,
            _ => Some(byte),
        }
    });
    rig.run(20.0);
    let state = rig.state();
    assert!(state.checksum_errors > 10, "{state:?}");
    assert!(state.skipped_bytes > 0);
    assert_eq!((state.link, state.connections), (Link::Up as u32, 1));
    assert_eq!(rig.robot.motion(), (300, 0));
}

#[test]
fn encoders_are_written_where_the_robot_file_asks_for_them() {
    let mut rig = up_with("encoders = true");
    rig.wanted = go(0.2, 0.0);
    rig.run(2.0);
    let (_, ticks, _) = rig.bench.read::<Encoders>("encoders").unwrap();
    assert!(ticks.left_ticks > 1000, "{ticks:?}");
    assert!(up().bench.read::<Encoders>("encoders").is_none());
}

#[test]
fn the_model_follows_the_robots_own_word_unless_the_robot_file_names_it() {
    let way = |config: &str| {
        let mut rig = Rig::new(config, Robot::new("p3dx"));
        rig.step();
        rig.run_until("link up", |rig| rig.link() == Link::Up as u32);
        rig.wanted = go(0.4, 0.0);
        rig.run_until("driving", |rig| rig.robot.motion() == (400, 0));
        let (told, before_mm) = (rig.odometry().x_m, rig.robot.x_mm);
        rig.run(2.0);
        (rig.odometry().x_m - told) / (rig.robot.x_mm - before_mm)
    };
    assert!((way("") - 0.000_485).abs() < 0.000_03);
    assert!((way("model = \"P3DX-SH\"") - 0.001).abs() < 0.000_06);
}

#[test]
fn a_robot_that_nobody_knows_is_called_foreign() {
    let mut rig = Rig::new("", Robot::new("seekur"));
    rig.run(5.0);
    assert_eq!(rig.link(), Link::Foreign as u32);
    assert_ne!(rig.robot.phase, Phase::Running);
}

#[test]
fn settings_out_of_bounds_are_refused_with_what_would_be_right() {
    for (config, expected) in [
        ("model = \"p3at\"", "known: p3dx-sh, p3dx, jackal, auto"),
        ("repeat_ms = 5000.0", "20 to 1000"),
        ("pulse_ms = nan", "50 to 1900"),
        ("hunt_bauds = [1200]", "9600"),
        ("bumper_stop = 9", "0 nothing"),
        ("sonar_poses = [{ x_m = 0.0, y_m = 0.0, bearing_rad = 0.0 }]", "all 16 or none"),
        ("conversion.distance_m_per_unit = -1.0", "above 0"),
        ("drift.way_m2_per_m = nan", "between 0 and 1"),
        ("device = \"seriel:/dev/ttyUSB0\"", "did you mean"),
        ("colour = \"red\"", "unknown field"),
    ] {
        let Err(error) = Bench::<P2os>::builder(config).build() else { panic!("{config} was accepted") };
        assert!(error.to_string().contains(expected), "{config}: {error}");
    }
}

#[test]
fn small_turn_rates_stay_alive() {
    let mut rig = up();
    rig.wanted = go(0.0, 0.4 * PI / 180.0);
    rig.run(1.0);
    assert_eq!(rig.robot.motion(), (0, 1));
}

const ON: Switch = Switch { on: 1 };
const OFF: Switch = Switch { on: 0 };
const NOW: Trigger = Trigger { unused: 0 };

#[test]
fn the_operator_can_take_the_motors_away_and_give_them_back() {
    let mut rig = driving();
    rig.call("enable", &OFF).unwrap();
    rig.run(2.0);
    assert!(!rig.robot.motors, "although commands ask for them");
    rig.call("enable", &ON).unwrap();
    rig.run_until("driving again", |rig| rig.robot.motion() == (300, 0));
}

#[test]
fn the_operators_stop_holds_until_the_operator_enables() {
    let mut rig = driving();
    rig.call("stop", &NOW).unwrap();
    rig.run(0.1);
    assert_eq!(rig.robot.motion(), (0, 0));
    rig.run(3.0);
    assert_eq!((rig.robot.motion(), rig.robot.motors), ((0, 0), true), "it holds its place");
    rig.call("enable", &ON).unwrap();
    rig.run_until("driving again", |rig| rig.robot.motion() == (300, 0));
}

#[test]
fn the_operators_off_and_stop_survive_a_lost_link() {
    for command in ["stop", "enable"] {
        let mut rig = driving();
        match command {
            "stop" => rig.call("stop", &NOW).unwrap(),
            _ => rig.call("enable", &OFF).unwrap(),
        }
        rig.robot.power_cycle();
        rig.run_until("second connection", |rig| rig.state().connections == 2);
        rig.run(2.0);
        assert_eq!(rig.robot.motion(), (0, 0), "{command}");
    }
}

#[test]
fn sonars_that_are_switched_off_say_so() {
    let mut rig = up();
    rig.call("switch_sonar", &OFF).unwrap();
    rig.run(0.5);
    assert!(!rig.robot.sonar);
    assert!(rig.echoes().iter().all(|echo| *echo == Echo::Off as u32));
    assert_eq!(rig.state().sonar_enabled, 0);
    rig.robot.power_cycle();
    rig.run_until("second connection", |rig| rig.state().connections == 2);
    rig.run(1.0);
    assert!(!rig.robot.sonar, "also of a robot that was switched off and on");
    rig.call("switch_sonar", &ON).unwrap();
    rig.run(2.0);
    assert!(rig.echoes().iter().all(|echo| *echo == Echo::Value as u32));
}

#[test]
fn the_operators_origin_is_where_the_robot_is() {
    let mut rig = driving();
    rig.run(2.0);
    assert!(rig.odometry().x_m > 0.5);
    let here_mm = rig.robot.x_mm;
    rig.call("set_origin", &NOW).unwrap();
    rig.run(1.0);
    assert!(rig.robot.numbers_since(0.0).contains(&command::SETO));
    assert!(rig.robot.x_mm < here_mm, "the robot's own counters fell to zero");
    let odometry = rig.odometry();
    assert!((odometry.x_m - 0.3).abs() < 0.04, "{} m since a second", odometry.x_m);
    assert_eq!(odometry.origin, 1);
}

#[test]
fn a_tone_is_sent_and_one_that_cannot_be_is_refused_with_the_reason() {
    let mut rig = up();
    rig.call("sound", &Sound { note: 60, duration_s: 0.1 }).unwrap();
    rig.run(0.1);
    assert!(rig.robot.numbers_since(0.0).contains(&command::SAY));
    for (sound, reason) in [
        (Sound { note: 128, duration_s: 0.1 }, "127"),
        (Sound { note: 60, duration_s: f64::NAN }, "5.1"),
        (Sound { note: 60, duration_s: 60.0 }, "5.1"),
    ] {
        let why = rig.call("sound", &sound).unwrap_err();
        assert!(why.contains(reason), "{why}");
    }
}

#[test]
fn what_a_robot_that_is_not_there_cannot_do_is_refused() {
    let mut robot = Robot::new("p3dx-sh");
    robot.is_mute = true;
    let mut rig = Rig::new("", robot);
    rig.run(1.0);
    assert_eq!(rig.link(), Link::Silent as u32);
    assert!(rig.call("enable", &ON).unwrap_err().contains("not connected"));
    assert!(rig.call("set_origin", &NOW).unwrap_err().contains("not connected"));
    assert!(rig.call("sound", &Sound { note: 60, duration_s: 0.1 }).unwrap_err().contains("not connected"));
    // Whoever wants it safe is heard at any time.
    rig.call("stop", &NOW).unwrap();
    rig.call("enable", &OFF).unwrap();
}
