//! The connection to a SCIP scanner as a state machine: it asks, waits, reads, recovers; it never blocks, reads no clock and
//! does no I/O. The node tells it the time, the port and the bytes, and sends what it says.
//!
//! ```text
//! Down ─ port open ─► QT ─► SCIP2.0 ─► VV ─► PP ─► [SS] ─► TM0, TM1 ×5, TM2 ─► BM ─► MD/ME ─ 00 ─► Running
//!                     ▲                 unknown model: 5 s pause                             │ no scan, or a fault
//!                     └──────────────────────────────────────────────────────────────────────┘
//! ```

pub use crate::port::{Demand, Port};

use super::clock::SensorClock;
use super::framer::Framer;
use super::model::Sensor;
use super::phases::{Core, Phase};
use super::protocol::{Area, Coding, Request};
use messages::{Link, ScanBeam};
use runtime::Time;

/// Times and habits of a session.
#[derive(Debug, Clone)]
pub struct SessionConfig {
    /// Time that each answer is waited for [s].
    pub answer_s: f64,
    /// Time without a scan after which the scanner counts as silent [s].
    pub silence_s: f64,
    /// The model that must answer; any where empty.
    pub model: String,
    /// Directions to measure between [rad].
    pub between_rad: (f64, f64),
    /// Steps that are sent as one.
    pub cluster: u8,
    /// Scans left out between two.
    pub skip: u8,
    /// Whether intensities are asked for.
    pub intensities: bool,
    /// Rate of the line, when it is a serial one [baud].
    pub line_baud: Option<u32>,
    /// Rate to switch a serial line to [baud].
    pub fast_baud: Option<u32>,
    /// Rates to try in turn when nothing answers on a serial line.
    pub hunt_bauds: Vec<u32>,
}

impl Default for SessionConfig {
    fn default() -> SessionConfig {
        SessionConfig {
            answer_s: 0.5,
            silence_s: 1.0,
            model: String::new(),
            between_rad: (-10.0, 10.0),
            cluster: 1,
            skip: 0,
            intensities: false,
            line_baud: None,
            fast_baud: None,
            hunt_bauds: Vec::new(),
        }
    }
}

impl SessionConfig {
    /// How scans are asked for.
    pub fn coding(&self) -> Coding {
        if self.intensities { Coding::Intensity } else { Coding::Long }
    }
}

/// What came from the scanner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event<'a> {
    /// The stream has begun: what measures, and which area.
    Connected(&'a Sensor, Area),
    /// A scan: when its turn passed step 0 in our time and the scanner's [s], and its beams.
    Scan(Time, f64, &'a [ScanBeam]),
}

/// The connection; see the module's text.
#[derive(Debug, Clone)]
pub struct Session {
    framer: Framer,
    core: Core,
}

impl Session {
    /// A session whose port is closed.
    pub fn new(config: SessionConfig) -> Session {
        Session { framer: Framer::new(), core: Core::new(config) }
    }

    /// Tells what the port is doing; call it before [`receive`](Session::receive).
    pub fn port(&mut self, now: Time, port: Port) {
        if port != self.core.contact.port() {
            self.framer.clear();
            self.core.port(now, port, self.framer.skipped_bytes());
        }
    }

    /// Takes bytes of which the last came at `arrived`, and hands on what they say.
    pub fn receive(&mut self, now: Time, arrived: Time, mut bytes: &[u8], mut on_event: impl FnMut(Event)) {
        while let Some(message) = self.framer.next(&mut bytes) {
            self.core.message(now, arrived, message, &mut on_event);
        }
    }

    /// Lets time pass; call it after all that has arrived was received. Says what the port should do.
    pub fn tick(&mut self, now: Time) -> Option<Demand> {
        let junk = self.framer.skipped_bytes() > self.core.skipped_before || self.framer.is_inside_message();
        self.core.tick(now, junk, self.framer.skipped_bytes());
        self.core.contact.take_demand()
    }

    /// The request that goes out now, if one waits.
    pub fn next_request(&mut self, now: Time) -> Option<Request> {
        self.core.next_request(now)
    }

    /// Whether scans flow.
    pub fn is_running(&self) -> bool {
        self.core.phase == Phase::Running
    }

    /// State of the link, and why there are no data.
    pub fn link(&self) -> Link {
        self.core.contact.link
    }

    /// The scanner's last status that was not "all well", as its two characters; 0 for none.
    pub fn status(&self) -> u32 {
        self.core.status
    }

    /// The scanner has said that it cannot measure for now.
    pub fn is_faulty(&self) -> bool {
        self.core.is_faulty
    }

    /// Who answered last.
    pub fn sensor(&self) -> Option<&Sensor> {
        self.core.sensor.as_ref()
    }

    /// Times that the stream began, whole scans, and damaged messages.
    pub fn counts(&self) -> (u32, u32, u32) {
        (self.core.connections, self.core.scans, self.core.damaged)
    }

    /// The scanner's clock.
    pub fn clock(&self) -> &SensorClock {
        &self.core.clock
    }

    /// The message finder, for its counters.
    pub fn framer(&self) -> &Framer {
        &self.framer
    }
}
