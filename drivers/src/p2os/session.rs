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

use super::config::ConfigPacket;
use super::protocol::{Argument, BYTE_GAP_S, COMMAND_SPACING_S, Framer, MAX_PACKET, command, encode_command, packet};
use super::queue::Queue;
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

/// What the port is doing, as the node sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// Not open.
    Closed,
    /// Being opened.
    Opening,
    /// Open; the number changes with every new opening.
    Open(u64),
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

/// What the port should do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Demand {
    /// Close and open again.
    Reopen,
    /// Switch the line to this speed [baud].
    Baud(u32),
}

/// Misses after which the port is opened anew, and after which the next line speed is tried.
const MISSES_PER_REOPEN: u32 = 5;
const MISSES_PER_BAUD: u32 = 2;
/// CONFIG is asked for this often, at this interval [s].
const CONFIG_TRIES: u32 = 5;
const CONFIG_INTERVAL_S: f64 = 0.2;

/// Time before a robot that was refused is asked again [s].
const REFUSED_S: f64 = 5.0;

/// The connection; see the module's text.
#[derive(Debug, Clone)]
pub struct Session {
    framer: Framer,
    core: Core,
}

/// All but the framer, so that a payload can be lent from there while this changes.
#[derive(Debug, Clone)]
struct Core {
    config: SessionConfig,
    phase: Phase,
    port: Port,
    link: Link,
    identity: Identity,
    queue: Queue,
    /// When the phase began and when it gives up.
    since: Time,
    deadline: Time,
    last_bytes: Time,
    last_sip: Time,
    next_send: Time,
    last_sent: Time,
    pulse_s: f64,
    misses: u32,
    connections: u32,
    config_tries: u32,
    config_at: Time,
    /// Packets and skipped bytes when the handshake began: tells "nothing" from "something foreign".
    packets_before: u64,
    skipped_before: u64,
    demand: Option<Demand>,
    baud_index: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Down,
    Sync(u8),
    Closing,
    Opening,
    Running,
}

impl Session {
    /// A session whose port is closed.
    pub fn new(config: SessionConfig) -> Session {
        let pulse_s = config.pulse_s;
        let core = Core {
            config,
            phase: Phase::Down,
            port: Port::Closed,
            link: Link::Connecting,
            identity: Identity::default(),
            queue: Queue::new(),
            since: Time::ZERO,
            deadline: Time::ZERO,
            last_bytes: Time::ZERO,
            last_sip: Time::ZERO,
            next_send: Time::ZERO,
            last_sent: Time::ZERO,
            pulse_s,
            misses: 0,
            connections: 0,
            config_tries: 0,
            config_at: Time::ZERO,
            packets_before: 0,
            skipped_before: 0,
            demand: None,
            baud_index: 0,
        };
        Session { framer: Framer::new(), core }
    }

    /// Tells what the port is doing; call it before [`receive`](Session::receive).
    pub fn port(&mut self, now: Time, port: Port) {
        let core = &mut self.core;
        if port == core.port {
            return;
        }
        let was_open = matches!(core.port, Port::Open(_));
        core.port = port;
        match port {
            Port::Open(_) => {
                self.framer.clear();
                core.misses = 0;
                core.link = Link::Connecting;
                core.begin(now, &self.framer);
            }
            Port::Opening | Port::Closed => {
                core.phase = Phase::Down;
                core.queue.clear();
                if was_open {
                    core.link = Link::Lost;
                } else if core.link != Link::Lost {
                    core.link = if port == Port::Opening { Link::Connecting } else { Link::NoPort };
                }
            }
        }
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
        self.core.demand.take()
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
        self.core.link
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

impl Core {
    fn enter(&mut self, now: Time, phase: Phase, timeout_s: f64) {
        self.phase = phase;
        self.since = now;
        self.deadline = now.after_s(timeout_s);
    }

    /// From the top: STOP, then SYNC0.
    fn begin(&mut self, now: Time, framer: &Framer) {
        self.queue.clear();
        self.queue.push(command::STOP, Argument::None);
        self.packets_before = framer.packets();
        self.skipped_before = framer.skipped_bytes();
        self.sync(now, 0);
    }

    fn sync(&mut self, now: Time, step: u8) {
        self.queue.push(step, Argument::None);
        self.enter(now, Phase::Sync(step), self.config.sync_timeout_s);
    }

    fn packet(&mut self, now: Time, payload: &[u8], on_event: &mut impl FnMut(Event)) {
        let Some(&kind) = payload.first() else { return };
        match self.phase {
            Phase::Down | Phase::Closing => {}
            // An echo of another step is late or early; the time-out decides.
            Phase::Sync(step) if kind <= command::SYNC2 => {
                if kind == step {
                    self.echo(now, step, payload);
                }
            }
            // The robot is in a session already: its own packets answer where an echo should.
            Phase::Sync(_) => {
                self.queue.clear();
                self.queue.push(command::STOP, Argument::None);
                self.queue.push(command::CLOSE, Argument::Integer(1));
                self.enter(now, Phase::Closing, self.config.drain_s);
            }
            Phase::Opening => {
                if packet::is_sip(kind) {
                    self.connected(now);
                    on_event(Event::Connected(&self.identity));
                    self.hand_on(now, payload, on_event);
                }
            }
            Phase::Running => {
                // A robot that echoes PULSE has restarted and waits for its handshake.
                if kind <= command::SYNC2 && now.since(self.since) > self.config.sync_timeout_s {
                    self.link = Link::Silent;
                    self.queue.clear();
                    self.queue.push(command::STOP, Argument::None);
                    self.sync(now, 0);
                } else {
                    self.hand_on(now, payload, on_event);
                }
            }
        }
    }

    fn echo(&mut self, now: Time, step: u8, payload: &[u8]) {
        if step < command::SYNC2 {
            return self.sync(now, step + 1);
        }
        self.identity = Identity::parse(payload).unwrap_or_default();
        if !(self.config.knows)(&self.identity) {
            self.link = Link::Foreign;
            return self.enter(now, Phase::Closing, REFUSED_S);
        }
        self.queue.push(command::OPEN, Argument::Integer(1));
        self.enter(now, Phase::Opening, 2.0 * self.config.sync_timeout_s);
    }

    fn connected(&mut self, now: Time) {
        self.enter(now, Phase::Running, 0.0);
        self.link = Link::Up;
        self.connections = self.connections.saturating_add(1);
        self.misses = 0;
        self.last_sip = now;
        self.pulse_s = self.config.pulse_s;
        self.config_tries = if self.config.asks_config { CONFIG_TRIES } else { 0 };
        self.config_at = now;
        // The firmware may hold set-points of an earlier session.
        self.queue.push(command::STOP, Argument::None);
    }

    fn hand_on(&mut self, now: Time, payload: &[u8], on_event: &mut impl FnMut(Event)) {
        if let Some(sip) = Sip::parse(payload) {
            self.last_sip = now;
            on_event(Event::Sip(&sip));
        } else if let Some(config) = ConfigPacket::parse(payload) {
            self.config_tries = 0;
            if config.watchdog_ms > 0 {
                self.pulse_s = self.config.pulse_s.min(f64::from(config.watchdog_ms) * 1e-3 / 3.0);
            }
            on_event(Event::Config(&config));
        } else if let Some(ticks) = EncoderTicks::parse(payload) {
            on_event(Event::Encoder(ticks));
        } else {
            on_event(Event::Other(payload));
        }
    }

    fn tick(&mut self, now: Time, framer: &Framer) {
        match self.phase {
            Phase::Down => {}
            Phase::Sync(_) | Phase::Opening if now >= self.deadline => self.miss(now, framer),
            Phase::Closing if now >= self.deadline => self.sync(now, 0),
            Phase::Running if now.since(self.last_sip) > self.config.silence_s => {
                self.link = Link::Silent;
                self.begin(now, framer);
            }
            Phase::Running if self.config_tries > 0 && now >= self.config_at => {
                self.config_tries -= 1;
                self.config_at = now.after_s(CONFIG_INTERVAL_S);
                self.queue.push(command::CONFIG, Argument::Integer(1));
            }
            _ => {}
        }
    }

    /// An answer did not come.
    fn miss(&mut self, now: Time, framer: &Framer) {
        self.misses = self.misses.saturating_add(1);
        let packets = framer.packets() > self.packets_before;
        let junk = framer.skipped_bytes() > self.skipped_before || framer.is_inside_packet();
        // Junk alone, or a handshake that the other end begins and never ends: something else lives there.
        self.link = if junk && !packets { Link::Foreign } else { Link::Silent };
        if self.misses.is_multiple_of(MISSES_PER_REOPEN) {
            self.demand = Some(Demand::Reopen);
        } else if self.misses.is_multiple_of(MISSES_PER_BAUD) && !self.config.hunt_bauds.is_empty() {
            self.baud_index = (self.baud_index + 1) % self.config.hunt_bauds.len();
            let baud = self.config.hunt_bauds[self.baud_index];
            self.config.line_baud = Some(baud);
            self.demand = Some(Demand::Baud(baud));
        }
        self.begin(now, framer);
    }

    fn sent(&mut self, now: Time, bytes: usize) {
        // Ten bits per byte on the line; a packet is due when the line has taken the one before.
        let line_s = self.config.line_baud.map_or(0.0, |baud| bytes as f64 * 10.0 / f64::from(baud.max(1)));
        self.last_sent = now;
        self.next_send = now.after_s(self.config.spacing_s.max(line_s));
    }
}
