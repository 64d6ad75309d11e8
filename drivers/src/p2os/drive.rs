//! Decides which motion command goes out next.
//!
//! Velocities go as VEL [mm/s] and RVEL [deg/s], not as VEL2, whose 20 mm/s per wheel cannot say a slow turn. Each is
//! sent when it changes and repeated, so that the controller's watchdog is fed by what we mean, not by an empty PULSE.

use super::power::Power;
use super::protocol::command;
use runtime::Time;

/// A velocity in the units of the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct WireVelocity {
    /// Forward [mm/s].
    pub forward_mm_s: i32,
    /// Turn, counter-clockwise [deg/s].
    pub turn_deg_s: i32,
}

/// Rounds a velocity to the wire's units and cuts it to the caps. A magnitude of a quarter of a unit or more never
/// becomes zero: a slow turn stays a turn. What is not finite is zero.
pub fn quantize(forward_m_s: f64, turn_rad_s: f64, max_speed_m_s: f64, max_turn_rad_s: f64) -> WireVelocity {
    WireVelocity {
        forward_mm_s: round(forward_m_s * 1000.0, max_speed_m_s * 1000.0),
        turn_deg_s: round(turn_rad_s.to_degrees(), max_turn_rad_s.to_degrees()),
    }
}

fn round(value: f64, cap: f64) -> i32 {
    if !value.is_finite() || value.abs() < 0.25 {
        return 0;
    }
    let rounded = value.abs().round().max(1.0).min(cap.floor().max(0.0));
    // Below the widest argument by the model's caps.
    (rounded * value.signum()) as i32
}

/// What was last said, and when.
#[derive(Debug, Clone, Copy)]
struct Said {
    value: i32,
    at: Time,
}

/// Velocities, and the power without which they mean nothing.
#[derive(Debug, Clone)]
pub struct Drive {
    /// Who has the motors.
    pub power: Power,
    repeat_s: f64,
    wanted: WireVelocity,
    said_forward: Option<Said>,
    said_turn: Option<Said>,
}

impl Drive {
    /// Nothing wanted, nothing said. Velocities are repeated every `repeat_s`.
    pub fn new(repeat_s: f64, power: Power) -> Drive {
        Drive { power, repeat_s, wanted: WireVelocity::default(), said_forward: None, said_turn: None }
    }

    /// A handshake was done: the robot stands with its motors off and knows nothing. `first`: it is the first one.
    pub fn connected(&mut self, first: bool) {
        self.power.connected(first);
        *self = Drive::new(self.repeat_s, self.power.clone());
    }

    /// The wanted velocity; zero when there is none.
    pub fn want(&mut self, velocity: WireVelocity) {
        self.wanted = velocity;
    }

    /// A command that must not wait behind others: a stop, or a slower way forward. (number, argument)
    pub fn urgent(&mut self, now: Time) -> Option<(u8, i32)> {
        let wanted = self.effective();
        if self.said_forward.is_some_and(|said| slows(said.value, wanted.forward_mm_s)) {
            return Some(self.say_forward(now, wanted.forward_mm_s));
        }
        if self.said_turn.is_some_and(|said| said.value != 0 && wanted.turn_deg_s == 0) {
            return Some(self.say_turn(now, 0));
        }
        None
    }

    /// The next command, changes first, then repetitions; `None` when all is said. (number, argument)
    pub fn next(&mut self, now: Time) -> Option<(u8, i32)> {
        if let Some(power) = self.power.next(now) {
            return Some(power);
        }
        if !self.power.is_asked() {
            return None;
        }
        let wanted = self.effective();
        let is_changed = |said: Option<Said>, value: i32| said.is_none_or(|said| said.value != value);
        let is_due = |said: Option<Said>| said.is_none_or(|said| now.since(said.at) >= self.repeat_s);
        let forward = (is_changed(self.said_forward, wanted.forward_mm_s), is_due(self.said_forward));
        let turn = (is_changed(self.said_turn, wanted.turn_deg_s), is_due(self.said_turn));
        // Changes before repetitions; of two, the one that was said longer ago: neither starves the other.
        let turn_waits_longer = self.said_turn.map(|said| said.at) <= self.said_forward.map(|said| said.at);
        match (forward, turn) {
            ((false, false), (false, false)) => None,
            _ if turn > forward || (turn == forward && turn_waits_longer) => {
                Some(self.say_turn(now, wanted.turn_deg_s))
            }
            _ => Some(self.say_forward(now, wanted.forward_mm_s)),
        }
    }

    fn effective(&self) -> WireVelocity {
        if self.power.may_move() { self.wanted } else { WireVelocity::default() }
    }

    fn say_forward(&mut self, now: Time, value: i32) -> (u8, i32) {
        self.said_forward = Some(Said { value, at: now });
        (command::VEL, value)
    }

    fn say_turn(&mut self, now: Time, value: i32) -> (u8, i32) {
        self.said_turn = Some(Said { value, at: now });
        (command::RVEL, value)
    }
}

/// Whether `wanted` is nearer to standing than `said`, or the other way.
fn slows(said: i32, wanted: i32) -> bool {
    said != 0 && (wanted.abs() < said.abs() || wanted.signum() != said.signum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::p2os::power::AfterLoss;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_6;

    const REPEAT_S: f64 = 0.15;

    fn at(seconds: f64) -> Time {
        Time::from_seconds(100.0 + seconds)
    }

    fn velocity(forward_mm_s: i32, turn_deg_s: i32) -> WireVelocity {
        WireVelocity { forward_mm_s, turn_deg_s }
    }

    fn drive(after_loss: AfterLoss) -> Drive {
        Drive::new(REPEAT_S, Power::new(after_loss))
    }

    /// All that is said at one instant.
    fn said(drive: &mut Drive, now: Time) -> Vec<(u8, i32)> {
        let mut all = Vec::new();
        while let Some(command) = drive.urgent(now).or_else(|| drive.next(now)) {
            all.push(command);
            assert!(all.len() < 10, "never ends: {all:?}");
        }
        all
    }

    /// Motors on and confirmed, standing.
    fn moving() -> Drive {
        let mut drive = drive(AfterLoss::Command);
        drive.connected(true);
        drive.power.device(false);
        drive.power.command(true);
        said(&mut drive, at(0.0));
        drive.power.device(true);
        drive
    }

    #[test]
    fn rates_are_rounded_and_small_ones_stay_alive() {
        let quantize = |forward, turn| quantize(forward, turn, 1.5, 3.0);
        assert_eq!(quantize(0.2004, FRAC_PI_6), velocity(200, 30));
        assert_eq!(quantize(-0.2004, -FRAC_PI_6), velocity(-200, -30));
        assert_eq!(quantize(0.0003, 0.3f64.to_radians()), velocity(1, 1));
        assert_eq!(quantize(-0.0003, -0.3f64.to_radians()), velocity(-1, -1));
        assert_eq!(quantize(0.0002, 0.2f64.to_radians()), velocity(0, 0));
        assert_eq!(quantize(9.0, -9.0), velocity(1500, -171));
        for odd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(quantize(odd, odd), velocity(0, 0));
        }
    }

    #[test]
    fn nothing_is_said_before_somebody_asks_for_power() {
        let mut drive = drive(AfterLoss::Command);
        drive.connected(true);
        drive.power.device(false);
        drive.want(velocity(300, 10));
        assert_eq!(said(&mut drive, at(0.0)), []);
        assert_eq!(said(&mut drive, at(5.0)), []);
    }

    #[test]
    fn motors_that_are_on_unasked_are_switched_off() {
        let mut drive = drive(AfterLoss::Command);
        drive.connected(true);
        drive.power.device(true);
        assert_eq!(said(&mut drive, at(0.0)), [(command::ENABLE, 0)]);
    }

    #[test]
    fn only_zero_is_said_until_the_device_confirms_its_motors() {
        let mut drive = drive(AfterLoss::Command);
        drive.connected(true);
        drive.power.device(false);
        drive.power.command(true);
        drive.want(velocity(300, 10));
        assert_eq!(said(&mut drive, at(0.0)), [(command::ENABLE, 1), (command::RVEL, 0), (command::VEL, 0)]);
        drive.power.device(false);
        assert_eq!(said(&mut drive, at(0.1)), []);
        assert!(said(&mut drive, at(0.6)).contains(&(command::ENABLE, 1)), "asks again");
        drive.power.device(true);
        assert_eq!(said(&mut drive, at(0.61)), [(command::RVEL, 10), (command::VEL, 300)]);
    }

    #[test]
    fn velocities_are_said_when_they_change_and_repeated_for_the_watchdog() {
        let mut drive = moving();
        drive.want(velocity(300, 10));
        assert_eq!(said(&mut drive, at(0.01)), [(command::RVEL, 10), (command::VEL, 300)]);
        assert_eq!(said(&mut drive, at(0.10)), []);
        assert_eq!(said(&mut drive, at(0.17)), [(command::RVEL, 10), (command::VEL, 300)]);
        drive.want(velocity(310, 10));
        assert_eq!(said(&mut drive, at(0.20)), [(command::VEL, 310)]);
    }

    #[test]
    fn a_turn_that_changes_all_the_time_does_not_starve_the_way_forward() {
        let mut drive = moving();
        let mut told = Vec::new();
        for step in 0..20 {
            drive.want(velocity(100 + step, 10 + step));
            // One command per step, as the line allows.
            told.extend(drive.urgent(at(0.02 * f64::from(step))).or_else(|| drive.next(at(0.02 * f64::from(step)))));
        }
        let forwards = told.iter().filter(|(number, _)| *number == command::VEL).count();
        assert!(told.len() == 20 && (9..=11).contains(&forwards), "{told:?}");
    }

    #[test]
    fn slowing_down_comes_before_everything_else() {
        let mut drive = moving();
        drive.want(velocity(300, 10));
        said(&mut drive, at(0.0));
        drive.want(velocity(100, 40));
        assert_eq!(drive.urgent(at(0.05)), Some((command::VEL, 100)));
        assert_eq!(drive.urgent(at(0.05)), None);
        drive.want(velocity(-100, 40));
        assert_eq!(drive.urgent(at(0.06)), Some((command::VEL, -100)));
        drive.want(velocity(-200, 40));
        assert_eq!(drive.urgent(at(0.07)), None, "faster backwards is no hurry");
    }

    #[test]
    fn an_operators_off_outlasts_commands_that_ask() {
        let mut drive = moving();
        drive.want(velocity(300, 0));
        said(&mut drive, at(0.0));
        drive.power.operator(false);
        drive.power.command(true);
        assert_eq!(said(&mut drive, at(0.1)), [(command::VEL, 0), (command::ENABLE, 0)]);
        drive.power.device(false);
        drive.power.command(false);
        drive.power.command(true);
        assert_eq!(said(&mut drive, at(0.2)), []);
        drive.power.operator(true);
        assert_eq!(drive.next(at(0.3)), Some((command::ENABLE, 1)));
    }

    #[test]
    fn an_operators_stop_holds_the_robot_still_with_its_motors_on() {
        let mut drive = moving();
        drive.want(velocity(300, 20));
        said(&mut drive, at(0.0));
        drive.power.halt();
        drive.power.command(true);
        assert_eq!(said(&mut drive, at(0.1)), [(command::VEL, 0), (command::RVEL, 0)]);
        drive.connected(false);
        drive.power.command(true);
        drive.power.device(true);
        assert!(!drive.power.may_move(), "a new connection does not lift the stop");
        drive.power.operator(true);
        drive.power.device(true);
        assert!(drive.power.may_move());
    }

    #[test]
    fn power_that_the_device_took_comes_back_only_when_asked_for_anew() {
        let mut drive = moving();
        drive.want(velocity(300, 0));
        said(&mut drive, at(0.0));
        drive.power.device(false);
        for step in 1..50 {
            drive.power.command(true);
            drive.power.device(false);
            let commands = said(&mut drive, at(0.1 * f64::from(step)));
            assert!(!commands.contains(&(command::ENABLE, 1)), "{commands:?}");
        }
        assert!(drive.power.is_held());
        drive.power.command(false);
        drive.power.command(true);
        assert_eq!(drive.next(at(9.0)), Some((command::ENABLE, 1)));
    }

    #[test]
    fn letting_go_and_asking_again_between_two_packets_is_no_grab_by_the_device() {
        let mut drive = moving();
        drive.power.command(false);
        said(&mut drive, at(0.1));
        drive.power.command(true);
        said(&mut drive, at(0.2));
        drive.power.device(false);
        drive.power.device(true);
        assert!(drive.power.may_move());
    }

    #[test]
    fn after_a_loss_the_operator_must_ask_where_the_robot_file_says_so() {
        for (after_loss, moves) in [(AfterLoss::Command, true), (AfterLoss::Operator, false)] {
            let mut drive = drive(after_loss);
            drive.connected(true);
            drive.power.command(true);
            assert_eq!(drive.next(at(0.0)), Some((command::ENABLE, 1)), "the first connection");
            drive.connected(false);
            drive.power.device(false);
            drive.power.command(true);
            drive.power.device(true);
            assert_eq!(drive.power.may_move(), moves, "{after_loss:?}");
        }
    }

    proptest! {
        #[test]
        fn a_velocity_is_never_sent_to_motors_that_nobody_asked_for(
            events in prop::collection::vec((0u8..8, -500i32..500, -100i32..100), 1..200)) {
            let mut drive = drive(AfterLoss::Command);
            let mut allowed = false;
            for (step, (event, forward, turn)) in events.into_iter().enumerate() {
                match event {
                    0 => { drive.power.operator(false); allowed = false }
                    1 => { drive.power.operator(true); allowed = true }
                    2 => { drive.power.command(true); allowed = true }
                    3 => { drive.power.command(false); allowed = false }
                    4 => drive.power.device(true),
                    5 => drive.power.device(false),
                    6 => { drive.connected(false); allowed = false }
                    _ => drive.want(velocity(forward, turn)),
                }
                for (number, value) in said(&mut drive, at(0.02 * step as f64)) {
                    prop_assert!(allowed || value == 0, "command {number} {value} after event {event}");
                    prop_assert!(number == command::ENABLE || value == 0 || drive.power.may_move());
                }
            }
        }
    }
}
