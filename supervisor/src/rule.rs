//! What the robot file says about the life of one node.

use crate::backoff::{Backoff, Intensity};

/// Which ends of a node are followed by a new start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Restart {
    /// Every end.
    #[default]
    Always,
    /// Every end but exit code 0.
    OnFailure,
    /// None.
    Never,
}

/// What the policy must know of one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rule {
    /// Which ends are followed by a new start.
    pub restart: Restart,
    /// Delays between a death and the next start.
    pub backoff: Backoff,
    /// When to give the node up.
    pub intensity: Intensity,
    /// Groups stop in ascending and start in descending order: what feeds the others has the higher number.
    pub stop_group: u8,
    /// Whether the node says when it is ready; one that does not counts as ready at its start.
    pub reports_ready: bool,
    /// How long the next group waits for this node to be ready, s.
    pub ready_within_s: f64,
    /// Time between the request to stop and SIGKILL, s.
    pub grace_s: f64,
}

impl Default for Rule {
    fn default() -> Self {
        Rule {
            restart: Restart::Always,
            backoff: Backoff::default(),
            intensity: Intensity::default(),
            stop_group: 0,
            reports_ready: true,
            ready_within_s: 2.0,
            grace_s: 2.0,
        }
    }
}
