//! The simulated host: all nodes of a robot in one thread, on a virtual clock, in a fixed order, from one seed.
//!
//! Releases are served in order of their time and, at one instant, in flow order. A step takes simulated time from a
//! seeded model, during which its node cannot step again: deadlines are missed and periods skipped as on a real robot.
//! What a step published is seen by steps released later; it releases its readers when it ends.

mod injection;
mod load;
mod processors;

use crate::calls::{LocalCalls, LocalRequest, Ticket, TicketState};
use crate::channel::{Claim, Geometry, Tree};
use crate::device::{Direction, MemoryLink, MemoryLinks};
use crate::host::Running;
use crate::node::OpenError;
use crate::ports::{Devices, Input, STATE_DEPTH, SUPERVISOR_STATE};
use crate::pump::PumpBuilder;
use crate::robot::{NodeSpec, Robot, STATISTICS, open_declared};
use crate::stop::{Keepsake, LatchPlace};
use crate::time::Time;
use guard::Word;
use messages::{NodeStatistics, SupervisorState};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How long a step takes in the simulated host.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExecutionModel {
    /// Shortest execution [s].
    pub least_s: f64,
    /// Longest ordinary execution [s].
    pub most_s: f64,
    /// How often a step takes `stall_s` instead, 0…1.
    pub stall_probability: f64,
    /// Execution of a stalled step [s].
    pub stall_s: f64,
}

impl Default for ExecutionModel {
    /// Tens of microseconds, and a stall of 3 ms once in a thousand steps.
    fn default() -> ExecutionModel {
        ExecutionModel { least_s: 20e-6, most_s: 80e-6, stall_probability: 0.001, stall_s: 3e-3 }
    }
}

/// No event happens then.
const NEVER: Time = Time::from_nanos(u64::MAX);

/// How often a node's counters are published where somebody reads them [s].
const STATISTICS_S: f64 = 1.0;

/// A robot in simulation.
pub struct SimulatedHost {
    robot: Robot,
    tree: Tree,
    links: MemoryLinks,
    calls: LocalCalls,
    /// Whether anybody has called anybody: before that there is nothing to carry.
    calls_in_use: bool,
    seed: u64,
    execution: ExecutionModel,
    now: Time,
    slots: Vec<Slot>,
    /// When each node steps next, if nothing else happens, as [`Slot::next_release`] says; the end of time for never.
    releases: Vec<Time>,
    /// For each node the nodes that its samples may release.
    listeners: Vec<Vec<usize>>,
    /// The stop latch, as the host was told.
    latch: Rc<Cell<Word>>,
    /// What dead nodes have left their successors.
    keepsakes: Vec<Keepsake>,
    /// Nodes that died in mid-step, and when.
    deaths: VecDeque<(usize, Time)>,
    /// What a governor is told and tells, where there is one.
    governed: Option<load::Governed>,
    /// The processors that the nodes share; without them each has one of its own.
    processors: Option<processors::Processors>,
}

/// One node's place; the node itself may be dead.
struct Slot {
    spec: NodeSpec,
    running: Option<Running>,
    triggers: Vec<Rc<Input>>,
    device_trigger: bool,
    /// A call or a reply has come for the step.
    called: Arc<AtomicBool>,
    /// Released by a sample or the device at this time and not served yet.
    pending: Option<Time>,
    busy_until: Time,
    /// When the step began that makes it busy.
    busy_since: Time,
    /// It dies in its next step.
    doomed: bool,
    /// Its steps take so many times as long, until then.
    slowed: (f64, Time),
    /// Its device links, also after its death.
    devices: Vec<(MemoryLink, Direction)>,
    /// Somebody reads how it keeps time.
    is_timed: bool,
    random: Pcg64Mcg,
    lives: u64,
}

/// What happened in one event of the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stepped {
    /// Index of the node, in flow order.
    pub node: usize,
    /// When it stepped.
    pub at: Time,
    /// Whether its step returned a fault.
    pub fault: bool,
}

impl SimulatedHost {
    /// All nodes of `robot`, opened and started at time `start`.
    pub fn new(robot: &Robot, seed: u64, start: Time) -> Result<SimulatedHost, OpenError> {
        SimulatedHost::with_execution(robot, seed, start, ExecutionModel::default())
    }

    /// The same with another model of execution times.
    pub fn with_execution(
        robot: &Robot,
        seed: u64,
        start: Time,
        execution: ExecutionModel,
    ) -> Result<SimulatedHost, OpenError> {
        let mut host = SimulatedHost {
            robot: robot.clone(),
            tree: Tree::local(),
            links: MemoryLinks::new(),
            calls: LocalCalls::new(),
            calls_in_use: robot.nodes.iter().any(|node| !node.calls.is_empty()),
            seed,
            execution,
            now: start,
            slots: Vec::new(),
            releases: vec![NEVER; robot.nodes.len()],
            listeners: Vec::new(),
            latch: Rc::default(),
            keepsakes: robot.nodes.iter().map(|_| Keepsake::default()).collect(),
            deaths: VecDeque::new(),
            governed: None,
            processors: None,
        };
        host.links.set_now(start);
        for (index, spec) in robot.nodes.iter().enumerate() {
            let stream = seed ^ (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            host.slots.push(Slot {
                spec: spec.clone(),
                running: None,
                triggers: Vec::new(),
                device_trigger: spec.triggers.iter().any(|t| t == "device"),
                called: Arc::default(),
                pending: None,
                busy_until: start,
                busy_since: start,
                doomed: false,
                slowed: (1.0, Time::ZERO),
                devices: Vec::new(),
                is_timed: robot
                    .nodes
                    .iter()
                    .flat_map(|node| node.reads.values())
                    .any(|wire| wire.from.contains(&spec.port_path(STATISTICS))),
                random: Pcg64Mcg::seed_from_u64(stream),
                lives: 0,
            });
        }
        // Every path exists before any reader looks for it.
        let mut opened = Vec::new();
        for index in 0..host.slots.len() {
            opened.push(host.open(index)?);
        }
        for (index, running) in opened.into_iter().enumerate() {
            for output in running.opened.ports.outputs() {
                output.bind(&host.tree, Claim::Continue)?;
            }
            host.slots[index].running = Some(running);
        }
        // Whoever supervises writes it later; readers look for it now.
        let state = Geometry::of::<SupervisorState>(0, STATE_DEPTH);
        let refused = |e: crate::channel::ChannelError| OpenError::resource(e.to_string());
        host.tree.prepare(SUPERVISOR_STATE, &state).map_err(refused)?;
        host.governed = load::Governed::of(robot, &host.tree, start).map_err(refused)?;
        for index in 0..host.slots.len() {
            host.settle(index)?;
        }
        host.find_listeners();
        Ok(host)
    }

    fn open(&self, index: usize) -> Result<Running, OpenError> {
        let spec = &self.slots[index].spec;
        let opened = open_declared(&self.robot, spec, self.seed, Devices::Memory(self.links.clone()))?;
        *opened.ports.latch.place.borrow_mut() = LatchPlace::Simulated(self.latch.clone());
        opened.ports.keepsake.share(&self.keepsakes[index]);
        // A node that starts later keeps to the grid of the run.
        Ok(Running::new(opened, spec, next_on_grid(self.now, spec.period_ns)))
    }

    /// Binds the read ports of a node whose written paths are bound, and starts it.
    fn settle(&mut self, index: usize) -> Result<(), OpenError> {
        let now = self.now;
        let slot = &mut self.slots[index];
        let Some(running) = &mut slot.running else { return Ok(()) };
        slot.devices = running.opened.ports.incoming.clone();
        for input in running.opened.ports.inputs() {
            input.bind(&self.tree)?;
        }
        let triggers = &slot.spec.triggers;
        slot.triggers = running
            .opened
            .ports
            .inputs()
            .iter()
            .filter(|input| triggers.iter().any(|t| t == input.port))
            .cloned()
            .collect();
        for input in &slot.triggers {
            input.take_arrival();
        }
        slot.lives += 1;
        let path = slot.spec.path();
        let mut pump = std::mem::replace(&mut running.opened.ports.pump, PumpBuilder::new(&path));
        let called = slot.called.clone();
        pump.notify(Arc::new(move |_| called.store(true, Ordering::Relaxed)));
        pump.join(&self.calls).map_err(|e| OpenError::Config { reason: e.to_string() })?;
        // A fault is kept in `last_fault`.
        let _ = running.start(now);
        self.plan(index);
        Ok(())
    }

    fn find_listeners(&mut self) {
        let mut listeners = vec![Vec::new(); self.slots.len()];
        for (reader, slot) in self.slots.iter().enumerate() {
            for input in &slot.triggers {
                for source in input.sources.borrow().iter() {
                    let writer =
                        self.slots.iter().position(|writer| source.path.starts_with(&(writer.spec.path() + "/")));
                    if let Some(writer) = writer
                        && !listeners[writer].contains(&reader)
                    {
                        listeners[writer].push(reader);
                    }
                }
            }
        }
        self.listeners = listeners;
    }

    /// The virtual time.
    pub fn now(&self) -> Time {
        self.now
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The channels, to read from beside the nodes.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// The device links, to inject faults into.
    pub fn links(&self) -> &MemoryLinks {
        &self.links
    }

    /// Sets the stop latch, as a guard does on a live robot. Nodes see it in their next step.
    pub fn set_latch(&mut self, state: guard::latch::State) {
        self.latch.set(self.latch.get().changed_to(state));
    }

    /// Calls a node from beside the nodes, as `sinew call` does on a live robot.
    pub fn call(&mut self, request: &LocalRequest<'_>) -> Ticket {
        self.calls_in_use = true;
        let ticket = self.calls.request(self.now, request);
        self.release_called();
        ticket
    }

    /// How a call stands.
    pub fn call_state(&self, ticket: Ticket) -> TicketState {
        self.calls.poll(ticket)
    }

    /// Withdraws a call.
    pub fn cancel_call(&mut self, ticket: Ticket) {
        self.calls.cancel(self.now, ticket);
        self.release_called();
    }

    /// Carries calls and replies, and releases those for whom there is something to look at.
    fn carry_calls(&mut self) {
        if self.calls_in_use {
            self.calls.advance(self.now);
            self.release_called();
        }
    }

    fn release_called(&mut self) {
        for index in 0..self.slots.len() {
            if self.slots[index].called.swap(false, Ordering::Relaxed) {
                self.release(index, self.now);
            }
        }
    }

    /// Has node `index` step at `at`, or earlier if it was to do so anyway.
    fn release(&mut self, index: usize, at: Time) {
        let slot = &mut self.slots[index];
        if slot.running.is_some() {
            slot.pending = Some(slot.pending.map_or(at, |pending| pending.min(at)));
            self.plan(index);
        }
    }

    /// Works out anew when node `index` steps next.
    fn plan(&mut self, index: usize) {
        self.releases[index] = self.slots[index].next_release().unwrap_or(NEVER);
    }

    /// Serves the next event at or before `until`; `None` when there is none, and the time is `until` then.
    pub fn step_until(&mut self, until: Time) -> Option<Stepped> {
        let mut best = self.next_event();
        while let Some(due) = self.governed.as_ref().map(|governed| governed.due)
            && due <= until
            && best.is_none_or(|(at, _)| due <= at)
        {
            self.now = self.now.max(due);
            self.tell_load();
            best = self.next_event();
        }
        if self.processors.is_some() {
            return self.step_shared(until, best);
        }
        match best {
            Some((at, index)) if at <= until && at < NEVER => Some(self.serve(index, at.max(self.now))),
            _ => {
                self.now = self.now.max(until);
                self.links.set_now(self.now);
                self.carry_calls();
                None
            }
        }
    }

    /// What happens next: when, and which node steps.
    fn next_event(&self) -> Option<(Time, usize)> {
        if let Some(processors) = &self.processors {
            return processors.next(self.now, &self.releases, &self.slots);
        }
        self.releases.iter().copied().zip(0..).min()
    }

    /// Serves all events up to `until`.
    pub fn run_until(&mut self, until: Time) {
        while self.step_until(until).is_some() {}
    }

    fn serve(&mut self, index: usize, at: Time) -> Stepped {
        self.now = at;
        self.links.set_now(at);
        let spent_s = self.spent_s(index);
        let slot = &mut self.slots[index];
        let Some(running) = &mut slot.running else { return Stepped { node: index, at, fault: false } };
        let grid = running.next_on_grid().filter(|next| *next <= at);
        let release = [slot.pending, grid].into_iter().flatten().min().unwrap_or(at);
        slot.pending = None;
        let ended = at.after_s(spent_s);
        (slot.busy_since, slot.busy_until) = (at, ended);
        let fault = running.step(at, release, || ended).is_err();
        self.stepped(index, at, ended, fault)
    }

    /// What follows a step that ended at `ended`.
    fn stepped(&mut self, index: usize, at: Time, ended: Time, fault: bool) -> Stepped {
        let slot = &mut self.slots[index];
        let Some(running) = &mut slot.running else { return Stepped { node: index, at, fault } };
        let has_device = !running.opened.ports.incoming.is_empty();
        if slot.is_timed {
            running.publish_statistics(ended, STATISTICS_S);
        }
        self.plan(index);
        if self.governed.as_ref().is_some_and(|governed| governed.node == index) {
            self.hear_periods(ended);
        }
        if self.slots[index].doomed {
            self.deaths.push_back((index, at));
            self.kill(index);
            self.release_listeners(index, ended);
            self.carry_calls();
            return Stepped { node: index, at, fault };
        }
        self.release_listeners(index, ended);
        if has_device {
            self.release_device_readers();
        }
        self.carry_calls();
        Stepped { node: index, at, fault }
    }

    /// Releases those whom the samples of node `index` trigger.
    fn release_listeners(&mut self, index: usize, ended: Time) {
        for k in 0..self.listeners[index].len() {
            let listener = self.listeners[index][k];
            let slot = &mut self.slots[listener];
            let arrived = slot.triggers.iter().fold(false, |any, input| input.take_arrival().is_some() | any);
            if arrived {
                self.release(listener, ended);
            }
        }
    }

    /// Bytes may be under way to any node with a device: it is released when the last byte of one `send` arrives. What a
    /// node has read is no longer under way.
    fn release_device_readers(&mut self) {
        for index in 0..self.slots.len() {
            let slot = &self.slots[index];
            let Some(running) = slot.running.as_ref().filter(|_| slot.device_trigger) else { continue };
            let arrivals = running.opened.ports.incoming.iter();
            let arrivals = arrivals.filter_map(|(link, direction)| link.next_arrival(*direction, Time::ZERO));
            if let Some(arrival) = arrivals.min() {
                self.release(index, arrival);
            }
        }
    }

    fn spent_s(&mut self, index: usize) -> f64 {
        let ExecutionModel { least_s, most_s, stall_probability, stall_s } = self.execution;
        let bits = self.slots[index].random.next_u64();
        // Two independent numbers in [0, 1) out of one draw.
        let spread = (bits >> 40) as f64 / (1_u64 << 24) as f64;
        let chance = (bits & 0xff_ffff) as f64 / (1_u64 << 24) as f64;
        let ordinary_s = if chance < stall_probability { stall_s } else { least_s + (most_s - least_s) * spread };
        let (factor, until) = self.slots[index].slowed;
        if self.now < until { ordinary_s * factor } else { ordinary_s }
    }

    /// Kills node `index` between two of its steps: no destructor of its own logic runs, its paths become free.
    pub fn kill(&mut self, index: usize) {
        let slot = &mut self.slots[index];
        slot.running = None;
        slot.triggers.clear();
        slot.pending = None;
        slot.doomed = false;
        if let Some(processors) = &mut self.processors {
            processors.forget(index);
        }
        self.calls.node_ended(&slot.spec.path());
        self.plan(index);
    }

    /// Lets node `index` hang for `seconds`: it holds its paths and does not step.
    pub fn hang(&mut self, index: usize, seconds: f64) {
        let until = self.now.after_s(seconds);
        let slot = &mut self.slots[index];
        if slot.busy_until <= self.now {
            slot.busy_since = self.now;
        }
        slot.busy_until = slot.busy_until.max(until);
        self.plan(index);
    }

    /// Starts node `index` again after a death.
    pub fn restart(&mut self, index: usize) -> Result<(), OpenError> {
        let running = self.open(index)?;
        running.opened.ports.bind(&self.tree, Claim::Continue)?;
        self.slots[index].running = Some(running);
        self.slots[index].busy_until = self.now;
        self.settle(index)?;
        self.find_listeners();
        self.release_device_readers();
        Ok(())
    }

    /// Whether node `index` is alive.
    pub fn alive(&self, index: usize) -> bool {
        self.slots[index].running.is_some()
    }

    /// Index of the node with path `/<layer>/<instance>`.
    pub fn index_of(&self, path: &str) -> Option<usize> {
        self.slots.iter().position(|slot| slot.spec.path() == path)
    }

    /// How node `index` kept time in this life.
    pub fn statistics(&self, index: usize) -> Option<NodeStatistics> {
        self.slots[index].running.as_ref().map(Running::summary)
    }

    /// Why node `index` faulted in its last step, if it did.
    pub fn last_fault(&self, index: usize) -> Option<crate::Fault> {
        self.slots[index].running.as_ref().and_then(|running| running.last_fault)
    }

    /// Ordered stop of every node, last in the flow first.
    pub fn stop(&mut self) {
        for index in (0..self.slots.len()).rev() {
            if let Some(running) = &mut self.slots[index].running {
                running.stop(self.now);
            }
        }
    }
}

impl Slot {
    /// When the node steps next, if nothing else happens.
    fn next_release(&self) -> Option<Time> {
        let running = self.running.as_ref()?;
        let grid = running.next_on_grid();
        let release = match (grid, self.pending.filter(|_| !running.suspended)) {
            (Some(grid), Some(pending)) => grid.min(pending),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => return None,
        };
        Some(release.max(self.busy_until))
    }
}

/// The first point of the run's grid at or after `now`.
fn next_on_grid(now: Time, period_ns: Option<u64>) -> Time {
    match period_ns {
        Some(period) if period > 0 => Time::from_nanos(now.nanos().div_ceil(period) * period),
        _ => now,
    }
}
