//! What the runtime says about every node.

use crate::Message;

/// How a node kept time, since it started. Written by the runtime beside the node's own ports.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct NodeStatistics {
    /// Steps done.
    pub steps: u64,
    /// Periods that passed without a step.
    pub skipped: u64,
    /// Steps that ended later than their deadline (counted from the release).
    pub missed_deadlines: u64,
    /// Steps that returned a fault.
    pub faults: u64,
    /// Samples lost on all inputs because the node was slower than their writers.
    pub dropped: u64,
    /// Release lateness (from the grid, or from the stamp of the releasing sample): median, 99 %, 99.9 % and greatest [s].
    pub lateness_s: [f64; 4],
    /// Execution time of a step: median, 99 %, 99.9 % and greatest [s].
    pub execution_s: [f64; 4],
    /// Response (release to end of step): median, 99 %, 99.9 % and greatest [s].
    pub response_s: [f64; 4],
    /// Execution of all steps together [s].
    pub busy_s: f64,
    /// The period that it keeps now; 0 for a node without one, and for one that is suspended [s].
    pub period_s: f64,
}

/// Where one source of a read port, or one written port, stood when a step began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct InputCursor {
    /// Index of the read port in the order of declaration; of a written port [`WRITTEN`] more than its index.
    pub port: u32,
    /// Number of the source's path; see [`path_number`].
    pub source: u32,
    /// Generation of the path's writer.
    pub generation: u64,
    /// Newest sample that the step could see, or that was written before it; 0 for none.
    pub sequence: u64,
    /// Newest sample that the port had handed out one by one.
    pub read_to: u64,
}

/// What [`InputCursor::port`] of a written port is counted from.
pub const WRITTEN: u32 = 1 << 31;

/// What the runtime did with a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum StepKind {
    /// One step.
    Step = 0,
    /// `start`, before the first step.
    Start = 1,
    /// `stop`, after the last one.
    Stop = 2,
}

/// All that a step depended on beside the node's state: with the samples that the cursors point at and the
/// [`StepEvents`] of the same step it can be done again. The tail holds an [`InputCursor`] per source and written port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
#[message(tail = InputCursor)]
pub struct StepInputs {
    /// Number of the step, from 1; 0 for `start`.
    pub step: u64,
    /// The `now` that the step received [ns].
    pub now_ns: u64,
    /// What was done; see [`StepKind`].
    #[message(values = "step start stop")]
    pub kind: u32,
    /// 1 when something that the step read was lost while it ran: it cannot be replayed.
    pub lost: u32,
    /// 1 when it returned a fault.
    pub fault: u32,
    /// Length of the step's [`StepEvents`]; 0 when it has none [byte].
    pub event_bytes: u32,
    /// The stop latch's word as the step saw it; 0 for a node that does not ask for the latch.
    pub latch: u64,
}

/// What reached a step other than by its read ports, and what it did other than by its written ones: bytes of devices
/// and calls, in the order in which the step asked. The tail holds entries one after another, each a header of 8 bytes
/// (kind: u8, port: u8, empty answers before it: u16, length: u32) and that many bytes. The kinds are in
/// `runtime/src/journal/kind.rs`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
#[message(tail = u8)]
pub struct StepEvents {
    /// Number of the step, as in its [`StepInputs`].
    pub step: u64,
    /// The `now` that the step received [ns].
    pub now_ns: u64,
}

/// Number of a path in an [`InputCursor`]: the lower half of its 64-bit FNV-1a.
pub fn path_number(path: &str) -> u32 {
    crate::schema::fnv1a(path.as_bytes()) as u32
}
