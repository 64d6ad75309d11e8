//! The connection to a SCIP scanner as a state machine: it asks, waits, reads, recovers; it never blocks, reads no clock and
//! does no I/O. The node tells it the time, the port and the bytes, and sends what it says.
//!
//! ```text
//! Down ─ port open ─► QT ─► SCIP2.0 ─► VV ─► PP ─► [SS] ─► TM0, TM1 ×5, TM2 ─► BM ─► MD/ME ─ 00 ─► Running
//!                     ▲                 unknown model: 5 s pause                             │ no scan, or a fault
//!                     └──────────────────────────────────────────────────────────────────────┘
//! ```

pub use crate::laser::Event;
pub use crate::port::{Demand, Port};

use super::clock::SensorClock;
use super::framer::Framer;
use super::model::Sensor;
use super::phases::{Core, Phase};
use super::protocol::{Coding, Request};
use super::settings::UrgConfig;
use crate::laser::talk::Lost;
use messages::{LaserState, Link};
use runtime::{Fault, Time};

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

    /// Whether scans flow.
    pub fn is_running(&self) -> bool {
        self.core.phase == Phase::Running
    }

    /// Who answered last.
    pub fn sensor(&self) -> Option<&Sensor> {
        self.core.sensor.as_ref()
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

impl crate::laser::Session for Session {
    const TYPE: &'static str = "urg";
    /// The laser goes off and the stream ends.
    const FAREWELL: &'static [u8] = b"\nQT\n";
    const FOREIGN: Fault = Fault::new("what answers is no scanner of the wanted model, or measures nothing");
    const FAULTY: Fault = Fault::new("the scanner says that it cannot measure: see `status` of the state");
    type Settings = UrgConfig;
    type Request = Request;

    fn of(settings: &UrgConfig, line_baud: Option<u32>) -> Session {
        Session::new(settings.session(line_baud))
    }

    fn port(&mut self, now: Time, port: Port) {
        if port != self.core.talk.contact.port() {
            self.framer.clear();
            self.core.port(now, port, self.framer.skipped_bytes());
        }
    }

    fn receive(&mut self, now: Time, arrived: Time, mut bytes: &[u8], mut on_event: impl FnMut(Event<'_>)) {
        while let Some(message) = self.framer.next(&mut bytes) {
            self.core.message(now, arrived, message, &mut on_event);
        }
    }

    fn tick(&mut self, now: Time, _on_event: impl FnMut(Event<'_>)) -> Option<Demand> {
        let junk = self.framer.skipped_bytes() > self.core.skipped_before || self.framer.is_inside_message();
        self.core.tick(now, junk, self.framer.skipped_bytes());
        self.core.talk.contact.take_demand()
    }

    fn next_request(&mut self, now: Time) -> Option<Request> {
        self.core.next_request(now)
    }

    fn link(&self) -> Link {
        self.core.talk.contact.link
    }

    fn is_faulty(&self) -> bool {
        self.core.talk.is_faulty
    }

    fn state(&self) -> LaserState {
        let lost = Lost { messages: 0, bytes: self.framer.skipped_bytes() };
        self.core.talk.state(self.is_running(), lost, self.core.clock.jumps())
    }
}
