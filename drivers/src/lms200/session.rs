//! The connection to an LMS as a state machine: it asks, waits, reads, recovers; it never blocks, reads no clock and does no
//! I/O. The node tells it the time, the port and the bytes, and sends what it says.
//!
//! ```text
//! Down ─ port open ─► 20 25 ─► [20 4x: rate] ─► 3A ─► 31 ─► 74 ─► [password, 77, 20 25] ─► [3B] ─► 20 24 ─ A0 ─► Running
//!                     ▲ no answer: the next rate           another model: 5 s pause                         │
//!                     └────────────────────────────────────────── no scan, or none that fits ◄─────────────┘
//! ```
//!
//! `20 25` ends whatever stream an earlier client has left on. The configuration is written (77, into the laser's EEPROM) only
//! where it differs from what is wanted. A telegram that the laser acknowledges may be answered as late as the manual says:
//! seconds; one that it refuses is sent again.

pub use crate::laser::Event;
pub use crate::port::{Demand, Port};

use super::clock::MirrorClock;
use super::framer::Framer;
use super::model::{Reach, Variant};
use super::phases::{Core, Phase};
use super::protocol::{MAX_REQUEST, OVERHEAD, encode};
use super::settings::Lms200Config;
use crate::laser::talk::Lost;
use messages::{LaserState, Link};
use runtime::{Fault, Time};

/// Times and habits of a session.
#[derive(Debug, Clone)]
pub struct SessionConfig {
    /// Time that each answer is waited for where nothing acknowledges the question [s].
    pub answer_s: f64,
    /// Time without a scan after which the laser counts as silent [s].
    pub silence_s: f64,
    /// What the type must begin with; any LMS where empty.
    pub model: String,
    /// Field and resolution; as they are where absent.
    pub variant: Option<Variant>,
    /// How far to measure.
    pub reach: Reach,
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
            answer_s: 1.0,
            silence_s: 1.0,
            model: String::new(),
            variant: None,
            reach: Reach::Keep,
            line_baud: None,
            fast_baud: None,
            hunt_bauds: Vec::new(),
        }
    }
}

/// A telegram to the laser.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    bytes: [u8; MAX_REQUEST],
    length: usize,
}

impl Request {
    /// The telegram of `body`; longer bodies than a configuration are cut, which none of ours is.
    pub fn new(body: &[u8]) -> Request {
        let mut request = Request { bytes: [0; MAX_REQUEST], length: 0 };
        let body = &body[..body.len().min(MAX_REQUEST - OVERHEAD)];
        request.length = encode(&mut request.bytes, 0, body);
        request
    }

    /// All of it.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    /// The command byte.
    pub fn command(&self) -> u8 {
        self.bytes[4]
    }
}

impl AsRef<[u8]> for Request {
    fn as_ref(&self) -> &[u8] {
        self.as_bytes()
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
        Session { framer: Framer::new(true), core: Core::new(config) }
    }

    /// Whether scans flow.
    pub fn is_running(&self) -> bool {
        self.core.phase == Phase::Running
    }

    /// The mirror's clock.
    pub fn clock(&self) -> &MirrorClock {
        &self.core.clock
    }

    /// The telegram finder, for its counters.
    pub fn framer(&self) -> &Framer {
        &self.framer
    }
}

impl crate::laser::Session for Session {
    const TYPE: &'static str = "lms200";
    /// `20 25`: the stream ends.
    const FAREWELL: &'static [u8] = &[0x02, 0x00, 0x02, 0x00, 0x20, 0x25, 0x35, 0x08];
    const FOREIGN: Fault =
        Fault::new("what answers is no laser of the wanted type, refuses the wanted mode, or its scans are none");
    const FAULTY: Fault = Fault::new("the laser says that it cannot measure: see `status` of the state");
    type Settings = Lms200Config;
    type Request = Request;

    fn of(settings: &Lms200Config, line_baud: Option<u32>) -> Session {
        Session::new(settings.session(line_baud))
    }

    fn port(&mut self, now: Time, port: Port) {
        if port != self.core.talk.contact.port() {
            self.framer.clear();
            self.core.port(now, port);
        }
    }

    fn receive(&mut self, now: Time, arrived: Time, mut bytes: &[u8], mut on_event: impl FnMut(Event<'_>)) {
        if !bytes.is_empty() {
            self.core.last_bytes = now;
        }
        while let Some(body) = self.framer.next(&mut bytes) {
            self.core.telegram(now, arrived, body, &mut on_event);
        }
    }

    fn tick(&mut self, now: Time, on_event: impl FnMut(Event<'_>)) -> Option<Demand> {
        if self.framer.is_inside_telegram() && now.since(self.core.last_bytes) > self.core.gap_s() {
            self.framer.give_up();
            let last = self.core.last_bytes;
            self.receive(now, last, &[], on_event);
        }
        self.core.tick(now, &self.framer);
        self.core.talk.contact.take_demand()
    }

    fn next_request(&mut self, now: Time) -> Option<Request> {
        self.core.next_request(now, &self.framer)
    }

    fn link(&self) -> Link {
        self.core.talk.contact.link
    }

    fn is_faulty(&self) -> bool {
        self.core.talk.is_faulty
    }

    fn state(&self) -> LaserState {
        let lost = Lost { messages: self.framer.sum_errors(), bytes: self.framer.skipped_bytes() };
        self.core.talk.state(self.is_running(), lost, self.core.clock.jumps())
    }
}

#[cfg(test)]
mod tests {
    use super::super::protocol::{command, mode};
    use super::*;

    #[test]
    fn the_farewell_is_the_telegram_that_ends_a_stream() {
        let request = Request::new(&[command::MODE, mode::REQUEST]);
        assert_eq!(request.as_bytes(), <Session as crate::laser::Session>::FAREWELL);
    }
}
