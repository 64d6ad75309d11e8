//! One fault that is to happen, with everything about it: what a fault file lists, and what a seed's rates come to.
//!
//! ```toml
//! [[fault]]
//! kind = "death"                # of the process of this node; also hang, slowdown, burst, stop, supervisor, command
//! at_s = 12.5
//! node = "/actions/steer_clear"
//! when = "mid_write"            # in its next step; also before_head, before_wake. Without it: at once, between steps
//! writes = 1                    # after so many whole writes
//! ```

use super::faults::mortal;
use crate::robot_plan::RobotPlan;
use runtime::Time;
use runtime::channel::Death;
use runtime::robot::Robot;
use serde::{Deserialize, Serialize};

/// A fault of a file or of a seed. Times are from the start of the run, and from the fault on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum PlannedFault {
    /// The process of a node dies.
    Death {
        /// When [s].
        at_s: f64,
        /// Path of the node.
        node: String,
        /// At once, or where in its next step.
        #[serde(default, skip_serializing_if = "When::is_at_once")]
        when: When,
        /// After so many whole writes of that step.
        #[serde(default, skip_serializing_if = "is_zero")]
        writes: u32,
    },
    /// The process of a node hangs.
    Hang {
        /// When [s].
        at_s: f64,
        /// Path of the node.
        node: String,
        /// How long [s].
        for_s: f64,
    },
    /// The steps of a node's process take longer.
    Slowdown {
        /// When [s].
        at_s: f64,
        /// Path of the node.
        node: String,
        /// So many times as long.
        factor: f64,
        /// How long [s].
        for_s: f64,
    },
    /// The lines to all devices lose bytes.
    Burst {
        /// When [s].
        at_s: f64,
        /// Share of the bytes, 0…1.
        share: f64,
        /// How long [s].
        for_s: f64,
        /// Which bytes.
        #[serde(default)]
        seed: u32,
    },
    /// A node raises an emergency stop.
    Stop {
        /// When [s].
        at_s: f64,
        /// Path of the node.
        node: String,
        /// When its cause has gone [s]; a person resets 1.5 s later.
        gone_after_s: f64,
        /// When somebody tries to reset it, perhaps too early [s].
        reset_after_s: f64,
    },
    /// The supervisor dies, and the next one takes over.
    Supervisor {
        /// When [s].
        at_s: f64,
        /// How long nobody supervises [s].
        for_s: f64,
    },
    /// A program that reactions execute fails.
    Command {
        /// When [s].
        at_s: f64,
        /// The program, as the robot file spells it.
        program: String,
        /// How long [s].
        for_s: f64,
    },
}

/// Where a death falls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// Between two steps.
    #[default]
    AtOnce,
    /// In the middle of a write.
    MidWrite,
    /// After a slot was written and before the head moves.
    BeforeHead,
    /// After the head has moved and before anybody is woken.
    BeforeWake,
}

impl When {
    fn is_at_once(&self) -> bool {
        *self == When::AtOnce
    }

    /// The channel's word for it, if it is in a step.
    pub(super) fn in_step(self) -> Option<Death> {
        match self {
            When::AtOnce => None,
            When::MidWrite => Some(Death::InMidWrite),
            When::BeforeHead => Some(Death::BeforeHead),
            When::BeforeWake => Some(Death::BeforeWake),
        }
    }
}

fn is_zero(value: &u32) -> bool {
    *value == 0
}

/// Longest duration, and greatest factor.
const MOST: f64 = 1e6;

impl PlannedFault {
    /// When it happens, from the start of the run [s].
    pub fn at_s(&self) -> f64 {
        match self {
            PlannedFault::Death { at_s, .. }
            | PlannedFault::Hang { at_s, .. }
            | PlannedFault::Slowdown { at_s, .. }
            | PlannedFault::Burst { at_s, .. }
            | PlannedFault::Stop { at_s, .. }
            | PlannedFault::Supervisor { at_s, .. }
            | PlannedFault::Command { at_s, .. } => *at_s,
        }
    }

    /// The same at another time.
    pub fn moved_to(mut self, to_s: f64) -> PlannedFault {
        match &mut self {
            PlannedFault::Death { at_s, .. }
            | PlannedFault::Hang { at_s, .. }
            | PlannedFault::Slowdown { at_s, .. }
            | PlannedFault::Burst { at_s, .. }
            | PlannedFault::Stop { at_s, .. }
            | PlannedFault::Supervisor { at_s, .. }
            | PlannedFault::Command { at_s, .. } => *at_s = to_s,
        }
        self
    }

    pub(super) fn at(&self, start: Time) -> Time {
        start.after_s(self.at_s())
    }

    /// The node that has it, if it is a node's.
    pub fn node(&self) -> Option<&str> {
        match self {
            PlannedFault::Death { node, .. }
            | PlannedFault::Hang { node, .. }
            | PlannedFault::Slowdown { node, .. }
            | PlannedFault::Stop { node, .. } => Some(node),
            PlannedFault::Burst { .. } | PlannedFault::Supervisor { .. } | PlannedFault::Command { .. } => None,
        }
    }

    /// Why it cannot happen to this robot, if it cannot.
    pub fn flaw(&self, robot: &Robot) -> Option<String> {
        let numbers = match self {
            PlannedFault::Death { .. } => vec![],
            PlannedFault::Hang { for_s, .. }
            | PlannedFault::Supervisor { for_s, .. }
            | PlannedFault::Command { for_s, .. } => vec![("for_s", *for_s)],
            PlannedFault::Slowdown { factor, for_s, .. } => vec![("factor", *factor), ("for_s", *for_s)],
            PlannedFault::Burst { share, for_s, .. } => {
                if !(0.0..=1.0).contains(share) {
                    return Some(format!("share is {share}: it must lie between 0 and 1"));
                }
                vec![("for_s", *for_s)]
            }
            PlannedFault::Stop { gone_after_s, reset_after_s, .. } => {
                vec![("gone_after_s", *gone_after_s), ("reset_after_s", *reset_after_s)]
            }
        };
        let wrong = |(_, value): &&(&str, f64)| !(0.0..=MOST).contains(value);
        let at = [("at_s", self.at_s())];
        if let Some((key, value)) = at.iter().chain(&numbers).find(wrong) {
            return Some(format!("{key} is {value}: it must be a number between 0 and {MOST}"));
        }
        if let PlannedFault::Command { program, .. } = self {
            let commands = RobotPlan::of(robot).commands;
            let known: Vec<&str> = commands.iter().filter_map(|words| words.first()).map(String::as_str).collect();
            return (!known.contains(&program.as_str())).then(|| match known.as_slice() {
                [] => format!("no reaction of this robot executes \"{program}\", nor anything else"),
                known => format!("no reaction of this robot executes \"{program}\"; they execute {}", known.join(", ")),
            });
        }
        let node = self.node()?;
        let known: Vec<String> = mortal(robot).concat();
        if known.iter().any(|path| path == node) {
            return None;
        }
        Some(match robot.nodes.iter().any(|known| known.path() == node) {
            true => format!("{node} is the world, or shares a process with it: that never fails"),
            false => format!("there is no node \"{node}\"; nodes are {}", known.join(", ")),
        })
    }
}

impl std::fmt::Display for PlannedFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:>10.6} s  ", self.at_s())?;
        match self {
            PlannedFault::Death { node, when, writes, .. } => match when {
                When::AtOnce => write!(f, "{node} dies"),
                When::MidWrite => write!(f, "{node} dies in the middle of a write, after {writes} others"),
                When::BeforeHead => {
                    write!(f, "{node} dies before a sample's number is published, after {writes} others")
                }
                When::BeforeWake => write!(f, "{node} dies before it wakes its readers, after {writes} others"),
            },
            PlannedFault::Hang { node, for_s, .. } => write!(f, "{node} hangs for {for_s} s"),
            PlannedFault::Slowdown { node, factor, for_s, .. } => {
                write!(f, "{node} takes {factor} times as long for {for_s} s")
            }
            PlannedFault::Burst { share, for_s, .. } => {
                write!(f, "lines to devices lose {:.1} % of their bytes for {for_s} s", 100.0 * share)
            }
            PlannedFault::Stop { node, gone_after_s, .. } => {
                write!(f, "{node} raises an emergency stop, its cause goes after {gone_after_s} s")
            }
            PlannedFault::Command { program, for_s, .. } => write!(f, "the command {program} fails for {for_s} s"),
            PlannedFault::Supervisor { for_s, .. } => write!(f, "the supervisor dies, the next comes after {for_s} s"),
        }
    }
}
