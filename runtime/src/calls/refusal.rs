//! Why a call was not done, in a form that a program can act on and a person can read.

use super::wire::{COMMAND_BYTES, Name};

/// Bytes of a reason that a step can read without allocating.
const REASON_BYTES: usize = 232;

/// What kind of refusal it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum RefusalCode {
    /// The node itself said no.
    ByNode = 1,
    /// The node has no such command.
    UnknownCommand = 2,
    /// The body is a message of another layout.
    WrongLayout = 3,
    /// The body's length is not that of the request message.
    WrongLength = 4,
    /// As many requests as fit are waiting already.
    QueueFull = 5,
    /// The deadline passed before the node answered.
    NotInTime = 6,
    /// The bytes are no call.
    Malformed = 7,
    /// The node dropped the request without an answer, which is a defect of the node.
    Forgotten = 8,
    /// Too many connections at once.
    TooManyCallers = 9,
    /// The caller has used this id for a call that is still under way.
    DuplicateId = 10,
    /// The caller's user may not call this node.
    NotAllowed = 11,
}

impl RefusalCode {
    const ALL: [RefusalCode; 11] = [
        RefusalCode::ByNode,
        RefusalCode::UnknownCommand,
        RefusalCode::WrongLayout,
        RefusalCode::WrongLength,
        RefusalCode::QueueFull,
        RefusalCode::NotInTime,
        RefusalCode::Malformed,
        RefusalCode::Forgotten,
        RefusalCode::TooManyCallers,
        RefusalCode::DuplicateId,
        RefusalCode::NotAllowed,
    ];

    /// The code with this number; an unknown one is the node's own.
    pub(crate) fn of(number: u8) -> RefusalCode {
        RefusalCode::ALL.into_iter().find(|code| *code as u8 == number).unwrap_or(RefusalCode::ByNode)
    }
}

/// Why a call was not done.
///
/// As a body: code (u32), four zero bytes, expected layout hash (u64), nearest command (32 bytes), then the reason's
/// UTF-8 text to the end; all little-endian.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// What kind of refusal it is.
    pub code: RefusalCode,
    /// The layout hash that the node expects, for [`RefusalCode::WrongLayout`].
    pub expected_hash: u64,
    /// The command whose name is nearest, for [`RefusalCode::UnknownCommand`].
    pub nearest: Name<COMMAND_BYTES>,
    /// Where, why and what to do.
    pub reason: String,
}

impl Refusal {
    /// A refusal without particulars.
    pub fn new(code: RefusalCode, reason: impl Into<String>) -> Refusal {
        Refusal { code, expected_hash: 0, nearest: Name::default(), reason: reason.into() }
    }

    /// The body of a `Refused` or `Failed` message.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(48 + self.reason.len());
        bytes.extend_from_slice(&(self.code as u32).to_le_bytes());
        bytes.extend_from_slice(&[0; 4]);
        bytes.extend_from_slice(&self.expected_hash.to_le_bytes());
        let mut nearest = [0; COMMAND_BYTES];
        nearest[..self.nearest.as_str().len()].copy_from_slice(self.nearest.as_str().as_bytes());
        bytes.extend_from_slice(&nearest);
        bytes.extend_from_slice(self.reason.as_bytes());
        bytes
    }

    /// The refusal in `body`; one that cannot be read is a refusal all the same.
    pub fn from_bytes(body: &[u8]) -> Refusal {
        let Some((head, text)) = body.split_at_checked(48) else {
            return Refusal::new(RefusalCode::Malformed, "the node refused, and its reason cannot be read");
        };
        let number = u32::from_le_bytes(std::array::from_fn(|index| head[index]));
        let nearest = std::str::from_utf8(&head[16..48]).unwrap_or("");
        Refusal {
            code: RefusalCode::ALL.into_iter().find(|code| *code as u32 == number).unwrap_or(RefusalCode::ByNode),
            expected_hash: u64::from_le_bytes(std::array::from_fn(|index| head[8 + index])),
            nearest: Name::new(nearest),
            reason: String::from_utf8_lossy(text).into_owned(),
        }
    }
}

/// A reason that a step can hold: a text in place, cut where it is too long.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Reason {
    /// What kind of refusal it is.
    pub code: RefusalCode,
    text: Name<REASON_BYTES>,
}

impl Reason {
    pub(crate) fn new(refusal: &Refusal) -> Reason {
        Reason { code: refusal.code, text: Name::new(&refusal.reason) }
    }

    /// Where, why and what to do.
    pub fn as_str(&self) -> &str {
        self.text.as_str()
    }
}

impl std::fmt::Debug for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}({:?})", self.code, self.as_str())
    }
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_refusal_survives_the_wire() {
        let refusal = Refusal {
            code: RefusalCode::UnknownCommand,
            expected_hash: 42,
            nearest: Name::new("enable"),
            reason: "no command \"enabel\"".into(),
        };
        assert_eq!(Refusal::from_bytes(&refusal.to_bytes()), refusal);
    }

    proptest! {
        #[test]
        fn any_body_of_a_refusal_is_a_refusal(body in prop::collection::vec(any::<u8>(), 0..120)) {
            let refusal = Refusal::from_bytes(&body);
            let _ = Reason::new(&refusal).as_str();
        }
    }
}
