//! Processors that the nodes share, for runs in which there may be too few: preemptive fixed priorities, first come first
//! served among equals, as SCHED_FIFO does.
//!
//! A step begins when its node first gets a processor; its inputs freeze then. It ends when it has had its execution
//! time, which may be long after: whoever has a higher priority takes the processor away meanwhile. What it published is
//! seen from its beginning on; it releases its readers when it ends.

use super::{NEVER, SimulatedHost, Slot, Stepped};
use crate::host::Done;
use crate::node::Fault;
use crate::time::Time;

/// The processors, and the steps that want them.
pub(super) struct Processors {
    pub count: usize,
    /// Highest priority first, and first come first among equals.
    jobs: Vec<Job>,
    /// Up to when they have computed.
    at: Time,
}

struct Job {
    node: usize,
    priority: u8,
    left_ns: u64,
    execution_ns: u64,
    release: Time,
    began: Time,
    result: Result<(), Fault>,
}

impl Processors {
    /// When something happens next, and the node that steps then; where a step ends first, the node that ends it.
    pub fn next(&self, now: Time, releases: &[Time], slots: &[Slot]) -> Option<(Time, usize)> {
        let begins = self.begins(now, releases, slots).map(|(at, _, node)| (at, node));
        let ends = self.ends().map(|(at, job)| (at, self.jobs[job].node));
        match (begins, ends) {
            (Some(begins), Some(ends)) if begins.0 < ends.0 => Some(begins),
            (begins, ends) => ends.or(begins),
        }
    }

    /// The next step that begins.
    fn begins(&self, now: Time, releases: &[Time], slots: &[Slot]) -> Option<(Time, u8, usize)> {
        let free = |priority: u8| self.jobs.iter().filter(|job| job.priority >= priority).count() < self.count;
        let due = releases.iter().enumerate().filter(|(node, at)| **at < NEVER && free(slots[*node].spec.priority));
        due.map(|(node, at)| ((*at).max(now), u8::MAX - slots[node].spec.priority, node)).min()
    }

    /// The next step that ends, and its place.
    fn ends(&self) -> Option<(Time, usize)> {
        let running = self.jobs.iter().take(self.count).enumerate();
        running.map(|(job, of)| (self.at.after_ns(of.left_ns), job)).min()
    }

    /// Lets them compute up to `now`, which lies before the next end.
    fn compute(&mut self, now: Time) {
        let spent_ns = now.nanos_since(self.at);
        self.at = self.at.max(now);
        for job in self.jobs.iter_mut().take(self.count) {
            job.left_ns = job.left_ns.saturating_sub(spent_ns);
        }
    }

    fn add(&mut self, job: Job) {
        let place = self.jobs.iter().position(|other| other.priority < job.priority).unwrap_or(self.jobs.len());
        self.jobs.insert(place, job);
    }

    /// Node `node` is dead.
    pub fn forget(&mut self, node: usize) {
        self.jobs.retain(|job| job.node != node);
    }
}

impl SimulatedHost {
    /// Has all nodes share `count` processors from now on, by their priorities; before, each has one of its own.
    pub fn share_processors(&mut self, count: usize) {
        self.processors = Some(Processors { count: count.max(1), jobs: Vec::new(), at: self.now });
    }

    /// The next event at or before `until` on shared processors.
    pub(super) fn step_shared(&mut self, until: Time, best: Option<(Time, usize)>) -> Option<Stepped> {
        let Some((at, _)) = best.filter(|(at, _)| *at <= until) else {
            self.now = self.now.max(until);
            self.links.set_now(self.now);
            self.carry_calls();
            return None;
        };
        self.now = self.now.max(at);
        self.links.set_now(self.now);
        let processors = self.processors.as_mut()?;
        match processors.ends().filter(|(ends, _)| *ends <= self.now) {
            Some((_, job)) => {
                processors.compute(self.now);
                let job = processors.jobs.remove(job);
                Some(self.end_job(job))
            }
            None => {
                let (_, _, node) = processors.begins(self.now, &self.releases, &self.slots)?;
                processors.compute(self.now);
                Some(self.begin_job(node))
            }
        }
    }

    fn begin_job(&mut self, node: usize) -> Stepped {
        let now = self.now;
        let execution_ns = (self.spent_s(node) * 1e9) as u64;
        let slot = &mut self.slots[node];
        let Some(running) = &mut slot.running else { return Stepped { node, at: now, fault: false } };
        let grid = running.next_on_grid().filter(|next| *next <= now);
        let release = [slot.pending, grid].into_iter().flatten().min().unwrap_or(now);
        slot.pending = None;
        (slot.busy_since, slot.busy_until) = (now, NEVER);
        let result = running.begin(now);
        let (priority, left_ns) = (slot.spec.priority, execution_ns);
        self.plan(node);
        if let Some(processors) = &mut self.processors {
            processors.add(Job { node, priority, left_ns, execution_ns, release, began: now, result });
        }
        Stepped { node, at: now, fault: result.is_err() }
    }

    fn end_job(&mut self, job: Job) -> Stepped {
        let Job { node, execution_ns, release, began, result, .. } = job;
        let ended = self.now;
        let slot = &mut self.slots[node];
        slot.busy_until = ended;
        if let Some(running) = &mut slot.running {
            running.end(Done { release, began, ended, execution_ns }, result);
        }
        self.stepped(node, began, ended, result.is_err())
    }
}
