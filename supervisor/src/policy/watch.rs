//! Hangs, silence, lateness and raised conditions; what they mean for the robot.

use runtime::Time;

use super::unit::{Intent, Standby};
use super::{Policy, Told, notify};
use crate::care::{Act, Condition};
use crate::event::{Action, Event, IncidentKind, Request};
use crate::severity::{Cause, CauseKind, Clear, Severity};
use crate::state::NodeState;

/// Less of the processors than this, and no priority helps a late node.
const IDLE_LEAST: f64 = 0.05;
/// A late node's priority is raised by so much at a time.
const RAISE_STEP: u8 = 5;

impl Policy {
    /// What the detectors say.
    pub(super) fn watched(&mut self, now: Time, event: Event, actions: &mut Vec<Action>) {
        if self.phase != super::Phase::Up {
            return;
        }
        match event {
            Event::Missed { node, beats, starved } => self.missed(now, node, beats, starved, actions),
            Event::Beat { node } => {
                self.units[node].sluggish = false;
                self.well(now, node, CauseKind::Hung);
            }
            Event::Late { node, misses, idle } => self.late(now, node, misses, idle, actions),
            Event::Stale { node, age_s } => self.stale(now, node, age_s, actions),
            Event::Fresh { node } => self.well(now, node, CauseKind::Silent),
            Event::Attached { node } | Event::Detached { node } => {
                let attached = matches!(event, Event::Attached { .. });
                notify(actions, node, now, IncidentKind::Care { attached });
                self.reactions.happened(node, if attached { Condition::Attach } else { Condition::Detach });
            }
            Event::Raised { node, code, severity } => {
                self.begin(now, node, CauseKind::Raised(code), severity, self.units[node].care.clear, actions);
                self.reactions.happened(node, Condition::Raised(Some(code)));
            }
            Event::Lowered { node, code } => self.well(now, node, CauseKind::Raised(code)),
            Event::Outcome { ticket, success } => {
                if let Some(failed) = self.reactions.outcome(ticket, success) {
                    self.tell_failed(now, failed, actions);
                }
            }
            _ => {}
        }
    }

    /// One thing about the node is right again, and with it what reactions made of it.
    fn well(&mut self, now: Time, node: usize, of: CauseKind) {
        self.ladder.gone(now, node, |kind| kind == of || matches!(kind, CauseKind::Reaction(_)));
    }

    fn missed(&mut self, now: Time, node: usize, beats: u32, starved: bool, actions: &mut Vec<Action>) {
        let unit = &mut self.units[node];
        let care = unit.care;
        let NodeState::Running { .. } = unit.state else { return };
        if care.beats_high > 0 && beats >= care.beats_high && !starved {
            unit.kill(node, now, actions);
            unit.intent = Intent::Keep;
            notify(actions, node, now, IncidentKind::Hung { beats });
            self.reactions.happened(node, Condition::MissedHigh);
        } else if care.beats_low > 0 && beats >= care.beats_low && !unit.sluggish {
            unit.sluggish = true;
            notify(actions, node, now, IncidentKind::Sluggish { beats, starved });
            self.raise(now, node, beats, actions);
            self.reactions.happened(node, Condition::MissedLow);
        }
    }

    /// Raises the priority of a node by one step, if it may be raised; whether it was.
    fn raise(&mut self, now: Time, node: usize, misses: u32, actions: &mut Vec<Action>) -> bool {
        let unit = &mut self.units[node];
        unit.late_at = now;
        if unit.above >= unit.care.raise_most {
            return false;
        }
        unit.above = unit.above.saturating_add(RAISE_STEP).min(unit.care.raise_most);
        actions.push(Action::Reprioritise { node, above: unit.above });
        notify(actions, node, now, IncidentKind::Raised { misses, above: unit.above });
        true
    }

    fn late(&mut self, now: Time, node: usize, misses: u32, idle: f64, actions: &mut Vec<Action>) {
        let care = self.units[node].care;
        if misses == 0 || !self.units[node].state.is_alive() {
            return;
        }
        self.reactions.happened(node, Condition::Late);
        if idle >= IDLE_LEAST && self.raise(now, node, misses, actions) {
            return;
        }
        let unit = &mut self.units[node];
        unit.late_at = now;
        if !std::mem::replace(&mut unit.overloaded, true) {
            notify(actions, node, now, IncidentKind::Overload { misses, idle });
            self.begin(now, node, CauseKind::Late, care.lateness, Clear::Gone { after_s: 0.0 }, actions);
        }
    }

    fn stale(&mut self, now: Time, node: usize, age_s: f64, actions: &mut Vec<Action>) {
        let care = self.units[node].care;
        let NodeState::Running { .. } = self.units[node].state else { return };
        let known =
            self.ladder.causes().iter().any(|c| c.node == node && c.kind == CauseKind::Silent && c.gone.is_none());
        if !known {
            notify(actions, node, now, IncidentKind::Silent { age_s });
            self.reactions.happened(node, Condition::Silent);
        }
        self.begin(now, node, CauseKind::Silent, care.silence, care.clear, actions);
        if care.restart_when_silent {
            self.units[node].kill(node, now, actions);
        }
    }

    fn begin(
        &mut self,
        now: Time,
        node: usize,
        cause: CauseKind,
        severity: Severity,
        clear: Clear,
        actions: &mut Vec<Action>,
    ) {
        if self.ladder.begin(now, node, cause, severity, clear) {
            notify(actions, node, now, IncidentKind::CauseBegan { cause, severity });
        }
    }

    /// Looks after every node: starts that hang, absences, priorities to be lowered, trials, standbys.
    pub(super) fn watch_over(&mut self, now: Time, actions: &mut Vec<Action>) {
        for node in 0..self.units.len() {
            let unit = &mut self.units[node];
            if unit.start_deadline().is_some_and(|at| at <= now) {
                unit.kill(node, now, actions);
                let waited_s = unit.care.start_deadline_s;
                notify(actions, node, now, IncidentKind::HungAtStart { waited_s });
                self.reactions.happened(node, Condition::NotReady);
            }
            let unit = &mut self.units[node];
            if unit.ease_at().is_some_and(|at| at <= now) {
                unit.overloaded = false;
                if unit.above > 0 {
                    unit.above = unit.above.saturating_sub(RAISE_STEP);
                    unit.late_at = now;
                    actions.push(Action::Reprioritise { node, above: unit.above });
                    notify(actions, node, now, IncidentKind::Eased { above: unit.above });
                }
                self.well(now, node, CauseKind::Late);
            }
            let unit = &mut self.units[node];
            if unit.trial.is_some_and(|at| at <= now) {
                unit.trial = None;
                actions.push(Action::Accept { node });
            }
            let wants_standby = unit.care.standby && unit.trial.is_none();
            let may_start = match unit.standby {
                Standby::None => true,
                Standby::Pausing { until } => until <= now,
                _ => false,
            };
            if may_start {
                unit.standby = Standby::None;
                if wants_standby && matches!(unit.state, NodeState::Running { .. }) {
                    unit.standby = Standby::Starting { other: false };
                    actions.push(Action::StartStandby { node, other: false });
                }
            }
            let missing = unit.missing(now);
            let care = unit.care;
            if missing && !std::mem::replace(&mut unit.absent, true) {
                self.begin(now, node, CauseKind::Absent, care.loss, care.clear, actions);
            } else if !missing && self.units[node].absent && matches!(self.units[node].state, NodeState::Running { .. })
            {
                self.units[node].absent = false;
                self.well(now, node, CauseKind::Absent);
            }
        }
    }

    /// Does what reactions are due to do.
    pub(super) fn react(&mut self, now: Time, actions: &mut Vec<Action>) {
        // An act may set off the next reaction: bounded, or two of them could chase each other within one instant.
        for _ in 0..64 {
            if let Some(failed) = self.reactions.take_overdue(now) {
                self.tell_failed(now, failed, actions);
                continue;
            }
            let Some(due) = self.reactions.take_due(now) else { return };
            let (node, ticket) = (due.node, due.ticket);
            match due.act {
                Act::Restart { node } => self.call(now, Request::Restart { node }, actions),
                Act::Execute { command } => actions.push(Action::Execute { ticket, command }),
                Act::Await { path, within_s } => actions.push(Action::Await { ticket, path, within_s }),
                Act::Heal => {
                    self.units[node].sluggish = false;
                    actions.push(Action::Heal { node });
                }
                Act::Raise(severity) => {
                    let clear = self.reactions.get(due.reaction).clear;
                    self.begin(now, node, CauseKind::Reaction(due.reaction), severity, clear, actions);
                }
                Act::Notify | Act::Log | Act::Wait(_) => {
                    let kind = IncidentKind::Reaction { reaction: due.reaction, act: due.index, failed: false };
                    notify(actions, node, now, kind);
                }
            }
        }
    }

    fn tell_failed(&self, now: Time, failed: crate::reactions::Failed, actions: &mut Vec<Action>) {
        let kind = IncidentKind::Reaction { reaction: failed.reaction, act: failed.index, failed: true };
        notify(actions, failed.node, now, kind);
    }

    /// Lets causes go that have ended, and tells the host what the robot may do now: what slows it down comes first of
    /// all actions from `first` on, what sets it free last.
    pub(super) fn settle(&mut self, now: Time, first: usize, actions: &mut Vec<Action>) {
        while let Some(cause) = self.ladder.take_ended(now) {
            tell_end(now, cause, actions);
        }
        let level = self.ladder.level();
        let wanted =
            Told { limp: level >= Severity::Limp, hold: level >= Severity::Hold, stop: level >= Severity::Stop };
        let before = std::mem::replace(&mut self.told, wanted);
        let mut slower = Vec::new();
        if wanted.stop && !before.stop {
            let stops = |cause: &&Cause| cause.severity == Severity::Stop;
            slower.push(Action::Stop { node: self.ladder.causes().iter().rev().find(stops).map_or(0, |c| c.node) });
        }
        if wanted.hold != before.hold {
            if wanted.hold { &mut slower } else { &mut *actions }.push(Action::Hold { on: wanted.hold });
        }
        if wanted.limp != before.limp {
            if wanted.limp { &mut slower } else { &mut *actions }.push(Action::Limp { on: wanted.limp });
        }
        actions.splice(first..first, slower);
    }
}

/// Tells that a cause is over.
pub(super) fn tell_end(now: Time, cause: Cause, actions: &mut Vec<Action>) {
    let Cause { node, kind, severity, since, .. } = cause;
    notify(actions, node, now, IncidentKind::CauseEnded { cause: kind, severity, lasted_s: now.since(since) });
}

/// For requests that are followed by an end in order.
pub(super) fn intent_of(request: Request) -> Intent {
    if matches!(request, Request::Stop { .. }) { Intent::Stop } else { Intent::Restart }
}
