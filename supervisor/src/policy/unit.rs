//! What the policy remembers of one node.

use runtime::Time;

use super::{KILLED_WITHIN_S, later, notify};
use crate::backoff::{Intensity, RecentRestarts};
use crate::care::Care;
use crate::event::{Action, IncidentKind, Next};
use crate::exit::Exit;
use crate::rule::Restart;
use crate::state::NodeState;

/// What follows the end of a node that was told to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Intent {
    /// What follows any end.
    #[default]
    Keep,
    /// Nothing, until somebody starts it.
    Stop,
    /// A new start at once.
    Restart,
    /// A new start with its group.
    Regroup,
    /// Nothing: its group was given up.
    GiveUp,
    /// The waiting replacement takes over.
    Swap,
}

/// The process that waits beside the node's own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) enum Standby {
    /// None.
    #[default]
    None,
    /// None, and none before this time.
    Pausing { until: Time },
    /// Being started; `other`: from the replacing program.
    Starting { other: bool },
    /// Ready to take over.
    Ready { other: bool },
}

impl Standby {
    /// Whether a process belongs to it.
    pub fn is_alive(self) -> bool {
        matches!(self, Standby::Starting { .. } | Standby::Ready { .. })
    }
}

#[derive(Debug, Clone)]
pub(super) struct Unit {
    pub care: Care,
    pub state: NodeState,
    pub intent: Intent,
    pub standby: Standby,
    /// The group that it belongs to.
    pub group: Option<usize>,
    pub started: Time,
    /// Until then later groups wait for this node; set by its first start, gone once it is ready or waited for.
    pub ready_by: Option<Time>,
    /// Set from a death until the node is ready again.
    pub down_since: Option<Time>,
    /// Whether it is counted as absent.
    pub absent: bool,
    /// Whether missed beats have been told since the last beat.
    pub sluggish: bool,
    /// Whether missing processors have been told since it last kept its deadlines.
    pub overloaded: bool,
    /// Priority above the robot file's.
    pub above: u8,
    /// The last time that it was late.
    pub late_at: Time,
    /// A replacement is on trial until then.
    pub trial: Option<Time>,
    /// Restarts since the last healthy spell.
    pub attempts: u32,
    pub recent: RecentRestarts,
}

impl Unit {
    pub fn new(care: Care, group: Option<usize>) -> Unit {
        Unit {
            care,
            state: NodeState::Waiting,
            intent: Intent::Keep,
            standby: Standby::None,
            group,
            started: Time::ZERO,
            ready_by: None,
            down_since: None,
            absent: false,
            sluggish: false,
            overloaded: false,
            above: 0,
            late_at: Time::ZERO,
            trial: None,
            attempts: 0,
            recent: RecentRestarts::new(care.rule.intensity),
        }
    }

    /// What an unasked end is followed by, as far as the node's own rule goes. `bounded`: its own intensity counts.
    pub fn after_death(&mut self, now: Time, exit: Exit, bounded: bool) -> Next {
        let rule = self.care.rule;
        let wanted = match rule.restart {
            Restart::Always => true,
            Restart::OnFailure => !exit.is_success(),
            Restart::Never => false,
        };
        if !wanted {
            return Next::End;
        }
        let Intensity { restarts, window_s } = rule.intensity;
        if bounded && !self.recent.allows_another(now) {
            return Next::GiveUp { restarts, window_s };
        }
        if self.standby == (Standby::Ready { other: false }) {
            return Next::Promote;
        }
        self.forgive(now);
        let delay_s = rule.backoff.delay_s(self.attempts);
        self.attempts += 1;
        // Under a nanosecond is at once, because a pause must end later than now.
        Next::Restart { delay_s: if delay_s >= 1e-9 { delay_s } else { 0.0 } }
    }

    /// Starts the process; tells how long the node was down if it is a restart.
    pub fn start(&mut self, node: usize, now: Time, actions: &mut Vec<Action>) -> Option<f64> {
        actions.push(Action::Start { node });
        self.begun(now)
    }

    /// The waiting process takes over.
    pub fn promote(&mut self, node: usize, now: Time, actions: &mut Vec<Action>) -> Option<f64> {
        actions.push(Action::Promote { node });
        self.standby = Standby::None;
        self.begun(now)
    }

    fn begun(&mut self, now: Time) -> Option<f64> {
        self.started = now;
        self.intent = Intent::Keep;
        self.sluggish = false;
        // A new process begins with the priority of the robot file.
        (self.above, self.overloaded) = (0, false);
        let down_s = self.down_since.map(|died| now.since(died));
        if self.care.rule.reports_ready {
            self.state = NodeState::Starting { since: now };
            if down_s.is_none() {
                self.ready_by = Some(later(now, self.care.rule.ready_within_s));
            }
        } else {
            self.state = NodeState::Running { since: now };
            self.down_since = None;
        }
        down_s
    }

    pub fn tell_restart(&self, node: usize, now: Time, down_s: Option<f64>, actions: &mut Vec<Action>) {
        let kind = IncidentKind::Restarted { attempt: self.attempts, down_s: down_s.unwrap_or(0.0) };
        notify(actions, node, now, kind);
    }

    /// Asks the process to end; what follows is `intent`.
    /// Forgets earlier restarts after a healthy spell.
    fn forgive(&mut self, now: Time) {
        let healthy_s = self.care.rule.backoff.healthy_s;
        if matches!(self.state, NodeState::Running { since } if now.since(since) >= healthy_s) {
            self.attempts = 0;
        }
    }

    pub fn terminate(&mut self, node: usize, now: Time, intent: Intent, actions: &mut Vec<Action>) {
        self.intent = intent;
        self.state = NodeState::Terminating { kill_at: later(now, self.care.rule.grace_s) };
        actions.push(Action::Terminate { node });
    }

    pub fn kill(&mut self, node: usize, now: Time, actions: &mut Vec<Action>) {
        // A node that ran well until it hung begins anew, as one does that died by itself.
        self.forgive(now);
        self.state = NodeState::Killing { overdue_at: now.after_s(KILLED_WITHIN_S) };
        actions.push(Action::Kill { node });
    }

    /// Kills what did not stop within its grace, and gives up waiting for what does not die.
    pub fn chase(&mut self, node: usize, now: Time, actions: &mut Vec<Action>) {
        match self.state {
            NodeState::Terminating { kill_at } if kill_at <= now => {
                self.kill(node, now, actions);
                notify(actions, node, now, IncidentKind::Killed { grace_s: self.care.rule.grace_s });
            }
            NodeState::Killing { overdue_at } if overdue_at <= now => {
                self.state = NodeState::Unkillable;
                notify(actions, node, now, IncidentKind::Unkillable);
            }
            _ => {}
        }
    }

    pub fn end(&mut self, state: NodeState) {
        self.state = state;
        self.ready_by = None;
    }

    /// Whether the robot has to do without the node now, and since when.
    pub fn missing(&self, now: Time) -> bool {
        match self.state {
            NodeState::Running { .. } | NodeState::Waiting => false,
            NodeState::GivenUp | NodeState::Stopped | NodeState::Ended { success: false } | NodeState::Unkillable => {
                true
            }
            NodeState::Ended { success: true } => false,
            _ => self.absent_at().is_some_and(|at| at <= now),
        }
    }

    /// When the node will count as absent, if it is not back before.
    pub fn absent_at(&self) -> Option<Time> {
        let down = !matches!(self.state, NodeState::Running { .. } | NodeState::Ended { .. } | NodeState::Stopped);
        self.down_since.filter(|_| down).map(|died| died.after_s(self.care.absent_after_s))
    }

    /// When a process that is not ready counts as hung.
    pub fn start_deadline(&self) -> Option<Time> {
        let deadline_s = self.care.start_deadline_s;
        match self.state {
            NodeState::Starting { since } if deadline_s > 0.0 => Some(later(since, deadline_s)),
            _ => None,
        }
    }

    /// When the priority of a calm node is lowered.
    pub fn ease_at(&self) -> Option<Time> {
        (self.above > 0 || self.overloaded).then(|| later(self.late_at, self.care.calm_s))
    }
}
