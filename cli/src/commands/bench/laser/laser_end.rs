//! The laser's end of a pseudo-terminal: an LMS that answers a start-up and sends a scan when it is told to.

use crate::commands::bench::reflex::Pty;
use drivers::lms200::framer::Framer;
use drivers::lms200::model::{CONFIG, MEASURING_MODE, UNIT, status_at};
use drivers::lms200::protocol::{ACK, FROM_LASER, command, mode, push};
use runtime::{Time, clock};
use std::io;

/// Values of a scan: 180° by halves.
const VALUES: usize = 361;
/// The obstacle: where its middle is, how wide it is on either side [value], and how near; and what is there else [mm].
const SIDE: usize = 60;
const HALF_WIDTH: usize = 14;
const NEAR_MM: u16 = 370;
const FAR_MM: u16 = 5000;
const WELL: u8 = 0x10;

/// The laser and its end of the line.
pub struct LaserEnd {
    pty: Pty,
    framer: Framer,
    streams: bool,
    out: Vec<u8>,
}

impl LaserEnd {
    /// A laser that waits for its client.
    pub fn open() -> io::Result<LaserEnd> {
        Ok(LaserEnd { pty: Pty::open()?, framer: Framer::new(false), streams: false, out: Vec::with_capacity(4096) })
    }

    /// Path of the client's end.
    pub fn name(&self) -> &str {
        self.pty.name()
    }

    /// Answers what the client has asked; never waits.
    pub fn serve(&mut self) -> io::Result<()> {
        let mut buffer = [0; 512];
        let now = clock::now();
        let count = self.pty.read(&mut buffer, now, now)?;
        let mut bytes = &buffer[..count];
        self.out.clear();
        let LaserEnd { framer, out, streams, .. } = self;
        while let Some(body) = framer.next(&mut bytes) {
            out.push(ACK);
            let mut answer = match *body {
                [command::TYPE] => b"\xBALMS200;30106;V02.30".to_vec(),
                [command::STATUS] => {
                    let mut status = vec![0; status_at::LENGTH - 1];
                    (status[0], status[status_at::ANGLE], status[status_at::RESOLUTION]) = (0xB1, 180, 50);
                    status
                }
                [command::GET_CONFIG] => {
                    let mut config = vec![0; CONFIG + 1];
                    (config[0], config[1 + MEASURING_MODE], config[1 + UNIT]) = (0xF4, 5, 1);
                    config
                }
                [command::MODE, wanted, ..] => {
                    *streams = wanted == mode::STREAM;
                    vec![0xA0, 0]
                }
                [command::VARIANT, a, b, c, d] => vec![0xBB, 1, a, b, c, d],
                _ => vec![command::REFUSED],
            };
            answer.push(WELL);
            push(out, FROM_LASER, &answer);
        }
        if self.out.is_empty() { Ok(()) } else { self.pty.write(&self.out) }
    }

    /// Sends a scan with an obstacle to the left, to the right, or with none; when its bytes were handed to the terminal.
    pub fn scan(&mut self, is_left: Option<bool>) -> io::Result<Time> {
        self.serve()?;
        if !self.streams {
            return Ok(clock::now());
        }
        let middle = is_left.map(|is_left| if is_left { VALUES / 2 + SIDE } else { VALUES / 2 - SIDE });
        let mut body = vec![0xB0];
        body.extend_from_slice(&(VALUES as u16 | 1 << 14).to_le_bytes());
        for value in 0..VALUES {
            let is_near = middle.is_some_and(|middle| value.abs_diff(middle) <= HALF_WIDTH);
            // No two walls are equally far: one distance all round would be a covered laser.
            let range_mm = if is_near { NEAR_MM } else { FAR_MM } + (value % 7) as u16;
            body.extend_from_slice(&range_mm.to_le_bytes());
        }
        body.push(WELL);
        self.out.clear();
        push(&mut self.out, FROM_LASER, &body);
        let begin = clock::now();
        self.pty.write(&self.out)?;
        Ok(begin)
    }
}
