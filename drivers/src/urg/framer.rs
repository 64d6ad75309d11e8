//! Finds messages in a stream of bytes: lines up to an empty one.

/// Longest message: 1,536 values of six characters, their lines' sums, echo, status and stamp.
pub const MAX_MESSAGE: usize = 12 * 1024;

/// An incremental, bounded message finder: bytes in, messages out, whatever stands between them.
///
/// Carriage returns are left out. A message longer than [`MAX_MESSAGE`] is dropped up to its empty line, and counted.
#[derive(Debug, Clone)]
pub struct Framer {
    held: Vec<u8>,
    /// The last call returned all that is held.
    returned: bool,
    /// The message has become too long: its rest is dropped.
    overlong: bool,
    at_line_start: bool,
    messages: u64,
    skipped_bytes: u64,
}

impl Default for Framer {
    fn default() -> Framer {
        Framer::new()
    }
}

impl Framer {
    /// Nothing held.
    pub fn new() -> Framer {
        Framer {
            held: Vec::with_capacity(MAX_MESSAGE),
            returned: false,
            overlong: false,
            at_line_start: true,
            messages: 0,
            skipped_bytes: 0,
        }
    }

    /// Takes bytes off the front of `input` until a message is complete and returns its lines, the empty one left out;
    /// `None` when all the input is used up. Call it until it says `None`.
    pub fn next(&mut self, input: &mut &[u8]) -> Option<&[u8]> {
        if std::mem::take(&mut self.returned) {
            self.held.clear();
        }
        while !input.is_empty() {
            let end = input.iter().position(|byte| *byte == b'\n');
            let (line, rest) = match end {
                Some(end) => (&input[..end], &input[end + 1..]),
                None => (*input, &input[input.len()..]),
            };
            *input = rest;
            let is_empty = self.at_line_start && line.iter().all(|byte| *byte == b'\r');
            self.take(line);
            let Some(_) = end else {
                self.at_line_start = is_empty;
                return None;
            };
            self.at_line_start = true;
            if !is_empty {
                self.take(b"\n");
            } else if std::mem::take(&mut self.overlong) {
                self.skipped_bytes += self.held.len() as u64;
                self.held.clear();
            } else if !self.held.is_empty() {
                self.messages += 1;
                self.returned = true;
                return Some(&self.held);
            }
        }
        None
    }

    /// Forgets what is held (a new connection); the counters stay.
    pub fn clear(&mut self) {
        if !std::mem::take(&mut self.returned) {
            self.skipped_bytes += self.held.len() as u64;
        }
        self.held.clear();
        (self.overlong, self.at_line_start) = (false, true);
    }

    /// Messages returned so far.
    pub fn messages(&self) -> u64 {
        self.messages
    }

    /// Bytes that belonged to no message.
    pub fn skipped_bytes(&self) -> u64 {
        self.skipped_bytes
    }

    /// Whether a message has begun and is not complete.
    pub fn is_inside_message(&self) -> bool {
        !self.returned && !self.held.is_empty()
    }

    fn take(&mut self, bytes: &[u8]) {
        if self.overlong || self.held.len() + bytes.len() > MAX_MESSAGE {
            self.overlong = true;
            self.skipped_bytes += bytes.len() as u64;
            return;
        }
        match bytes.contains(&b'\r') {
            false => self.held.extend_from_slice(bytes),
            true => self.held.extend(bytes.iter().filter(|byte| **byte != b'\r')),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(framer: &mut Framer, mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        while let Some(message) = framer.next(&mut bytes) {
            found.push(message.to_vec());
        }
        found
    }

    #[test]
    fn messages_end_at_an_empty_line_however_the_stream_is_cut() {
        let stream = b"\n\nQT\n00P\n\nBM\r\n02R\r\n\r\nMD00";
        let whole = messages(&mut Framer::new(), stream);
        assert_eq!(whole, [b"QT\n00P\n".to_vec(), b"BM\n02R\n".to_vec()]);
        for cut in 1..8 {
            let mut framer = Framer::new();
            let pieces: Vec<Vec<u8>> = stream.chunks(cut).flat_map(|piece| messages(&mut framer, piece)).collect();
            assert_eq!(pieces, whole, "cut {cut}");
            assert!(framer.is_inside_message());
        }
    }

    #[test]
    fn an_endless_message_is_dropped_and_counted() {
        let mut framer = Framer::new();
        for _ in 0..40 {
            assert!(messages(&mut framer, &[b'x'; 1000]).is_empty());
        }
        assert_eq!(messages(&mut framer, b"\n\nQT\n00P\n\n"), [b"QT\n00P\n".to_vec()]);
        assert_eq!(framer.skipped_bytes(), 40_001);
    }
}
