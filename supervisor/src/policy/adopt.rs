//! Going on where a dead supervisor left off.

use runtime::Time;

use super::Policy;
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

impl Policy {
    /// Takes a node over, before `Event::Begin`.
    pub fn adopt(&mut self, node: usize, known: Adopted) {
        let unit = &mut self.units[node];
        match known {
            Adopted::Waiting => {}
            Adopted::Alive { ready: true, started } => {
                (unit.state, unit.started) = (NodeState::Running { since: started }, started);
            }
            Adopted::Alive { ready: false, started } => {
                (unit.state, unit.started) = (NodeState::Starting { since: started }, started);
            }
            Adopted::Ended { success } => unit.state = NodeState::Ended { success },
            Adopted::GivenUp => unit.state = NodeState::GivenUp,
            Adopted::Stopped => unit.state = NodeState::Stopped,
        }
    }
}
