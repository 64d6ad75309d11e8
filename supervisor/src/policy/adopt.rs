//! Going on where a dead supervisor left off: what each node was doing, and what had happened to it before.

use runtime::Time;
use serde::{Deserialize, Serialize};

use super::unit::Unit;
use super::{Policy, Told};
use crate::backoff::RecentRestarts;
use crate::severity::{Cause, CauseKind, Severity};
use crate::state::NodeState;

/// What is known of a node that a supervisor before this one has started.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Adopted {
    /// It was not started yet.
    Waiting,
    /// Its process runs, or ran a moment ago: then its death is told as an event after this.
    Alive {
        /// Whether it was ready.
        ready: bool,
        /// When it was started.
        started: Time,
    },
    /// It is dead and waits for its next start until then.
    Pausing {
        /// The end of its back-off.
        until: Time,
    },
    /// It is dead and waits for its group, not before then.
    Regrouping {
        /// The end of its back-off.
        until: Time,
    },
    /// It ended and was not to be started again.
    Ended {
        /// Whether it ended well.
        success: bool,
    },
    /// It had died too often.
    GivenUp,
    /// It was stopped by a person.
    Stopped,
}

/// What happened to a node before, as far as it counts for what comes: no takeover makes a crash loop begin anew.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Past {
    /// Restarts since its last healthy spell.
    pub attempts: u32,
    /// When it was restarted, as far as its window reaches back [ns].
    pub restarts_ns: Vec<u64>,
    /// Since when it is down [ns].
    pub down_since_ns: Option<u64>,
    /// Its replacement is on trial until then [ns].
    pub trial_ns: Option<u64>,
}

/// What holds the robot back, and what groups have been through.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RobotPast {
    /// The causes that count.
    pub causes: Vec<Cause>,
    /// Whether an emergency stop waits for its reset.
    pub latched: bool,
    /// When each group was restarted, as far as its window reaches back [ns].
    pub groups_ns: Vec<Vec<u64>>,
}

impl Policy {
    /// What a successor must know of `node` beside its state.
    pub fn past(&self, node: usize) -> Past {
        let unit = &self.units[node];
        Past {
            attempts: unit.attempts,
            restarts_ns: unit.recent.times().map(Time::nanos).collect(),
            down_since_ns: unit.down_since.map(Time::nanos),
            trial_ns: unit.trial.map(Time::nanos),
        }
    }

    /// What a successor must know of the robot.
    pub fn robot_past(&self) -> RobotPast {
        let times = |recent: &RecentRestarts| recent.times().map(Time::nanos).collect();
        RobotPast {
            causes: self.ladder.causes().to_vec(),
            latched: self.ladder.latched(),
            groups_ns: self.fates.iter().map(|fate| times(&fate.recent)).collect(),
        }
    }

    /// Takes a node over, before `Event::Begin`.
    pub fn adopt(&mut self, node: usize, known: Adopted, past: &Past) {
        let unit = &mut self.units[node];
        unit.remember(past);
        match known {
            Adopted::Waiting => {}
            Adopted::Alive { ready: true, started } => {
                (unit.state, unit.started) = (NodeState::Running { since: started }, started);
            }
            Adopted::Alive { ready: false, started } => {
                (unit.state, unit.started) = (NodeState::Starting { since: started }, started);
            }
            Adopted::Pausing { until } => unit.state = NodeState::Pausing { until },
            Adopted::Regrouping { until } => unit.state = NodeState::Regrouping { until },
            Adopted::Ended { success } => unit.state = NodeState::Ended { success },
            Adopted::GivenUp => unit.state = NodeState::GivenUp,
            Adopted::Stopped => unit.state = NodeState::Stopped,
        }
    }

    /// Takes over what holds the robot back, after all nodes and before `Event::Begin`: what waits for a person goes on
    /// waiting.
    pub fn adopt_robot(&mut self, now: Time, past: &RobotPast) {
        let known = |cause: &&Cause| cause.node < self.units.len();
        self.ladder.adopt(past.causes.iter().filter(known).copied(), past.latched);
        for cause in self.ladder.causes().to_vec() {
            // It is counted already, and must be told as gone when it is.
            let unit = &mut self.units[cause.node];
            match cause.kind {
                _ if cause.gone.is_some() => {}
                CauseKind::Absent => unit.absent = true,
                CauseKind::Late => unit.overloaded = true,
                // The detector of silence says when it is over; who raised a code, when that is.
                CauseKind::Silent | CauseKind::Raised(_) => {}
                // Whoever would have said so has died with the supervisor.
                CauseKind::Hung | CauseKind::Reaction(_) => {
                    self.ladder.gone(now, cause.node, |kind| kind == cause.kind);
                }
            }
        }
        let level = self.ladder.level();
        self.told =
            Told { limp: level >= Severity::Limp, hold: level >= Severity::Hold, stop: level >= Severity::Stop };
        for (fate, times) in self.fates.iter_mut().zip(&past.groups_ns) {
            times.iter().for_each(|&at| fate.recent.count(Time::from_nanos(at)));
        }
    }
}

impl Unit {
    fn remember(&mut self, past: &Past) {
        self.attempts = past.attempts;
        past.restarts_ns.iter().for_each(|&at| self.recent.count(Time::from_nanos(at)));
        self.down_since = past.down_since_ns.map(Time::from_nanos);
        self.trial = past.trial_ns.map(Time::from_nanos);
    }
}
