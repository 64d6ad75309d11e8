//! The electronics of a SCIP 2.0 scanner, without any line: commands in, replies and scans out.
//!
//! The time stamp of a scan is the instant at which the mirror passes step 0. Statuses and checks follow the
//! specification; what a client may send beside it is answered as the independent clients expect.

use super::server::OUTBOX;
use super::unit::outbox;
use drivers::urg::model::Sensor;
use drivers::urg::protocol::{
    Area, BAUDS, Coding, MAX_REQUEST, STAMP_BITS, decimal, encode, push_block, push_line, status, sum,
};
use runtime::Time;

/// A stream of scans that somebody has asked for.
#[derive(Debug, Clone, Copy)]
struct Stream {
    /// The request's line.
    line: [u8; MAX_REQUEST],
    length: usize,
    coding: Coding,
    area: Area,
    skip: u8,
    /// Scans to go; `None` for ever.
    left: Option<u8>,
    /// Scans to leave out before the next one.
    wait: u8,
    /// The first scan begins after the request: it never comes together with the reply.
    since: Time,
}

/// See the module's text.
#[derive(Debug, Clone)]
pub(super) struct Scip {
    sensor: Sensor,
    boot_ms: u32,
    laser_on: bool,
    adjusts_time: bool,
    stream: Option<Stream>,
    /// A G command that waits for the first scan after the laser went on.
    wanted: Option<Stream>,
    line: Vec<u8>,
    latest_m: Vec<f64>,
    latest: Option<Time>,
    characters: Vec<u8>,
    pub out: Vec<u8>,
    pub baud: Option<u32>,
}

impl Scip {
    /// A scanner just switched on, its clock `boot_ms` ahead of ours.
    pub fn new(sensor: Sensor, boot_ms: u32) -> Scip {
        Scip {
            sensor,
            boot_ms,
            laser_on: false,
            adjusts_time: false,
            stream: None,
            wanted: None,
            line: Vec::with_capacity(MAX_REQUEST),
            latest_m: Vec::with_capacity(drivers::laser::MAX_BEAMS),
            latest: None,
            characters: Vec::with_capacity(drivers::laser::MAX_BEAMS * 6),
            out: outbox(),
            baud: None,
        }
    }

    /// Another client.
    pub fn restart(&mut self) {
        self.line.clear();
        self.out.clear();
        self.baud = None;
        self.quit();
    }

    /// Whether the laser is on.
    pub fn measures(&self) -> bool {
        self.laser_on
    }

    pub fn hear(&mut self, now: Time, bytes: &[u8]) {
        for byte in bytes {
            match byte {
                b'\n' | b'\r' if self.line.is_empty() => {}
                b'\n' | b'\r' => {
                    let mut line = [0; MAX_REQUEST];
                    let length = self.line.len();
                    line[..length].copy_from_slice(&self.line);
                    self.line.clear();
                    self.obey(now, &line[..length]);
                }
                // An overlong line is cut; its length is then wrong for every command.
                _ if self.line.len() < MAX_REQUEST => self.line.push(*byte),
                _ => {}
            }
        }
    }

    pub fn scan(&mut self, begun: Time, ranges_m: &[f64]) {
        self.latest_m.clear();
        self.latest_m.extend_from_slice(ranges_m);
        self.latest = Some(begun);
        if let Some(wanted) = self.wanted.take() {
            self.send_scan(&wanted, status::OK);
        }
        let Some(mut stream) = self.stream.filter(|stream| begun >= stream.since) else { return };
        if stream.wait > 0 {
            stream.wait -= 1;
            self.stream = Some(stream);
            return;
        }
        stream.wait = stream.skip;
        if let Some(left) = &mut stream.left {
            *left -= 1;
            let digits = [b'0' + *left / 10, b'0' + *left % 10];
            stream.line[13..15].copy_from_slice(&digits);
        }
        self.stream = Some(stream);
        self.send_scan(&stream, status::SCAN);
        if stream.left == Some(0) {
            (self.stream, self.laser_on) = (None, false);
        }
    }

    fn obey(&mut self, now: Time, line: &[u8]) {
        let command = line.split(|byte| *byte == b';').next().unwrap_or_default();
        match command {
            b"SCIP2.0" => self.reply(line, *b"0E"),
            b"VV" => self.version(line),
            b"PP" => self.parameters(line),
            b"II" => self.information(now, line),
            b"BM" => {
                let was_on = std::mem::replace(&mut self.laser_on, true);
                self.reply(line, if was_on { status::ALREADY } else { status::OK });
            }
            b"QT" | b"RS" | b"RT" => {
                self.quit();
                self.reply(line, status::OK);
            }
            b"TM0" => {
                let status = if self.adjusts_time { *b"02" } else { status::OK };
                self.quit();
                self.adjusts_time = true;
                self.reply(line, status);
            }
            b"TM1" if self.adjusts_time => {
                let mut stamp = [0; 4];
                encode(&mut stamp, self.stamp(now));
                self.begin(line, status::OK);
                push_line(&mut self.out, &stamp);
                self.out.push(b'\n');
            }
            b"TM1" => self.reply(line, *b"04"),
            b"TM2" => {
                let status = if self.adjusts_time { status::OK } else { *b"03" };
                self.adjusts_time = false;
                self.reply(line, status);
            }
            // The state in three digits: 000 is "works well".
            b"%ST" => {
                self.begin(line, status::OK);
                push_line(&mut self.out, b"000");
                self.out.push(b'\n');
            }
            b"%SL" | b"HS0" | b"HS1" => self.reply(line, status::OK),
            [b'C', b'R', _, _] | [b'D', b'B', _, _] | [b'R', b'B'] => self.reply(line, status::OK),
            [b'S', b'S', digits @ ..] => {
                let (status, baud) = self.rate(digits);
                self.reply(line, status);
                self.baud = baud.or(self.baud);
            }
            [b'G', letter, rest @ ..] => self.get(line, *letter, rest),
            [b'M', letter, rest @ ..] => self.begin_stream(now, line, *letter, rest),
            [b'V' | b'P' | b'I' | b'B' | b'Q' | b'R' | b'T' | b'S' | b'H' | b'C' | b'D' | b'%', ..] => {
                self.reply(line, status::UNKNOWN[1]);
            }
            _ => self.reply(line, status::UNKNOWN[0]),
        }
    }

    fn quit(&mut self) {
        (self.stream, self.wanted, self.laser_on, self.adjusts_time, self.latest) = (None, None, false, false, None);
    }

    /// What SS leads to: its status, and the rate where the line is to have another one.
    fn rate(&self, digits: &[u8]) -> ([u8; 2], Option<u32>) {
        // The Ethernet models have no line, and do not know the command's length.
        if digits.len() != 6 || self.sensor.is("UST-10LX") {
            return (status::BAD_LENGTH, None);
        }
        match decimal(digits) {
            None => (*b"01", None),
            Some(baud) if self.baud == Some(baud) => (*b"03", None),
            Some(baud) if BAUDS.contains(&baud) => (status::OK, Some(baud)),
            Some(_) => (*b"04", None),
        }
    }

    /// `ssss eeee cc` of G and M commands, or the status of what is wrong with it.
    fn area(&self, parameters: &[u8]) -> Result<Area, [u8; 2]> {
        let number = |from: usize, to: usize, wrong: &[u8; 2]| decimal(&parameters[from..to]).ok_or(*wrong);
        let (start, end) = (number(0, 4, b"01")?, number(4, 8, b"02")?);
        let cluster = number(8, 10, b"03")? as u8;
        // A common scanner measures from AMIN on, and answers for steps before it, too: as nothing measured.
        if end > self.sensor.last_step {
            return Err(*b"04");
        }
        if end < start {
            return Err(*b"05");
        }
        Ok(Area { start: start as u16, end: end as u16, cluster })
    }

    fn get(&mut self, line: &[u8], letter: u8, parameters: &[u8]) {
        let Some(coding) = Coding::of(letter) else { return self.reply(line, status::UNKNOWN[1]) };
        if parameters.split(|byte| *byte == b';').next().map(<[u8]>::len) != Some(10) {
            return self.reply(line, status::BAD_LENGTH);
        }
        match self.area(parameters) {
            Err(status) => self.reply(line, status),
            Ok(_) if !self.laser_on => self.reply(line, status::LASER_OFF),
            Ok(area) => {
                let get = stream(line, coding, area, 0, None);
                match self.latest {
                    Some(_) => self.send_scan(&get, status::OK),
                    None => self.wanted = Some(get),
                }
            }
        }
    }

    fn begin_stream(&mut self, now: Time, line: &[u8], letter: u8, parameters: &[u8]) {
        let Some(coding) = Coding::of(letter) else { return self.reply(line, status::UNKNOWN[1]) };
        if parameters.split(|byte| *byte == b';').next().map(<[u8]>::len) != Some(13) {
            return self.reply(line, status::BAD_LENGTH);
        }
        let area = match self.area(parameters) {
            Ok(area) => area,
            Err(status) => return self.reply(line, status),
        };
        let (Some(skip), Some(count)) = (decimal(&parameters[10..11]), decimal(&parameters[11..13])) else {
            let skip_is_wrong = decimal(&parameters[10..11]).is_none();
            return self.reply(line, if skip_is_wrong { *b"06" } else { *b"07" });
        };
        self.laser_on = true;
        let stream = stream(line, coding, area, skip as u8, (count > 0).then_some(count as u8));
        self.stream = Some(Stream { since: now, ..stream });
        self.reply(line, status::OK);
    }

    fn send_scan(&mut self, stream: &Stream, status: [u8; 2]) {
        let Some(begun) = self.latest else { return };
        let needs = stream.length + 16 + stream.area.count() * stream.coding.characters() * 67 / 64;
        if self.out.len() + needs > OUTBOX {
            return;
        }
        self.begin(&stream.line[..stream.length], status);
        let mut stamp = [0; 4];
        encode(&mut stamp, self.stamp(begun));
        push_line(&mut self.out, &stamp);
        self.characters.clear();
        let width = stream.coding.characters();
        for index in 0..stream.area.count() {
            let (value, intensity) = self.value(&stream.area, index);
            let mut six = [0; 6];
            match stream.coding {
                Coding::Short => encode(&mut six[..2], value.min(0xFFF)),
                _ => {
                    encode(&mut six[..3], value);
                    encode(&mut six[3..], intensity);
                }
            }
            self.characters.extend_from_slice(&six[..width]);
        }
        push_block(&mut self.out, &self.characters);
        self.out.push(b'\n');
    }

    /// What the device says of the `index`-th cluster, and how strong the echo was.
    fn value(&self, area: &Area, index: usize) -> (u32, u32) {
        let cluster = usize::from(area.cluster.max(1));
        let first = usize::from(area.start) + index * cluster;
        let last = (first + cluster - 1).min(usize::from(area.end));
        let unmeasured = self.sensor.first_step as usize;
        let mut least_m = f64::INFINITY;
        for step in first..=last {
            if let Some(range_m) = step.checked_sub(unmeasured).and_then(|beam| self.latest_m.get(beam)) {
                least_m = least_m.min(*range_m);
            }
        }
        // A finite distance within the mirror's reach is below 100 m.
        let value = (least_m * 1e3).round().min(1e6) as u32;
        let is_old = self.sensor.is("URG-04LX");
        match value {
            _ if value > self.sensor.max_mm => (u32::from(!is_old), 0),
            _ if value < self.sensor.min_mm => (if is_old { 7 } else { 2 }, 0),
            _ => (value, (4000.0 / (1.0 + least_m)) as u32),
        }
    }

    fn stamp(&self, at: Time) -> u32 {
        let ms = at.nanos() / 1_000_000 + u64::from(self.boot_ms);
        (ms & ((1 << STAMP_BITS) - 1)) as u32
    }

    fn begin(&mut self, line: &[u8], status: [u8; 2]) {
        self.out.extend_from_slice(line);
        self.out.push(b'\n');
        push_line(&mut self.out, &status);
    }

    fn reply(&mut self, line: &[u8], status: [u8; 2]) {
        if self.out.len() + line.len() + 8 <= OUTBOX {
            self.begin(line, status);
            self.out.push(b'\n');
        }
    }

    /// Lines `KEY:value;S`; the sum leaves the `;` out.
    fn say(&mut self, line: &[u8], pairs: &[(&str, &[u8])]) {
        if self.out.len() + 1024 > OUTBOX {
            return;
        }
        self.begin(line, status::OK);
        for (key, value) in pairs {
            self.characters.clear();
            self.characters.extend_from_slice(key.as_bytes());
            self.characters.push(b':');
            self.characters.extend_from_slice(value);
            let sum = sum(&self.characters);
            self.out.extend_from_slice(&self.characters);
            self.out.extend_from_slice(&[b';', sum, b'\n']);
        }
        self.out.push(b'\n');
    }

    fn version(&mut self, line: &[u8]) {
        let sensor = self.sensor;
        self.say(
            line,
            &[
                ("VEND", b"Hokuyo Automatic Co.,Ltd."),
                ("PROD", sensor.name()),
                ("FIRM", b"1.0.0(simulated)"),
                ("PROT", b"SCIP 2.0"),
                ("SERI", b"S0000001"),
            ],
        );
    }

    fn parameters(&mut self, line: &[u8]) {
        let sensor = self.sensor;
        let numbers = [
            sensor.min_mm,
            sensor.max_mm,
            sensor.steps_per_turn,
            sensor.first_step,
            sensor.last_step,
            sensor.front_step,
            sensor.rpm,
        ]
        .map(Digits::of);
        let [min, max, steps, first, last, front, rpm] = &numbers;
        self.say(
            line,
            &[
                ("MODL", sensor.name()),
                ("DMIN", min.text()),
                ("DMAX", max.text()),
                ("ARES", steps.text()),
                ("AMIN", first.text()),
                ("AMAX", last.text()),
                ("AFRT", front.text()),
                ("SCAN", rpm.text()),
            ],
        );
    }

    fn information(&mut self, now: Time, line: &[u8]) {
        let sensor = self.sensor;
        let mut time = [0; 6];
        let stamp = self.stamp(now);
        for (place, digit) in time.iter_mut().enumerate() {
            *digit = b"0123456789ABCDEF"[(stamp >> (20 - 4 * place) & 15) as usize];
        }
        let laser: &[u8] = if self.laser_on { b"ON" } else { b"OFF" };
        let mode: &[u8] = if self.stream.is_some() { b"Measuring" } else { b"Idle" };
        let rpm = Digits::of(sensor.rpm);
        self.say(
            line,
            &[
                ("MODL", sensor.name()),
                ("LASR", laser),
                ("SCSP", rpm.text()),
                ("MESM", mode),
                ("SBPS", b"USB only"),
                ("TIME", &time),
                ("STAT", b"Sensor works well."),
            ],
        );
    }
}

fn stream(line: &[u8], coding: Coding, area: Area, skip: u8, left: Option<u8>) -> Stream {
    let mut kept = [0; MAX_REQUEST];
    kept[..line.len()].copy_from_slice(line);
    Stream { line: kept, length: line.len(), coding, area, skip, left, wait: 0, since: Time::ZERO }
}

/// A number in decimal digits without allocating.
struct Digits {
    bytes: [u8; 10],
    from: usize,
}

impl Digits {
    fn of(mut value: u32) -> Digits {
        let mut digits = Digits { bytes: [b'0'; 10], from: 10 };
        loop {
            digits.from -= 1;
            digits.bytes[digits.from] = b'0' + (value % 10) as u8;
            value /= 10;
            if value == 0 {
                return digits;
            }
        }
    }

    fn text(&self) -> &[u8] {
        &self.bytes[self.from..]
    }
}
