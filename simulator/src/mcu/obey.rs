//! What each command does. Numbers and arguments: `drivers::p2os::protocol`.

use super::drive::Goal;
use super::sonar::SonarUnit;
use super::{Core, Session, Settings, Stream};
use crate::mcu::settings::Flash;
use drivers::p2os::protocol::{Argument, MAX_PACKET, Request, command, encode_command, unpack_wheels};
use runtime::Time;
use runtime::math::wrap_angle;
use std::f64::consts::PI;

const DEG: f64 = PI / 180.0;
const MM: f64 = 0.001;

impl Core {
    /// Obeys the command in `payload`, as the session's state allows.
    pub(super) fn obey(&mut self, flash: &Flash, now: Time, payload: &[u8]) {
        let Some(request) = Request::parse(payload) else { return };
        match self.session {
            Session::Waiting(expected) => self.shake_hands(flash, expected, request.number),
            Session::Ready => match request.number {
                command::OPEN => self.open(flash, now),
                command::SYNC0 => self.shake_hands(flash, 0, command::SYNC0),
                command::CLOSE => self.session = Session::Waiting(0),
                _ => {}
            },
            Session::Running => {
                self.last_command = now;
                match request.number {
                    command::PULSE | command::OPEN => {}
                    command::CLOSE => self.close(),
                    _ => self.act(flash, &request),
                }
            }
        }
    }

    /// Echoes the SYNC that is awaited; one out of order starts the sequence anew.
    fn shake_hands(&mut self, flash: &Flash, expected: u8, number: u8) {
        if number > command::SYNC2 {
            return;
        }
        if number != expected && number != command::SYNC0 {
            self.session = Session::Waiting(0);
            return;
        }
        let mut packet = [0; MAX_PACKET];
        let length = match number {
            command::SYNC2 => flash.identity.encode(&mut packet),
            _ => encode_command(&mut packet, number, Argument::None),
        };
        // The texts are bounded, so that the packet always fits.
        self.outbox.push(&packet[..length.unwrap_or(0)]);
        self.session = if number == command::SYNC2 { Session::Ready } else { Session::Waiting(number + 1) };
    }

    fn open(&mut self, flash: &Flash, now: Time) {
        self.session = Session::Running;
        self.last_command = now;
        self.next_sip = now.after_ns(u64::from(flash.sip_cycle_ms) * 1_000_000);
        self.odometer.reset();
        self.set_motors(false);
        self.sonar = SonarUnit::new();
        self.sonar.start(now);
    }

    fn close(&mut self) {
        self.session = Session::Waiting(0);
        self.set_motors(false);
        self.settings = Settings::FACTORY;
        (self.encoder_packets, self.io_packets) = (Stream::Off, Stream::Off);
        self.wants_config = false;
        self.hung_up = true;
    }

    fn act(&mut self, flash: &Flash, request: &Request) {
        let argument = request.integer();
        match request.number {
            command::ENABLE => self.set_motors(argument != 0),
            command::SETV => self.settings.set_translation_speed(&flash.tops, argument),
            command::SETA => self.settings.set_translation_ramp(&flash.tops, argument),
            command::SETRV => self.settings.set_rotation_speed(&flash.tops, argument),
            command::SETRA => self.settings.set_rotation_ramp(&flash.tops, argument),
            command::SETO => self.set_origin(),
            command::STOP => self.stand_still(),
            command::E_STOP | command::QSTOP => {
                self.stand_still();
                self.emergency = true;
            }
            command::E_STALL => self.settings.stop_button_disables = argument != 0,
            command::POLLING => self.sonar.poll(request.text()),
            command::SONAR => self.sonar.switch(argument),
            command::SONARCYCLE => self.settings.sonar_cycle_ms = SonarUnit::cycle_ms(argument),
            command::BUMPSTALL => self.settings.bump_stall = argument.clamp(0, 3) as u8,
            command::CONFIG => self.wants_config = true,
            command::ENCODER => self.encoder_packets = Stream::from_argument(argument),
            command::IOREQUEST => self.io_packets = Stream::from_argument(argument),
            command::DIGOUT => {
                let [values, mask] = request.word(0).to_le_bytes();
                self.digital_out = (self.digital_out & !mask) | (values & mask);
            }
            command::HOSTBAUD => self.settings.host_baud = argument.clamp(0, 4) as u8,
            command::BATTEST => self.battery.pretend(argument),
            command::RESET => {
                self.close();
                self.hung_up = false;
                self.odometer.reset();
            }
            // Motion commands do nothing while the motors are off.
            _ if self.motors => self.move_as_told(flash, request.number, argument),
            // SAY, TTY, GRIPPER, BATTERYINFO and the like are taken and have no effect here; what is unknown, too.
            _ => {}
        }
    }

    fn move_as_told(&mut self, flash: &Flash, number: u8, argument: i32) {
        let value = f64::from(argument);
        match number {
            command::VEL => self.translate(Goal::Speed(value * MM)),
            command::MOVE => self.translate(Goal::Place(self.odometer.way_m + value * MM)),
            command::RVEL | command::ROTATE => self.rotate(Goal::Speed(value * DEG)),
            command::HEAD => {
                let here = self.odometer.heading_rad;
                self.turn_to(here + wrap_angle(value * DEG - here));
            }
            command::DHEAD => self.turn_to(self.odometer.heading_rad + value * DEG),
            command::DCHEAD => self.turn_to(self.heading_set_point_rad + value * DEG),
            command::VEL2 => {
                let (left_mm_s, right_mm_s) = unpack_wheels(argument);
                let (left, right) = (f64::from(left_mm_s) * MM, f64::from(right_mm_s) * MM);
                self.translate(Goal::Speed(0.5 * (left + right)));
                self.rotate(Goal::Speed(0.5 * (right - left) * flash.turn_rad_per_m));
                self.by_wheels = true;
            }
            _ => {}
        }
    }

    fn translate(&mut self, goal: Goal) {
        if std::mem::take(&mut self.by_wheels) {
            self.rotation.goal = Goal::Speed(0.0);
        }
        self.translation.pursue(goal, &self.settings.translation);
    }

    fn rotate(&mut self, goal: Goal) {
        if std::mem::take(&mut self.by_wheels) {
            self.translation.goal = Goal::Speed(0.0);
        }
        self.rotation.pursue(goal, &self.settings.rotation);
    }

    fn turn_to(&mut self, heading_rad: f64) {
        self.heading_set_point_rad = heading_rad;
        self.rotate(Goal::Place(heading_rad));
    }

    /// The frame moves, the robot and its goals do not: a set-point stays where it is in the room.
    fn set_origin(&mut self) {
        let turned_rad = self.odometer.heading_rad;
        self.odometer.reset();
        self.heading_set_point_rad -= turned_rad;
        if let Goal::Place(heading_rad) = self.rotation.goal {
            self.rotation.goal = Goal::Place(heading_rad - turned_rad);
        }
    }
}

impl Stream {
    fn from_argument(argument: i32) -> Stream {
        match argument {
            ..=0 => Stream::Off,
            1 => Stream::Once,
            2.. => Stream::Each,
        }
    }

    /// Whether the packet goes out now; once means once.
    pub(super) fn take(&mut self) -> bool {
        let now = *self != Stream::Off;
        if *self == Stream::Once {
            *self = Stream::Off;
        }
        now
    }
}
