//! The same policy in the simulated host: deaths, hangs, slow-downs and lost bytes come from a seed, detection and
//! processes take simulated time, and the policy decides as on a live robot.
//!
//! What stands for what: a process that dies is noticed after a fraction of a millisecond (pidfd), one that hangs by
//! missed beats, every [`LOOK_S`]; a start takes as long as a small program takes to be loaded and to open its ports; a
//! driver's last will is written when its death has been noticed, as the guard does. What the policy lets the robot do
//! stands at `/supervisor/robot/state` as on a live robot.

mod answers;
mod faults;
mod governed;
mod inject;
mod planned;

pub use faults::FaultRates;
pub use planned::{PlannedFault, When};

use std::collections::BTreeMap;

use guard::latch::State;
use messages::{NodeStatistics, SupervisorState, bytemuck};
use runtime::channel::{Claim, Geometry, RawReader, RawWriter};
use runtime::robot::Robot;
use runtime::{ExecutionModel, OpenError, STATE_DEPTH, SUPERVISOR_STATE, SimulatedHost, Time};

use crate::beats::BEATS_PER_LIMIT;
use crate::event::{Action, Event, IncidentKind, Request};
use crate::exit::Exit;
use crate::policy::Policy;
use crate::robot_plan::{Crew, RobotPlan};
use crate::severity::Severity;
use crate::state::NodeState;

/// How often beats, ages and deadlines are looked at [s].
pub const LOOK_S: f64 = 0.01;
/// So many missed beats of this length are the 100 ms after which a node hangs [s].
const BEAT_S: f64 = 0.1 / BEATS_PER_LIMIT as f64;
/// Looks between two of deadlines and ages.
const SLOW_LOOKS: u64 = 10;

/// What happened in a supervised run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Chronicle {
    /// Faults injected, by kind: deaths, hangs, slow-downs, bursts, stops, supervisor's deaths, refused commands.
    pub faults: [u64; 7],
    /// Commands that reactions have asked for, and those of them that failed.
    pub commands: u64,
    /// Of them, those that failed.
    pub commands_failed: u64,
    /// Restarts of processes, whatever the reason.
    pub restarts: u64,
    /// Times from a death to the next sign of life, in the order of their ends [s].
    pub recoveries_s: Vec<f64>,
    /// Processes given up.
    pub given_up: u64,
    /// Times that limp mode was entered, and that the robot was held.
    pub limps: u64,
    /// Times that the robot was held.
    pub holds: u64,
    /// Emergency stops.
    pub stops: u64,
    /// Emergency stops that were let go by anything but a reset after their cause.
    pub let_go: u64,
}

/// What is to happen at a later time.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Later {
    Tell(Event),
    Come(usize),
    StandbyCome { crew: usize, other: bool },
    Leave(usize),
    Will(usize),
    EndBurst,
    Person,
    Resume,
}

/// A robot in simulation under its supervisor.
pub struct SupervisedHost {
    host: SimulatedHost,
    policy: Policy,
    crews: Vec<Crew>,
    /// By time; the first of them that is still to come.
    faults: Vec<PlannedFault>,
    upcoming: usize,
    start: Time,
    seed: u64,
    /// The lines lose bytes until then.
    burst_until: Time,
    /// By time and number of entry.
    agenda: BTreeMap<(Time, u64), Later>,
    entries: u64,
    looks: u64,
    look: Time,
    /// The supervisor is being replaced until then.
    absent_until: Time,
    state: RawWriter,
    said: SupervisorState,
    ages: Vec<Vec<(RawReader, u64)>>,
    stale: Vec<bool>,
    missed: Vec<u64>,
    beating: Vec<bool>,
    died_at: Vec<Option<Time>>,
    wills: Vec<Option<&'static [u8]>>,
    /// What each node did in its former lives.
    former: Vec<NodeStatistics>,
    /// What the governor wants, where there is one.
    governor: Option<governed::Governor>,
    /// Where the stop latch stands, and since when the robot must stand.
    latch: State,
    stopped_since: Option<Time>,
    /// Commands and paths that reactions name by number.
    commands: Vec<Vec<String>>,
    paths: Vec<String>,
    awaited: Vec<answers::Awaited>,
    /// Programs that fail, and until when.
    refused: Vec<(String, Time)>,
    chronicle: Chronicle,
}

impl SupervisedHost {
    /// `robot` from `seed`, with these faults. `will` gives the bytes that stop the device of a node type.
    pub fn new(
        robot: &Robot,
        seed: u64,
        start: Time,
        mut faults: Vec<PlannedFault>,
        will: &dyn Fn(&str) -> Option<&'static [u8]>,
    ) -> Result<SupervisedHost, OpenError> {
        let host = SimulatedHost::with_execution(robot, seed, start, ExecutionModel::default())?;
        let plan = RobotPlan::of(robot);
        let refused = |e: runtime::channel::ChannelError| OpenError::Port {
            port: SUPERVISOR_STATE.into(),
            reason: e.to_string(),
        };
        let state = host
            .tree()
            .writer(SUPERVISOR_STATE, &Geometry::of::<SupervisorState>(0, STATE_DEPTH), Claim::Continue)
            .map_err(refused)?;
        let ages = plan.crews.iter().map(|crew| {
            let open = |(path, max_age_ns): &(String, u64)| Some((host.tree().reader(path, None).ok()?, *max_age_ns));
            crew.fresh.iter().filter_map(open).collect()
        });
        let count = plan.crews.len();
        let wills = plan.crews.iter().map(|crew| crew.nodes.iter().find_map(|&node| will(robot.nodes[node].kind.name)));
        faults.sort_by(|a, b| a.at_s().total_cmp(&b.at_s()));
        let mut supervised = SupervisedHost {
            policy: Policy::supervising(plan.supervision),
            faults,
            upcoming: 0,
            start,
            seed,
            burst_until: start,
            agenda: BTreeMap::new(),
            entries: 0,
            looks: 0,
            look: start.after_s(LOOK_S),
            absent_until: start,
            state,
            said: SupervisorState { severity: u32::MAX, ..SupervisorState::default() },
            ages: ages.collect(),
            stale: vec![false; count],
            missed: vec![0; count],
            beating: vec![true; count],
            died_at: vec![None; count],
            wills: wills.collect(),
            former: vec![NodeStatistics::default(); robot.nodes.len()],
            governor: governed::Governor::of(&host, &plan.crews),
            chronicle: Chronicle::default(),
            latch: State::Run,
            stopped_since: None,
            commands: plan.commands,
            paths: plan.paths,
            awaited: Vec::new(),
            refused: Vec::new(),
            crews: plan.crews,
            host,
        };
        // All nodes have been opened and started already.
        supervised.take(Event::Begin);
        for node in 0..count {
            supervised.take(Event::Ready { node });
        }
        Ok(supervised)
    }

    /// The host, to read from.
    pub fn host(&self) -> &SimulatedHost {
        &self.host
    }

    /// Since when the robot must stand: latched, or reset and not yet resumed.
    pub fn stopped_since(&self) -> Option<Time> {
        self.stopped_since
    }

    /// The policy.
    pub fn policy(&self) -> &Policy {
        &self.policy
    }

    /// What has happened so far.
    pub fn chronicle(&self) -> &Chronicle {
        &self.chronicle
    }

    /// How node `index` kept time in all of its lives; the times are those of this one.
    pub fn statistics(&self, index: usize) -> NodeStatistics {
        let now = self.host.statistics(index).unwrap_or_default();
        let before = &self.former[index];
        NodeStatistics {
            steps: before.steps + now.steps,
            skipped: before.skipped + now.skipped,
            missed_deadlines: before.missed_deadlines + now.missed_deadlines,
            faults: before.faults + now.faults,
            dropped: before.dropped + now.dropped,
            execution_s: if now.steps > 0 { now.execution_s } else { before.execution_s },
            ..now
        }
    }

    /// Keeps what a node did, whose life is about to end.
    fn remember(&mut self, index: usize) {
        if self.host.alive(index) {
            self.former[index] = self.statistics(index);
        }
    }

    /// Runs up to `until`.
    pub fn run_until(&mut self, until: Time) {
        loop {
            let now = self.host.now();
            let timer = self.policy.next_timer().map(|at| at.max(self.absent_until));
            let agenda = self.agenda.keys().next().map(|&(at, _)| at);
            let next = [timer, agenda, self.next_fault(), Some(self.look)].into_iter().flatten().min().unwrap_or(until);
            if next > until {
                self.run_host(until);
                if self.agenda.keys().next().is_none_or(|&(at, _)| at > until) {
                    return;
                }
                continue;
            }
            // A death in mid-step may bring something that comes earlier.
            self.run_host(next.max(now));
            if self.agenda.keys().next().is_some_and(|&(at, _)| at < next) {
                self.serve_agenda(self.host.now());
                continue;
            }
            let now = self.host.now();
            self.serve_agenda(now);
            while self.next_fault().is_some_and(|at| at <= now) {
                let fault = self.faults[self.upcoming].clone();
                self.upcoming += 1;
                self.inject(now, &fault);
            }
            if self.look <= now {
                self.look = now.after_s(LOOK_S);
                self.look(now);
            }
            if self.policy.next_timer().is_some_and(|at| at <= now) && now >= self.absent_until {
                self.take(Event::Timer);
            }
        }
    }

    /// Ordered stop of every node.
    pub fn stop(&mut self) {
        self.host.stop();
    }

    /// Runs the host, and puts what died in mid-step on the agenda.
    fn run_host(&mut self, until: Time) {
        self.host.run_until(until);
        while let Some((node, _)) = self.host.take_death() {
            if let Some(crew) = self.crews.iter().position(|crew| crew.nodes.contains(&node)) {
                self.bury(crew);
            }
        }
    }

    fn later(&mut self, at: Time, what: Later) {
        self.entries += 1;
        self.agenda.insert((at, self.entries), what);
    }

    fn serve_agenda(&mut self, now: Time) {
        while let Some((&(at, entry), &what)) = self.agenda.iter().next() {
            if at > now {
                return;
            }
            self.agenda.remove(&(at, entry));
            match what {
                // Nobody is there to be told; the next supervisor finds out.
                Later::Tell(event) if now < self.absent_until => self.later(self.absent_until, Later::Tell(event)),
                Later::Tell(event) => self.take(event),
                Later::Come(crew) => self.come(now, crew),
                Later::StandbyCome { crew, .. } => self.take(Event::StandbyReady { node: crew }),
                Later::Leave(crew) => {
                    for node in self.crews[crew].nodes.clone() {
                        self.remember(node);
                        self.host.stop_node(node);
                    }
                    self.take(Event::Died { node: crew, exit: Exit::Code(0) });
                }
                Later::Will(crew) => self.write_will(crew),
                Later::EndBurst if now < self.burst_until => {}
                Later::EndBurst => {
                    for name in self.host.links().names() {
                        self.host.links().link(&name).iter().for_each(runtime::device::MemoryLink::clear_fault);
                    }
                }
                Later::Person => self.person(),
                Later::Resume => self.resume(now),
            }
        }
    }

    /// The process of `crew` is dead: its nodes are gone at once, its end is noticed a little later.
    fn bury(&mut self, crew: usize) {
        let now = self.host.now();
        for node in self.crews[crew].nodes.clone() {
            self.remember(node);
            self.host.kill(node);
        }
        // A start that was under way died with it.
        self.agenda.retain(|_, later| *later != Later::Come(crew) && *later != Later::Leave(crew));
        self.died_at[crew].get_or_insert(now);
        let told = |later: &Later| matches!(later, Later::Tell(Event::Died { node, .. }) if *node == crew);
        if self.agenda.values().any(told) {
            // It was dead already.
            return;
        }
        let noticed = now.after_s(self.drawn_s(crew, 1, 0.1e-3, 2e-3));
        self.later(noticed, Later::Tell(Event::Died { node: crew, exit: Exit::Signal { signal: 9, core: false } }));
        if self.wills[crew].is_some() {
            // The guard lives on while the supervisor is being replaced.
            let written = noticed.after_s(self.drawn_s(crew, 2, 0.1e-3, 5e-3));
            self.later(written, Later::Will(crew));
        }
    }

    fn write_will(&mut self, crew: usize) {
        let Some(bytes) = self.wills[crew] else { return };
        for node in self.crews[crew].nodes.clone() {
            if !self.host.alive(node) {
                self.host.write_will(node, bytes);
            }
        }
    }

    fn come(&mut self, now: Time, crew: usize) {
        for node in self.crews[crew].nodes.clone() {
            if !self.host.alive(node) && self.host.restart(node).is_err() {
                let exit = Exit::Code(1);
                self.take(Event::Died { node: crew, exit });
                return;
            }
        }
        (self.missed[crew], self.beating[crew]) = (0, true);
        if let Some(died) = self.died_at[crew].take() {
            self.chronicle.recoveries_s.push(now.since(died));
        }
        self.later(now, Later::Tell(Event::Ready { node: crew }));
    }

    fn take(&mut self, event: Event) {
        let now = self.host.now();
        let (latched, may_reset) = (self.policy.latched(), self.policy.refusal(Request::Reset).is_none());
        let mut actions = Vec::new();
        self.policy.handle(now, event, &mut actions);
        if latched && !self.policy.latched() && !(event == Event::Call(Request::Reset) && may_reset) {
            self.chronicle.let_go += 1;
        }
        if latched && !self.policy.latched() {
            self.arm(now);
        }
        for action in actions {
            self.act(now, action);
        }
        self.say(now);
    }

    fn act(&mut self, now: Time, action: Action) {
        match action {
            // All run from the beginning.
            Action::Start { node } if self.alive(node) => {}
            Action::Start { node } => {
                self.chronicle.restarts += 1;
                let comes = now.after_s(self.drawn_s(node, 3, 3e-3, 60e-3));
                self.later(comes, Later::Come(node));
            }
            Action::Promote { node } => {
                self.chronicle.restarts += 1;
                let comes = now.after_s(self.drawn_s(node, 4, 0.3e-3, 5e-3));
                self.later(comes, Later::Come(node));
            }
            Action::StartStandby { node, other } => {
                let comes = now.after_s(self.drawn_s(node, 5, 3e-3, 60e-3));
                self.later(comes, Later::StandbyCome { crew: node, other });
            }
            Action::KillStandby { node } => {
                let of = |later: &Later| matches!(later, Later::StandbyCome { crew, .. } if *crew == node);
                self.agenda.retain(|_, later| !of(later));
            }
            Action::Terminate { node } => {
                // One that hangs does not hear it.
                if !self.hangs(node) {
                    let leaves = now.after_s(self.drawn_s(node, 6, 1e-3, 20e-3));
                    self.later(leaves, Later::Leave(node));
                }
            }
            Action::Kill { node } => self.bury(node),
            Action::Execute { ticket, command } => self.execute(now, ticket, command),
            Action::Await { ticket, path, within_s } => self.wait_for(now, ticket, path, within_s),
            Action::Limp { on } => self.chronicle.limps += u64::from(on),
            Action::Hold { on } => self.chronicle.holds += u64::from(on),
            Action::Stop { .. } => {
                self.chronicle.stops += 1;
                self.latch(now, State::Latched);
            }
            Action::Notify(incident) => {
                let given_up =
                    matches!(incident.kind, IncidentKind::Died { next: crate::event::Next::GiveUp { .. }, .. });
                self.chronicle.given_up += u64::from(given_up);
            }
            Action::Revert { .. }
            | Action::Accept { .. }
            | Action::Dismiss { .. }
            | Action::Reprioritise { .. }
            | Action::Heal { .. }
            | Action::Done => {}
        }
    }

    /// Publishes what the robot may do, when that has changed.
    fn say(&mut self, now: Time) {
        let severity = self.policy.severity();
        let lost = |&node: &usize| self.policy.node(node).is_lost();
        let state = SupervisorState {
            severity: severity as u32,
            limp: u32::from(severity >= Severity::Limp),
            hold: u32::from(severity >= Severity::Hold),
            stop: u32::from(severity >= Severity::Stop),
            causes: self.policy.causes().len() as u32,
            lost: (0..self.policy.nodes()).filter(lost).count() as u32,
        };
        if state != self.said {
            self.said = state;
            self.state.publish(now.nanos(), bytemuck::bytes_of(&state), &[]);
        }
    }

    fn alive(&self, crew: usize) -> bool {
        self.crews[crew].nodes.iter().all(|&node| self.host.alive(node))
    }

    fn hangs(&self, crew: usize) -> bool {
        let now = self.host.now();
        let busy = |&node: &usize| self.host.busy_since(node).is_some_and(|since| now.since(since) > BEAT_S);
        self.crews[crew].nodes.iter().any(busy)
    }

    /// What the detectors see: beats each time, ages and deadlines now and then.
    fn look(&mut self, now: Time) {
        if now < self.absent_until {
            return;
        }
        if let Some(event) = self.governor.as_mut().and_then(|governor| governor.hear(now)) {
            self.take(event);
        }
        self.looks += 1;
        self.look_for_paths(now);
        let slowly = self.looks.is_multiple_of(SLOW_LOOKS);
        for crew in 0..self.crews.len() {
            let NodeState::Running { .. } = self.policy.node(crew) else { continue };
            if !self.alive(crew) {
                continue;
            }
            let longest_s = self.crews[crew].nodes.iter().filter_map(|&node| self.host.busy_since(node));
            let longest_s = longest_s.map(|since| now.since(since)).fold(0.0, f64::max);
            let beats = (longest_s / BEAT_S) as u32;
            if beats > 0 {
                self.beating[crew] = false;
                self.take(Event::Missed { node: crew, beats, starved: false });
            } else if !std::mem::replace(&mut self.beating[crew], true) {
                self.take(Event::Beat { node: crew });
            }
            if slowly {
                self.look_closer(now, crew);
            }
        }
    }

    fn look_closer(&mut self, now: Time, crew: usize) {
        let missed: u64 =
            self.crews[crew].nodes.iter().filter_map(|&node| self.host.punctuality(node)).map(|p| p.1).sum();
        let before = std::mem::replace(&mut self.missed[crew], missed);
        if missed > before {
            // Each node has a processor of its own in the simulated host.
            self.take(Event::Late { node: crew, misses: (missed - before) as u32, idle: 1.0 });
        }
        let age_ns = |(ring, _): &(RawReader, u64)| {
            let stamp = ring.stamp(ring.head()).map_or(0, |sample| sample.stamp_ns);
            now.nanos_since(Time::from_nanos(stamp))
        };
        let oldest = self.ages[crew].iter().filter(|age| age_ns(age) > age.1).map(age_ns).max();
        match oldest {
            Some(age_ns) if !std::mem::replace(&mut self.stale[crew], true) => {
                self.take(Event::Stale { node: crew, age_s: age_ns as f64 / 1e9 });
            }
            None if std::mem::replace(&mut self.stale[crew], false) => self.take(Event::Fresh { node: crew }),
            _ => {}
        }
    }
}
