//! Tells once when a watched process has ended.

use std::os::fd::{AsFd, OwnedFd};

use rustix::event::{PollFd, PollFlags};

use super::Part;
use crate::Time;

/// A process's pidfd and what to do when it ends.
pub(crate) struct Watch {
    process: OwnedFd,
    ended: Option<Box<dyn FnOnce() + Send>>,
}

impl Watch {
    pub fn new(process: OwnedFd, ended: Box<dyn FnOnce() + Send>) -> Watch {
        Watch { process, ended: Some(ended) }
    }
}

impl Part for Watch {
    fn advance(&mut self, _now: Time) -> Option<Time> {
        None
    }

    fn watch<'a>(&'a self, descriptors: &mut Vec<PollFd<'a>>) {
        // An ended process stays readable: watching on would spin.
        if self.ended.is_some() {
            descriptors.push(PollFd::from_borrowed_fd(self.process.as_fd(), PollFlags::IN));
        }
    }

    fn ready(&mut self, _now: Time, events: &[PollFlags]) {
        if events.iter().any(|event| !event.is_empty())
            && let Some(ended) = self.ended.take()
        {
            ended();
        }
    }

    fn close(&mut self) -> bool {
        true
    }
}
