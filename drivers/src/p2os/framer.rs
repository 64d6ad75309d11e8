//! Finds packets in a stream of bytes.

use super::protocol::{HEADER, MAX_PACKET, OVERHEAD, checksum};

/// Least count byte: one byte of payload and the checksum.
const MIN_COUNT: u8 = 3;

/// An incremental, bounded packet finder: bytes in, payloads out, whatever stands between them.
///
/// It hunts for the header, checks the count and the checksum, and after an error hunts on from the second byte of
/// what it had taken for a packet, so that junk which looks like a header never costs the true packet behind it.
///
/// ```
/// use drivers::p2os::protocol::Framer;
/// let mut framer = Framer::new();
/// let mut input: &[u8] = b"WMS2\r\xFA\xFB\x03\x01\x00\x01";
/// while let Some(payload) = framer.next(&mut input) {
///     assert_eq!(payload, [1]);
/// }
/// assert_eq!((framer.packets(), framer.skipped_bytes()), (1, 5));
/// ```
#[derive(Debug, Clone)]
pub struct Framer {
    /// What may still become a packet; starts with the header's first byte unless empty.
    held: [u8; MAX_PACKET],
    length: usize,
    /// Length of the packet that the last call returned; dropped at the next call.
    returned: usize,
    max_count: u8,
    packets: u64,
    checksum_errors: u64,
    skipped_bytes: u64,
}

impl Default for Framer {
    fn default() -> Framer {
        Framer::new()
    }
}

impl Framer {
    /// Accepts packets of any size.
    pub const fn new() -> Framer {
        Framer::with_max_count(u8::MAX)
    }

    /// Takes a count byte above `max_count` for junk, as the firmware does above
    /// [`MAX_COMMAND_COUNT`](super::protocol::MAX_COMMAND_COUNT).
    pub const fn with_max_count(max_count: u8) -> Framer {
        Framer {
            held: [0; MAX_PACKET],
            length: 0,
            returned: 0,
            max_count,
            packets: 0,
            checksum_errors: 0,
            skipped_bytes: 0,
        }
    }

    /// Takes bytes off the front of `input` until a packet is complete and returns its payload; `None` when all the
    /// input is used up. Call it until it says `None`.
    pub fn next(&mut self, input: &mut &[u8]) -> Option<&[u8]> {
        self.drop_returned();
        loop {
            match self.look() {
                Look::Packet(length) => {
                    self.packets += 1;
                    self.returned = length;
                    return Some(&self.held[3..length - 2]);
                }
                Look::Junk => self.skip(),
                Look::Wants(bytes) => {
                    // An empty hold skips to the next possible header without copying.
                    if self.length == 0 {
                        let junk = input.iter().position(|byte| *byte == HEADER[0]).unwrap_or(input.len());
                        self.skipped_bytes += junk as u64;
                        *input = &input[junk..];
                    }
                    if input.is_empty() {
                        return None;
                    }
                    let (taken, rest) = input.split_at(bytes.min(input.len()));
                    self.held[self.length..self.length + taken.len()].copy_from_slice(taken);
                    self.length += taken.len();
                    *input = rest;
                }
            }
        }
    }

    /// Says that the sender paused so long ([`BYTE_GAP_S`](super::protocol::BYTE_GAP_S)) that a begun packet will
    /// never be completed. Hunts on behind its header; call [`next`](Framer::next) afterwards, what is held may
    /// contain a whole packet.
    pub fn give_up(&mut self) {
        self.drop_returned();
        if self.length > 0 {
            self.skip();
        }
    }

    /// Forgets what is held (a new connection); the counters stay.
    pub fn clear(&mut self) {
        self.drop_returned();
        self.skipped_bytes += self.length as u64;
        self.length = 0;
    }

    /// Whether a packet has begun and is not complete.
    pub fn is_inside_packet(&self) -> bool {
        self.length > self.returned
    }

    /// Packets returned so far.
    pub fn packets(&self) -> u64 {
        self.packets
    }

    /// Packets whose checksum was wrong.
    pub fn checksum_errors(&self) -> u64 {
        self.checksum_errors
    }

    /// Bytes that belonged to no packet.
    pub fn skipped_bytes(&self) -> u64 {
        self.skipped_bytes
    }

    fn look(&mut self) -> Look {
        let held = &self.held[..self.length];
        match *held {
            [] => Look::Wants(1),
            [first, ..] if first != HEADER[0] => Look::Junk,
            [_] => Look::Wants(1),
            [_, second, ..] if second != HEADER[1] => Look::Junk,
            [_, _] => Look::Wants(1),
            [_, _, count, ..] if count < MIN_COUNT || count > self.max_count => Look::Junk,
            [_, _, count, ..] => {
                let whole = usize::from(count) + 3;
                if held.len() < whole {
                    return Look::Wants(whole - held.len());
                }
                let (body, sum) = held[3..whole].split_at(whole - OVERHEAD);
                if checksum(body).to_be_bytes() == *sum {
                    Look::Packet(whole)
                } else {
                    self.checksum_errors += 1;
                    Look::Junk
                }
            }
        }
    }

    /// Skips the first byte and all up to the next one that may begin a header.
    fn skip(&mut self) {
        let held = &self.held[..self.length];
        let junk = held.iter().skip(1).position(|byte| *byte == HEADER[0]).map_or(held.len(), |at| at + 1);
        self.skipped_bytes += junk as u64;
        self.drop_front(junk);
    }

    fn drop_returned(&mut self) {
        let returned = std::mem::take(&mut self.returned);
        self.drop_front(returned);
    }

    fn drop_front(&mut self, bytes: usize) {
        if bytes > 0 {
            self.held.copy_within(bytes..self.length, 0);
            self.length -= bytes;
        }
    }
}

/// What the held bytes are.
enum Look {
    /// A packet of that whole length, checksum right.
    Packet(usize),
    /// Not the beginning of a packet.
    Junk,
    /// Undecided: that many more bytes are needed at least.
    Wants(usize),
}
