//! What a pump runs: a state machine over descriptors and timers that never waits by itself.

use rustix::event::{PollFd, PollFlags};

use crate::Time;

/// One state machine of a pump.
pub(crate) trait Part: Send {
    /// Does what is due at `now` and what the step asked for; gives the instant of its next timer.
    fn advance(&mut self, now: Time) -> Option<Time>;

    /// Adds the descriptors that it waits for.
    fn watch<'a>(&'a self, descriptors: &mut Vec<PollFd<'a>>);

    /// Takes what has happened: as many `events` as [`watch`](Part::watch) added descriptors, in the same order.
    fn ready(&mut self, now: Time, events: &[PollFlags]);

    /// The last call: sends what is pending without waiting, and closes. True when all has gone out; while it is false
    /// the pump calls it again after polling [`watch`](Part::watch), for a moment.
    fn close(&mut self) -> bool;
}
