//! What both hosts do with a node: freeze its inputs, step it, count, publish.

use crate::announced::Told;
use crate::node::{AnyNode, Fault};
use crate::ports::{Ports, Writer};
use crate::record::Record;
use crate::robot::Missed;
use crate::schedule::Grid;
use crate::statistics::{Statistics, StepTimes};
use crate::time::Time;
use messages::{NodeStatistics, StepKind};

/// A node, opened, with what the runtime adds to it.
pub(crate) struct Opened {
    pub(crate) node: Box<dyn AnyNode>,
    pub(crate) ports: Ports,
    pub(crate) statistics: Writer<NodeStatistics>,
    pub(crate) record: Option<Record>,
}

/// The times of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Done {
    /// When it was due.
    pub release: Time,
    /// The `now` that it received.
    pub began: Time,
    /// When it was over.
    pub ended: Time,
    /// How long it computed [ns].
    pub execution_ns: u64,
}

/// A running node.
pub(crate) struct Running {
    pub(crate) opened: Opened,
    pub(crate) grid: Option<Grid>,
    pub(crate) counted: Statistics,
    pub(crate) last_fault: Option<Fault>,
    missed: Missed,
    deadline_ns: Option<u64>,
    published: Time,
    /// The governor has told it not to step.
    pub(crate) suspended: bool,
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
            published: start,
            suspended: false,
        }
    }

    /// Keeps what the governor announces, from the next release on. Answers whether anything has changed.
    pub(crate) fn keep_to(&mut self, now: Time, told: Told) -> bool {
        let Some(grid) = &mut self.grid else { return false };
        let changes = self.suspended != told.suspended || grid.period_ns() != told.period_ns;
        if std::mem::replace(&mut self.suspended, told.suspended) && !told.suspended {
            grid.pass_over(now);
        }
        grid.set_period(told.period_ns);
        changes
    }

    /// When its grid releases it next.
    pub(crate) fn next_on_grid(&self) -> Option<Time> {
        self.grid.filter(|_| !self.suspended).map(|grid| grid.next())
    }

    /// Another period from the next release on.
    pub(crate) fn set_period(&mut self, period_ns: u64) {
        if let Some(grid) = &mut self.grid {
            grid.set_period(period_ns);
        }
    }

    /// One step at `now` that was due at `release`; `end` tells the time after it.
    pub(crate) fn step(&mut self, now: Time, release: Time, end: impl FnOnce() -> Time) -> Result<(), Fault> {
        let result = self.begin(now);
        let ended = end();
        self.end(Done { release, began: now, ended, execution_ns: ended.nanos_since(now) }, result);
        result
    }

    /// The node's part of a step.
    pub(crate) fn begin(&mut self, now: Time) -> Result<(), Fault> {
        self.opened.ports.freeze(now);
        if let Some(record) = &mut self.opened.record {
            record.begin(&self.opened.ports);
        }
        self.opened.node.step(now)
    }

    /// Counts a step that has been done.
    pub(crate) fn end(&mut self, done: Done, result: Result<(), Fault>) {
        let Done { release, began: now, ended, execution_ns } = done;
        let lateness_ns = ended.nanos_since(release).saturating_sub(execution_ns);
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
        if let Some(record) = &mut self.opened.record {
            record.end(&self.opened.ports, StepKind::Step, self.counted.steps(), now, result.is_err());
        }
        self.last_fault = result.err();
    }

    /// The node's `start`, before its first step.
    pub(crate) fn start(&mut self, now: Time) -> Result<(), Fault> {
        let result = self.beside_steps(StepKind::Start, now, |node| node.start(now));
        self.last_fault = result.err();
        result
    }

    /// The node's `stop`, after its last step.
    pub(crate) fn stop(&mut self, now: Time) {
        let _ = self.beside_steps(StepKind::Stop, now, |node| {
            node.stop(now);
            Ok(())
        });
    }

    fn beside_steps(
        &mut self,
        kind: StepKind,
        now: Time,
        act: impl FnOnce(&mut dyn AnyNode) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let Opened { node, ports, record, .. } = &mut self.opened;
        ports.freeze(now);
        if let Some(record) = record {
            record.begin(ports);
        }
        let result = act(node.as_mut());
        if let Some(record) = record {
            record.end(ports, kind, self.counted.steps(), now, result.is_err());
        }
        result
    }

    /// The counters so far.
    pub(crate) fn summary(&self) -> NodeStatistics {
        let dropped = self.opened.ports.inputs().iter().map(|input| input.dropped()).sum();
        let period_s = self.grid.filter(|_| !self.suspended).map_or(0.0, |grid| grid.period_ns() as f64 * 1e-9);
        NodeStatistics { period_s, ..self.counted.summary(dropped) }
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
