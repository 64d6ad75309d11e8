//! Decides when the motors get power.
//!
//! They are off after every handshake, go on when a fresh command asks (`enable` = 1) or the operator does, and off when
//! either says so:
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

/// Time after which an ENABLE that the device has not confirmed is repeated [s].
const REPEAT_S: f64 = 0.5;

/// Who wants the motors on, and what the device says; see the module's text.
#[derive(Debug, Clone)]
pub struct Power {
    after_loss: AfterLoss,
    said: Option<(bool, Time)>,
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

impl Power {
    /// Off, and nobody asks.
    pub fn new(after_loss: AfterLoss) -> Power {
        Power {
            after_loss,
            said: None,
            asked: false,
            forbidden: false,
            halted: false,
            taken: false,
            device_on: None,
            confirmed: false,
        }
    }

    /// A handshake was done: the robot's motors are off and it knows nothing. `first`: it is the first one.
    pub fn connected(&mut self, first: bool) {
        let forbidden = self.forbidden || (!first && self.after_loss == AfterLoss::Operator);
        *self = Power { forbidden, halted: self.halted, ..Power::new(self.after_loss) };
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

    /// The operator switches the motors. "On" also ends a [`halt`](Power::halt).
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

    /// What the operator has ordered, to be left to a successor: whether the robot is halted, whether power is forbidden.
    pub fn orders(&self) -> (bool, bool) {
        (self.halted, self.forbidden)
    }

    /// What the operator had ordered a predecessor.
    pub fn restore(&mut self, (halted, forbidden): (bool, bool)) {
        (self.halted, self.forbidden) = (halted, forbidden);
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

    /// Whether somebody wants the motors on.
    pub fn is_asked(&self) -> bool {
        self.asked
    }

    /// Whether velocities other than zero are sent.
    pub fn may_move(&self) -> bool {
        self.asked && self.confirmed && !self.halted
    }

    /// Whether the operator or the device keeps the flow from moving the robot.
    pub fn is_held(&self) -> bool {
        self.forbidden || self.halted || self.taken
    }

    /// The next ENABLE; `None` when the device knows. (number, argument)
    pub fn next(&mut self, now: Time) -> Option<(u8, i32)> {
        let is_done = self.device_on.unwrap_or(false) == self.asked;
        let due = match self.said {
            // A robot is opened with its motors off: nothing to say until somebody asks.
            None => self.asked || !is_done,
            Some((value, at)) => value != self.asked || (!is_done && now.since(at) >= REPEAT_S),
        };
        due.then(|| {
            self.said = Some((self.asked, now));
            (command::ENABLE, i32::from(self.asked))
        })
    }

    fn ask(&mut self, on: bool) {
        self.asked = on;
        if !on {
            self.confirmed = false;
        }
    }
}
