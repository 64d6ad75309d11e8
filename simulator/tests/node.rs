//! The world as a node on the bench: what a driver at the other end of the line sees, and what is published.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

use drivers::p2os::conformance::{Server, check};
use drivers::p2os::protocol::{Argument, MAX_PACKET, command, encode_command};
use messages::Truth;
use runtime::{Bench, Device, Time};
use simulator::World;

const FIXTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/worlds");
const STEP_NS: u64 = 10_000_000;

/// The node, and the driver's end of its line.
struct Line {
    bench: Bench<World>,
    device: Device,
    now: Time,
}

impl Line {
    fn new(config: &str) -> Line {
        let bench = Bench::builder(config).files(FIXTURES).build().unwrap();
        let device = bench.links().client("base", None);
        Line { bench, device, now: Time::from_seconds(100.0) }
    }

    fn command(&mut self, number: u8, argument: Argument) {
        let mut out = [0; MAX_PACKET];
        let length = encode_command(&mut out, number, argument).unwrap();
        self.device.send(&out[..length]).unwrap();
    }

    fn truth(&self) -> (Time, Truth) {
        let (stamp, truth, _) = self.bench.read::<Truth>("truth").unwrap();
        (stamp, truth)
    }
}

impl Server for Line {
    fn send(&mut self, bytes: &[u8]) {
        self.device.send(bytes).unwrap();
    }

    fn receive(&mut self, bytes: &mut Vec<u8>) {
        let mut buffer = [0; 1024];
        loop {
            let count = self.device.receive(&mut buffer);
            if count == 0 {
                return;
            }
            bytes.extend_from_slice(&buffer[..count]);
        }
    }

    fn advance(&mut self, seconds: f64) {
        for _ in 0..(seconds * 100.0).round() as usize {
            self.now = self.now.after_ns(STEP_NS);
            self.bench.step(self.now).unwrap();
        }
    }
}

#[test]
fn a_driver_finds_a_pioneer_at_the_other_end_of_the_line() {
    let mut line = Line::new("world = 'plain.toml'");
    line.advance(0.05);
    check(&mut line).unwrap_or_else(|failure| panic!("{failure}"));
}

#[test]
fn the_truth_follows_the_body_and_knows_its_clearance() {
    let mut line = Line::new("world = 'plain.toml'\nbodies = [{ name = 'base', start = [6.0, 0.0, 0.0] }]");
    line.advance(0.1);
    for number in [0, 1, 2, command::OPEN] {
        line.command(number, Argument::None);
    }
    line.command(command::ENABLE, Argument::Integer(1));
    line.command(command::VEL, Argument::Integer(200));
    line.advance(1.0);
    let (stamp, truth) = line.truth();
    assert_eq!(stamp, line.now);
    assert!(truth.x_m > 6.05 && truth.velocity.linear_x_m_s > 0.15, "{truth:?}");
    assert!((truth.clearance_m - (9.0 - truth.x_m - 0.21)).abs() < 0.02, "{truth:?}");
    assert!((truth.distance_m - (truth.x_m - 6.0)).abs() < 0.01);
    assert_eq!(truth.contacts, [0; 3]);
}

#[test]
fn a_contact_is_published_once_with_its_cause() {
    let mut line = Line::new("world = 'plain.toml'\nbodies = [{ name = 'base', start = [8.0, 0.0, 0.0] }]");
    line.advance(0.1);
    for number in [0, 1, 2, command::OPEN] {
        line.command(number, Argument::None);
    }
    line.command(command::ENABLE, Argument::Integer(1));
    line.command(command::VEL, Argument::Integer(400));
    let mut seen = Vec::new();
    for _ in 0..300 {
        line.advance(0.01);
        line.command(command::PULSE, Argument::None);
        seen.extend(line.bench.read::<Truth>("truth").unwrap().2);
    }
    assert_eq!(seen.len(), 1, "{seen:?}");
    assert_eq!((seen[0].cause, line.truth().1.contacts), (0, [1, 0, 0]));
    assert!((seen[0].x_m - 9.0).abs() < 0.01);
}

#[test]
fn steps_between_the_grid_wait_for_it() {
    let mut line = Line::new("world = 'plain.toml'");
    line.advance(0.05);
    let (stamp, _) = line.truth();
    // A byte that arrives makes the node step at once; the world goes on at its next whole step.
    line.bench.step(line.now.after_ns(3_000_000)).unwrap();
    assert_eq!(line.truth().0, stamp);
    line.bench.step(line.now.after_ns(STEP_NS + 1)).unwrap();
    assert_eq!(line.truth().0, stamp.after_ns(STEP_NS));
}

#[test]
fn what_is_wrong_with_the_world_or_the_settings_is_said_at_opening() {
    let said = |config: &str| match Bench::<World>::builder(config).files(FIXTURES).build() {
        Ok(_) => panic!("{config} was taken"),
        Err(error) => error.to_string(),
    };
    assert!(said("world = 'gone.toml'").contains("gone.toml"));
    assert!(said("world = 'plain.toml'\nbodies = [{ name = 'base', model = 'p3dy' }]").contains("known are p3dx-sh"));
    let two = said("world = 'plain.toml'\nbodies = [{ name = 'base' }, { name = 'other' }]");
    assert!(two.contains("body 1 has no start"), "{two}");
    let unsound = said("world = 'plain.toml'\n[realism.sonar]\nlost = 2.0");
    assert!(unsound.contains("sonar.lost = 2"), "{unsound}");
}
