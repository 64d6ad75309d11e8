//! What to do about births, deaths and requests: a pure state machine, the same in the live and the simulated host.
//!
//! Events come in with the time; actions go out; no clock, no process, no file. Nodes start in groups, the highest
//! `stop_group` first, and stop in the opposite order; a group waits until the ones before it are ready (or stopped).
//! A node that dies is started again after its back-off, until its intensity is used up; then it is given up and the
//! robot goes on degraded.

use runtime::Time;

use crate::backoff::{Intensity, RecentRestarts};
use crate::event::{Action, Event, Incident, IncidentKind, Next};
use crate::exit::Exit;
use crate::rule::{Restart, Rule};
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
struct Unit {
    rule: Rule,
    state: NodeState,
    started: Time,
    /// Until then later groups wait for this node; set by its first start, gone once it is ready or waited for.
    ready_by: Option<Time>,
    /// Set from a death until the node is ready again.
    down_since: Option<Time>,
    /// Restarts since the last healthy spell.
    attempts: u32,
    recent: RecentRestarts,
}

/// The supervisor's mind.
#[derive(Debug, Clone)]
pub struct Policy {
    units: Vec<Unit>,
    phase: Phase,
}

impl Policy {
    /// A policy for nodes with these rules, none of them started.
    pub fn new(rules: impl IntoIterator<Item = Rule>) -> Policy {
        let unit = |rule: Rule| Unit {
            rule,
            state: NodeState::Waiting,
            started: Time::ZERO,
            ready_by: None,
            down_since: None,
            attempts: 0,
            recent: RecentRestarts::new(rule.intensity),
        };
        Policy { units: rules.into_iter().map(unit).collect(), phase: Phase::Idle }
    }

    /// Takes in what has happened and appends to `actions` what is to be done about it.
    pub fn handle(&mut self, now: Time, event: Event, actions: &mut Vec<Action>) {
        if self.phase == Phase::Done {
            return;
        }
        match event {
            Event::Begin if self.phase == Phase::Idle => self.phase = Phase::Up,
            Event::Begin | Event::Timer => {}
            Event::Ready { node } => self.ready(now, node, actions),
            Event::Died { node, exit } => self.died(now, node, exit, actions),
            Event::StopRequested if self.phase != Phase::Killing => self.phase = Phase::Stopping,
            Event::StopRequested => {}
            Event::KillRequested => self.phase = Phase::Killing,
        }
        match self.phase {
            Phase::Up => self.keep_up(now, actions),
            Phase::Stopping | Phase::Killing => self.wind_down(now, actions),
            Phase::Idle | Phase::Done => {}
        }
    }

    /// When to come back with `Event::Timer`; always later than the `now` of the last event.
    pub fn next_timer(&self) -> Option<Time> {
        let ready_by = |unit: &Unit| unit.ready_by.filter(|_| self.phase == Phase::Up);
        let timers = self.units.iter().flat_map(|unit| [unit.state.timer(), ready_by(unit)]);
        timers.flatten().min().filter(|_| self.phase != Phase::Done)
    }

    /// State of one node.
    pub fn node(&self, node: usize) -> NodeState {
        self.units[node].state
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

    fn ready(&mut self, now: Time, node: usize, actions: &mut Vec<Action>) {
        let unit = &mut self.units[node];
        if let NodeState::Starting { .. } = unit.state {
            unit.state = NodeState::Running { since: now };
            unit.ready_by = None;
            if let Some(died) = unit.down_since.take() {
                notify(actions, node, now, IncidentKind::Recovered { down_s: now.since(died) });
            }
        }
    }

    fn died(&mut self, now: Time, node: usize, exit: Exit, actions: &mut Vec<Action>) {
        let stopping = self.phase != Phase::Up;
        let unit = &mut self.units[node];
        if !unit.state.is_alive() {
            return;
        }
        let lived_s = now.since(unit.started);
        if stopping {
            let killed_by_us = matches!(unit.state, NodeState::Killing { .. } | NodeState::Unkillable);
            unit.state = NodeState::Stopped;
            if !exit.is_obedient() && !killed_by_us {
                notify(actions, node, now, IncidentKind::Died { exit, lived_s, next: Next::Stop });
            }
            return;
        }
        let next = unit.after_death(now, exit);
        unit.down_since.get_or_insert(now);
        // What is to be told must not delay what is to be done, so the start comes first.
        let at_once = next == Next::Restart { delay_s: 0.0 };
        let down_s = if at_once { unit.start(node, now, actions) } else { None };
        notify(actions, node, now, IncidentKind::Died { exit, lived_s, next });
        match next {
            Next::Restart { delay_s } if !at_once => unit.state = NodeState::Pausing { until: now.after_s(delay_s) },
            Next::Restart { .. } => unit.tell_restart(node, now, down_s, actions),
            Next::GiveUp { .. } => unit.end(NodeState::GivenUp),
            Next::End | Next::Stop => unit.end(NodeState::Ended { success: exit.is_success() }),
        }
    }

    /// Starts what is due: pauses that are over, and the next group once those before it are ready.
    fn keep_up(&mut self, now: Time, actions: &mut Vec<Action>) {
        for (node, unit) in self.units.iter_mut().enumerate() {
            if matches!(unit.state, NodeState::Pausing { until } if until <= now) {
                let down_s = unit.start(node, now, actions);
                unit.tell_restart(node, now, down_s, actions);
            }
            if unit.ready_by.is_some_and(|by| by <= now) {
                unit.ready_by = None;
                notify(actions, node, now, IncidentKind::NotReady { waited_s: unit.rule.ready_within_s });
            }
        }
        while let Some(group) = self.waiting_group() {
            if self.units.iter().any(|unit| unit.rule.stop_group > group && unit.ready_by.is_some()) {
                break;
            }
            for (node, unit) in self.units.iter_mut().enumerate() {
                if unit.state == NodeState::Waiting && unit.rule.stop_group == group {
                    unit.start(node, now, actions);
                }
            }
        }
        let over = |unit: &Unit| matches!(unit.state, NodeState::Ended { .. } | NodeState::GivenUp);
        if self.units.iter().all(over) {
            self.finish(actions);
        }
    }

    /// Stops the lowest group that still lives; the next follows when it is gone.
    fn wind_down(&mut self, now: Time, actions: &mut Vec<Action>) {
        use NodeState::*;
        let at_once = self.phase == Phase::Killing;
        for (node, unit) in self.units.iter_mut().enumerate() {
            match unit.state {
                Waiting | Pausing { .. } => unit.end(Stopped),
                Starting { .. } | Running { .. } | Terminating { .. } if at_once => unit.kill(node, now, actions),
                Terminating { kill_at } if kill_at <= now => {
                    unit.kill(node, now, actions);
                    notify(actions, node, now, IncidentKind::Killed { grace_s: unit.rule.grace_s });
                }
                Killing { overdue_at } if overdue_at <= now => {
                    unit.state = Unkillable;
                    notify(actions, node, now, IncidentKind::Unkillable);
                }
                _ => {}
            }
        }
        // A process that hangs in the kernel must not keep the drivers from stopping their devices.
        let holds_up = |unit: &&Unit| unit.state.is_alive() && unit.state != Unkillable;
        let lowest = self.units.iter().filter(holds_up).map(|unit| unit.rule.stop_group).min();
        for (node, unit) in self.units.iter_mut().enumerate() {
            if matches!(unit.state, Starting { .. } | Running { .. }) && Some(unit.rule.stop_group) == lowest {
                unit.state = Terminating { kill_at: later(now, unit.rule.grace_s) };
                actions.push(Action::Terminate { node });
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
        self.units.iter().filter(waiting).map(|unit| unit.rule.stop_group).max()
    }
}

impl Unit {
    fn after_death(&mut self, now: Time, exit: Exit) -> Next {
        let wanted = match self.rule.restart {
            Restart::Always => true,
            Restart::OnFailure => !exit.is_success(),
            Restart::Never => false,
        };
        if !wanted {
            return Next::End;
        }
        let Intensity { restarts, window_s } = self.rule.intensity;
        if !self.recent.allows_another(now) {
            return Next::GiveUp { restarts, window_s };
        }
        if matches!(self.state, NodeState::Running { since } if now.since(since) >= self.rule.backoff.healthy_s) {
            self.attempts = 0;
        }
        let delay_s = self.rule.backoff.delay_s(self.attempts);
        self.attempts += 1;
        // Under a nanosecond is at once, because a pause must end later than now.
        Next::Restart { delay_s: if delay_s >= 1e-9 { delay_s } else { 0.0 } }
    }

    /// Starts the process; tells how long the node was down if it is a restart.
    fn start(&mut self, node: usize, now: Time, actions: &mut Vec<Action>) -> Option<f64> {
        actions.push(Action::Start { node });
        self.started = now;
        let down_s = self.down_since.map(|died| now.since(died));
        if down_s.is_some() {
            self.recent.count(now);
        }
        if self.rule.reports_ready {
            self.state = NodeState::Starting { since: now };
            if down_s.is_none() {
                self.ready_by = Some(later(now, self.rule.ready_within_s));
            }
        } else {
            self.state = NodeState::Running { since: now };
            self.down_since = None;
        }
        down_s
    }

    fn tell_restart(&self, node: usize, now: Time, down_s: Option<f64>, actions: &mut Vec<Action>) {
        let kind = IncidentKind::Restarted { attempt: self.attempts, down_s: down_s.unwrap_or(0.0) };
        notify(actions, node, now, kind);
    }

    fn kill(&mut self, node: usize, now: Time, actions: &mut Vec<Action>) {
        self.state = NodeState::Killing { overdue_at: now.after_s(KILLED_WITHIN_S) };
        actions.push(Action::Kill { node });
    }

    fn end(&mut self, state: NodeState) {
        self.state = state;
        self.ready_by = None;
    }
}

/// `seconds` after `now`, at least a nanosecond: a timer that has come already would be asked for for ever.
fn later(now: Time, seconds: f64) -> Time {
    now.after_s(seconds).max(now.after_ns(1))
}

fn notify(actions: &mut Vec<Action>, node: usize, at: Time, kind: IncidentKind) {
    actions.push(Action::Notify(Incident { node, at, kind }));
}
