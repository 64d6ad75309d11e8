//! Requests and answers of calls that many nodes share.

use crate::Message;

/// Asks for something to be switched (std_srvs/SetBool).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct Switch {
    /// On: 1, or off: 0.
    pub on: u64,
}

/// Asks for something that needs no particulars (std_srvs/Trigger).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct Trigger {
    /// Means nothing; a message has at least one field.
    pub unused: u64,
}

/// Asks for one tone.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Sound {
    /// Note after MIDI, 1…127, 60 is middle C; 0 for a rest.
    pub note: u64,
    /// How long [s].
    pub duration_s: f64,
}

/// The request was taken over. What became of it shows in the node's state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct Done {
    /// The node's own time of the step that took it [ns].
    pub at_ns: u64,
}
