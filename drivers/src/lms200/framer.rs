//! Finds telegrams in a stream of bytes.

use super::protocol::{ACK, FROM_LASER, MAX_BODY, MAX_TELEGRAM, NAK, OVERHEAD, STX, crc};

/// An incremental, bounded telegram finder: bytes in, bodies out, whatever stands between them.
///
/// After a wrong sum it hunts on from the second byte of what it had taken for a telegram.
#[derive(Debug, Clone)]
pub struct Framer {
    held: Vec<u8>,
    /// Length of the telegram that the last call returned.
    returned: usize,
    from_laser: bool,
    telegrams: u64,
    sum_errors: u64,
    skipped_bytes: u64,
    acknowledged: u64,
    refused: u64,
}

impl Framer {
    /// Finds what a laser says, or what a client says to one.
    pub fn new(from_laser: bool) -> Framer {
        Framer { held: Vec::with_capacity(MAX_TELEGRAM), from_laser, ..Framer::idle() }
    }

    /// One that holds no memory, to stand in for another for a moment.
    pub const fn idle() -> Framer {
        Framer {
            held: Vec::new(),
            returned: 0,
            from_laser: false,
            telegrams: 0,
            sum_errors: 0,
            skipped_bytes: 0,
            acknowledged: 0,
            refused: 0,
        }
    }

    /// Takes bytes off the front of `input` until a telegram is complete and returns its body; `None` when all the input
    /// is used up. Call it until it says `None`.
    pub fn next(&mut self, input: &mut &[u8]) -> Option<&[u8]> {
        let returned = std::mem::take(&mut self.returned);
        self.held.drain(..returned);
        loop {
            match self.look() {
                Look::Telegram(length) => {
                    self.telegrams += 1;
                    self.returned = length;
                    return Some(&self.held[4..length - 2]);
                }
                Look::Junk => self.skip(),
                Look::Wants(bytes) => {
                    if input.is_empty() {
                        return None;
                    }
                    let (taken, rest) = input.split_at(bytes.min(input.len()));
                    self.held.extend_from_slice(taken);
                    *input = rest;
                }
            }
        }
    }

    /// The sender paused so long that a begun telegram will never be completed: hunts on behind its first byte.
    pub fn give_up(&mut self) {
        let returned = std::mem::take(&mut self.returned);
        self.held.drain(..returned);
        if !self.held.is_empty() {
            self.skip();
        }
    }

    /// Forgets what is held (a new connection); the counters stay.
    pub fn clear(&mut self) {
        self.skipped_bytes += (self.held.len() - std::mem::take(&mut self.returned)) as u64;
        self.held.clear();
    }

    /// Whether a telegram has begun and is not complete.
    pub fn is_inside_telegram(&self) -> bool {
        self.held.len() > self.returned
    }

    /// Telegrams returned so far.
    pub fn telegrams(&self) -> u64 {
        self.telegrams
    }

    /// Telegrams whose sum was wrong.
    pub fn sum_errors(&self) -> u64 {
        self.sum_errors
    }

    /// Bytes that belonged to no telegram, a laser's acknowledgements left out.
    pub fn skipped_bytes(&self) -> u64 {
        self.skipped_bytes
    }

    /// Single bytes between telegrams by which a laser says that it takes a telegram, and that it refuses one.
    pub fn answers(&self) -> (u64, u64) {
        (self.acknowledged, self.refused)
    }

    fn look(&mut self) -> Look {
        match *self.held.as_slice() {
            [] => Look::Wants(1),
            [first, ..] if first != STX => Look::Junk,
            [_] => Look::Wants(1),
            // A laser may have a number of its own.
            [_, address, ..] if self.from_laser && !(FROM_LASER..FROM_LASER + 5).contains(&address) => Look::Junk,
            [_, address, ..] if !self.from_laser && address >= FROM_LASER => Look::Junk,
            [_, _] | [_, _, _] => Look::Wants(4 - self.held.len()),
            [_, _, low, high, ..] => {
                let body = usize::from(u16::from_le_bytes([low, high]));
                if body == 0 || body > MAX_BODY {
                    return Look::Junk;
                }
                let whole = body + OVERHEAD;
                if self.held.len() < whole {
                    return Look::Wants(whole - self.held.len());
                }
                let (telegram, sum) = self.held[..whole].split_at(whole - 2);
                if crc(telegram).to_le_bytes() == *sum {
                    return Look::Telegram(whole);
                }
                self.sum_errors += 1;
                Look::Junk
            }
        }
    }

    /// Skips the first byte and all up to the next one that may begin a telegram.
    fn skip(&mut self) {
        match *self.held.as_slice() {
            [ACK] if self.from_laser => self.acknowledged += 1,
            [NAK] if self.from_laser => self.refused += 1,
            _ => return self.skip_junk(),
        }
        self.held.clear();
    }

    fn skip_junk(&mut self) {
        let junk = self.held.iter().skip(1).position(|byte| *byte == STX).map_or(self.held.len(), |at| at + 1);
        self.skipped_bytes += junk as u64;
        self.held.drain(..junk);
    }
}

/// What the held bytes are.
enum Look {
    /// A telegram of that whole length, sum right.
    Telegram(usize),
    /// Not the beginning of a telegram.
    Junk,
    /// Undecided: that many more bytes are needed at least.
    Wants(usize),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lms200::protocol::{ACK, push};

    #[test]
    fn telegrams_are_found_among_junk_however_the_stream_is_cut() {
        let mut stream = vec![ACK, STX, 0x80, 0xFF, 0xFF, STX];
        push(&mut stream, 0x80, &[0xA0, 0, 0x10]);
        push(&mut stream, 0x81, &[0xB0, 1, 0, 9, 0, 0x10]);
        let last = stream.len();
        push(&mut stream, 0x80, &[0xA0, 0, 0x10]);
        stream[last + 5] ^= 1;
        push(&mut stream, 0x80, &[0xBA, 1]);
        for cut in 1..stream.len() {
            let mut framer = Framer::new(true);
            let mut found = Vec::new();
            for mut piece in stream.chunks(cut) {
                while let Some(body) = framer.next(&mut piece) {
                    found.push(body.to_vec());
                }
            }
            assert_eq!(found, [vec![0xA0, 0, 0x10], vec![0xB0, 1, 0, 9, 0, 0x10], vec![0xBA, 1]], "cut {cut}");
            assert!(framer.sum_errors() >= 1 && framer.skipped_bytes() >= 5);
            assert!(framer.answers().0 >= 1);
        }
    }
}
