//! The session's phases: what each packet and each time-out leads to.

use super::config::ConfigPacket;
use super::protocol::{Argument, Framer, command, packet};
use super::queue::Queue;
use super::session::{Event, Port, SessionConfig};
use super::sip::{EncoderTicks, Identity, Sip};
use crate::contact::Contact;
use messages::Link;
use runtime::Time;

/// CONFIG is asked for this often, at this interval [s].
const CONFIG_TRIES: u32 = 5;
const CONFIG_INTERVAL_S: f64 = 0.2;

/// Time before a robot that was refused is asked again [s].
const REFUSED_S: f64 = 5.0;

/// All of a session but its framer, so that a payload can be lent from there while this changes.
#[derive(Debug, Clone)]
pub struct Core {
    config: SessionConfig,
    pub phase: Phase,
    pub contact: Contact,
    pub identity: Identity,
    pub queue: Queue,
    /// When the phase began and when it gives up.
    since: Time,
    deadline: Time,
    pub last_bytes: Time,
    last_sip: Time,
    pub next_send: Time,
    pub last_sent: Time,
    pub pulse_s: f64,
    pub connections: u32,
    config_tries: u32,
    config_at: Time,
    /// Packets and skipped bytes when the handshake began: tells "nothing" from "something foreign".
    packets_before: u64,
    skipped_before: u64,
    /// Who a predecessor has found at the other end of the line that is handed over.
    inherits: Option<Identity>,
}

/// Where the connection stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// The port is not open.
    Down,
    /// SYNC of that number was sent.
    Sync(u8),
    /// CLOSE was sent; whatever comes is let drain.
    Closing,
    /// OPEN was sent.
    Opening,
    /// SIPs flow.
    Running,
}

impl Core {
    /// In [`Phase::Down`].
    pub fn new(config: SessionConfig) -> Core {
        let pulse_s = config.pulse_s;
        Core {
            contact: Contact::new(config.line_baud, config.hunt_bauds.clone()),
            config,
            phase: Phase::Down,
            identity: Identity::default(),
            queue: Queue::new(),
            since: Time::ZERO,
            deadline: Time::ZERO,
            last_bytes: Time::ZERO,
            last_sip: Time::ZERO,
            next_send: Time::ZERO,
            last_sent: Time::ZERO,
            pulse_s,
            connections: 0,
            config_tries: 0,
            config_at: Time::ZERO,
            packets_before: 0,
            skipped_before: 0,
            inherits: None,
        }
    }

    /// The port's state has changed.
    pub fn port(&mut self, now: Time, port: Port, framer: &Framer) {
        if self.contact.moved(port) {
            return match self.inherits.take() {
                Some(identity) if (self.config.knows)(&identity) => self.go_on(now, identity),
                _ => self.begin(now, framer),
            };
        }
        self.phase = Phase::Down;
        self.queue.clear();
    }

    fn enter(&mut self, now: Time, phase: Phase, timeout_s: f64) {
        self.phase = phase;
        self.since = now;
        self.deadline = now.after_s(timeout_s);
    }

    /// The next opening of the port is of a line on which a session with `identity` goes on.
    pub fn inherit(&mut self, identity: Identity) {
        self.inherits = Some(identity);
    }

    /// Into the session of a dead predecessor: STOP, then its SIPs; when none comes, from the top.
    fn go_on(&mut self, now: Time, identity: Identity) {
        self.queue.clear();
        self.queue.push(command::STOP, Argument::None);
        self.identity = identity;
        self.enter(now, Phase::Opening, self.config.sync_timeout_s);
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

    pub fn packet(&mut self, now: Time, payload: &[u8], on_event: &mut impl FnMut(Event)) {
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
                    self.contact.link = Link::Silent;
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
            self.contact.link = Link::Foreign;
            return self.enter(now, Phase::Closing, REFUSED_S);
        }
        self.queue.push(command::OPEN, Argument::Integer(1));
        self.enter(now, Phase::Opening, 2.0 * self.config.sync_timeout_s);
    }

    fn connected(&mut self, now: Time) {
        self.enter(now, Phase::Running, 0.0);
        self.contact.up();
        self.connections = self.connections.saturating_add(1);
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

    pub fn tick(&mut self, now: Time, framer: &Framer) {
        match self.phase {
            Phase::Down => {}
            Phase::Sync(_) | Phase::Opening if now >= self.deadline => self.miss(now, framer),
            Phase::Closing if now >= self.deadline => self.sync(now, 0),
            Phase::Running if now.since(self.last_sip) > self.config.silence_s => {
                self.contact.link = Link::Silent;
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
        let packets = framer.packets() > self.packets_before;
        let junk = framer.skipped_bytes() > self.skipped_before || framer.is_inside_packet();
        // Junk alone, or a handshake that the other end begins and never ends: something else lives there.
        self.contact.miss(junk && !packets);
        self.begin(now, framer);
    }

    pub fn sent(&mut self, now: Time, bytes: usize) {
        // Ten bits per byte on the line; a packet is due when the line has taken the one before.
        let line_s = self.contact.baud().map_or(0.0, |baud| bytes as f64 * 10.0 / f64::from(baud.max(1)));
        self.last_sent = now;
        self.next_send = now.after_s(self.config.spacing_s.max(line_s));
    }
}
