//! How bad it is: a ladder of five rungs; each cause stands on one of them and says when it leaves it (PX4's failsafe).

use runtime::Time;
use serde::{Deserialize, Serialize};

/// What a cause does to the robot. The highest rung on which any cause stands counts; a higher one includes the lower.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Hash, Serialize, Deserialize)]
pub enum Severity {
    /// Nothing.
    #[default]
    None,
    /// People are told.
    Warn,
    /// Limp mode: fewer actions, less speed.
    Limp,
    /// The robot stands still until the cause is gone.
    Hold,
    /// Emergency stop: latched until a person resets it.
    Stop,
}

impl Severity {
    /// All rungs, from the lowest.
    pub const ALL: [Severity; 5] = [Severity::None, Severity::Warn, Severity::Limp, Severity::Hold, Severity::Stop];

    /// The rung in one word.
    pub fn word(self) -> &'static str {
        ["none", "warn", "limp", "hold", "stop"][self as usize]
    }
}

/// When a cause no longer counts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub enum Clear {
    /// Once it has been gone for `after_s`.
    Gone {
        /// How long it must be gone, s.
        after_s: f64,
    },
    /// Once it is gone and a person says so.
    #[default]
    Reset,
    /// Never in this run.
    Never,
}

/// What is wrong with a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum CauseKind {
    /// It is given up, has failed for good, or has been down for too long.
    Absent,
    /// It hangs.
    Hung,
    /// Its samples are too old.
    Silent,
    /// It misses deadlines and nothing helps.
    Late,
    /// Somebody raised this code.
    Raised(u16),
    /// A reaction of the robot file says so, by its number.
    Reaction(usize),
}

impl CauseKind {
    /// The cause in words.
    pub fn words(self) -> String {
        match self {
            CauseKind::Absent => "cannot be had".to_owned(),
            CauseKind::Hung => "hangs".to_owned(),
            CauseKind::Silent => "is silent".to_owned(),
            CauseKind::Late => "misses its deadlines".to_owned(),
            CauseKind::Raised(code) => format!("raised condition {code}"),
            CauseKind::Reaction(reaction) => format!("set off reaction {reaction}"),
        }
    }
}

/// One cause that holds the robot back.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// The node that it concerns.
    pub node: usize,
    /// What is wrong.
    pub kind: CauseKind,
    /// Its rung.
    pub severity: Severity,
    /// When it leaves it.
    pub clear: Clear,
    /// When it began.
    pub since: Time,
    /// Since when it is gone, though it still counts.
    pub gone: Option<Time>,
}

impl Cause {
    /// When it ends by itself, if nothing happens meanwhile.
    pub(crate) fn ends_at(&self) -> Option<Time> {
        match (self.clear, self.gone) {
            // A stop never ends by itself, whatever the robot file says of its cause.
            (Clear::Gone { after_s }, Some(gone)) if self.severity < Severity::Stop => Some(gone.after_s(after_s)),
            _ => None,
        }
    }

    /// Whether a person's reset ends it.
    pub(crate) fn resettable(&self) -> bool {
        self.gone.is_some() && self.clear != Clear::Never
    }
}
