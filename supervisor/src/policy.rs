//! What to do about births, deaths, silence and requests: a pure state machine, the same in the live and the simulated
//! host.
//!
//! Events come in with the time; actions go out; no clock, no process, no file. Nodes start in groups, the highest
//! `stop_group` first, and stop in the opposite order; a group waits until the ones before it are ready (or stopped).
//! A node that dies is started again after its back-off, or its warm standby takes over, alone or with its group, until
//! the intensity is used up; then it is given up. What cannot be had, hangs, is silent or late puts the robot on a rung
//! of the severity ladder: warn, limp, hold, stop; each cause says when it leaves it. An emergency stop never lets go by
//! itself: there is no action for it.

mod adopt;
mod life;
mod requests;
mod unit;
mod watch;

pub use self::adopt::{Adopted, Past, RobotPast};
use runtime::Time;

use self::unit::{Intent, Standby, Unit};
use crate::backoff::RecentRestarts;
use crate::care::{Care, Group, Supervision};
use crate::event::{Action, Event, Incident, IncidentKind};
use crate::ladder::Ladder;
use crate::reactions::Reactions;
use crate::rule::Rule;
use crate::severity::{Cause, Severity};
use crate::state::{NodeState, RobotState};

/// After SIGKILL even a process in the middle of a system call has this long, s, before the next group is stopped.
const KILLED_WITHIN_S: f64 = 1.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Idle,
    Up,
    Stopping,
    Killing,
    Done,
}

#[derive(Debug, Clone)]
struct Fate {
    group: Group,
    recent: RecentRestarts,
}

/// What the host was last told about the robot's freedom to move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Told {
    limp: bool,
    hold: bool,
    stop: bool,
}

/// The supervisor's mind.
#[derive(Debug, Clone)]
pub struct Policy {
    units: Vec<Unit>,
    fates: Vec<Fate>,
    ladder: Ladder,
    reactions: Reactions,
    told: Told,
    phase: Phase,
}

impl Policy {
    /// A policy for nodes with these rules, none of them started.
    pub fn new(rules: impl IntoIterator<Item = Rule>) -> Policy {
        let nodes = rules.into_iter().map(Care::plain).collect();
        Policy::supervising(Supervision { nodes, ..Supervision::default() })
    }

    /// A policy for all that the robot file says.
    pub fn supervising(plan: Supervision) -> Policy {
        let group_of = |node: usize| plan.groups.iter().position(|group| group.members.contains(&node));
        let units = plan.nodes.iter().enumerate().map(|(node, &care)| Unit::new(care, group_of(node))).collect();
        let fate = |group: Group| Fate { recent: RecentRestarts::new(group.intensity), group };
        Policy {
            units,
            fates: plan.groups.into_iter().map(fate).collect(),
            ladder: Ladder::default(),
            reactions: Reactions::new(plan.reactions),
            told: Told::default(),
            phase: Phase::Idle,
        }
    }

    /// Takes care of one node more, which is started at the next event. Its number is that of the nodes so far.
    pub fn add(&mut self, care: Care) {
        self.units.push(Unit::new(care, None));
    }

    /// Takes in what has happened and appends to `actions` what is to be done about it.
    pub fn handle(&mut self, now: Time, event: Event, actions: &mut Vec<Action>) {
        if self.phase == Phase::Done {
            return;
        }
        let first = actions.len();
        match event {
            Event::Begin if self.phase == Phase::Idle => self.phase = Phase::Up,
            Event::Begin | Event::Timer => {}
            Event::Ready { node } => self.ready(now, node, actions),
            Event::Died { node, exit } => self.died(now, node, exit, actions),
            Event::StopRequested if self.phase != Phase::Killing => self.phase = Phase::Stopping,
            Event::StopRequested => {}
            Event::KillRequested => self.phase = Phase::Killing,
            Event::StandbyReady { node } => self.standby_ready(now, node, actions),
            Event::StandbyDied { node, exit } => self.standby_died(now, node, exit, actions),
            Event::Call(request) => self.call(now, request, actions),
            watched => self.watched(now, watched, actions),
        }
        match self.phase {
            Phase::Up => {
                self.keep_up(now, actions);
                self.react(now, actions);
                // What reactions asked for has its own consequences.
                self.keep_up(now, actions);
                self.settle(now, first, actions);
                self.finish_if_over(actions);
            }
            Phase::Stopping | Phase::Killing => self.wind_down(now, actions),
            Phase::Idle | Phase::Done => {}
        }
    }

    /// When to come back with `Event::Timer`; always later than the `now` of the last event.
    pub fn next_timer(&self) -> Option<Time> {
        if self.phase == Phase::Done {
            return None;
        }
        let states = self.units.iter().filter_map(|unit| unit.state.timer());
        if self.phase != Phase::Up {
            return states.min();
        }
        let watched = self.units.iter().flat_map(|unit| {
            let absent = unit.absent_at().filter(|_| !unit.absent);
            let regroups = matches!(unit.state, NodeState::Regrouping { .. }) && !self.group_is_held_up(unit.group);
            let regroup = unit.group.filter(|_| regroups).and_then(|group| self.group_starts_at(group));
            let standby = if let Standby::Pausing { until } = unit.standby { Some(until) } else { None };
            [unit.ready_by, absent, unit.start_deadline(), unit.ease_at(), unit.trial, regroup, standby]
        });
        states.chain(watched.flatten()).chain(self.ladder.timer()).chain(self.reactions.timer()).min()
    }

    /// State of one node.
    pub fn node(&self, node: usize) -> NodeState {
        self.units[node].state
    }

    /// Whether a replacement of the node is on trial.
    pub fn on_trial(&self, node: usize) -> bool {
        self.units[node].trial.is_some()
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.units.len()
    }

    /// State of the robot.
    pub fn robot(&self) -> RobotState {
        match self.phase {
            Phase::Stopping | Phase::Killing => RobotState::Stopping,
            Phase::Done => RobotState::Stopped,
            _ if self.units.iter().any(|unit| unit.state.is_lost()) => RobotState::Degraded,
            _ if self.waiting_group().is_some() => RobotState::Starting,
            _ => RobotState::Running,
        }
    }

    /// The rung on which the robot stands.
    pub fn severity(&self) -> Severity {
        self.ladder.level()
    }

    /// What put it there.
    pub fn causes(&self) -> &[Cause] {
        self.ladder.causes()
    }

    /// Whether the emergency stop is latched as far as this policy goes.
    pub fn latched(&self) -> bool {
        self.ladder.latched()
    }

    /// Starts what is due: pauses that are over, groups, and the next stop group once those before it are ready.
    fn keep_up(&mut self, now: Time, actions: &mut Vec<Action>) {
        for (node, unit) in self.units.iter_mut().enumerate() {
            if matches!(unit.state, NodeState::Pausing { until } if until <= now) {
                unit.recent.count(now);
                let down_s = unit.start(node, now, actions);
                unit.tell_restart(node, now, down_s, actions);
            }
            if unit.ready_by.is_some_and(|by| by <= now) {
                unit.ready_by = None;
                notify(actions, node, now, IncidentKind::NotReady { waited_s: unit.care.rule.ready_within_s });
                self.reactions.happened(node, crate::care::Condition::NotReady);
            }
            unit.chase(node, now, actions);
        }
        self.regroup(now, actions);
        self.watch_over(now, actions);
        while let Some(group) = self.waiting_group() {
            if self.units.iter().any(|unit| unit.care.rule.stop_group > group && unit.ready_by.is_some()) {
                break;
            }
            for (node, unit) in self.units.iter_mut().enumerate() {
                if unit.state == NodeState::Waiting && unit.care.rule.stop_group == group {
                    unit.start(node, now, actions);
                }
            }
        }
    }

    /// Ends the run when nothing is left to supervise.
    fn finish_if_over(&mut self, actions: &mut Vec<Action>) {
        let over = |unit: &Unit| matches!(unit.state, NodeState::Ended { .. } | NodeState::GivenUp);
        if self.units.iter().all(over) {
            for (node, unit) in self.units.iter_mut().enumerate() {
                if std::mem::take(&mut unit.standby).is_alive() {
                    actions.push(Action::KillStandby { node });
                }
            }
            self.finish(actions);
        }
    }

    /// Stops the lowest group that still lives; the next follows when it is gone.
    fn wind_down(&mut self, now: Time, actions: &mut Vec<Action>) {
        use NodeState::*;
        let at_once = self.phase == Phase::Killing;
        for (node, unit) in self.units.iter_mut().enumerate() {
            if std::mem::take(&mut unit.standby).is_alive() {
                actions.push(Action::KillStandby { node });
            }
            match unit.state {
                Waiting | Pausing { .. } | Regrouping { .. } => unit.end(Stopped),
                Starting { .. } | Running { .. } | Terminating { .. } if at_once => unit.kill(node, now, actions),
                _ => unit.chase(node, now, actions),
            }
        }
        // A process that hangs in the kernel must not keep the drivers from stopping their devices.
        let holds_up = |unit: &&Unit| unit.state.is_alive() && unit.state != Unkillable;
        let lowest = self.units.iter().filter(holds_up).map(|unit| unit.care.rule.stop_group).min();
        for (node, unit) in self.units.iter_mut().enumerate() {
            if matches!(unit.state, Starting { .. } | Running { .. }) && Some(unit.care.rule.stop_group) == lowest {
                unit.terminate(node, now, Intent::Stop, actions);
            }
        }
        if !self.units.iter().any(|unit| unit.state.is_alive()) {
            self.finish(actions);
        }
    }

    fn finish(&mut self, actions: &mut Vec<Action>) {
        self.phase = Phase::Done;
        actions.push(Action::Done);
    }

    /// The group to be started next.
    fn waiting_group(&self) -> Option<u8> {
        let waiting = |unit: &&Unit| unit.state == NodeState::Waiting;
        self.units.iter().filter(waiting).map(|unit| unit.care.rule.stop_group).max()
    }
}

/// `seconds` after `now`, at least a nanosecond: a timer that has come already would be asked for for ever.
fn later(now: Time, seconds: f64) -> Time {
    now.after_s(seconds).max(now.after_ns(1))
}

fn notify(actions: &mut Vec<Action>, node: usize, at: Time, kind: IncidentKind) {
    actions.push(Action::Notify(Incident { node, at, kind }));
}
