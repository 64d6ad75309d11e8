//! The session against a small robot, a recorded one, none, and everything else that a port may bring.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::p2os::protocol::*;
use drivers::p2os::session::*;
use messages::Link;
use runtime::Time;
use support::recording;
use support::robot::{Phase, Robot};

const STEP_S: f64 = 0.01;

/// Session and robot, joined by a cable, on a clock of 10 ms.
struct Bench {
    session: Session,
    robot: Robot,
    now: Time,
    connected: usize,
    sips: usize,
    configs: usize,
    encoders: usize,
    demands: Vec<Demand>,
    /// Whether pulses are sent, as the node does.
    pulses: bool,
}

impl Bench {
    fn new(config: SessionConfig, robot: Robot) -> Bench {
        let mut bench = Bench {
            session: Session::new(config),
            robot,
            now: Time::from_seconds(10.0),
            connected: 0,
            sips: 0,
            configs: 0,
            encoders: 0,
            demands: Vec::new(),
            pulses: true,
        };
        bench.session.port(bench.now, Port::Open(1));
        bench
    }

    fn step(&mut self) {
        self.now = self.now.after_s(STEP_S);
        self.robot.advance(STEP_S);
        let bytes = std::mem::take(&mut self.robot.out);
        self.feed(&bytes);
        let mut out = [0; MAX_PACKET];
        let length = match self.session.next_queued(self.now, &mut out) {
            None if self.pulses => self.session.next_pulse(self.now, &mut out),
            length => length,
        };
        if let Some(length) = length {
            self.robot.hear(&out[..length]);
        }
    }

    fn feed(&mut self, bytes: &[u8]) {
        let Bench { connected, sips, configs, encoders, .. } = self;
        let mut count = |event: Event| match event {
            Event::Connected(_) => *connected += 1,
            Event::Sip(_) => *sips += 1,
            Event::Config(_) => *configs += 1,
            Event::Encoder(_) => *encoders += 1,
            Event::Other(_) => {}
        };
        self.session.receive(self.now, bytes, &mut count);
        self.demands.extend(self.session.tick(self.now, &mut count));
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            self.step();
        }
    }

    fn run_until(&mut self, what: &str, until: impl Fn(&Bench) -> bool) {
        for _ in 0..2000 {
            if until(self) {
                return;
            }
            self.step();
        }
        panic!("20 s without: {what}; link {:?}", self.session.link());
    }
}

fn running() -> Bench {
    let mut bench = Bench::new(SessionConfig::default(), Robot::new("p3dx-sh"));
    bench.run_until("running", |bench| bench.session.is_running());
    bench
}

#[test]
fn a_fresh_robot_is_opened_in_the_order_of_the_manual() {
    let mut bench = running();
    bench.run(0.5);
    let numbers = bench.robot.numbers_since(0.0);
    let start = [command::STOP, command::SYNC0, command::SYNC1, command::SYNC2, command::OPEN];
    assert_eq!(numbers[..5], start);
    assert_eq!(bench.session.link(), Link::Up);
    assert_eq!(bench.session.identity().subclass.as_str(), "p3dx-sh");
    assert_eq!((bench.connected, bench.session.connections(), bench.configs), (1, 1, 1));
    assert!(bench.sips >= 5);
}

#[test]
fn the_motors_of_a_robot_that_was_just_opened_are_off() {
    let mut bench = running();
    bench.run(3.0);
    assert!(!bench.robot.motors);
    assert!(!bench.robot.numbers_since(0.0).contains(&command::ENABLE));
}

#[test]
fn a_robot_that_drives_in_an_old_session_is_stopped_before_anything_feeds_its_watchdog() {
    for stopped_by_watchdog in [false, true] {
        let mut robot = Robot::new("p3dx-sh");
        (robot.phase, robot.motors, robot.velocity) = (Phase::Running, true, 400);
        if stopped_by_watchdog {
            robot.advance(3.0);
            assert!(robot.is_watchdog_stopped());
        }
        let before_mm = robot.x_mm;
        let began_s = robot.now_s;
        let mut bench = Bench::new(SessionConfig::default(), robot);
        bench.run_until("running", |bench| bench.session.is_running());
        assert_eq!(bench.robot.numbers_since(began_s)[0], command::STOP);
        assert!(bench.robot.numbers_since(began_s).contains(&command::CLOSE));
        let way_mm = bench.robot.x_mm - before_mm;
        // One step passes before the STOP arrives.
        assert!(way_mm <= if stopped_by_watchdog { 0.0 } else { 400.0 * STEP_S }, "{way_mm} mm");
        bench.run(5.0);
        assert_eq!(bench.session.link(), Link::Up);
        assert_eq!(bench.robot.motion(), (0, 0));
    }
}

#[test]
fn a_moving_robot_answers_with_the_other_type_and_is_closed_too() {
    let mut robot = Robot::new("p3dx-sh");
    (robot.phase, robot.motors, robot.velocity) = (Phase::Running, true, 400);
    robot.watchdog_s = f64::INFINITY;
    let mut bench = Bench::new(SessionConfig::default(), robot);
    // The robot does not hear the STOP, so that its packets are of type 0x33.
    bench.session.next_queued(bench.now, &mut [0; MAX_PACKET]);
    bench.run_until("running", |bench| bench.session.is_running());
    assert!(bench.robot.numbers_since(0.0).contains(&command::CLOSE));
}

#[test]
fn pulse_keeps_the_watchdog_fed_and_is_the_only_traffic() {
    let mut bench = running();
    bench.run(1.0);
    let from_s = bench.robot.now_s;
    bench.run(10.0);
    let numbers = bench.robot.numbers_since(from_s);
    assert!(numbers.iter().all(|number| *number == command::PULSE), "{numbers:?}");
    assert!((15..=18).contains(&numbers.len()), "{} pulses in 10 s", numbers.len());
    assert!(!bench.robot.is_watchdog_stopped());
}

#[test]
fn a_shorter_watchdog_is_fed_more_often() {
    let mut bench = running();
    bench.robot.config.as_mut().unwrap().watchdog_ms = 300;
    bench.run(5.0);
    // The configuration was asked for when the session began; ask again.
    assert!(bench.session.enqueue(command::CONFIG, Argument::Integer(1)));
    bench.run(0.2);
    let from_s = bench.robot.now_s;
    bench.run(3.0);
    assert!(bench.robot.numbers_since(from_s).len() >= 27);
}

#[test]
fn a_command_takes_the_place_of_a_pulse() {
    let mut bench = running();
    bench.run(1.0);
    let from_s = bench.robot.now_s;
    for _ in 0..20 {
        assert!(bench.session.enqueue(command::VEL, Argument::Integer(100)));
        bench.run(0.4);
    }
    assert!(!bench.robot.numbers_since(from_s).contains(&command::PULSE));
}

#[test]
fn commands_keep_their_distance() {
    let mut bench = running();
    for speed in 0..10 {
        assert!(bench.session.enqueue(command::VEL, Argument::Integer(speed)));
    }
    let mut out = [0; MAX_PACKET];
    let mut sent = Vec::new();
    for _ in 0..200 {
        bench.now = bench.now.after_s(0.001);
        if bench.session.next_queued(bench.now, &mut out).is_some() {
            sent.push(bench.now.seconds());
        }
        assert!(bench.session.next_queued(bench.now, &mut out).is_none(), "two commands at one instant");
    }
    assert!(sent.len() >= 10);
    assert!(sent.windows(2).all(|pair| pair[1] - pair[0] > 0.0049), "{sent:?}");
}

#[test]
fn a_slow_line_spaces_commands_by_their_length() {
    let config = SessionConfig { line_baud: Some(9600), ..SessionConfig::default() };
    let mut bench = Bench::new(config, Robot::new("p3dx-sh"));
    bench.run_until("running", |bench| bench.session.is_running());
    bench.run(0.5);
    bench.session.enqueue(command::VEL, Argument::Integer(1));
    bench.session.enqueue(command::VEL, Argument::Integer(2));
    let mut out = [0; MAX_PACKET];
    assert_eq!(bench.session.next_queued(bench.now, &mut out), Some(9));
    assert_eq!(bench.session.next_queued(bench.now.after_s(0.009), &mut out), None, "9 bytes take 9.4 ms");
    assert_eq!(bench.session.next_queued(bench.now.after_s(0.010), &mut out), Some(9));
}

#[test]
fn a_lost_echo_costs_a_time_out_not_the_connection() {
    for lost in 0..5 {
        let mut bench = Bench::new(SessionConfig::default(), Robot::new("p3dx-sh"));
        let mut answers = 0;
        for _ in 0..1000 {
            bench.step();
            if !bench.robot.out.is_empty() {
                if answers == lost {
                    bench.robot.out.clear();
                }
                answers += 1;
            }
        }
        assert_eq!(bench.session.link(), Link::Up, "answer {lost} lost");
    }
}

#[test]
fn a_lost_command_of_the_handshake_costs_a_time_out_not_the_connection() {
    for lost in 0..6 {
        let mut bench = Bench::new(SessionConfig::default(), Robot::new("p3dx-sh"));
        for _ in 0..1000 {
            let heard = bench.robot.log.len();
            bench.robot.is_mute = heard == lost && bench.robot.now_s < 0.3;
            bench.step();
        }
        assert_eq!(bench.session.link(), Link::Up, "command {lost} lost");
    }
}

#[test]
fn a_robot_that_falls_silent_is_said_to_be_and_is_found_again() {
    let mut bench = running();
    bench.robot.is_mute = true;
    bench.run(0.9);
    assert_eq!(bench.session.link(), Link::Up);
    bench.run(0.3);
    assert_eq!(bench.session.link(), Link::Silent);
    assert!(!bench.session.is_running());
    assert!(!bench.session.enqueue(command::VEL, Argument::Integer(1)), "no command for a silent robot");
    bench.run(10.0);
    assert!(bench.demands.contains(&Demand::Reopen), "a port that stays silent is opened anew");
    bench.robot.is_mute = false;
    bench.run_until("running", |bench| bench.session.is_running());
    assert_eq!((bench.session.link(), bench.session.connections()), (Link::Up, 2));
}

#[test]
fn a_robot_that_was_switched_off_and_on_is_shaken_hands_with_at_once() {
    let mut bench = running();
    bench.run(1.0);
    bench.robot.power_cycle();
    let from_s = bench.robot.now_s;
    // The next PULSE is echoed as SYNC0: no need to wait for the second of silence.
    bench.run_until("running anew", |bench| bench.connected == 2);
    assert!(bench.robot.now_s - from_s < 1.0, "{}", bench.robot.now_s - from_s);
    assert!(!bench.robot.motors);
}

#[test]
fn a_port_without_a_robot_is_silent_and_its_speeds_are_tried_in_turn() {
    let mut robot = Robot::new("p3dx-sh");
    robot.is_mute = true;
    let config = SessionConfig { hunt_bauds: vec![9600, 38400, 115_200], ..SessionConfig::default() };
    let mut bench = Bench::new(config, robot);
    assert_eq!(bench.session.link(), Link::Connecting);
    bench.run(5.2);
    assert_eq!(bench.session.link(), Link::Silent);
    let expected = [38400, 115_200, 9600].map(Demand::Baud);
    assert_eq!(bench.demands[..3], expected);
    assert_eq!(bench.demands[3], Demand::Reopen, "all were tried");
}

#[test]
fn something_else_at_the_port_is_called_foreign() {
    let mut robot = Robot::new("p3dx-sh");
    robot.is_mute = true;
    let mut bench = Bench::new(SessionConfig::default(), robot);
    for _ in 0..100 {
        bench.step();
        bench.feed(b"$GPGGA,123519,4807.038,N*47\r\n");
    }
    assert_eq!(bench.session.link(), Link::Foreign);
}

#[test]
fn a_robot_of_an_unknown_model_is_not_opened() {
    let config = SessionConfig { knows: |identity| identity.subclass.as_str() == "p3dx", ..SessionConfig::default() };
    let mut bench = Bench::new(config, Robot::new("seekur"));
    bench.run(8.0);
    assert_eq!(bench.session.link(), Link::Foreign);
    assert_eq!(bench.session.identity().subclass.as_str(), "seekur");
    assert_ne!(bench.robot.phase, Phase::Running);
    assert_eq!(bench.connected, 0);
}

#[test]
fn a_lost_port_says_so_and_a_new_one_is_shaken_hands_with() {
    let mut bench = running();
    bench.session.port(bench.now, Port::Closed);
    assert_eq!(bench.session.link(), Link::Lost);
    assert!(!bench.session.may_send(bench.now.after_s(1.0)));
    bench.session.port(bench.now, Port::Opening);
    assert_eq!(bench.session.link(), Link::Lost, "while it is being opened the reason stays");
    bench.session.port(bench.now, Port::Open(2));
    assert_eq!(bench.session.link(), Link::Connecting);
    let from_s = bench.robot.now_s;
    bench.run_until("running anew", |bench| bench.connected == 2);
    assert_eq!(bench.robot.numbers_since(from_s)[0], command::STOP);
    let mut never = Session::new(SessionConfig::default());
    never.port(bench.now, Port::Opening);
    assert_eq!(never.link(), Link::Connecting);
    never.port(bench.now, Port::Closed);
    assert_eq!(never.link(), Link::NoPort);
}

#[test]
fn a_silent_robot_stays_silent_while_its_port_is_opened_anew() {
    let mut bench = running();
    bench.robot.is_mute = true;
    bench.run_until("demand", |bench| bench.demands.contains(&Demand::Reopen));
    for port in [Port::Closed, Port::Opening, Port::Open(2)] {
        bench.session.port(bench.now, port);
        assert_eq!(bench.session.link(), Link::Silent, "{port:?}");
    }
    bench.run_until("demand", |bench| bench.demands.iter().filter(|d| **d == Demand::Reopen).count() == 2);
    // A further try at a port that is not there changes nothing until it is open.
    let rest = [
        (Port::Opening, Link::Silent),
        (Port::Closed, Link::NoPort),
        (Port::Opening, Link::NoPort),
        (Port::Open(3), Link::Connecting),
    ];
    for (port, link) in rest {
        bench.session.port(bench.now, port);
        assert_eq!(bench.session.link(), link, "{port:?}");
    }
}

#[test]
fn a_port_that_was_reopened_between_two_steps_is_noticed_by_its_number() {
    let mut bench = running();
    bench.session.port(bench.now, Port::Open(2));
    assert!(!bench.session.is_running());
    assert_eq!(bench.session.link(), Link::Connecting);
}

#[test]
fn a_packet_that_stops_half_way_does_not_swallow_the_next() {
    let mut bench = running();
    bench.run(0.35);
    let sips = bench.sips;
    bench.feed(&[0xFA, 0xFB, 200, 0x32, 0]);
    bench.run(1.0);
    // The first SIP behind it completes nothing: it is found again after the pause that gives the torso up.
    assert!(bench.sips - sips >= 9, "{}", bench.sips - sips);
    assert_eq!(bench.session.link(), Link::Up);
}

#[test]
fn the_recorded_robot_is_shaken_hands_with_and_its_packets_are_handed_on() {
    let mut session = Session::new(SessionConfig::default());
    let mut sent: Vec<Vec<u8>> = Vec::new();
    let (mut sips, mut configs, mut others) = (0, 0, 0);
    let (mut now, mut out) = (Time::from_seconds(1.0), [0; MAX_PACKET]);
    session.port(now, Port::Open(1));
    let start = now;
    for line in recording::lines().iter().filter(|line| line.from == recording::From::Robot) {
        // The clock goes to the line's time in steps, so that the session can say its part before.
        while now.since(start) < line.at_s {
            now = now.after_s(0.005);
            session.tick(now, |_| {});
            if let Some(length) = session.next_queued(now, &mut out) {
                sent.push(out[3..length - 2].to_vec());
            }
        }
        session.receive(now, &line.bytes, |event| match event {
            Event::Sip(_) => sips += 1,
            Event::Config(_) => configs += 1,
            Event::Other(_) => others += 1,
            _ => {}
        });
    }
    assert_eq!(sent[..4], [vec![29], vec![0], vec![1], vec![2]], "STOP, then the handshake");
    assert_eq!(sent[4], [command::OPEN, KIND_POSITIVE, 1, 0], "the very bytes of the vendor's client");
    assert_eq!(session.identity().name.as_str(), "AMRISim");
    assert_eq!((session.link(), session.connections()), (Link::Up, 1));
    assert_eq!((sips, configs, others), (191, 1, 1116));
    assert_eq!((session.framer().checksum_errors(), session.framer().skipped_bytes()), (0, 0));
}
