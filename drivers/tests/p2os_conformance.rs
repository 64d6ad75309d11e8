//! The conformance suite: the tests' own robot passes, and each kind of wrong robot fails where it is wrong.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::p2os::conformance::{Failure, Server, check};
use drivers::p2os::protocol::*;
use support::robot::Robot;

/// The tests' robot behind a wire that may spoil what it says or hears.
struct Wire {
    robot: Robot,
    hears: fn(&[u8]) -> Vec<u8>,
    says: fn(Vec<u8>) -> Vec<u8>,
}

impl Server for Wire {
    fn send(&mut self, bytes: &[u8]) {
        let heard = (self.hears)(bytes);
        self.robot.hear(&heard);
    }

    fn receive(&mut self, bytes: &mut Vec<u8>) {
        bytes.extend((self.says)(std::mem::take(&mut self.robot.out)));
    }

    fn advance(&mut self, seconds: f64) {
        self.robot.advance(seconds);
    }
}

fn robot() -> Robot {
    let mut robot = Robot::new("p3dx-sh");
    let config = robot.config.as_mut().unwrap();
    (config.class, config.subclass) = ("Pioneer".into(), "P3DX-SH".into());
    (config.rotation_acceleration_top, config.translation_acceleration_top) = (300, 2000);
    robot
}

fn run(robot: Robot, hears: fn(&[u8]) -> Vec<u8>, says: fn(Vec<u8>) -> Vec<u8>) -> Result<(), Failure> {
    check(&mut Wire { robot, hears, says })
}

#[test]
fn a_right_robot_passes() {
    run(robot(), <[u8]>::to_vec, |said| said).unwrap();
}

#[test]
fn a_robot_that_cannot_turn_fails_where_it_should_turn() {
    let deaf_to_turns = |bytes: &[u8]| if bytes.get(3) == Some(&command::RVEL) { Vec::new() } else { bytes.to_vec() };
    let failure = run(robot(), deaf_to_turns, |said| said).unwrap_err();
    assert!(failure.check.contains("RVEL"), "{failure}");
}

#[test]
fn a_robot_without_watchdog_fails_where_it_should_stop() {
    let mut endless = robot();
    endless.watchdog_s = f64::INFINITY;
    let failure = run(endless, <[u8]>::to_vec, |said| said).unwrap_err();
    assert!(failure.check.contains("nobody speaks"), "{failure}");
}

#[test]
fn a_robot_whose_configuration_is_all_zeros_fails_there() {
    let mut empty = robot();
    empty.config.as_mut().unwrap().translation_speed_top = 0;
    let failure = run(empty, <[u8]>::to_vec, |said| said).unwrap_err();
    assert!(failure.check.contains("CONFIG"), "{failure}");
}

#[test]
fn a_mute_or_foreign_robot_fails_the_handshake() {
    let mut mute = robot();
    mute.is_mute = true;
    for failure in [
        run(mute, <[u8]>::to_vec, |said| said).unwrap_err(),
        run(robot(), <[u8]>::to_vec, |said| said.iter().map(|byte| byte ^ 1).collect()).unwrap_err(),
    ] {
        assert!(failure.check.contains("handshake"), "{failure}");
    }
    let unknown = run(Robot::new("seekur"), <[u8]>::to_vec, |said| said).unwrap_err();
    assert!(unknown.what.contains("seekur"), "{unknown}");
}
