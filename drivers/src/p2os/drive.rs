//! Decides which motion command goes out next: velocities, motor power, and who may have it.
//!
//! Velocities go as VEL [mm/s] and RVEL [deg/s], not as VEL2, whose 20 mm/s per wheel cannot say a slow turn. Each is
//! sent when it changes and repeated, so that the controller's watchdog is fed by what we mean, not by an empty PULSE.
//!
//! Motor power. The robot's motors are off after every handshake. They go on when a fresh command asks (`enable` = 1)
//! or the operator does, and off when either says so:
//!
//! - An operator's "off" and "stop" last until the operator's "on"; commands cannot undo them.
//! - When the *device* takes the power (somebody presses the MOTORS or stop button), that lasts until the commands let go
//!   and ask again, or until the operator's "on": a hand on the robot outranks the flow.
//! - With [`AfterLoss::Operator`], every connection but the first waits for the operator's "on", so that a robot that
//!   somebody switches off and on again stays where it is.
//! - No velocity but zero is sent before the device has confirmed that its motors are on.

use super::protocol::command;
use runtime::Time;

/// Who may switch the motors on after the link was lost or the robot restarted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AfterLoss {
    /// The next fresh command that asks for it.
    #[default]
    Command,
    /// Only the operator.
    Operator,
}

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

/// Time after which an ENABLE that the device has not confirmed is repeated [s].
const ENABLE_REPEAT_S: f64 = 0.5;

/// What was last said, and when.
#[derive(Debug, Clone, Copy)]
struct Said {
    value: i32,
    at: Time,
}

/// Velocities and motor power; see the module's text.
#[derive(Debug, Clone)]
pub struct Drive {
    repeat_s: f64,
    after_loss: AfterLoss,
    wanted: WireVelocity,
    said_forward: Option<Said>,
    said_turn: Option<Said>,
    said_power: Option<Said>,
    /// Whether the last one who was entitled to say so wants power.
    asked: bool,
    /// The operator forbids power.
    forbidden: bool,
    /// The operator holds the robot still; power stays as it is.
    halted: bool,
    /// The device took the power by itself.
    taken: bool,
    /// The device's own word, as soon as there is one.
    device_on: Option<bool>,
    /// The device has said "on" since power was asked for.
    confirmed: bool,
}

impl Drive {
    /// Nothing wanted, nothing said. Velocities are repeated every `repeat_s`.
    pub fn new(repeat_s: f64, after_loss: AfterLoss) -> Drive {
        Drive {
            repeat_s,
            after_loss,
            wanted: WireVelocity::default(),
            said_forward: None,
            said_turn: None,
            said_power: None,
            asked: false,
            forbidden: false,
            halted: false,
            taken: false,
            device_on: None,
            confirmed: false,
        }
    }

    /// A handshake was done: the robot stands with its motors off and knows nothing. `first`: it is the first one.
    pub fn connected(&mut self, first: bool) {
        let forbidden = self.forbidden || (!first && self.after_loss == AfterLoss::Operator);
        *self = Drive { forbidden, halted: self.halted, ..Drive::new(self.repeat_s, self.after_loss) };
    }

    /// A fresh command's wish for power.
    pub fn command(&mut self, enable: bool) {
        if !enable {
            self.taken = false;
            self.ask(false);
        } else if !self.forbidden && !self.taken {
            self.asked = true;
        }
    }

    /// The operator switches the motors. "On" also ends a [`halt`](Drive::halt).
    pub fn operator(&mut self, on: bool) {
        self.forbidden = !on;
        if on {
            (self.halted, self.taken) = (false, false);
        }
        self.ask(on);
    }

    /// The operator stops the robot: velocity zero until the operator's next "on".
    pub fn halt(&mut self) {
        self.halted = true;
    }

    /// What the device says about its motors.
    pub fn device(&mut self, on: bool) {
        self.device_on = Some(on);
        if self.asked {
            if self.confirmed && !on {
                self.taken = true;
                self.ask(false);
            }
            self.confirmed |= on && self.asked;
        }
    }

    /// The wanted velocity; zero when there is none.
    pub fn want(&mut self, velocity: WireVelocity) {
        self.wanted = velocity;
    }

    /// Whether velocities other than zero are sent.
    pub fn may_move(&self) -> bool {
        self.asked && self.confirmed && !self.halted
    }

    /// Whether the operator or the device keeps the flow from moving the robot.
    pub fn is_held(&self) -> bool {
        self.forbidden || self.halted || self.taken
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
        if let Some(power) = self.next_power(now) {
            return Some(power);
        }
        if !self.asked {
            return None;
        }
        let wanted = self.effective();
        let changed = |said: Option<Said>, value: i32| said.is_none_or(|said| said.value != value);
        let due = |said: Option<Said>| said.is_none_or(|said| now.since(said.at) >= self.repeat_s);
        if changed(self.said_turn, wanted.turn_deg_s) {
            return Some(self.say_turn(now, wanted.turn_deg_s));
        }
        if changed(self.said_forward, wanted.forward_mm_s) || due(self.said_forward) {
            return Some(self.say_forward(now, wanted.forward_mm_s));
        }
        if due(self.said_turn) {
            return Some(self.say_turn(now, wanted.turn_deg_s));
        }
        None
    }

    fn next_power(&mut self, now: Time) -> Option<(u8, i32)> {
        let is_told = self.said_power.is_some_and(|said| (said.value == 1) == self.asked);
        let is_done = self.device_on.unwrap_or(false) == self.asked;
        let due = match self.said_power {
            // A robot is opened with its motors off: nothing to say until somebody asks.
            None => self.asked || !is_done,
            Some(said) => !is_told || (!is_done && now.since(said.at) >= ENABLE_REPEAT_S),
        };
        due.then(|| {
            let value = i32::from(self.asked);
            self.said_power = Some(Said { value, at: now });
            (command::ENABLE, value)
        })
    }

    fn ask(&mut self, on: bool) {
        self.asked = on;
        if !on {
            self.confirmed = false;
        }
    }

    fn effective(&self) -> WireVelocity {
        if self.may_move() { self.wanted } else { WireVelocity::default() }
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
    use proptest::prelude::*;

    const REPEAT_S: f64 = 0.15;

    fn at(seconds: f64) -> Time {
        Time::from_seconds(100.0 + seconds)
    }

    fn velocity(forward_mm_s: i32, turn_deg_s: i32) -> WireVelocity {
        WireVelocity { forward_mm_s, turn_deg_s }
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
        let mut drive = Drive::new(REPEAT_S, AfterLoss::Command);
        drive.connected(true);
        drive.device(false);
        drive.command(true);
        said(&mut drive, at(0.0));
        drive.device(true);
        drive
    }

    #[test]
    fn rates_are_rounded_and_small_ones_stay_alive() {
        let quantize = |forward, turn| quantize(forward, turn, 1.5, 3.0);
        assert_eq!(quantize(0.2004, 0.5236), velocity(200, 30));
        assert_eq!(quantize(-0.2004, -0.5236), velocity(-200, -30));
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
        let mut drive = Drive::new(REPEAT_S, AfterLoss::Command);
        drive.connected(true);
        drive.device(false);
        drive.want(velocity(300, 10));
        assert_eq!(said(&mut drive, at(0.0)), []);
        assert_eq!(said(&mut drive, at(5.0)), []);
    }

    #[test]
    fn motors_that_are_on_unasked_are_switched_off() {
        let mut drive = Drive::new(REPEAT_S, AfterLoss::Command);
        drive.connected(true);
        drive.device(true);
        assert_eq!(said(&mut drive, at(0.0)), [(command::ENABLE, 0)]);
    }

    #[test]
    fn only_zero_is_said_until_the_device_confirms_its_motors() {
        let mut drive = Drive::new(REPEAT_S, AfterLoss::Command);
        drive.connected(true);
        drive.device(false);
        drive.command(true);
        drive.want(velocity(300, 10));
        assert_eq!(said(&mut drive, at(0.0)), [(command::ENABLE, 1), (command::RVEL, 0), (command::VEL, 0)]);
        drive.device(false);
        assert_eq!(said(&mut drive, at(0.1)), []);
        assert!(said(&mut drive, at(0.6)).contains(&(command::ENABLE, 1)), "asks again");
        drive.device(true);
        assert_eq!(said(&mut drive, at(0.61)), [(command::RVEL, 10), (command::VEL, 300)]);
    }

    #[test]
    fn velocities_are_said_when_they_change_and_repeated_for_the_watchdog() {
        let mut drive = moving();
        drive.want(velocity(300, 10));
        assert_eq!(said(&mut drive, at(0.01)), [(command::RVEL, 10), (command::VEL, 300)]);
        assert_eq!(said(&mut drive, at(0.10)), []);
        assert_eq!(said(&mut drive, at(0.17)), [(command::VEL, 300), (command::RVEL, 10)]);
        drive.want(velocity(310, 10));
        assert_eq!(said(&mut drive, at(0.20)), [(command::VEL, 310)]);
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
        drive.operator(false);
        drive.command(true);
        assert_eq!(said(&mut drive, at(0.1)), [(command::VEL, 0), (command::ENABLE, 0)]);
        drive.device(false);
        drive.command(false);
        drive.command(true);
        assert_eq!(said(&mut drive, at(0.2)), []);
        drive.operator(true);
        assert_eq!(drive.next(at(0.3)), Some((command::ENABLE, 1)));
    }

    #[test]
    fn an_operators_stop_holds_the_robot_still_with_its_motors_on() {
        let mut drive = moving();
        drive.want(velocity(300, 20));
        said(&mut drive, at(0.0));
        drive.halt();
        drive.command(true);
        assert_eq!(said(&mut drive, at(0.1)), [(command::VEL, 0), (command::RVEL, 0)]);
        drive.connected(false);
        drive.command(true);
        drive.device(true);
        assert!(!drive.may_move(), "a new connection does not lift the stop");
        drive.operator(true);
        drive.device(true);
        assert!(drive.may_move());
    }

    #[test]
    fn power_that_the_device_took_comes_back_only_when_asked_for_anew() {
        let mut drive = moving();
        drive.want(velocity(300, 0));
        said(&mut drive, at(0.0));
        drive.device(false);
        for step in 1..50 {
            drive.command(true);
            drive.device(false);
            let commands = said(&mut drive, at(0.1 * f64::from(step)));
            assert!(!commands.contains(&(command::ENABLE, 1)), "{commands:?}");
        }
        assert!(drive.is_held());
        drive.command(false);
        drive.command(true);
        assert_eq!(drive.next(at(9.0)), Some((command::ENABLE, 1)));
    }

    #[test]
    fn letting_go_and_asking_again_between_two_packets_is_no_grab_by_the_device() {
        let mut drive = moving();
        drive.command(false);
        said(&mut drive, at(0.1));
        drive.command(true);
        said(&mut drive, at(0.2));
        drive.device(false);
        drive.device(true);
        assert!(drive.may_move());
    }

    #[test]
    fn after_a_loss_the_operator_must_ask_where_the_robot_file_says_so() {
        for (after_loss, moves) in [(AfterLoss::Command, true), (AfterLoss::Operator, false)] {
            let mut drive = Drive::new(REPEAT_S, after_loss);
            drive.connected(true);
            drive.command(true);
            assert_eq!(drive.next(at(0.0)), Some((command::ENABLE, 1)), "the first connection");
            drive.connected(false);
            drive.device(false);
            drive.command(true);
            drive.device(true);
            assert_eq!(drive.may_move(), moves, "{after_loss:?}");
        }
    }

    proptest! {
        #[test]
        fn a_velocity_is_never_sent_to_motors_that_nobody_asked_for(
            events in prop::collection::vec((0u8..8, -500i32..500, -100i32..100), 1..200)) {
            let mut drive = Drive::new(REPEAT_S, AfterLoss::Command);
            let mut allowed = false;
            for (step, (event, forward, turn)) in events.into_iter().enumerate() {
                match event {
                    0 => { drive.operator(false); allowed = false }
                    1 => { drive.operator(true); allowed = true }
                    2 => { drive.command(true); allowed = true }
                    3 => { drive.command(false); allowed = false }
                    4 => drive.device(true),
                    5 => drive.device(false),
                    6 => { drive.connected(false); allowed = false }
                    _ => drive.want(velocity(forward, turn)),
                }
                for (number, value) in said(&mut drive, at(0.02 * step as f64)) {
                    prop_assert!(allowed || value == 0, "command {number} {value} after event {event}");
                    prop_assert!(number == command::ENABLE || value == 0 || drive.may_move());
                }
            }
        }
    }
}
