//! The connection to the microcontroller as a state machine: handshake, watchdog feeding, recovery. It never blocks,
//! reads no clock and does no I/O; the node tells it the time, the link and the bytes, and sends what it says.
//!
//! ```text
//! Down ─ port open ─► Sync 0 ─► 1 ─► 2 ─ identity ─► Opening ─ first SIP ─► Running
//!                      │ ▲ a robot that runs already: CLOSE, drain           │
//!                      ▼ │                                                   │ no SIP for a second, or an echo
//!                     Closing ◄──────────────────────────────────────────────┘ of SYNC: all over again
//! ```
//!
//! Every handshake begins with STOP: a robot that is still in a session takes SYNC0 for PULSE, and PULSE after its
//! watchdog has acted lets it *resume its old motion*. STOP first takes that motion away; a robot that waits for
//! SYNC0 ignores it.

pub use crate::port::{Demand, Port};

use super::config::ConfigPacket;
use super::phases::{Core, Phase};
use super::protocol::{Argument, BYTE_GAP_S, COMMAND_SPACING_S, Framer, MAX_PACKET, command, encode_command};
use super::sip::{EncoderTicks, Identity, Sip};
use messages::Link;
use runtime::Time;

/// Times and habits of a session.
#[derive(Debug, Clone)]
pub struct SessionConfig {
    /// Time that each step of the handshake waits for its answer [s].
    pub sync_timeout_s: f64,
    /// Time to let a running robot's last packets drain after CLOSE [s].
    pub drain_s: f64,
    /// Time without a SIP after which the robot counts as silent [s].
    pub silence_s: f64,
    /// Time without a command after which PULSE is sent; a third of the robot's watchdog if that is less [s].
    pub pulse_s: f64,
    /// Least time between two commands [s].
    pub spacing_s: f64,
    /// Speed of the line, when it is a serial one: packets are not sent faster than it takes them [baud].
    pub line_baud: Option<u32>,
    /// Line speeds to try in turn when nothing answers; empty for none.
    pub hunt_bauds: Vec<u32>,
    /// Whether to ask for the configuration.
    pub asks_config: bool,
    /// Whether a robot of this identity can be driven; one that cannot is not opened.
    pub knows: fn(&Identity) -> bool,
}

impl Default for SessionConfig {
    fn default() -> SessionConfig {
        SessionConfig {
            sync_timeout_s: 0.5,
            drain_s: 0.2,
            silence_s: 1.0,
            pulse_s: 0.6,
            spacing_s: COMMAND_SPACING_S,
            line_baud: None,
            hunt_bauds: Vec::new(),
            asks_config: true,
            knows: |_| true,
        }
    }
}

/// What came from the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event<'a> {
    /// The handshake is done and the first SIP is here: settings may be sent.
    Connected(&'a Identity),
    /// A SIP.
    Sip(&'a Sip),
    /// The configuration.
    Config(&'a ConfigPacket),
    /// Wheel ticks.
    Encoder(EncoderTicks),
    /// Any other packet: its payload.
    Other(&'a [u8]),
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
            self.core.port(now, port, &self.framer);
        }
    }

    /// The port, when it opens, is one on which a predecessor's session with `identity` goes on.
    pub fn inherit(&mut self, identity: Identity) {
        self.core.inherit(identity);
    }

    /// A packet of `length` bytes went out past the session: the next ones keep their distance.
    pub fn sent_aside(&mut self, now: Time, length: usize) {
        self.core.sent(now, length);
    }

    /// Takes bytes from the robot and hands on what they say.
    pub fn receive(&mut self, now: Time, mut bytes: &[u8], mut on_event: impl FnMut(Event)) {
        if !bytes.is_empty() {
            self.core.last_bytes = now;
        }
        while let Some(payload) = self.framer.next(&mut bytes) {
            self.core.packet(now, payload, &mut on_event);
        }
    }

    /// Lets time pass; call it after all that has arrived was received. Says what the port should do.
    pub fn tick(&mut self, now: Time, on_event: impl FnMut(Event)) -> Option<Demand> {
        if self.framer.is_inside_packet() && now.since(self.core.last_bytes) > BYTE_GAP_S {
            self.framer.give_up();
            self.receive(now, &[], on_event);
        }
        self.core.tick(now, &self.framer);
        self.core.contact.take_demand()
    }

    /// Whether a packet may be sent now: the port is open and the last one is long enough ago.
    pub fn may_send(&self, now: Time) -> bool {
        self.core.phase != Phase::Down && now >= self.core.next_send
    }

    /// Whether the robot runs: handshake done, SIPs flow, settings and motion commands may be sent.
    pub fn is_running(&self) -> bool {
        self.core.phase == Phase::Running
    }

    /// Puts a command behind those that wait; `false` when the queue is full, the argument is unfit or the robot
    /// does not run.
    pub fn enqueue(&mut self, number: u8, argument: Argument) -> bool {
        self.is_running() && self.core.queue.push(number, argument)
    }

    /// Encodes the next waiting command into `out`; `None` when there is none or it is too early.
    pub fn next_queued(&mut self, now: Time, out: &mut [u8; MAX_PACKET]) -> Option<usize> {
        if !self.may_send(now) {
            return None;
        }
        let length = self.core.queue.pop(out)?;
        self.core.sent(now, length);
        Some(length)
    }

    /// Encodes a command that goes out at once; `None` when it is too early, the robot does not run, or the argument
    /// is unfit.
    pub fn next_direct(
        &mut self,
        now: Time,
        number: u8,
        argument: Argument,
        out: &mut [u8; MAX_PACKET],
    ) -> Option<usize> {
        if !self.may_send(now) || !self.is_running() {
            return None;
        }
        let length = encode_command(out, number, argument).ok()?;
        self.core.sent(now, length);
        Some(length)
    }

    /// Encodes a PULSE when the watchdog needs one.
    pub fn next_pulse(&mut self, now: Time, out: &mut [u8; MAX_PACKET]) -> Option<usize> {
        if now.since(self.core.last_sent) < self.core.pulse_s {
            return None;
        }
        self.next_direct(now, command::PULSE, Argument::None, out)
    }

    /// State of the link, and why there are no data.
    pub fn link(&self) -> Link {
        self.core.contact.link
    }

    /// Who answered last.
    pub fn identity(&self) -> &Identity {
        &self.core.identity
    }

    /// Times that the link came up.
    pub fn connections(&self) -> u32 {
        self.core.connections
    }

    /// The packet finder, for its counters.
    pub fn framer(&self) -> &Framer {
        &self.framer
    }
}
