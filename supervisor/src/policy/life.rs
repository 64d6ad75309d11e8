//! Births and deaths, alone and in groups (OTP's strategies).

use runtime::Time;

use super::unit::{Intent, Standby};
use super::{Phase, Policy, later, notify};
use crate::backoff::Intensity;
use crate::care::{Condition, Strategy};
use crate::event::{Action, IncidentKind, Next};
use crate::exit::Exit;
use crate::severity::CauseKind;
use crate::state::NodeState;

/// A standby that ended is started again after this long, s.
const STANDBY_PAUSE_S: f64 = 1.0;

impl Policy {
    pub(super) fn ready(&mut self, now: Time, node: usize, actions: &mut Vec<Action>) {
        let unit = &mut self.units[node];
        if let NodeState::Starting { .. } = unit.state {
            unit.state = NodeState::Running { since: now };
            unit.ready_by = None;
            if let Some(died) = unit.down_since.take() {
                notify(actions, node, now, IncidentKind::Recovered { down_s: now.since(died) });
            }
        }
    }

    pub(super) fn died(&mut self, now: Time, node: usize, exit: Exit, actions: &mut Vec<Action>) {
        let stopping = self.phase != Phase::Up;
        let unit = &mut self.units[node];
        if !unit.state.is_alive() {
            return;
        }
        let lived_s = now.since(unit.started);
        let killed_by_us = matches!(unit.state, NodeState::Killing { .. } | NodeState::Unkillable);
        let mut intent = std::mem::take(&mut unit.intent);
        if intent == Intent::Regroup && unit.state == NodeState::Unkillable {
            // Its group has started without it: it follows alone.
            intent = Intent::Restart;
        }
        if stopping {
            unit.state = NodeState::Stopped;
            if !exit.is_obedient() && !killed_by_us {
                notify(actions, node, now, IncidentKind::Died { exit, lived_s, next: Next::Stop });
            }
            return;
        }
        unit.sluggish = false;
        unit.down_since.get_or_insert(now);
        self.ladder.gone(now, node, |kind| matches!(kind, CauseKind::Hung));
        if intent != Intent::Keep {
            self.ended_as_told(now, node, intent, actions);
            return;
        }
        self.reactions.happened(node, Condition::Death);
        if !exit.is_success() {
            self.reactions.happened(node, Condition::AbnormalDeath);
        }
        if unit.trial.take().is_some() {
            // The replacement has failed: its predecessor is known to work.
            actions.push(Action::Revert { node });
            unit.start(node, now, actions);
            let next = Next::Restart { delay_s: 0.0 };
            notify(actions, node, now, IncidentKind::Died { exit, lived_s, next });
            notify(actions, node, now, IncidentKind::Reverted);
            return;
        }
        let group = unit.group.filter(|&group| self.fates[group].group.strategy != Strategy::OneForOne);
        let mut next = unit.after_death(now, exit, group.is_none());
        if let (Some(group), Next::Restart { .. } | Next::Promote) = (group, next) {
            let delay_s = if let Next::Restart { delay_s } = next { delay_s } else { 0.0 };
            let Intensity { restarts, window_s } = self.fates[group].group.intensity;
            next = match self.fates[group].recent.allows_another(now) {
                true => Next::RestartGroup { group, delay_s },
                false => Next::GiveUp { restarts, window_s },
            };
        }
        // What is to be told must not delay what is to be done, so the start comes first.
        let unit = &mut self.units[node];
        let mut down_s = None;
        match next {
            Next::Restart { delay_s: 0.0 } => {
                unit.recent.count(now);
                down_s = unit.start(node, now, actions);
            }
            Next::Restart { delay_s } => unit.state = NodeState::Pausing { until: now.after_s(delay_s) },
            Next::Promote => {
                unit.recent.count(now);
                down_s = unit.promote(node, now, actions);
            }
            Next::RestartGroup { group, delay_s } => self.stop_group_of(now, group, node, Some(delay_s), actions),
            Next::GiveUp { .. } => {
                unit.end(NodeState::GivenUp);
                if let Some(group) = group {
                    self.stop_group_of(now, group, node, None, actions);
                }
            }
            Next::End | Next::Stop => unit.end(NodeState::Ended { success: exit.is_success() }),
        }
        notify(actions, node, now, IncidentKind::Died { exit, lived_s, next });
        match next {
            Next::Restart { delay_s: 0.0 } => self.units[node].tell_restart(node, now, down_s, actions),
            Next::Promote => {
                notify(actions, node, now, IncidentKind::TookOver { down_s: down_s.unwrap_or(0.0) });
            }
            Next::GiveUp { .. } => self.reactions.happened(node, Condition::GivenUp),
            _ => {}
        }
        if matches!(next, Next::Restart { .. } | Next::Promote | Next::RestartGroup { .. }) {
            self.reactions.happened(node, Condition::Restart);
        }
    }

    /// What follows an end that was asked for.
    fn ended_as_told(&mut self, now: Time, node: usize, intent: Intent, actions: &mut Vec<Action>) {
        let unit = &mut self.units[node];
        match intent {
            Intent::Stop => unit.end(NodeState::Stopped),
            Intent::GiveUp => unit.end(NodeState::GivenUp),
            Intent::Regroup => unit.state = NodeState::Regrouping { until: now },
            Intent::Swap if unit.standby == (Standby::Ready { other: true }) => {
                unit.promote(node, now, actions);
                unit.trial = Some(later(now, unit.care.trial_s));
                notify(actions, node, now, IncidentKind::Replaced);
            }
            Intent::Swap => {
                actions.push(Action::Revert { node });
                unit.start(node, now, actions);
                notify(actions, node, now, IncidentKind::Reverted);
            }
            Intent::Restart | Intent::Keep => {
                unit.start(node, now, actions);
            }
        }
    }

    /// Ends those who share the fate of `node`; `delay_s` until they start again, `None` if they are given up.
    fn stop_group_of(&mut self, now: Time, group: usize, node: usize, delay_s: Option<f64>, actions: &mut Vec<Action>) {
        let fate = &self.fates[group].group;
        let place = fate.members.iter().position(|&member| member == node).unwrap_or(0);
        let first = if fate.strategy == Strategy::OneForAll { 0 } else { place };
        let until = now.after_s(delay_s.unwrap_or(0.0));
        if delay_s.is_some() {
            self.units[node].state = NodeState::Regrouping { until };
        }
        // OTP: the last is ended first.
        for &member in fate.members[first..].iter().rev().filter(|&&member| member != node) {
            let unit = &mut self.units[member];
            match (unit.state, delay_s) {
                (NodeState::Starting { .. } | NodeState::Running { .. }, Some(_)) => {
                    unit.terminate(member, now, Intent::Regroup, actions);
                    notify(actions, member, now, IncidentKind::WithGroup { group, began: false });
                }
                (NodeState::Starting { .. } | NodeState::Running { .. }, None) => {
                    unit.terminate(member, now, Intent::GiveUp, actions);
                    notify(actions, member, now, IncidentKind::WithGroup { group, began: false });
                }
                (NodeState::Pausing { .. }, Some(_)) => unit.state = NodeState::Regrouping { until },
                (NodeState::Pausing { .. } | NodeState::Regrouping { .. }, None) => unit.end(NodeState::GivenUp),
                (NodeState::Terminating { .. } | NodeState::Killing { .. }, None) if unit.intent != Intent::Stop => {
                    unit.intent = Intent::GiveUp;
                }
                _ => {}
            }
        }
    }

    /// Whether members of the group are still being ended, so that nobody of it may start.
    pub(super) fn group_is_held_up(&self, group: Option<usize>) -> bool {
        let Some(group) = group else { return false };
        self.fates[group].group.members.iter().any(|&member| {
            let unit = &self.units[member];
            let ending = matches!(unit.state, NodeState::Terminating { .. } | NodeState::Killing { .. });
            ending && matches!(unit.intent, Intent::Regroup | Intent::Keep)
        })
    }

    /// When the last of the group's back-offs is over.
    pub(super) fn group_starts_at(&self, group: usize) -> Option<Time> {
        let until = |&member: &usize| match self.units[member].state {
            NodeState::Regrouping { until } => Some(until),
            _ => None,
        };
        self.fates[group].group.members.iter().filter_map(until).max()
    }

    /// Starts the groups whose members have all ended.
    pub(super) fn regroup(&mut self, now: Time, actions: &mut Vec<Action>) {
        for group in 0..self.fates.len() {
            let waits = |unit: &super::Unit| matches!(unit.state, NodeState::Regrouping { .. });
            let due = self.group_starts_at(group).is_some_and(|at| at <= now);
            if !due || self.group_is_held_up(Some(group)) {
                continue;
            }
            self.fates[group].recent.count(now);
            for member in self.fates[group].group.members.clone() {
                let unit = &mut self.units[member];
                if waits(unit) {
                    let down_s = unit.start(member, now, actions);
                    unit.tell_restart(member, now, down_s, actions);
                    notify(actions, member, now, IncidentKind::WithGroup { group, began: true });
                }
            }
        }
    }

    pub(super) fn standby_ready(&mut self, now: Time, node: usize, actions: &mut Vec<Action>) {
        let unit = &mut self.units[node];
        let Standby::Starting { other } = unit.standby else { return };
        unit.standby = Standby::Ready { other };
        if !other || self.phase != Phase::Up {
            return;
        }
        if matches!(unit.state, NodeState::Starting { .. } | NodeState::Running { .. }) {
            unit.terminate(node, now, Intent::Swap, actions);
        } else {
            // Its predecessor died meanwhile, and goes its own way.
            unit.standby = Standby::None;
            actions.push(Action::KillStandby { node });
            actions.push(Action::Dismiss { node });
            notify(actions, node, now, IncidentKind::Reverted);
        }
    }

    pub(super) fn standby_died(&mut self, now: Time, node: usize, _exit: Exit, actions: &mut Vec<Action>) {
        let unit = &mut self.units[node];
        if !unit.standby.is_alive() {
            return;
        }
        if matches!(unit.standby, Standby::Starting { other: true }) {
            actions.push(Action::Dismiss { node });
            notify(actions, node, now, IncidentKind::Reverted);
        }
        unit.standby = Standby::Pausing { until: later(now, STANDBY_PAUSE_S) };
    }
}
