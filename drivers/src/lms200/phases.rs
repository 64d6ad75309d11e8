//! The session's phases: what each answer and each time-out leads to.

use super::clock::MirrorClock;
use super::framer::Framer;
use super::model::{CONFIG, MEASURING_MODE, Scale, Status, UNIT, Variant, is_error, is_remarkable};
use super::protocol::{MAX_VALUES, OVERHEAD, Scan, Unit, command, mode};
use super::session::{Event, Port, Request, SessionConfig};
use crate::laser::News;
use crate::laser::talk::Talk;
use messages::{Echo, Link, ScanBeam};
use runtime::Time;

/// Times that a refused telegram is sent again.
const REPEATS: u8 = 2;
/// Pause within a telegram after which its rest will not come, beside the time of a byte [s].
const GAP_S: f64 = 0.1;

/// Where the connection stands: which request waits for its answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// The port is not open.
    Down,
    /// 20 25: an earlier client's stream ends.
    Quiet,
    /// 20 4x.
    Rate,
    /// 3A.
    Type,
    /// 31.
    Status,
    /// 74.
    Config,
    /// 20 00 and the password.
    Install,
    /// 77.
    SetConfig,
    /// 20 25 after that.
    Leave,
    /// 3B.
    Variant,
    /// 20 24.
    Stream,
    /// Scans flow.
    Running,
    /// Nothing is asked for a while.
    Pause,
}

impl Phase {
    /// How long an acknowledged request may take, by the manual and a margin [s].
    fn patience_s(self) -> f64 {
        match self {
            Phase::SetConfig => 15.0,
            Phase::Variant => 12.0,
            Phase::Install | Phase::Leave => 6.0,
            _ => 3.0,
        }
    }
}

/// All of a session but its framer, so that a telegram can be lent from there while this changes.
#[derive(Debug, Clone)]
pub struct Core {
    config: SessionConfig,
    pub talk: Talk<Request>,
    pub phase: Phase,
    pub clock: MirrorClock,
    pub last_bytes: Time,
    variant: Variant,
    scale: Scale,
    /// The configuration as the laser has told it.
    told: Option<[u8; CONFIG]>,
    /// Times that the present question has been sent again.
    repeats: u8,
    /// The framer's counts when the last request went out: acknowledged, refused, junk.
    answers: (u64, u64),
    junk: u64,
    beams: Vec<ScanBeam>,
}

impl Core {
    /// In [`Phase::Down`].
    pub fn new(config: SessionConfig) -> Core {
        Core {
            talk: Talk::new(config.line_baud, config.hunt_bauds.clone()),
            config,
            phase: Phase::Down,
            clock: MirrorClock::default(),
            last_bytes: Time::ZERO,
            variant: Variant::default(),
            scale: Scale::of(0, Unit::Centimetre),
            told: None,
            repeats: 0,
            answers: (0, 0),
            junk: 0,
            beams: Vec::with_capacity(MAX_VALUES),
        }
    }

    /// The port's state has changed.
    pub fn port(&mut self, now: Time, port: Port) {
        if self.talk.contact.moved(port) {
            return self.begin(now);
        }
        self.phase = Phase::Down;
        self.talk.end();
    }

    /// Pause after which a begun telegram will not be completed [s].
    pub fn gap_s(&self) -> f64 {
        GAP_S + self.line_s(1)
    }

    /// Time that bytes take on the line [s].
    fn line_s(&self, bytes: usize) -> f64 {
        self.talk.contact.baud().map_or(0.0, |baud| bytes as f64 * 10.0 / f64::from(baud.max(1)))
    }

    /// From the top.
    fn begin(&mut self, now: Time) {
        self.talk.begin();
        self.told = None;
        self.clock.restart();
        self.ask(now, Phase::Quiet, &[command::MODE, mode::REQUEST]);
    }

    fn ask(&mut self, now: Time, phase: Phase, body: &[u8]) {
        self.phase = phase;
        self.repeats = 0;
        self.talk.ask(now, Request::new(body), self.config.answer_s);
    }

    fn pause(&mut self, now: Time, link: Link) {
        self.phase = Phase::Pause;
        self.talk.pause(now, link);
    }

    pub fn next_request(&mut self, now: Time, framer: &Framer) -> Option<Request> {
        // On a slow line a scan may have to pass first.
        let busy_s = self.line_s(2 * MAX_VALUES + 16);
        let request = self.talk.next_request(now, self.config.answer_s + busy_s)?;
        (self.answers, self.junk) = (framer.answers(), framer.skipped_bytes());
        Some(request)
    }

    pub fn telegram(&mut self, now: Time, arrived: Time, body: &[u8], on_event: &mut impl FnMut(Event<'_>)) {
        let (Some(&kind), Some(&status)) = (body.first(), body.last()) else { return };
        if matches!(self.phase, Phase::Down | Phase::Pause) {
            return;
        }
        if is_remarkable(status) {
            self.talk.status = u32::from(status);
        }
        if kind == command::SCAN + command::ANSWER {
            if self.phase == Phase::Running {
                self.scan(now, arrived, body, on_event);
            }
            return;
        }
        match (self.talk.asked(), kind) {
            // Switched on just now: what was set before is gone.
            (_, command::POWER_ON) => self.begin(now),
            (Some((asked, _)), _) if kind == asked.command() | command::ANSWER => {
                self.talk.heard = true;
                self.answer(now, body, on_event);
            }
            (Some(_), command::REFUSED) => {
                self.talk.heard = true;
                self.refused(now);
            }
            // Of an earlier stream, or for another client.
            _ => {}
        }
    }

    fn answer(&mut self, now: Time, body: &[u8], on_event: &mut impl FnMut(Event<'_>)) {
        let is_well = body.len() > 2 && body[1] == 0;
        match self.phase {
            Phase::Quiet => match self.talk.other_rate(self.config.fast_baud).and_then(rate_mode) {
                Some(code) => self.ask(now, Phase::Rate, &[command::MODE, code]),
                None => self.ask(now, Phase::Type, &[command::TYPE]),
            },
            Phase::Rate => {
                if is_well && let Some(baud) = self.config.fast_baud {
                    self.talk.contact.switch(baud);
                }
                self.ask(now, Phase::Type, &[command::TYPE]);
            }
            Phase::Type => {
                let name = &body[1..];
                let wanted = if self.config.model.is_empty() { "LMS" } else { &self.config.model };
                let is_it = name.get(..wanted.len()).is_some_and(|name| name.eq_ignore_ascii_case(wanted.as_bytes()));
                match is_it {
                    true => self.ask(now, Phase::Status, &[command::STATUS]),
                    false => self.pause(now, Link::Foreign),
                }
            }
            Phase::Status => match Status::parse(body) {
                Some(status) if status.is_faulty => self.fault(now),
                told => {
                    self.variant = told.and_then(|told| told.variant).unwrap_or_default();
                    self.ask(now, Phase::Config, &[command::GET_CONFIG]);
                }
            },
            Phase::Config => self.configured(now, &body[1..]),
            Phase::Install if is_well => self.write_config(now),
            Phase::SetConfig if body.len() > 2 && body[1] == 1 => {
                self.scaled(&body[2..]);
                self.ask(now, Phase::Leave, &[command::MODE, mode::REQUEST]);
            }
            Phase::Install | Phase::SetConfig => self.refused(now),
            Phase::Leave => self.ask_variant(now),
            Phase::Variant => self.variant(now, body),
            Phase::Stream if is_well => {
                self.phase = Phase::Running;
                self.talk.streams(now);
                on_event(Event::Sweep(&self.variant.sweep(self.scale)));
            }
            Phase::Stream => self.pause(now, Link::Foreign),
            Phase::Down | Phase::Running | Phase::Pause => {}
        }
    }

    /// The laser does not do what it was asked: what can be done without goes on.
    fn refused(&mut self, now: Time) {
        match self.phase {
            Phase::Quiet => self.ask(now, Phase::Type, &[command::TYPE]),
            Phase::Rate => self.ask(now, Phase::Type, &[command::TYPE]),
            Phase::Status => self.ask(now, Phase::Config, &[command::GET_CONFIG]),
            Phase::Config => self.ask_variant(now),
            // It measures, but not as far as it should, or elsewhere.
            _ => self.pause(now, Link::Foreign),
        }
    }

    fn configured(&mut self, now: Time, config: &[u8]) {
        let Some(told) = config.first_chunk::<CONFIG>() else { return self.refused(now) };
        self.scaled(told);
        self.told = Some(*told);
        match self.config.reach.codes() {
            Some(codes) if codes != (told[MEASURING_MODE], told[UNIT]) => {
                let mut password = [0; 10];
                password[0] = command::MODE;
                password[1] = mode::INSTALL;
                password[2..].copy_from_slice(mode::PASSWORD);
                self.ask(now, Phase::Install, &password);
            }
            _ => self.ask_variant(now),
        }
    }

    fn write_config(&mut self, now: Time) {
        let (Some(told), Some((measuring_mode, unit))) = (self.told, self.config.reach.codes()) else {
            return self.refused(now);
        };
        let mut body = [0; CONFIG + 1];
        body[0] = command::SET_CONFIG;
        body[1..].copy_from_slice(&told);
        body[1 + MEASURING_MODE] = measuring_mode;
        body[1 + UNIT] = unit;
        self.ask(now, Phase::SetConfig, &body);
    }

    /// Takes over how distances are written, from a configuration.
    fn scaled(&mut self, config: &[u8]) {
        if let (Some(&measuring_mode), Some(&unit)) = (config.get(MEASURING_MODE), config.get(UNIT))
            && let Some(unit) = Unit::of(unit)
        {
            self.scale = Scale::of(measuring_mode, unit);
        }
    }

    fn ask_variant(&mut self, now: Time) {
        match self.config.variant {
            Some(Variant { angle_deg, resolution_cdeg }) => {
                let ([a, b], [c, d]) = (angle_deg.to_le_bytes(), resolution_cdeg.to_le_bytes());
                self.ask(now, Phase::Variant, &[command::VARIANT, a, b, c, d]);
            }
            None => self.ask(now, Phase::Stream, &[command::MODE, mode::STREAM]),
        }
    }

    fn variant(&mut self, now: Time, body: &[u8]) {
        let told = match body {
            [_, 1, a, b, c, d, ..] => Variant::of(u16::from_le_bytes([*a, *b]), u16::from_le_bytes([*c, *d])),
            _ => None,
        };
        match told {
            Some(variant) if Some(variant) == self.config.variant => {
                self.variant = variant;
                self.ask(now, Phase::Stream, &[command::MODE, mode::STREAM]);
            }
            _ => self.pause(now, Link::Foreign),
        }
    }

    fn scan(&mut self, now: Time, arrived: Time, body: &[u8], on_event: &mut impl FnMut(Event<'_>)) {
        let fits = |scan: &Scan| scan.first == 0 && scan.values.len() == 2 * self.variant.count();
        let Some(scan) = Scan::parse(body).filter(fits) else {
            return self.talk.misfit();
        };
        self.talk.scanned(now);
        self.talk.is_faulty = is_error(scan.status);
        if !is_remarkable(scan.status) {
            self.talk.status = 0;
        }
        if scan.unit != self.scale.unit {
            self.scale.unit = scan.unit;
            on_event(Event::Sweep(&self.variant.sweep(self.scale)));
        }
        let (scale, is_faulty) = (self.scale, self.talk.is_faulty);
        self.beams.clear();
        self.beams.extend(scan.iter().map(|value| match is_faulty {
            false => scale.beam(value),
            true => ScanBeam { range_m: 0.0, intensity: 0, echo: Echo::Fault as u16 },
        }));
        let sweep = self.variant.sweep(scale);
        let after_s = sweep.span_s() + self.line_s(body.len() + OVERHEAD);
        let first = self.clock.scan(arrived, after_s, sweep.scan_s());
        on_event(Event::Scan(News { first, sensor_time_s: f64::NAN, beams: &self.beams }));
    }

    /// The laser says that it cannot measure.
    fn fault(&mut self, now: Time) {
        self.pause(now, Link::Up);
        self.talk.is_faulty = true;
    }

    pub fn tick(&mut self, now: Time, framer: &Framer) {
        match self.phase {
            Phase::Down => {}
            Phase::Running if self.talk.fell_silent(now, self.config.silence_s) => self.begin(now),
            Phase::Running => {}
            Phase::Pause if self.talk.is_over(now) => self.begin(now),
            Phase::Pause => {}
            _ => self.wait(now, framer),
        }
    }

    /// Looks whether the request has been acknowledged or refused, and how long its answer may still take.
    fn wait(&mut self, now: Time, framer: &Framer) {
        if self.talk.asked().is_none() {
            return;
        }
        let (acknowledged, refused) = framer.answers();
        let quiet = framer.skipped_bytes() <= self.junk;
        if refused > self.answers.1 && quiet && self.repeats < REPEATS {
            self.repeats += 1;
            self.talk.ask_again();
        } else if acknowledged > self.answers.0 && quiet {
            self.answers.0 = acknowledged;
            self.talk.wait_on(now, self.phase.patience_s());
        } else if self.talk.is_over(now) {
            let junk = !quiet || framer.is_inside_telegram();
            self.talk.miss(junk);
            self.begin(now);
        }
    }
}

/// The mode that switches to a rate.
fn rate_mode(baud: u32) -> Option<u8> {
    mode::BAUDS.into_iter().find(|(_, known)| *known == baud).map(|(code, _)| code)
}
