//! What answers the policy from outside in the simulated host: commands and paths of reactions, and the person who resets.
//!
//! A path that a reaction waits for has come when a sample is in it that was written since, as on a live robot. A command
//! is not run, because a mission must be the same on every machine: that it was asked for is counted, and it ends well
//! after 1 to 50 ms, unless a fault of the list (`kind = "command"`) says that it fails. A person who is heard resets, and
//! resumes a moment later: between the two the robot stands, armed.

use super::{Later, SupervisedHost};
use crate::event::{Event, Request};
use guard::latch::State;
use runtime::Time;
use runtime::channel::RawReader;

/// From a person's reset to the word that lets the robot go [s].
const RESUMED_S: (f64, f64) = (0.2, 1.0);

/// A path that a reaction waits for.
pub(super) struct Awaited {
    ticket: u32,
    path: usize,
    ring: Option<RawReader>,
    since: Time,
    until: Time,
}

impl SupervisedHost {
    /// A reaction executes a command of the robot file.
    pub(super) fn execute(&mut self, now: Time, ticket: u32, command: usize) {
        self.chronicle.commands += 1;
        let program = self.commands.get(command).and_then(|words| words.first());
        let fails = |(refused, until): &(String, Time)| Some(refused) == program && now < *until;
        let success = program.is_some() && !self.refused.iter().any(fails);
        self.chronicle.commands_failed += u64::from(!success);
        let ends = now.after_s(self.drawn_s(ticket as usize, 7, 1e-3, 50e-3));
        self.later(ends, Later::Tell(Event::Outcome { ticket, success }));
    }

    /// A reaction waits for a path of the robot file.
    pub(super) fn wait_for(&mut self, now: Time, ticket: u32, path: usize, within_s: f64) {
        self.awaited.push(Awaited { ticket, path, ring: None, since: now, until: now.after_s(within_s) });
    }

    /// Tells of paths that have come, or come no more.
    pub(super) fn look_for_paths(&mut self, now: Time) {
        let mut ended = Vec::new();
        let (tree, paths) = (self.host.tree(), &self.paths);
        self.awaited.retain_mut(|awaited| {
            if awaited.ring.is_none() {
                awaited.ring = paths.get(awaited.path).and_then(|path| tree.reader(path, None).ok());
            }
            let stamp = |ring: &RawReader| ring.stamp(ring.head()).map_or(0, |sample| sample.stamp_ns);
            let success = awaited.ring.as_ref().is_some_and(|ring| stamp(ring) > awaited.since.nanos());
            let over = success || awaited.until <= now;
            if over {
                ended.push(Event::Outcome { ticket: awaited.ticket, success });
            }
            !over
        });
        for event in ended {
            self.take(event);
        }
    }

    /// Sets the stop latch.
    pub(super) fn latch(&mut self, now: Time, state: State) {
        self.latch = state;
        self.host.set_latch(state);
        match state {
            State::Run => self.stopped_since = None,
            _ => {
                self.stopped_since.get_or_insert(now);
            }
        }
    }

    /// The policy has heard a person's reset: the same person resumes.
    pub(super) fn arm(&mut self, now: Time) {
        self.latch(now, State::Armed);
        let resumes = now.after_s(self.drawn_s(0, 8, RESUMED_S.0, RESUMED_S.1));
        self.later(resumes, Later::Resume);
    }

    /// A person lets the robot go, if it is armed still.
    pub(super) fn resume(&mut self, now: Time) {
        if self.latch == State::Armed {
            self.latch(now, State::Run);
        }
    }

    /// A person tries to reset.
    pub(super) fn person(&mut self) {
        self.take(Event::Call(Request::Reset));
    }
}
