//! Telegrams of the SICK LMS 2xx: frame, check sum, commands, scans (SICK, "Telegrams for Configuring and Operating the
//! LMS 2xx").
//!
//! `02`, address, length (little-endian, from the command to the end of the data), command and data, check sum. The laser
//! answers with the command plus 0x80, and its data end in a status byte.

/// First byte of a telegram.
pub const STX: u8 = 0x02;
/// The laser takes the telegram.
pub const ACK: u8 = 0x06;
/// The laser refuses the telegram: its sum or its form is wrong.
pub const NAK: u8 = 0x15;
/// Address of answers; the laser's own number is added.
pub const FROM_LASER: u8 = 0x80;
/// Header and check sum.
pub const OVERHEAD: usize = 6;
/// Longest body that any command or answer has: 401 values and what stands around them.
pub const MAX_BODY: usize = 1024;
/// Longest telegram that a client sends: a configuration.
pub const MAX_REQUEST: usize = 48;
/// Longest telegram.
pub const MAX_TELEGRAM: usize = MAX_BODY + OVERHEAD;
/// Time of a turn of the mirror: 75 Hz [s].
pub const TURN_S: f64 = 1.0 / 75.0;
/// Most values of a scan.
pub const MAX_VALUES: usize = 401;

/// Commands; an answer has the same number plus 0x80.
pub mod command {
    /// Reset.
    pub const RESET: u8 = 0x10;
    /// Switch the operating mode, see [`mode`](super::mode).
    pub const MODE: u8 = 0x20;
    /// One scan.
    pub const SCAN: u8 = 0x30;
    /// A stream's scan of a part of the field.
    pub const PART: u8 = 0x37;
    /// Status.
    pub const STATUS: u8 = 0x31;
    /// Type.
    pub const TYPE: u8 = 0x3A;
    /// Variant: angle and resolution.
    pub const VARIANT: u8 = 0x3B;
    /// Read the configuration.
    pub const GET_CONFIG: u8 = 0x74;
    /// Write the configuration.
    pub const SET_CONFIG: u8 = 0x77;
    /// What an answer adds.
    pub const ANSWER: u8 = 0x80;
    /// Sent by itself after power-on and reset.
    pub const POWER_ON: u8 = 0x90;
    /// Not understood, or not allowed in this mode.
    pub const REFUSED: u8 = 0x92;
}

/// Operating modes.
pub mod mode {
    /// Installation; needs the password.
    pub const INSTALL: u8 = 0x00;
    /// All scans, continuously.
    pub const STREAM: u8 = 0x24;
    /// Scans on request.
    pub const REQUEST: u8 = 0x25;
    /// All scans of a part of the field.
    pub const STREAM_PART: u8 = 0x27;
    /// Rates of the line, by mode [baud].
    pub const BAUDS: [(u8, u32); 4] = [(0x40, 38_400), (0x41, 19_200), (0x42, 9_600), (0x48, 500_000)];
    /// The password as shipped.
    pub const PASSWORD: &[u8] = b"SICK_LMS";
}

/// Check sum: over all before it, start byte included.
pub fn crc(bytes: &[u8]) -> u16 {
    let (mut sum, mut before) = (0_u16, 0_u8);
    for byte in bytes {
        let top = sum & 0x8000 != 0;
        sum <<= 1;
        if top {
            sum ^= 0x8005;
        }
        sum ^= u16::from(*byte) | u16::from(before) << 8;
        before = *byte;
    }
    sum
}

/// Writes the telegram of `body` to or from `address`; its length, 0 where it does not fit or the body is empty or longer
/// than [`MAX_BODY`].
pub fn encode(out: &mut [u8], address: u8, body: &[u8]) -> usize {
    let length = body.len() + OVERHEAD;
    if body.is_empty() || body.len() > MAX_BODY || out.len() < length {
        return 0;
    }
    out[0] = STX;
    out[1] = address;
    out[2..4].copy_from_slice(&(body.len() as u16).to_le_bytes());
    out[4..length - 2].copy_from_slice(body);
    let sum = crc(&out[..length - 2]);
    out[length - 2..length].copy_from_slice(&sum.to_le_bytes());
    length
}

/// Appends the telegram of `body`; false where it cannot be one, see [`encode`].
pub fn push(out: &mut Vec<u8>, address: u8, body: &[u8]) -> bool {
    let start = out.len();
    out.resize(start + body.len() + OVERHEAD, 0);
    let length = encode(&mut out[start..], address, body);
    out.truncate(start + length);
    length > 0
}

/// The unit of a scan's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Centimetres: to 81.91 m.
    Centimetre,
    /// Millimetres: to 8.191 m.
    Millimetre,
    /// Decimetres.
    Decimetre,
}

impl Unit {
    /// By the two bits of a scan's count word, or by the configuration's byte.
    pub fn of(code: u8) -> Option<Unit> {
        [Unit::Centimetre, Unit::Millimetre, Unit::Decimetre].get(usize::from(code)).copied()
    }

    /// One unit [m].
    pub fn metres(self) -> f64 {
        match self {
            Unit::Centimetre => 0.01,
            Unit::Millimetre => 0.001,
            Unit::Decimetre => 0.1,
        }
    }
}

/// A scan as the laser sends it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scan<'a> {
    /// First value that is sent, counted from 0.
    pub first: usize,
    /// The values' unit.
    pub unit: Unit,
    /// Two bytes per value, little-endian.
    pub values: &'a [u8],
    /// The laser's status byte.
    pub status: u8,
}

impl<'a> Scan<'a> {
    /// Reads an answer's body; `None` when it is none of a scan or its lengths disagree.
    pub fn parse(body: &'a [u8]) -> Option<Scan<'a>> {
        const ALL: u8 = command::SCAN + command::ANSWER;
        const PART: u8 = command::PART + command::ANSWER;
        let (&kind, rest) = body.split_first()?;
        let (first, rest) = match kind {
            ALL => (1, rest),
            PART => (usize::from(u16::from_le_bytes([*rest.first()?, *rest.get(1)?])), rest.get(4..)?),
            _ => return None,
        };
        let word = u16::from_le_bytes([*rest.first()?, *rest.get(1)?]);
        let count = usize::from(word & 0x3FF);
        let values = rest.get(2..2 + 2 * count)?;
        // Behind the values: perhaps a real-time index, and the status.
        let behind = &rest[2 + 2 * count..];
        let status = match behind {
            [status] | [_, status] => *status,
            _ => return None,
        };
        // Bit 13: a turn of an interlaced scan alone, which nobody here asks for.
        let sound = word & 0x2000 == 0 && count > 0 && first > 0 && first - 1 + count <= MAX_VALUES;
        let unit = Unit::of((word >> 14) as u8)?;
        sound.then_some(Scan { first: first - 1, unit, values, status })
    }

    /// The values.
    pub fn iter(&self) -> impl Iterator<Item = u16> + '_ {
        self.values.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
    }
}

/// Bits of a value that are its distance, by the measuring mode: what is above are flags (fields, reflectors, dazzle).
pub fn value_bits(measuring_mode: u8) -> u32 {
    match measuring_mode {
        3 | 4 => 14,
        5 | 6 => 15,
        0x0F => 16,
        _ => 13,
    }
}

/// The angle of a variant and its resolution, if the laser has it [deg, 1/100 deg].
pub fn is_variant(angle_deg: u16, resolution_cdeg: u16) -> bool {
    matches!((angle_deg, resolution_cdeg), (180, 100 | 50) | (100, 100 | 50 | 25))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn telegrams_are_those_of_the_manual() {
        let telegram = |body: &[u8]| {
            let mut out = Vec::new();
            assert!(push(&mut out, 0, body));
            out
        };
        assert_eq!(telegram(&[0x20, 0x24]), [2, 0, 2, 0, 0x20, 0x24, 0x34, 0x08]);
        assert_eq!(telegram(&[0x20, 0x48]), [2, 0, 2, 0, 0x20, 0x48, 0x58, 0x08]);
        assert_eq!(telegram(&[0x31]), [2, 0, 1, 0, 0x31, 0x15, 0x12]);
        let install = [&[0x20, 0x00][..], mode::PASSWORD].concat();
        assert_eq!(telegram(&install)[14..], [0xBE, 0xC5]);
        assert_eq!(telegram(&[0x3B, 180, 0, 50, 0])[4..], [0x3B, 0xB4, 0, 0x32, 0, 0x3B, 0x1F]);
        assert_eq!(telegram(&[0x3B, 100, 0, 25, 0])[4..], [0x3B, 0x64, 0, 0x19, 0, 0xE7, 0x72]);
        let mut answer = Vec::new();
        push(&mut answer, FROM_LASER, &[0xA0, 0x00, 0x10]);
        assert_eq!(answer, [2, 0x80, 3, 0, 0xA0, 0, 0x10, 0x16, 0x0A]);
        assert!(!push(&mut answer, 0, &[0; MAX_BODY + 1]) && !push(&mut answer, 0, &[]));
    }

    #[test]
    fn scans_are_read_and_lengths_that_disagree_are_refused() {
        let mut body = vec![0xB0];
        body.extend_from_slice(&(3_u16 | 1 << 14).to_le_bytes());
        body.extend_from_slice(&[1, 0, 2, 0, 0xFF, 0x1F, 0x10]);
        let scan = Scan::parse(&body).unwrap();
        assert_eq!((scan.first, scan.unit, scan.status), (0, Unit::Millimetre, 0x10));
        assert_eq!(scan.iter().collect::<Vec<_>>(), [1, 2, 0x1FFF]);
        for cut in 0..body.len() {
            assert_eq!(Scan::parse(&body[..cut]), None, "{cut}");
        }
        // With a real-time index; of a part; with no values; of more values than there can be.
        assert_eq!(Scan::parse(&[&body[..9], &[7, 0x10]].concat()).unwrap().status, 0x10);
        assert_eq!(Scan::parse(&[0xB7, 2, 0, 2, 0, 1, 0, 9, 0, 0x10]).unwrap().first, 1);
        assert_eq!(Scan::parse(&[0xB0, 0, 0, 0x10]), None);
        assert_eq!(Scan::parse(&[0xB7, 0xFF, 0xFF, 2, 0, 1, 0, 9, 0, 0x10]), None);
    }
}
