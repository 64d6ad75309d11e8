//! SCIP 2.0: lines of text, sums, and numbers in characters of six bits (Hokuyo, "Communication Protocol Specification for
//! SCIP2.0 Standard").
//!
//! A request is `command[;string]` and LF. A reply is the request's line again, a status of two characters and its sum,
//! further lines each with its sum, and an empty line. The sum of a line is that of its bytes, modulo 64, plus 0x30.

/// Bytes of data in a full line of a data block.
pub const BLOCK: usize = 64;
/// Longest request.
pub const MAX_REQUEST: usize = 64;
/// A stamp counts milliseconds in this many bits.
pub const STAMP_BITS: u32 = 24;
/// Rates that serial scanners know [baud].
pub const BAUDS: [u32; 6] = [19_200, 57_600, 115_200, 250_000, 500_000, 750_000];
/// The TCP port of the Ethernet models.
pub const TCP_PORT: u16 = 10940;

/// Statuses that replies carry.
pub mod status {
    /// Done.
    pub const OK: [u8; 2] = *b"00";
    /// A scan follows.
    pub const SCAN: [u8; 2] = *b"99";
    /// BM: the laser is on already; TM: not in the mode that it was asked to leave.
    pub const ALREADY: [u8; 2] = *b"02";
    /// The laser is off (G), or it cannot be switched on (BM: 01).
    pub const LASER_OFF: [u8; 2] = *b"10";
    /// The first, the second character of the command is unknown.
    pub const UNKNOWN: [[u8; 2]; 2] = [*b"0D", *b"0E"];
    /// The request has a wrong length.
    pub const BAD_LENGTH: [u8; 2] = *b"0F";
    /// Measuring has been resumed.
    pub const RESUMED: [u8; 2] = *b"98";
}

/// The sum character of a line.
pub fn sum(line: &[u8]) -> u8 {
    (line.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)) & 0x3F) + 0x30
}

/// A line without its sum; `None` when the sum is wrong. In lines `TEXT;S` the sum leaves the `;` out, or not.
pub fn checked(line: &[u8]) -> Option<&[u8]> {
    let (last, body) = line.split_last()?;
    if sum(body) == *last {
        return Some(body);
    }
    let text = body.strip_suffix(b";")?;
    (sum(text) == *last).then_some(text)
}

/// Writes `value` in `out.len()` characters.
pub fn encode(out: &mut [u8], mut value: u32) {
    for place in out.iter_mut().rev() {
        *place = (value & 0x3F) as u8 + 0x30;
        value >>= 6;
    }
}

/// The value of up to five characters; `None` when one is none of the alphabet.
#[inline]
pub fn decode(characters: &[u8]) -> Option<u32> {
    let mut value = 0;
    let mut strange = 0;
    for character in characters {
        let six = character.wrapping_sub(0x30);
        strange |= six & 0xC0;
        value = value << 6 | u32::from(six);
    }
    (strange == 0).then_some(value)
}

/// A number in decimal digits, as requests and parameters have it.
pub fn decimal(digits: &[u8]) -> Option<u32> {
    if digits.is_empty() || digits.len() > 9 {
        return None;
    }
    digits.iter().try_fold(0_u32, |number, digit| digit.is_ascii_digit().then(|| number * 10 + u32::from(digit - b'0')))
}

/// What a scan is asked for: G, M and N commands have it in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Area {
    /// First step.
    pub start: u16,
    /// Last step.
    pub end: u16,
    /// Steps of which the least distance is sent as one; 0 and 1 are the same.
    pub cluster: u8,
}

impl Area {
    /// Values that come back.
    pub fn count(&self) -> usize {
        usize::from(self.end.saturating_sub(self.start) + 1).div_ceil(usize::from(self.cluster.max(1)))
    }
}

/// How values are coded: by the second character of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// `S`: two characters, to 4095 mm.
    Short,
    /// `D`: three characters.
    Long,
    /// `E`: three characters and three of intensity.
    Intensity,
}

impl Coding {
    /// By the second character of a G or M command.
    pub fn of(letter: u8) -> Option<Coding> {
        match letter {
            b'S' => Some(Coding::Short),
            b'D' => Some(Coding::Long),
            b'E' => Some(Coding::Intensity),
            _ => None,
        }
    }

    /// The letter.
    pub fn letter(self) -> u8 {
        match self {
            Coding::Short => b'S',
            Coding::Long => b'D',
            Coding::Intensity => b'E',
        }
    }

    /// Characters per beam.
    pub fn characters(self) -> usize {
        match self {
            Coding::Short => 2,
            Coding::Long => 3,
            Coding::Intensity => 6,
        }
    }
}

/// A request being written. Longer ones than [`MAX_REQUEST`] are cut, which none of ours is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    bytes: [u8; MAX_REQUEST],
    length: usize,
}

impl Request {
    /// The request that is this text and a line feed.
    pub fn new(text: &[u8]) -> Request {
        let mut request = Request { bytes: [0; MAX_REQUEST], length: 0 };
        request.put(text);
        request.end()
    }

    /// `MDsssseeeecciNN`: a stream of `count` scans, each but the `skip` in between; 0 goes on for ever.
    pub fn stream(coding: Coding, area: Area, skip: u8, count: u8) -> Request {
        let mut request = Request { bytes: [0; MAX_REQUEST], length: 0 };
        request.put(&[b'M', coding.letter()]);
        request.digits(u32::from(area.start), 4);
        request.digits(u32::from(area.end), 4);
        request.digits(u32::from(area.cluster), 2);
        request.digits(u32::from(skip.min(9)), 1);
        request.digits(u32::from(count.min(99)), 2);
        request.end()
    }

    /// `SSnnnnnn`: another rate of a serial line.
    pub fn baud(baud: u32) -> Request {
        let mut request = Request { bytes: [0; MAX_REQUEST], length: 0 };
        request.put(b"SS");
        request.digits(baud, 6);
        request.end()
    }

    /// All of it, line feed included.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    /// The line without its line feed, as the reply echoes it.
    pub fn line(&self) -> &[u8] {
        &self.bytes[..self.length.saturating_sub(1)]
    }

    fn put(&mut self, bytes: &[u8]) {
        let count = bytes.len().min(MAX_REQUEST - 1 - self.length);
        self.bytes[self.length..self.length + count].copy_from_slice(&bytes[..count]);
        self.length += count;
    }

    fn digits(&mut self, value: u32, places: u32) {
        let mut unit = 10_u32.pow(places - 1);
        for _ in 0..places {
            self.put(&[b'0' + (value / unit % 10) as u8]);
            unit /= 10;
        }
    }

    fn end(mut self) -> Request {
        self.bytes[self.length] = b'\n';
        self.length += 1;
        self
    }
}

impl AsRef<[u8]> for Request {
    fn as_ref(&self) -> &[u8] {
        self.as_bytes()
    }
}

/// One reply: its lines without line feeds.
#[derive(Debug, Clone, Copy)]
pub struct Reply<'a> {
    /// The request again.
    pub echo: &'a [u8],
    /// The status.
    pub status: [u8; 2],
    /// What follows the status, with the line feeds.
    pub body: &'a [u8],
}

impl<'a> Reply<'a> {
    /// Reads a message as the framer gives it; `None` when it has no status or the status's sum is wrong.
    pub fn parse(message: &'a [u8]) -> Option<Reply<'a>> {
        let mut parts = message.splitn(3, |byte| *byte == b'\n');
        let (echo, line) = (parts.next()?, parts.next()?);
        let status = match checked(line)? {
            [one, two] => [*one, *two],
            _ => return None,
        };
        Some(Reply { echo, status, body: parts.next().unwrap_or_default() })
    }

    /// The lines of the body.
    pub fn lines(&self) -> impl Iterator<Item = &'a [u8]> {
        self.body.split(|byte| *byte == b'\n').filter(|line| !line.is_empty())
    }

    /// The value of the line `KEY:value` of a VV, PP or II reply.
    pub fn value(&self, key: &[u8]) -> Option<&'a [u8]> {
        self.lines().filter_map(checked).find_map(|line| line.strip_prefix(key)?.strip_prefix(b":"))
    }

    /// Whether this is the first (`00`) or a later (`99`) reply to the streaming request `line`: a later one has the
    /// scans that remain in place of the count.
    pub fn answers(&self, line: &[u8]) -> bool {
        match (line.first(), line.len()) {
            (Some(b'M' | b'N'), 15..) => {
                self.echo.len() == line.len() && self.echo[..13] == line[..13] && self.echo[15..] == line[15..]
            }
            _ => self.echo == line,
        }
    }
}

/// Why a data block is not what was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BlockError {
    /// A line's sum is wrong.
    #[error("a line's sum is wrong")]
    Sum,
    /// Fewer or more values than asked for.
    #[error("another number of values than asked for")]
    Count,
    /// A character that codes nothing.
    #[error("a character that codes nothing")]
    Character,
}

/// Reads the stamp and the values of a scan into `beams` (distance and intensity, device units), which must be as long
/// as the area has values. `scratch` takes the characters. Gives the stamp [ms].
pub fn parse_scan(
    body: &[u8],
    coding: Coding,
    scratch: &mut Vec<u8>,
    beams: &mut [(u32, u32)],
) -> Result<u32, BlockError> {
    let mut lines = body.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    let stamp = checked(lines.next().ok_or(BlockError::Count)?).ok_or(BlockError::Sum)?;
    let stamp = if stamp.len() == 4 { decode(stamp) } else { None }.ok_or(BlockError::Character)?;
    scratch.clear();
    let wanted = beams.len() * coding.characters();
    for line in lines {
        let (last, data) = line.split_last().ok_or(BlockError::Count)?;
        if sum(data) != *last {
            return Err(BlockError::Sum);
        }
        if scratch.len() + data.len() > wanted {
            return Err(BlockError::Count);
        }
        scratch.extend_from_slice(data);
    }
    if scratch.len() != wanted {
        return Err(BlockError::Count);
    }
    let per_beam = coding.characters();
    for (beam, characters) in beams.iter_mut().zip(scratch.chunks_exact(per_beam)) {
        let (distance, intensity) = characters.split_at(per_beam.min(3));
        let both = decode(distance).zip(decode(intensity));
        *beam = both.ok_or(BlockError::Character)?;
    }
    Ok(stamp)
}

/// Appends a line with its sum.
pub fn push_line(out: &mut Vec<u8>, line: &[u8]) {
    out.extend_from_slice(line);
    out.push(sum(line));
    out.push(b'\n');
}

/// Appends characters as a data block.
pub fn push_block(out: &mut Vec<u8>, characters: &[u8]) {
    characters.chunks(BLOCK).for_each(|line| push_line(out, line));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_the_specification_and_of_captured_lines() {
        for line in ["00P", "99b", "01Q", "02R", "03S", "10Q", "0Dd", "0Ee", "0Ff"] {
            assert_eq!(checked(line.as_bytes()), Some(&line.as_bytes()[..2]), "{line}");
        }
        for line in ["AMAX:1080;Z", "ARES:1440;^", "SCAN:2400;U", "PROT:SCIP 2.0;N"] {
            assert_eq!(checked(line.as_bytes()), Some(&line.as_bytes()[..line.len() - 2]), "{line}");
        }
        assert_eq!(checked(b"00Q"), None);
        assert_eq!(checked(b""), None);
    }

    #[test]
    fn numbers_are_coded_as_in_the_specification() {
        for (text, value) in [("CB", 1234), ("1Dh", 5432), ("m2@0", 16_000_000)] {
            let mut out = [0; 5];
            encode(&mut out[..text.len()], value);
            assert_eq!(&out[..text.len()], text.as_bytes());
            assert_eq!(decode(text.as_bytes()), Some(value));
        }
        assert_eq!(decode(b"\n0"), None);
        assert_eq!(decode(b"\xF0p"), None);
        assert_eq!(
            (decimal(b"0725"), decimal(b""), decimal(b"7a"), decimal(b"9999999999")),
            (Some(725), None, None, None)
        );
    }

    #[test]
    fn a_stream_is_asked_for_in_the_words_of_the_specification() {
        let area = Area { start: 44, end: 725, cluster: 1 };
        let request = Request::stream(Coding::Long, area, 0, 0);
        assert_eq!(request.as_bytes(), b"MD0044072501000\n");
        assert_eq!(area.count(), 682);
        assert_eq!(Area { cluster: 3, ..area }.count(), 228);
        assert_eq!(Request::baud(57_600).line(), b"SS057600");
    }

    #[test]
    fn a_scan_survives_the_block_and_every_damage_is_seen() {
        let beams: Vec<(u32, u32)> = (0..100).map(|k| (k * 37, k)).collect();
        for coding in [Coding::Long, Coding::Intensity] {
            let mut characters = Vec::new();
            for (distance, intensity) in &beams {
                let mut three = [0; 6];
                encode(&mut three[..3], *distance);
                encode(&mut three[3..], *intensity);
                characters.extend_from_slice(&three[..coding.characters()]);
            }
            let mut body = Vec::new();
            push_line(&mut body, b"0000");
            push_block(&mut body, &characters);
            let mut read = vec![(0, 0); 100];
            let mut scratch = Vec::new();
            assert_eq!(parse_scan(&body, coding, &mut scratch, &mut read), Ok(0));
            assert!(read.iter().zip(&beams).all(|(read, sent)| read.0 == sent.0));
            assert_eq!(coding == Coding::Intensity, read[7].1 == 7);
            for at in 0..body.len() {
                let mut damaged = body.clone();
                damaged[at] ^= 1;
                assert!(parse_scan(&damaged, coding, &mut scratch, &mut read).is_err(), "{at}");
            }
            assert_eq!(parse_scan(&body, coding, &mut scratch, &mut read[..99]), Err(BlockError::Count));
        }
    }
}
