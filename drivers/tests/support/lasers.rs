//! Two small lasers for the drivers' tests: the least that start-up and streaming need. (The simulator's are others.)

use drivers::lms200::framer::Framer;
use drivers::lms200::model::{CONFIG, MEASURING_MODE, UNIT, status_at};
use drivers::lms200::protocol::{ACK, FROM_LASER, NAK, command, mode, push};
use drivers::urg::protocol::{encode, push_block, push_line, sum};

/// A laser at the other end of a line.
pub trait Scanner {
    /// Takes bytes; gives what it answers.
    fn hear(&mut self, bytes: &[u8]) -> Vec<u8>;
    /// A whole scan of these values, the `k`-th, 25 ms after the one before; nothing while it does not stream.
    fn scan(&mut self, k: u32, values: &[u32]) -> Vec<u8>;
    /// Values of a whole scan.
    fn count(&self) -> usize;
    /// It says that it is something else.
    fn pretend(&mut self, name: &str);
}

/// An LMS 200 of 361 values.
pub struct Lms {
    pub framer: Framer,
    pub name: String,
    pub streams: bool,
    pub config: [u8; CONFIG],
    pub variant: [u8; 4],
    /// Refuses the next telegrams by a NAK.
    pub refuses: u32,
    /// Every body that it was sent.
    pub log: Vec<Vec<u8>>,
    /// The rate at which it listens, and whether it acknowledges without answering.
    pub baud: u32,
    pub only_acknowledges: bool,
}

impl Default for Lms {
    fn default() -> Lms {
        let mut config = [0; CONFIG];
        config[MEASURING_MODE] = 0;
        config[UNIT] = 1;
        Lms {
            framer: Framer::new(false),
            name: "LMS200;30106;V02.30".into(),
            streams: false,
            config,
            variant: [180, 0, 100, 0],
            refuses: 0,
            log: Vec::new(),
            baud: 9600,
            only_acknowledges: false,
        }
    }
}

impl Lms {
    fn answer(&mut self, body: &[u8]) -> Vec<u8> {
        let mut out = vec![ACK];
        if self.only_acknowledges {
            return out;
        }
        let parts: Vec<u8> = match body {
            [command::TYPE] => [&[0xBA], self.name.as_bytes()].concat(),
            [command::STATUS] => {
                let mut status = vec![0; status_at::LENGTH - 1];
                status[0] = 0xB1;
                status[status_at::ANGLE..][..4].copy_from_slice(&self.variant);
                status
            }
            [command::GET_CONFIG] => [&[0xF4][..], &self.config].concat(),
            [command::SET_CONFIG, config @ ..] => {
                self.config[..config.len()].copy_from_slice(config);
                [&[0xF7, 1][..], &self.config].concat()
            }
            [command::MODE, wanted, ..] => {
                self.streams = *wanted == mode::STREAM;
                if let Some((_, baud)) = mode::BAUDS.into_iter().find(|(code, _)| code == wanted) {
                    self.baud = baud;
                }
                vec![0xA0, 0]
            }
            [command::VARIANT, variant @ ..] if variant.len() == 4 => {
                self.variant.copy_from_slice(variant);
                [&[0xBB, 1], variant].concat()
            }
            _ => vec![command::REFUSED],
        };
        push(&mut out, FROM_LASER, &[&parts[..], &[0x10]].concat());
        out
    }
}

impl Scanner for Lms {
    fn hear(&mut self, mut bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        let mut framer = std::mem::replace(&mut self.framer, Framer::idle());
        while let Some(body) = framer.next(&mut bytes) {
            self.log.push(body.to_vec());
            match self.refuses {
                0 => out.extend(self.answer(body)),
                _ => {
                    self.refuses -= 1;
                    out.push(NAK);
                }
            }
        }
        self.framer = framer;
        out
    }

    fn scan(&mut self, _: u32, values: &[u32]) -> Vec<u8> {
        let mut out = Vec::new();
        if self.streams {
            let mut body = vec![0xB0];
            body.extend_from_slice(&(values.len() as u16 | u16::from(self.config[UNIT]) << 14).to_le_bytes());
            values.iter().for_each(|value| body.extend_from_slice(&(*value as u16).to_le_bytes()));
            body.push(0x10);
            push(&mut out, FROM_LASER, &body);
        }
        out
    }

    fn count(&self) -> usize {
        361
    }

    fn pretend(&mut self, name: &str) {
        self.name = name.into();
    }
}

/// A UTM-30LX.
pub struct Scip {
    line: Vec<u8>,
    pub name: String,
    stream: Option<Vec<u8>>,
    /// What its clock reads when `k` is 0 [ms].
    pub clock_ms: u32,
}

impl Default for Scip {
    fn default() -> Scip {
        Scip { line: Vec::new(), name: "UTM-30LX".into(), stream: None, clock_ms: 5000 }
    }
}

impl Scip {
    fn answer(&mut self, line: &[u8]) -> Vec<u8> {
        let reply = |status: &[u8]| {
            let mut out = [line, b"\n"].concat();
            push_line(&mut out, status);
            out
        };
        let mut out = match line {
            b"PP" => {
                let mut out = reply(b"00");
                let name = format!("MODL:{}", self.name);
                for pair in
                    [&name, "DMIN:23", "DMAX:60000", "ARES:1440", "AMIN:0", "AMAX:1080", "AFRT:540", "SCAN:2400"]
                {
                    out.extend_from_slice(pair.as_bytes());
                    out.extend_from_slice(&[b';', sum(pair.as_bytes()), b'\n']);
                }
                out
            }
            b"TM0" => reply(b"01"),
            [b'M', ..] => {
                self.stream = Some(line.to_vec());
                reply(b"00")
            }
            b"QT" => {
                self.stream = None;
                reply(b"00")
            }
            _ => reply(b"00"),
        };
        out.push(b'\n');
        out
    }
}

impl Scanner for Scip {
    fn hear(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        for byte in bytes {
            match byte {
                b'\n' => {
                    let line = std::mem::take(&mut self.line);
                    if !line.is_empty() {
                        out.extend(self.answer(&line));
                    }
                }
                other => self.line.push(*other),
            }
        }
        out
    }

    fn scan(&mut self, k: u32, values: &[u32]) -> Vec<u8> {
        let Some(line) = &self.stream else { return Vec::new() };
        let mut out = [line, &b"\n"[..]].concat();
        push_line(&mut out, b"99");
        let mut stamp = [0; 4];
        encode(&mut stamp, (self.clock_ms + 25 * k) & 0xFF_FFFF);
        push_line(&mut out, &stamp);
        let mut characters = Vec::new();
        for value in values {
            let mut three = [0; 3];
            encode(&mut three, *value);
            characters.extend_from_slice(&three);
        }
        push_block(&mut out, &characters);
        out.push(b'\n');
        out
    }

    fn count(&self) -> usize {
        1081
    }

    fn pretend(&mut self, name: &str) {
        self.name = name.into();
    }
}
