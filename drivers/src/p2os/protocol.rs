//! The Pioneer's packets as bytes: frame, checksum, command arguments. Pure: no I/O, no allocation, no clock.
//!
//! Both ends use this file: the driver encodes commands and frames what the robot sends; a simulated microcontroller
//! frames commands and encodes packets. Bodies of packets are in [`super::sip`] and [`super::config`].
//!
//! ```text
//! FA FB  N  payload (N − 2 bytes)  checksum, high byte first
//! payload to the robot:    number | number kind argument
//! payload from the robot:  type body
//! ```
//!
//! Everything else is little-endian. Source: P2OS/ARCOS manuals and two independent open drivers.

pub use super::framer::Framer;
pub use super::numbers::{BAUDS, command, flag, packet};

/// First two bytes of every packet.
pub const HEADER: [u8; 2] = [0xFA, 0xFB];
/// Greatest payload that the count byte can express [byte].
pub const MAX_PAYLOAD: usize = 253;
/// Greatest whole packet: header, count, payload, checksum [byte].
pub const MAX_PACKET: usize = MAX_PAYLOAD + OVERHEAD;
/// Bytes of a packet that are not payload: header, count, checksum.
pub const OVERHEAD: usize = 5;
/// Greatest count byte that the firmware accepts in a command; longer ones are ignored.
pub const MAX_COMMAND_COUNT: u8 = 204;
/// Greatest whole SIP [byte].
pub const MAX_SIP_PACKET: usize = 200;
/// Least time between two commands; the firmware may lose denser ones [s].
pub const COMMAND_SPACING_S: f64 = 0.005;
/// Time without a byte after which a packet that has begun will not be completed [s].
pub const BYTE_GAP_S: f64 = 0.1;
/// Customary TCP port of simulators and serial bridges.
pub const TCP_PORT: u16 = 8101;

/// Kind byte of a non-negative integer argument.
pub const KIND_POSITIVE: u8 = 0x3B;
/// Kind byte of a negative integer argument, whose two bytes hold the magnitude.
pub const KIND_NEGATIVE: u8 = 0x1B;
/// Kind byte of a text argument: length byte, then the bytes.
pub const KIND_TEXT: u8 = 0x2B;

/// Resolution of VEL2's wheel speeds [mm/s].
pub const VEL2_UNIT_MM_S: i32 = 20;

/// STOP, ENABLE 0, CLOSE: what a driver sends last, and what others may send for one that died.
#[rustfmt::skip]
pub const STOP_PACKETS: [u8; 24] = [
    0xFA, 0xFB, 3, command::STOP, 0, command::STOP, //
    0xFA, 0xFB, 6, command::ENABLE, KIND_POSITIVE, 0, 0, command::ENABLE, KIND_POSITIVE, //
    0xFA, 0xFB, 6, command::CLOSE, KIND_POSITIVE, 1, 0, command::CLOSE + 1, KIND_POSITIVE,
];

/// STOP and ENABLE 0: what stops a robot whose session goes on.
#[rustfmt::skip]
pub const HALT_PACKETS: [u8; 15] = [
    0xFA, 0xFB, 3, command::STOP, 0, command::STOP, //
    0xFA, 0xFB, 6, command::ENABLE, KIND_POSITIVE, 0, 0, command::ENABLE, KIND_POSITIVE,
];

/// What the guard writes for a driver that is dead: more bytes in all than the longest command that the firmware would
/// still wait for the end of.
pub const LAST_WILL: runtime::Will = runtime::Will {
    bytes: &HALT_PACKETS,
    repeat: (MAX_COMMAND_COUNT as u32 + 3).div_ceil(HALT_PACKETS.len() as u32),
    spacing_us: 5_000,
};

/// Checksum of a payload: sum of big-endian words modulo 65536; an odd last byte is XORed into the low byte.
pub fn checksum(payload: &[u8]) -> u16 {
    let (pairs, rest) = payload.as_chunks::<2>();
    let sum = pairs.iter().fold(0u16, |sum, pair| sum.wrapping_add(u16::from_be_bytes(*pair)));
    rest.iter().fold(sum, |sum, byte| sum ^ u16::from(*byte))
}

/// Why a packet was not encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    /// A packet needs a payload.
    #[error("a packet without payload cannot be sent")]
    Empty,
    /// The payload exceeds what the count byte can say, or the caller's buffer.
    #[error("the packet does not fit: at most {MAX_PAYLOAD} bytes of payload and the given buffer")]
    TooLong,
    /// An integer argument is a magnitude of 16 bits.
    #[error("an integer argument must lie within -65535..=65535")]
    OutOfRange,
}

/// Writes one packet into the caller's buffer, field by field; [`finish`](Builder::finish) adds header and checksum.
///
/// Overlong writes are remembered and reported by `finish`, so that a chain of fields needs one check.
pub struct Builder<'a> {
    out: &'a mut [u8],
    payload_length: usize,
    overflow: bool,
}

impl<'a> Builder<'a> {
    /// Begins a packet whose payload starts with `first` (command number or packet type).
    pub fn new(out: &'a mut [u8], first: u8) -> Builder<'a> {
        let mut builder = Builder { out, payload_length: 0, overflow: false };
        builder.u8(first);
        builder
    }

    /// Appends raw bytes.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        let start = 3 + self.payload_length;
        let end = start + bytes.len();
        if self.payload_length + bytes.len() > MAX_PAYLOAD || end + 2 > self.out.len() {
            self.overflow = true;
        } else {
            self.out[start..end].copy_from_slice(bytes);
            self.payload_length += bytes.len();
        }
        self
    }

    /// Appends a byte.
    pub fn u8(&mut self, value: u8) -> &mut Self {
        self.bytes(&[value])
    }

    /// Appends a little-endian word.
    pub fn u16(&mut self, value: u16) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    /// Appends a little-endian signed word.
    pub fn i16(&mut self, value: i16) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    /// Appends a little-endian double word.
    pub fn u32(&mut self, value: u32) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    /// Appends a little-endian signed double word.
    pub fn i32(&mut self, value: i32) -> &mut Self {
        self.bytes(&value.to_le_bytes())
    }

    /// Appends text and its terminating NUL.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.bytes(text.as_bytes()).u8(0)
    }

    /// Bytes of payload so far.
    pub fn payload_length(&self) -> usize {
        self.payload_length
    }

    /// Completes the packet; returns its whole length.
    pub fn finish(&mut self) -> Result<usize, EncodeError> {
        if self.overflow {
            return Err(EncodeError::TooLong);
        }
        if self.payload_length == 0 {
            return Err(EncodeError::Empty);
        }
        let end = 3 + self.payload_length;
        self.out[..2].copy_from_slice(&HEADER);
        self.out[2] = (self.payload_length + 2) as u8;
        let sum = checksum(&self.out[3..end]);
        self.out[end..end + 2].copy_from_slice(&sum.to_be_bytes());
        Ok(end + 2)
    }
}

/// Frames `payload` into `out`; returns the packet's length.
pub fn encode(out: &mut [u8], payload: &[u8]) -> Result<usize, EncodeError> {
    let Some((first, rest)) = payload.split_first() else { return Err(EncodeError::Empty) };
    Builder::new(out, *first).bytes(rest).finish()
}

/// Argument of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Argument<'a> {
    /// The bare command.
    None,
    /// Sign and 16-bit magnitude: −65535…65535.
    Integer(i32),
    /// Two raw bytes sent as they are with the positive kind byte (DIGOUT, VEL2).
    Word(u16),
    /// At most 200 bytes.
    Text(&'a [u8]),
}

/// Frames a command into `out` ([`MAX_PACKET`] bytes always suffice); returns the packet's length.
pub fn encode_command(out: &mut [u8], number: u8, argument: Argument) -> Result<usize, EncodeError> {
    let mut builder = Builder::new(out, number);
    match argument {
        Argument::None => {}
        Argument::Integer(value) => {
            let magnitude = u16::try_from(value.unsigned_abs()).map_err(|_| EncodeError::OutOfRange)?;
            builder.u8(if value < 0 { KIND_NEGATIVE } else { KIND_POSITIVE }).u16(magnitude);
        }
        Argument::Word(word) => {
            builder.u8(KIND_POSITIVE).u16(word);
        }
        Argument::Text(text) => {
            let length = u8::try_from(text.len()).map_err(|_| EncodeError::TooLong)?;
            builder.u8(KIND_TEXT).u8(length).bytes(text);
        }
    }
    if builder.payload_length() + 2 > usize::from(MAX_COMMAND_COUNT) {
        return Err(EncodeError::TooLong);
    }
    builder.finish()
}

/// Packs two wheel speeds into VEL2's argument, each rounded to [`VEL2_UNIT_MM_S`] and cut to a signed byte.
pub fn pack_wheels(left_mm_s: i32, right_mm_s: i32) -> u16 {
    let unit = |speed: i32| {
        let half = VEL2_UNIT_MM_S / 2;
        let rounded = if speed < 0 { speed.saturating_sub(half) } else { speed.saturating_add(half) } / VEL2_UNIT_MM_S;
        rounded.clamp(-127, 127) as i8 as u8
    };
    u16::from_le_bytes([unit(right_mm_s), unit(left_mm_s)])
}

/// Wheel speeds (left, right) of a VEL2 argument as [`Request::integer`] reads it, whichever sign the client sent [mm/s].
pub fn unpack_wheels(argument: i32) -> (i32, i32) {
    let [right, left] = (argument as u16).to_le_bytes();
    (i32::from(left as i8) * VEL2_UNIT_MM_S, i32::from(right as i8) * VEL2_UNIT_MM_S)
}

/// A command as the robot's end reads it. Missing bytes of an argument count as zero, as clients in use require.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request<'a> {
    /// The command; see [`command`].
    pub number: u8,
    /// The kind byte, if there is one.
    pub kind: Option<u8>,
    /// What follows the kind byte.
    pub raw: &'a [u8],
}

impl<'a> Request<'a> {
    /// Reads a payload; `None` when it is empty.
    pub fn parse(payload: &'a [u8]) -> Option<Request<'a>> {
        let (number, rest) = payload.split_first()?;
        let (kind, raw) = rest.split_first().map_or((None, rest), |(kind, raw)| (Some(*kind), raw));
        Some(Request { number: *number, kind, raw })
    }

    /// The integer argument; zero when it is missing or short.
    pub fn integer(&self) -> i32 {
        let magnitude = i32::from(self.word(0) as u16);
        if self.kind == Some(KIND_NEGATIVE) { -magnitude } else { magnitude }
    }

    /// The `index`-th two's-complement word after the kind byte; zero when it is missing.
    pub fn word(&self, index: usize) -> i16 {
        let byte = |at: usize| self.raw.get(at).copied().unwrap_or(0);
        let at = index.saturating_mul(2);
        i16::from_le_bytes([byte(at), byte(at.saturating_add(1))])
    }

    /// The `index`-th four-byte integer after the kind byte (SIM_ commands); zero when it is missing.
    pub fn long(&self, index: usize) -> i32 {
        let at = index.saturating_mul(4);
        let byte = |offset: usize| self.raw.get(at.saturating_add(offset)).copied().unwrap_or(0);
        i32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])
    }

    /// The text argument, cut where the packet ends; empty when the command carries none.
    pub fn text(&self) -> &'a [u8] {
        match (self.kind, self.raw.split_first()) {
            (Some(KIND_TEXT), Some((length, text))) => &text[..text.len().min(usize::from(*length))],
            _ => &[],
        }
    }
}
