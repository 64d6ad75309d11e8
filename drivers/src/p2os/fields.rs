//! Reads a packet's body field by field, and keeps short texts without allocating.

/// A cursor over little-endian fields. Once a field does not fit, it and all later ones are `None`: a prefix of a
/// packet reads as the fields that are there.
#[derive(Debug, Clone)]
pub struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    /// Starts at the front of `body`.
    pub const fn new(body: &'a [u8]) -> Fields<'a> {
        Fields { rest: body }
    }

    /// The next byte.
    pub fn u8(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    /// The next signed byte.
    pub fn i8(&mut self) -> Option<i8> {
        self.u8().map(|byte| byte as i8)
    }

    /// The next word.
    pub fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    /// The next signed word.
    pub fn i16(&mut self) -> Option<i16> {
        self.take().map(i16::from_le_bytes)
    }

    /// The next double word.
    pub fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    /// The next signed double word.
    pub fn i32(&mut self) -> Option<i32> {
        self.take().map(i32::from_le_bytes)
    }

    /// The next NUL-terminated text; one that the packet's end cuts off is `None`.
    pub fn text(&mut self) -> Option<Text> {
        match self.rest.iter().position(|byte| *byte == 0) {
            Some(end) => {
                let text = Text::from_bytes(&self.rest[..end]);
                self.rest = &self.rest[end + 1..];
                Some(text)
            }
            None => {
                self.rest = &[];
                None
            }
        }
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        match self.rest.split_first_chunk::<N>() {
            Some((bytes, rest)) => {
                self.rest = rest;
                Some(*bytes)
            }
            None => {
                self.rest = &[];
                None
            }
        }
    }
}

/// Greatest length of a [`Text`] [byte].
pub const MAX_TEXT: usize = 32;

/// A short text of a packet (name, class, serial number), cut at [`MAX_TEXT`] bytes; what is not printable ASCII
/// becomes `?`.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
pub struct Text {
    bytes: [u8; MAX_TEXT],
    length: u8,
}

impl Text {
    /// Takes over the first [`MAX_TEXT`] bytes.
    pub fn from_bytes(bytes: &[u8]) -> Text {
        let mut text = Text::default();
        for (to, from) in text.bytes.iter_mut().zip(bytes) {
            *to = if from.is_ascii_graphic() || *from == b' ' { *from } else { b'?' };
            text.length += 1;
        }
        text
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        // Only ASCII is ever stored, so the conversion cannot fail.
        str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or("")
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Text {
        Text::from_bytes(text.as_bytes())
    }
}

impl std::fmt::Debug for Text {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        self.as_str().fmt(f)
    }
}

impl std::fmt::Display for Text {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}
