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
}

/// Where one input stood when a step began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct InputCursor {
    /// Index of the port in the order of declaration.
    pub port: u32,
    /// Index of the source (candidate or member) within the port.
    pub source: u32,
    /// Generation of the source's writer.
    pub generation: u64,
    /// Newest sample that the step could see; 0 for none.
    pub sequence: u64,
}

/// All that a step depended on beside the node's state; the tail holds an [`InputCursor`] per source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
#[message(tail = InputCursor)]
pub struct StepInputs {
    /// Number of the step, from 1.
    pub step: u64,
    /// The `now` that the step received [ns].
    pub now_ns: u64,
    /// 1 when a sample was lost while the step ran: it cannot be replayed.
    pub lost: u64,
}
