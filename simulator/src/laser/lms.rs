//! The electronics of an LMS 200, without any line: telegrams in, acknowledgements, answers and scans out.
//!
//! As left by its last user it listens at 500 kBd, so that a line without a rate carries every scan; a client that switches
//! to a slower rate gets the newest scans that fit through it, as from the device. What a client may send beside the manual is
//! answered as the independent clients expect: short configurations, a resolution of 0.

use super::server::OUTBOX;
use super::unit::outbox;
use drivers::laser::Sweep;
use drivers::lms200::framer::Framer;
use drivers::lms200::model::{CONFIG, MEASURING_MODE, Scale, UNIT, Variant, status_at};
use drivers::lms200::protocol::{ACK, FROM_LASER, MAX_BODY, MAX_VALUES, NAK, OVERHEAD, Unit, command, encode, mode};
use runtime::Time;

/// The status byte of a laser that is well.
const WELL: u8 = 0x10;
/// What it says that it is.
const TYPE: &[u8] = b"LMS200;30106;V02.30";
/// The rate at which it was left [baud].
const LEFT_AT: u32 = 500_000;

/// See the module's text.
#[derive(Debug, Clone)]
pub(super) struct Lms {
    framer: Framer,
    mode: u8,
    variant: Variant,
    config: [u8; CONFIG],
    /// Part of the field that is streamed: first and last value from 1.
    part: (u16, u16),
    has_new_sweep: bool,
    latest_m: Vec<f64>,
    /// A scan was asked for before there was one.
    wanted: bool,
    rate_baud: u32,
    /// The line is taken up to then.
    busy_until: Time,
    body: Vec<u8>,
    pub out: Vec<u8>,
    pub baud: Option<u32>,
}

impl Lms {
    /// A laser just switched on, in millimetres up to 32 m.
    pub fn new() -> Lms {
        let mut config = [0; CONFIG];
        (config[MEASURING_MODE], config[UNIT]) = (5, 1);
        Lms {
            framer: Framer::new(false),
            mode: mode::REQUEST,
            variant: Variant::default(),
            config,
            part: (1, 1),
            has_new_sweep: false,
            latest_m: Vec::with_capacity(MAX_VALUES),
            wanted: false,
            rate_baud: LEFT_AT,
            busy_until: Time::ZERO,
            body: Vec::with_capacity(MAX_BODY),
            out: outbox(),
            baud: None,
        }
    }

    /// The beams after power-on.
    pub fn sweep(&self) -> Sweep {
        self.variant.sweep(self.scale())
    }

    /// Other beams, where a command has changed them.
    pub fn take_sweep(&mut self) -> Option<Sweep> {
        std::mem::take(&mut self.has_new_sweep).then(|| self.sweep())
    }

    /// Another client: a serial device does not notice, and streams on.
    pub fn restart(&mut self) {
        self.framer.clear();
        self.out.clear();
    }

    /// Whether anybody wants scans; the mirror turns anyhow.
    pub fn measures(&self) -> bool {
        self.wanted || self.streams()
    }

    fn streams(&self) -> bool {
        matches!(self.mode, mode::STREAM | mode::STREAM_PART)
    }

    pub fn hear(&mut self, bytes: &[u8]) {
        let mut framer = std::mem::replace(&mut self.framer, Framer::idle());
        let mut rest = bytes;
        let mut damaged = framer.sum_errors();
        while let Some(body) = framer.next(&mut rest) {
            self.obey(body);
        }
        damaged = framer.sum_errors() - damaged;
        if damaged > 0 && self.out.len() < OUTBOX {
            self.out.push(NAK);
        }
        self.framer = framer;
    }

    /// A whole scan, its last beam taken at `taken`.
    pub fn scan(&mut self, taken: Time, ranges_m: &[f64]) {
        self.latest_m.clear();
        self.latest_m.extend_from_slice(ranges_m);
        let is_whole = ranges_m.len() == self.variant.count();
        if !is_whole || !self.measures() || taken < self.busy_until {
            return;
        }
        self.wanted = false;
        let before = self.out.len();
        self.send_scan();
        let bits = (self.out.len() - before) as u64 * 10;
        self.busy_until = taken.after_ns(bits * 1_000_000_000 / u64::from(self.rate_baud.max(1)));
    }

    fn scale(&self) -> Scale {
        Scale::of(self.config[MEASURING_MODE], Unit::of(self.config[UNIT]).unwrap_or(Unit::Centimetre))
    }

    fn obey(&mut self, body: &[u8]) {
        if self.out.len() + 512 > OUTBOX {
            return;
        }
        self.out.push(ACK);
        match *body {
            [command::TYPE] => self.say(&[&[command::TYPE | 0x80], TYPE]),
            [command::STATUS] => self.status(),
            [command::GET_CONFIG] => {
                let config = self.config;
                self.say(&[&[command::GET_CONFIG | 0x80], &config]);
            }
            [command::SET_CONFIG, ref config @ ..] => self.configure(config),
            [command::MODE, wanted, ref rest @ ..] => self.switch_mode(wanted, rest),
            // The next whole scan is the answer.
            [command::SCAN, 1] => self.wanted = true,
            [command::VARIANT, a, b, c, d] => {
                self.switch_variant(u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
            }
            [command::RESET] => {
                self.say(&[&[command::RESET + 0x81]]);
                (self.mode, self.variant, self.has_new_sweep) = (mode::REQUEST, Variant::default(), true);
                self.say(&[&[command::POWER_ON], TYPE]);
            }
            _ => self.say(&[&[command::REFUSED]]),
        }
    }

    /// An answer: the parts, and the status byte.
    fn say(&mut self, parts: &[&[u8]]) {
        self.body.clear();
        parts.iter().for_each(|part| self.body.extend_from_slice(part));
        self.body.push(WELL);
        self.push_body();
    }

    fn push_body(&mut self) {
        let start = self.out.len();
        if start + self.body.len() + OVERHEAD > OUTBOX {
            return;
        }
        self.out.resize(start + self.body.len() + OVERHEAD, 0);
        let length = encode(&mut self.out[start..], FROM_LASER, &self.body);
        self.out.truncate(start + length);
    }

    fn switch_mode(&mut self, wanted: u8, rest: &[u8]) {
        const ANSWER: u8 = command::MODE | 0x80;
        let result = match (wanted, rest) {
            (mode::INSTALL, rest) => u8::from(rest != mode::PASSWORD),
            (mode::STREAM | mode::REQUEST, []) => 0,
            (mode::STREAM_PART, &[a, b, c, d]) => {
                let (first, last) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
                let is_part = first >= 1 && first <= last && usize::from(last) <= self.variant.count();
                if is_part {
                    self.part = (first, last);
                }
                if is_part { 0 } else { 2 }
            }
            (code, []) => {
                let rate = mode::BAUDS.into_iter().find(|(known, _)| *known == code);
                if let Some((_, baud)) = rate {
                    (self.rate_baud, self.baud) = (baud, Some(baud));
                    return self.say(&[&[ANSWER, 0]]);
                }
                2
            }
            _ => 2,
        };
        if result == 0 {
            self.mode = wanted;
        }
        self.say(&[&[ANSWER, result]]);
    }

    fn switch_variant(&mut self, angle_deg: u16, resolution_cdeg: u16) {
        let asked = match resolution_cdeg {
            // As one client says "as it is".
            0 => Some(self.variant),
            _ => Variant::of(angle_deg, resolution_cdeg),
        };
        if let Some(variant) = asked {
            self.has_new_sweep |= variant != self.variant;
            self.variant = variant;
        }
        let Variant { angle_deg, resolution_cdeg } = self.variant;
        let ([a, b], [c, d]) = (angle_deg.to_le_bytes(), resolution_cdeg.to_le_bytes());
        self.say(&[&[command::VARIANT | 0x80, u8::from(asked.is_some()), a, b, c, d]]);
    }

    fn configure(&mut self, config: &[u8]) {
        let allowed = self.mode == mode::INSTALL && config.len() <= CONFIG;
        let unit = config.get(UNIT).copied().unwrap_or(self.config[UNIT]);
        let done = allowed && Unit::of(unit).is_some();
        if done {
            self.config[..config.len()].copy_from_slice(config);
            // The scale may be another: beams are the same, their reach is not.
            self.has_new_sweep = true;
        }
        let config = self.config;
        self.say(&[&[command::SET_CONFIG | 0x80, u8::from(done)], &config]);
    }

    fn status(&mut self) {
        let mut status = [0; status_at::LENGTH - 1];
        status[0] = command::STATUS | 0x80;
        status[1..8].copy_from_slice(b" V02.30");
        status[status_at::MODE] = self.mode;
        status[status_at::MEASURING_MODE] = self.config[MEASURING_MODE];
        let Variant { angle_deg, resolution_cdeg } = self.variant;
        status[status_at::ANGLE..][..2].copy_from_slice(&angle_deg.to_le_bytes());
        status[status_at::RESOLUTION..][..2].copy_from_slice(&resolution_cdeg.to_le_bytes());
        // The divider of the rate's generator, as 8001 hexadecimal at 500 kBd up to 8019 + 40 at 9600.
        let divider = (500_000 / self.rate_baud.max(1)) as u16;
        status[status_at::BAUD..][..2].copy_from_slice(&(0x8000 | divider).to_le_bytes());
        status[status_at::UNIT] = self.config[UNIT];
        status[status_at::LASER_ON] = 1;
        self.say(&[&status]);
    }

    fn send_scan(&mut self) {
        let scale = self.scale();
        let unit = u16::from(self.config[UNIT]) << 14;
        let is_part = self.mode == mode::STREAM_PART;
        let (first, last) = if is_part { self.part } else { (1, self.latest_m.len() as u16) };
        let Some(values) = self.latest_m.get(usize::from(first) - 1..usize::from(last)) else { return };
        self.body.clear();
        match is_part {
            false => self.body.push(command::SCAN | 0x80),
            true => {
                self.body.push(command::PART | 0x80);
                self.body.extend_from_slice(&first.to_le_bytes());
                self.body.extend_from_slice(&last.to_le_bytes());
            }
        }
        self.body.extend_from_slice(&(values.len() as u16 | unit).to_le_bytes());
        for range_m in values {
            self.body.extend_from_slice(&scale.value(*range_m).to_le_bytes());
        }
        self.body.push(WELL);
        self.push_body();
    }
}
