//! The bytes of a call: one message of a Unix seqpacket socket, a fixed header and a body.
//!
//! All numbers are little-endian.
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 4 | magic `SNWC` |
//! | 4 | 2 | version, 1 |
//! | 6 | 2 | [`Kind`] |
//! | 8 | 8 | call id, chosen by the caller, unique within its connection; replies repeat it |
//! | 16 | 8 | deadline, CLOCK_MONOTONIC ns of this machine; 0: none |
//! | 24 | 8 | layout hash of the body's message; 0: the body is no message |
//! | 32 | 4 | length of the body |
//! | 36 | 1 | priority, 255 first |
//! | 37 | 3 | zero |
//! | 40 | 32 | command, UTF-8, padded with zeros |
//! | 72 | 64 | sender, the path of the node that sends it or a program's name, padded with zeros |
//! | 136 | … | body: a message's fixed part, or what [`Kind`] says |

/// The first four bytes.
pub const MAGIC: [u8; 4] = *b"SNWC";
/// The version spoken here.
pub const VERSION: u16 = 1;
/// Length of the header.
pub const HEADER_BYTES: usize = 136;
/// Longest body.
pub const MAX_BODY_BYTES: usize = 64 * 1024;
/// Longest message.
pub const MAX_MESSAGE_BYTES: usize = HEADER_BYTES + MAX_BODY_BYTES;
/// Longest name of a command.
pub const COMMAND_BYTES: usize = 32;
/// Longest name of a sender.
pub const SENDER_BYTES: usize = 64;

/// What a message is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub enum Kind {
    /// To the node: what is `command`? Without a command: which are there? Answered at once, with JSON.
    Describe = 1,
    /// To the node: do `command`; the body is its request message.
    Request = 2,
    /// To the node: the call of this id is no longer wanted.
    Cancel = 3,
    /// From the node: the long order is under way; the deadline no longer counts.
    Accepted = 16,
    /// From the node: the newest progress message of a long order. Older ones may have been skipped.
    Progress = 17,
    /// From the node, last: the answer message, or the JSON of `describe`, `ping` and `state`.
    Answer = 18,
    /// From the node, last: the call was not begun; the body is a [`Refusal`](super::Refusal).
    Refused = 19,
    /// From the node, last: the order was begun and could not be done; the body is a [`Refusal`](super::Refusal).
    Failed = 20,
    /// From the node, last: the call was cancelled.
    Cancelled = 21,
}

impl Kind {
    const ALL: [Kind; 9] = [
        Kind::Describe,
        Kind::Request,
        Kind::Cancel,
        Kind::Accepted,
        Kind::Progress,
        Kind::Answer,
        Kind::Refused,
        Kind::Failed,
        Kind::Cancelled,
    ];

    /// Whether a message of this kind ends its call.
    pub fn is_last(self) -> bool {
        matches!(self, Kind::Answer | Kind::Refused | Kind::Failed | Kind::Cancelled)
    }
}

/// The header of a message, without the length of the body, which the body knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// What the message is for.
    pub kind: Kind,
    /// The call that it belongs to.
    pub id: u64,
    /// When the caller stops waiting [ns of CLOCK_MONOTONIC]; 0: never.
    pub deadline_ns: u64,
    /// Layout hash of the body's message; 0: no message.
    pub layout_hash: u64,
    /// 255 first.
    pub priority: u8,
    /// The command.
    pub command: Name<COMMAND_BYTES>,
    /// Who sends it, in its own words.
    pub sender: Name<SENDER_BYTES>,
}

/// Why bytes are no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// Shorter than a header.
    #[error("{0} bytes are too few: a call begins with a header of {HEADER_BYTES} bytes")]
    Short(usize),
    /// Other first bytes.
    #[error("the message does not begin with \"SNWC\": no call of Sinew's")]
    Magic,
    /// Another version.
    #[error("version {0} of the call protocol; this side speaks version {VERSION}: use programs of one release")]
    Version(u16),
    /// No such kind.
    #[error("kind {0} does not exist")]
    Kind(u16),
    /// The body's length is not what the header says, or too great.
    #[error("the header promises a body of {said} bytes, {found} came; at most {MAX_BODY_BYTES} are allowed")]
    Length {
        /// What the header says.
        said: usize,
        /// What came.
        found: usize,
    },
    /// A name is not UTF-8 text padded with zeros.
    #[error("the {0} is no UTF-8 text padded with zeros")]
    Name(&'static str),
}

impl Header {
    /// A header with nothing but its kind and call.
    pub fn new(kind: Kind, id: u64) -> Header {
        Header {
            kind,
            id,
            deadline_ns: 0,
            layout_hash: 0,
            priority: 0,
            command: Name::default(),
            sender: Name::default(),
        }
    }

    /// The header's bytes for a body of `body_bytes`.
    pub fn to_bytes(&self, body_bytes: usize) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        bytes[0..4].copy_from_slice(&MAGIC);
        bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
        bytes[6..8].copy_from_slice(&(self.kind as u16).to_le_bytes());
        bytes[8..16].copy_from_slice(&self.id.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.deadline_ns.to_le_bytes());
        bytes[24..32].copy_from_slice(&self.layout_hash.to_le_bytes());
        bytes[32..36].copy_from_slice(&(body_bytes as u32).to_le_bytes());
        bytes[36] = self.priority;
        bytes[40..72].copy_from_slice(&self.command.0);
        bytes[72..136].copy_from_slice(&self.sender.0);
        bytes
    }

    /// The whole message.
    pub fn message(&self, body: &[u8]) -> Vec<u8> {
        let mut message = Vec::with_capacity(HEADER_BYTES + body.len());
        message.extend_from_slice(&self.to_bytes(body.len()));
        message.extend_from_slice(body);
        message
    }
}

/// Header and body of a message that came from anybody.
pub fn parse(message: &[u8]) -> Result<(Header, &[u8]), WireError> {
    let Some((head, body)) = message.split_at_checked(HEADER_BYTES) else {
        return Err(WireError::Short(message.len()));
    };
    if head[0..4] != MAGIC {
        return Err(WireError::Magic);
    }
    let version = u16::from_le_bytes(field(head, 4));
    if version != VERSION {
        return Err(WireError::Version(version));
    }
    let kind = u16::from_le_bytes(field(head, 6));
    let kind = Kind::ALL.into_iter().find(|known| *known as u16 == kind).ok_or(WireError::Kind(kind))?;
    let said = u32::from_le_bytes(field(head, 32)) as usize;
    if said != body.len() || said > MAX_BODY_BYTES {
        return Err(WireError::Length { said, found: body.len() });
    }
    let header = Header {
        kind,
        id: u64::from_le_bytes(field(head, 8)),
        deadline_ns: u64::from_le_bytes(field(head, 16)),
        layout_hash: u64::from_le_bytes(field(head, 24)),
        priority: head[36],
        command: Name::from_bytes(field(head, 40)).ok_or(WireError::Name("command"))?,
        sender: Name::from_bytes(field(head, 72)).ok_or(WireError::Name("sender"))?,
    };
    Ok((header, body))
}

/// The `N` bytes of `head` from `offset`, which lie within it.
fn field<const N: usize>(head: &[u8], offset: usize) -> [u8; N] {
    std::array::from_fn(|index| head[offset + index])
}

/// A text of at most `N` bytes in place, padded with zeros.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Name<const N: usize>([u8; N]);

impl<const N: usize> Name<N> {
    /// `text`, cut at a character's boundary when it is too long, and at its first NUL.
    pub fn new(text: &str) -> Name<N> {
        let text = text.split('\0').next().unwrap_or("");
        let end = (0..=N.min(text.len())).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Name(bytes)
    }

    /// The name in `bytes`: UTF-8, then only zeros.
    fn from_bytes(bytes: [u8; N]) -> Option<Name<N>> {
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(N);
        let clean = bytes[end..].iter().all(|byte| *byte == 0) && std::str::from_utf8(&bytes[..end]).is_ok();
        clean.then_some(Name(bytes))
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap_or(N);
        std::str::from_utf8(&self.0[..end]).unwrap_or("")
    }
}

impl<const N: usize> Default for Name<N> {
    fn default() -> Name<N> {
        Name([0; N])
    }
}

impl<const N: usize> std::fmt::Debug for Name<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.as_str())
    }
}

impl<const N: usize> std::fmt::Display for Name<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample() -> Header {
        Header {
            kind: Kind::Request,
            id: 7,
            deadline_ns: 12_345,
            layout_hash: 0xFEED,
            priority: 200,
            command: Name::new("enable"),
            sender: Name::new("/tasks/mission"),
        }
    }

    #[test]
    fn a_message_survives_the_wire() {
        let message = sample().message(b"body");
        assert_eq!(parse(&message), Ok((sample(), &b"body"[..])));
    }

    #[test]
    fn a_foreign_message_says_what_is_wrong() {
        let good = sample().message(b"body");
        let with = |offset: usize, value: u8| {
            let mut bad = good.clone();
            bad[offset] = value;
            parse(&bad).map(|(header, _)| header)
        };
        assert_eq!(parse(&good[..20]).unwrap_err(), WireError::Short(20));
        assert_eq!(with(0, b'X'), Err(WireError::Magic));
        assert_eq!(with(4, 9), Err(WireError::Version(9)));
        assert_eq!(with(6, 99), Err(WireError::Kind(99)));
        assert_eq!(with(32, 5), Err(WireError::Length { said: 5, found: 4 }));
        assert_eq!(with(40, 0xFF), Err(WireError::Name("command")));
        assert_eq!(with(135, b'x'), Err(WireError::Name("sender")));
    }

    #[test]
    fn a_long_name_is_cut_at_a_character() {
        assert_eq!(Name::<4>::new("abcde").as_str(), "abcd");
        assert_eq!(Name::<4>::new("abcé").as_str(), "abc");
        assert_eq!(Name::<4>::new("a\0b").as_str(), "a");
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = parse(&bytes);
        }

        #[test]
        fn a_damaged_message_is_refused_or_means_what_it_says(offset in 0usize..140, value: u8) {
            let mut message = sample().message(b"body");
            message[offset] = value;
            if let Ok((header, body)) = parse(&message) {
                let again = header.message(body);
                // Only the three spare bytes are free.
                prop_assert!(again == message || (37..40).contains(&offset));
            }
        }
    }
}
