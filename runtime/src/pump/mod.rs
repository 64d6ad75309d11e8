//! One thread per node that does all waiting on descriptors: devices, calls from others, calls to others, watched
//! processes. It fills rings and bumps the step's word; `futex_waitv`, in which the step waits, takes no descriptors.
//!
//! A [`PumpBuilder`] only collects (declaring a node opens nothing); [`PumpBuilder::spawn`] makes it live.

mod builder;
mod guarded;
mod part;
mod run;
mod waker;
mod watch;

use std::sync::Arc;

pub use builder::{Attach, PumpBuilder, PumpError};
pub(crate) use guarded::{GuardLine, GuardPart};
pub(crate) use part::Part;
pub use run::Pump;
pub(crate) use run::monotonic;
pub use waker::Waker;

/// What has come for the step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// Bytes from a device, or its link changed.
    Device,
    /// A request of another node or of a person, or its cancellation.
    Call,
    /// News of a call that this node made.
    Reply,
}

/// Tells the step's thread that something has come. Called on the pump's thread; it must not wait.
pub type Notifier = Arc<dyn Fn(Arrival) + Send + Sync>;

/// Takes one line for people's eyes. Called on the pump's thread.
pub type Log = Arc<dyn Fn(&str) + Send + Sync>;
