//! What both hosts do with a node: freeze its inputs, step it, count, publish.

use crate::node::{AnyNode, Fault};
use crate::ports::{Ports, Writer};
use crate::robot::Missed;
use crate::schedule::Grid;
use crate::statistics::{Statistics, StepTimes};
use crate::time::Time;
use messages::{InputCursor, NodeStatistics, StepInputs};

/// A node, opened, with what the runtime adds to it.
pub(crate) struct Opened {
    pub(crate) node: Box<dyn AnyNode>,
    pub(crate) ports: Ports,
    pub(crate) statistics: Writer<NodeStatistics>,
    pub(crate) record: Option<Writer<StepInputs>>,
}

/// A running node.
pub(crate) struct Running {
    pub(crate) opened: Opened,
    pub(crate) grid: Option<Grid>,
    pub(crate) counted: Statistics,
    pub(crate) last_fault: Option<Fault>,
    missed: Missed,
    deadline_ns: Option<u64>,
    cursors: Vec<InputCursor>,
    published: Time,
}

impl Running {
    pub(crate) fn new(opened: Opened, spec: &crate::robot::NodeSpec, start: Time) -> Running {
        Running {
            opened,
            grid: spec.period_ns.map(|period| Grid::new(start, period)),
            counted: Statistics::default(),
            last_fault: None,
            missed: spec.missed,
            deadline_ns: spec.deadline_ns.or(spec.period_ns),
            cursors: Vec::with_capacity(crate::robot::INPUTS_CAPACITY),
            published: start,
        }
    }

    /// Another period from the next release on.
    pub(crate) fn set_period(&mut self, period_ns: u64) {
        if let Some(grid) = &mut self.grid {
            grid.set_period(period_ns);
        }
    }

    /// One step at `now` that was due at `release`; `end` tells the time after it.
    pub(crate) fn step(&mut self, now: Time, release: Time, end: impl FnOnce() -> Time) -> Result<(), Fault> {
        self.opened.ports.freeze(now);
        if self.opened.record.is_some() {
            self.note_cursors();
        }
        let result = self.opened.node.step(now);
        let ended = end();
        let lateness_ns = now.nanos_since(release);
        let execution_ns = ended.nanos_since(now);
        self.counted.record(StepTimes {
            lateness_ns,
            execution_ns,
            missed_deadline: self.deadline_ns.is_some_and(|deadline| lateness_ns + execution_ns > deadline),
            fault: result.is_err(),
        });
        if let Some(grid) = &mut self.grid
            && grid.next() <= release
        {
            let skipped = grid.advance(ended, self.missed);
            self.counted.skip(skipped);
        }
        if self.opened.record.is_some() {
            self.publish_cursors(now);
        }
        self.last_fault = result.err();
        result
    }

    fn note_cursors(&mut self) {
        self.cursors.clear();
        let cursors = &mut self.cursors;
        for (port, input) in self.opened.ports.inputs().iter().enumerate() {
            input.take_lost();
            input.cursors(port as u32, |cursor| {
                if cursors.len() < cursors.capacity() {
                    cursors.push(cursor);
                }
            });
        }
    }

    fn publish_cursors(&mut self, now: Time) {
        let lost = self.opened.ports.inputs().iter().any(|input| input.take_lost());
        let inputs = StepInputs { step: self.counted.steps(), now_ns: now.nanos(), lost: u64::from(lost) };
        if let Some(record) = &mut self.opened.record {
            record.write_with_tail(now, &inputs, &self.cursors);
        }
    }

    /// The counters so far.
    pub(crate) fn summary(&self) -> NodeStatistics {
        let dropped = self.opened.ports.inputs().iter().map(|input| input.dropped()).sum();
        self.counted.summary(dropped)
    }

    /// Publishes the counters when the last time is `period_s` ago.
    pub(crate) fn publish_statistics(&mut self, now: Time, period_s: f64) {
        if now.since(self.published) >= period_s {
            self.published = now;
            let summary = self.summary();
            self.opened.statistics.write(now, &summary);
        }
    }
}
