//! The kinds of entries of a journal, as they stand in recordings: never change a number.
//!
//! | kind | from | payload after the header |
//! |---|---|---|
//! | `Received` | device | arrived [ns] u64, bytes |
//! | `Link` | device | state of the link, one word: low two bits 0 closed, 1 opening, 2 open, 3 closed with an error number |
//! | `SendFailed` | device | the link's word, or all ones when the line was full |
//! | `Taken` | caller of a command | number u64, deadline [ns] u64, pid u32, uid u32, priority u8, length of name u8, name, message |
//! | `Cancelled` | caller of a command | number u64, why u8 |
//! | `Polled` | called node | state u8, reason's code u8, then answer or reason's text |
//! | `Progress` | called node | message |
//! | `Kept` | device | 1 where the open link is a predecessor's, else 0: u8; a change only |
//! | `Inherited` | predecessor | what the node's keepsake holds |
//! | `Sent` | step | bytes |
//! | `Reopened` | step | – |
//! | `Baud` | step | rate [baud] u32 |
//! | `Ended` | step | number u64, how u8, then answer or reason's text |
//! | `Accepted` | step | number u64 |
//! | `Reported` | step | number u64, message |
//! | `Called` | step | number u64, deadline [ns] u64, priority u8, message |
//! | `CallCancelled` | step | – |
//! | `Left` | step | what it leaves its successor in its keepsake |

/// What an entry tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum EntryKind {
    Received = 0,
    Link = 1,
    SendFailed = 2,
    Taken = 3,
    Cancelled = 4,
    Polled = 5,
    Progress = 6,
    Kept = 7,
    Inherited = 8,
    Sent = 16,
    Reopened = 17,
    Baud = 18,
    Ended = 19,
    Accepted = 20,
    Reported = 21,
    Called = 22,
    CallCancelled = 23,
    Left = 24,
}

/// Kinds below this are inputs of the step, the others its outputs.
pub(crate) const FIRST_OUTPUT: u8 = 16;

/// The kind's name, for people.
pub(crate) fn name(kind: u8) -> &'static str {
    match kind {
        0 => "bytes from the device",
        1 => "state of the device's link",
        2 => "refused bytes to the device",
        3 => "request",
        4 => "cancellation",
        5 => "state of a call",
        6 => "progress of a call",
        7 => "whether the device's link is a predecessor's",
        8 => "keepsake of a predecessor",
        16 => "bytes to the device",
        17 => "reopening of the device",
        18 => "the device's rate",
        19 => "end of a request",
        20 => "acceptance of an order",
        21 => "progress report",
        22 => "call",
        23 => "cancellation of a call",
        24 => "keepsake for a successor",
        _ => "unknown entry",
    }
}
