//! What the robot file says about the care for nodes, beside each node's own [`Rule`].

use crate::backoff::Intensity;
use crate::rule::Rule;
use crate::severity::{Clear, Severity};

/// How one node is cared for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Care {
    /// Births and deaths.
    pub rule: Rule,
    /// What it means for the robot when the node cannot be had.
    pub loss: Severity,
    /// When that no longer counts.
    pub clear: Clear,
    /// A node that is down counts as lost after this long, s; one that was given up, at once.
    pub absent_after_s: f64,
    /// A node that is not ready this long after its start hangs, s: it is killed. Zero: never.
    pub start_deadline_s: f64,
    /// So many missed beats raise the priority and are told; zero: none do.
    pub beats_low: u32,
    /// So many missed beats mean that it hangs: it is killed; zero: none do.
    pub beats_high: u32,
    /// What silence means for the robot.
    pub silence: Severity,
    /// Whether a silent node is killed, to be started again.
    pub restart_when_silent: bool,
    /// What missed deadlines mean for the robot when no priority helps.
    pub lateness: Severity,
    /// Priority above the robot file's that a late node may be given; zero: none.
    pub raise_most: u8,
    /// How long a late node must keep its deadlines before its priority is lowered again, s.
    pub calm_s: f64,
    /// Whether a second process waits to take over.
    pub standby: bool,
    /// How long a replacement is on trial, s.
    pub trial_s: f64,
}

impl Care {
    /// Care for a node with these births and deaths, and nothing more.
    pub fn plain(rule: Rule) -> Care {
        Care {
            rule,
            loss: Severity::Warn,
            clear: Clear::Gone { after_s: 0.0 },
            absent_after_s: 1.0,
            start_deadline_s: 0.0,
            beats_low: 0,
            beats_high: 0,
            silence: Severity::Warn,
            restart_when_silent: false,
            lateness: Severity::Warn,
            raise_most: 0,
            calm_s: 10.0,
            standby: false,
            trial_s: 1.0,
        }
    }
}

impl Default for Care {
    fn default() -> Care {
        Care::plain(Rule::default())
    }
}

/// Who is started anew with a member that died (OTP's supervisors).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Strategy {
    /// Nobody else.
    #[default]
    OneForOne,
    /// All members.
    OneForAll,
    /// The members named after it.
    RestForOne,
}

/// Nodes that share a fate.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Its members, in the order in which they are started.
    pub members: Vec<usize>,
    /// Who is started anew with one that died.
    pub strategy: Strategy,
    /// Group restarts that are allowed; more, and all members that would be started anew are given up.
    pub intensity: Intensity,
}

/// What a reaction waits for (QNX HAM's conditions).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// The node's process ended unasked.
    Death,
    /// It ended by a signal or with a code other than 0.
    AbnormalDeath,
    /// It missed as many beats as raise its priority.
    MissedLow,
    /// It missed as many beats as count as a hang.
    MissedHigh,
    /// It came under the supervisor's care.
    Attach,
    /// It left the supervisor's care.
    Detach,
    /// It was started again.
    Restart,
    /// Somebody raised this code; `None`: any.
    Raised(Option<u16>),
    /// Its samples are too old.
    Silent,
    /// It missed a deadline.
    Late,
    /// It did not get ready in time.
    NotReady,
    /// It was given up.
    GivenUp,
}

impl Condition {
    fn covers(self, happened: Condition) -> bool {
        self == happened || matches!((self, happened), (Condition::Raised(None), Condition::Raised(_)))
    }
}

/// One thing that a reaction does (QNX HAM's actions). They are done one after another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Act {
    /// Start this node anew.
    Restart {
        /// Which.
        node: usize,
    },
    /// Run a command of the robot file and wait for its end.
    Execute {
        /// Which.
        command: usize,
    },
    /// Wait until a path has a sample.
    Await {
        /// Which path of the robot file.
        path: usize,
        /// How long at most, s.
        within_s: f64,
    },
    /// Wait, s.
    Wait(f64),
    /// Tell people.
    Notify,
    /// Keep a record.
    Log,
    /// Count the node's heartbeat as healthy.
    Heal,
    /// Put the robot on this rung until the node is well again.
    Raise(Severity),
}

/// What follows a condition.
#[derive(Debug, Clone, PartialEq)]
pub struct Reaction {
    /// Whose condition; `None`: any node's.
    pub node: Option<usize>,
    /// What it waits for.
    pub when: Condition,
    /// What is done.
    pub acts: Vec<Act>,
    /// What is done instead of the rest when one of them fails; no restarts, as in HAM.
    pub fallback: Vec<Act>,
    /// Whether it may act more than once.
    pub again: bool,
    /// When a rung that it put the robot on no longer counts.
    pub clear: Clear,
}

impl Reaction {
    /// Whether it follows when this happens to `node`.
    pub(crate) fn follows(&self, node: usize, happened: Condition) -> bool {
        self.node.is_none_or(|wanted| wanted == node) && self.when.covers(happened)
    }
}

/// Everything that the policy is made from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Supervision {
    /// The nodes.
    pub nodes: Vec<Care>,
    /// Nodes that share a fate; a node is in one group at most.
    pub groups: Vec<Group>,
    /// What else follows.
    pub reactions: Vec<Reaction>,
}
