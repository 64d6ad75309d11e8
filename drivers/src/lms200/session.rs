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

pub use crate::port::{Demand, Port};

use super::clock::MirrorClock;
use super::framer::Framer;
use super::model::{Reach, Variant};
use super::phases::{Core, Phase};
use super::protocol::{MAX_REQUEST, OVERHEAD, encode};
use crate::laser::Sweep;
use messages::{Link, ScanBeam};
use runtime::Time;

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

/// What came from the laser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event<'a> {
    /// Scans are such from now on.
    Sweep(&'a Sweep),
    /// A scan: when its first beam was taken in our time, and its beams.
    Scan(Time, &'a [ScanBeam]),
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

    /// Tells what the port is doing; call it before [`receive`](Session::receive).
    pub fn port(&mut self, now: Time, port: Port) {
        if port != self.core.contact.port() {
            self.framer.clear();
            self.core.port(now, port);
        }
    }

    /// Takes bytes of which the last came at `arrived`, and hands on what they say.
    pub fn receive(&mut self, now: Time, arrived: Time, mut bytes: &[u8], mut on_event: impl FnMut(Event)) {
        if !bytes.is_empty() {
            self.core.last_bytes = now;
        }
        while let Some(body) = self.framer.next(&mut bytes) {
            self.core.telegram(now, arrived, body, &mut on_event);
        }
    }

    /// Lets time pass; call it after all that has arrived was received. Says what the port should do.
    pub fn tick(&mut self, now: Time, on_event: impl FnMut(Event)) -> Option<Demand> {
        if self.framer.is_inside_telegram() && now.since(self.core.last_bytes) > self.core.gap_s() {
            self.framer.give_up();
            let last = self.core.last_bytes;
            self.receive(now, last, &[], on_event);
        }
        self.core.tick(now, &self.framer);
        self.core.contact.take_demand()
    }

    /// The telegram that goes out now, if one waits.
    pub fn next_request(&mut self, now: Time) -> Option<Request> {
        self.core.next_request(now, &self.framer)
    }

    /// Whether scans flow.
    pub fn is_running(&self) -> bool {
        self.core.phase == Phase::Running
    }

    /// State of the link, and why there are no data.
    pub fn link(&self) -> Link {
        self.core.contact.link
    }

    /// The laser's last status byte that was not "all well"; 0 for none.
    pub fn status(&self) -> u32 {
        u32::from(self.core.status)
    }

    /// The laser has said that it cannot measure.
    pub fn is_faulty(&self) -> bool {
        self.core.is_faulty
    }

    /// Times that the stream began, whole scans, and damaged telegrams.
    pub fn counts(&self) -> (u32, u32, u32) {
        let sums = u32::try_from(self.framer.sum_errors()).unwrap_or(u32::MAX);
        (self.core.connections, self.core.scans, self.core.damaged.saturating_add(sums))
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
