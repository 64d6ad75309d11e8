//! The session's phases: what each reply and each time-out leads to.

use super::clock::SensorClock;
use super::model::Sensor;
use super::protocol::{Area, Reply, Request, checked, decode, parse_scan, status};
use super::session::{Event, Port, SessionConfig};
use crate::laser::talk::Talk;
use crate::laser::{MAX_BEAMS, News};
use messages::{Link, ScanBeam};
use runtime::Time;

/// Times that the scanner's clock is asked for.
const CLOCK_QUESTIONS: u8 = 5;

/// Where the connection stands: which request waits for its answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// The port is not open.
    Down,
    /// QT: an earlier client's stream ends.
    Quiet,
    /// SCIP2.0: older scanners begin in SCIP 1.1.
    Dialect,
    /// VV.
    Version,
    /// PP.
    Parameters,
    /// SS.
    Rate,
    /// TM0.
    ClockOn,
    /// TM1 for the n-th time.
    Clock(u8),
    /// TM2.
    ClockOff,
    /// BM.
    LaserOn,
    /// MD or ME.
    Stream,
    /// Scans flow.
    Running,
    /// Nothing is asked for a while.
    Pause,
}

/// All of a session but its framer, so that a message can be lent from there while this changes.
#[derive(Debug, Clone)]
pub struct Core {
    config: SessionConfig,
    pub talk: Talk<Request>,
    pub phase: Phase,
    pub sensor: Option<Sensor>,
    pub clock: SensorClock,
    pub skipped_before: u64,
    area: Area,
    scratch: Vec<u8>,
    values: Vec<(u32, u32)>,
    beams: Vec<ScanBeam>,
}

impl Core {
    /// In [`Phase::Down`].
    pub fn new(config: SessionConfig) -> Core {
        Core {
            talk: Talk::new(config.line_baud, config.hunt_bauds.clone()),
            config,
            phase: Phase::Down,
            sensor: None,
            clock: SensorClock::default(),
            skipped_before: 0,
            area: Area { start: 0, end: 0, cluster: 1 },
            scratch: Vec::with_capacity(MAX_BEAMS * 6),
            values: Vec::with_capacity(MAX_BEAMS),
            beams: Vec::with_capacity(MAX_BEAMS),
        }
    }

    /// The port's state has changed.
    pub fn port(&mut self, now: Time, port: Port, skipped: u64) {
        if self.talk.contact.moved(port) {
            return self.begin(now, skipped);
        }
        self.phase = Phase::Down;
        self.talk.end();
    }

    /// From the top.
    fn begin(&mut self, now: Time, skipped: u64) {
        self.talk.begin();
        self.skipped_before = skipped;
        self.clock.restart();
        // The empty line ends what an earlier client may have left half-written.
        self.ask(now, Phase::Quiet, Request::new(b"QT"));
    }

    fn ask(&mut self, now: Time, phase: Phase, request: Request) {
        self.phase = phase;
        self.talk.ask(now, request, self.config.answer_s);
    }

    fn pause(&mut self, now: Time, link: Link) {
        self.phase = Phase::Pause;
        self.talk.pause(now, link);
    }

    pub fn next_request(&mut self, now: Time) -> Option<Request> {
        self.talk.next_request(now, self.config.answer_s)
    }

    pub fn message(&mut self, now: Time, arrived: Time, message: &[u8], on_event: &mut impl FnMut(Event<'_>)) {
        let reply = Reply::parse(message);
        match (self.phase, reply) {
            (Phase::Down | Phase::Pause, _) => {}
            // In SCIP 1.1 statuses have no sum: whatever answers, it was heard.
            (Phase::Quiet | Phase::Dialect, _) => {
                let line = message.split(|byte| *byte == b'\n').next().unwrap_or_default();
                if self.talk.asked().is_some_and(|(asked, _)| asked.line() == line) {
                    self.talk.heard = true;
                    self.next_question(now);
                }
            }
            (_, Some(reply)) => match self.talk.asked() {
                Some((asked, at)) if reply.answers(asked.line()) => {
                    self.talk.heard = true;
                    self.answer(now, (at, arrived), &reply, on_event);
                }
                // A late scan of an earlier stream, or an answer to another client.
                _ => {}
            },
            (_, None) => self.talk.misfit(),
        }
    }

    /// Asks what comes after the present question.
    fn next_question(&mut self, now: Time) {
        match self.phase {
            Phase::Quiet => self.ask(now, Phase::Dialect, Request::new(b"SCIP2.0")),
            Phase::Dialect => self.ask(now, Phase::Version, Request::new(b"VV")),
            Phase::Version => self.ask(now, Phase::Parameters, Request::new(b"PP")),
            Phase::Parameters => match self.talk.other_rate(self.config.fast_baud) {
                Some(baud) => self.ask(now, Phase::Rate, Request::baud(baud)),
                None => self.ask(now, Phase::ClockOn, Request::new(b"TM0")),
            },
            Phase::Rate => self.ask(now, Phase::ClockOn, Request::new(b"TM0")),
            Phase::ClockOn => self.ask(now, Phase::Clock(1), Request::new(b"TM1")),
            Phase::Clock(n) if n < CLOCK_QUESTIONS => self.ask(now, Phase::Clock(n + 1), Request::new(b"TM1")),
            Phase::Clock(_) => self.ask(now, Phase::ClockOff, Request::new(b"TM2")),
            Phase::ClockOff => self.ask(now, Phase::LaserOn, Request::new(b"BM")),
            Phase::LaserOn => self.ask_for_scans(now),
            Phase::Down | Phase::Stream | Phase::Running | Phase::Pause => {}
        }
    }

    fn ask_for_scans(&mut self, now: Time) {
        let request = Request::stream(self.config.coding(), self.area, self.config.skip, 0);
        self.ask(now, Phase::Stream, request);
    }

    /// The reply to what was asked at one time and came at another.
    fn answer(
        &mut self,
        now: Time,
        (asked, arrived): (Time, Time),
        reply: &Reply,
        on_event: &mut impl FnMut(Event<'_>),
    ) {
        let is_well = matches!(reply.status, status::OK | status::SCAN);
        if !is_well && !matches!(self.phase, Phase::ClockOn | Phase::ClockOff | Phase::LaserOn) {
            self.talk.status = u32::from(u16::from_be_bytes(reply.status));
        }
        match self.phase {
            Phase::Parameters => self.parameters(now, reply),
            Phase::Rate => {
                if is_well && let Some(baud) = self.config.fast_baud {
                    self.talk.contact.switch(baud);
                }
                self.next_question(now);
            }
            // A scanner without this mode: its scans alone must do.
            Phase::ClockOn if !is_well && reply.status != status::ALREADY => {
                self.ask(now, Phase::LaserOn, Request::new(b"BM"));
            }
            Phase::Clock(_) => {
                let stamp = reply.lines().next().and_then(checked).filter(|line| line.len() == 4).and_then(decode);
                if let Some(stamp) = stamp {
                    self.clock.synchronise(stamp, asked, arrived);
                }
                self.next_question(now);
            }
            Phase::LaserOn if !is_well && reply.status != status::ALREADY => {
                self.talk.status = u32::from(u16::from_be_bytes(reply.status));
                self.fault(now);
            }
            Phase::Stream | Phase::Running => self.scan_or_status(now, arrived, reply, on_event),
            _ => self.next_question(now),
        }
    }

    fn parameters(&mut self, now: Time, reply: &Reply) {
        self.sensor = Sensor::parse(reply);
        match &self.sensor {
            Some(sensor) if self.config.model.is_empty() || sensor.is(&self.config.model) => {
                let (from_rad, to_rad) = self.config.between_rad;
                self.area = sensor.area(from_rad, to_rad, self.config.cluster);
                self.next_question(now);
            }
            // Another model, or one that measures nothing.
            _ => self.pause(now, Link::Foreign),
        }
    }

    fn scan_or_status(&mut self, now: Time, arrived: Time, reply: &Reply, on_event: &mut impl FnMut(Event<'_>)) {
        let Some(sensor) = self.sensor else { return };
        match reply.status {
            status::OK => {
                self.phase = Phase::Running;
                self.talk.streams(now);
                on_event(Event::Sweep(&sensor.sweep(&self.area)));
            }
            status::SCAN if self.phase == Phase::Running => {
                self.values.resize(self.area.count(), (0, 0));
                let coding = self.config.coding();
                match parse_scan(reply.body, coding, &mut self.scratch, &mut self.values) {
                    Ok(stamp) => {
                        self.beams.clear();
                        self.beams.extend(self.values.iter().map(|(value, intensity)| sensor.beam(*value, *intensity)));
                        self.talk.scanned(now);
                        self.talk.is_faulty = false;
                        let span_s = sensor.delay_s(self.area.end);
                        let (begun, sensor_time_s) = self.clock.scan(stamp, arrived, span_s);
                        let first_s = sensor.delay_s(self.area.start);
                        on_event(Event::Scan(News {
                            first: begun.after_s(first_s),
                            sensor_time_s: sensor_time_s + first_s,
                            beams: &self.beams,
                        }));
                    }
                    Err(_) => self.talk.misfit(),
                }
            }
            status::SCAN => {}
            status::LASER_OFF => self.ask(now, Phase::LaserOn, Request::new(b"BM")),
            status::RESUMED => self.ask_for_scans(now),
            // Stopped to verify itself: 98 follows, or a fault.
            [b'2'..=b'4', _] => self.talk.is_busy(now),
            [b'5'..=b'9', _] => self.fault(now),
            // Our request is refused: something else than a SCIP 2.0 scanner.
            _ => self.pause(now, Link::Foreign),
        }
    }

    /// The scanner says that it cannot measure.
    fn fault(&mut self, now: Time) {
        self.pause(now, Link::Up);
        self.talk.is_faulty = true;
    }

    pub fn tick(&mut self, now: Time, junk: bool, skipped: u64) {
        match self.phase {
            Phase::Down => {}
            Phase::Running if self.talk.fell_silent(now, self.config.silence_s) => self.begin(now, skipped),
            Phase::Running => {}
            Phase::Pause if self.talk.is_over(now) => self.begin(now, skipped),
            // Some scanners answer QT only in SCIP 2.0.
            Phase::Quiet if self.talk.is_over(now) => self.next_question(now),
            _ if self.talk.is_over(now) && self.phase != Phase::Pause => self.miss(now, junk, skipped),
            _ => {}
        }
    }

    /// An answer did not come.
    fn miss(&mut self, now: Time, junk: bool, skipped: u64) {
        // Junk alone: something else lives there.
        self.talk.miss(junk);
        self.begin(now, skipped);
    }
}
