//! The states of a node and of the robot.

use runtime::Time;

/// State of one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NodeState {
    /// Not started yet: waits for the groups before it.
    Waiting,
    /// Its process runs but is not ready.
    Starting { since: Time },
    /// Its process runs and is ready.
    Running { since: Time },
    /// Dead, to be started again.
    Pausing { until: Time },
    /// Dead, to be started again with its group, not before `until`.
    Regrouping { until: Time },
    /// Asked to stop.
    Terminating { kill_at: Time },
    /// Killed, death not yet seen.
    Killing { overdue_at: Time },
    /// Killed long ago and still there.
    Unkillable,
    /// Ended, and not to be started again.
    Ended { success: bool },
    /// Died too often.
    GivenUp,
    /// Ended because the robot stops, or because somebody asked for it.
    Stopped,
}

impl NodeState {
    /// Whether a process belongs to the node.
    pub fn is_alive(self) -> bool {
        use NodeState::*;
        matches!(self, Starting { .. } | Running { .. } | Terminating { .. } | Killing { .. } | Unkillable)
    }

    /// Whether the robot has to do without the node.
    pub fn is_lost(self) -> bool {
        matches!(self, NodeState::GivenUp | NodeState::Ended { success: false })
    }

    /// The state in one word, as `status` prints it.
    pub fn word(self) -> &'static str {
        match self {
            NodeState::Waiting => "waiting",
            NodeState::Starting { .. } => "starting",
            NodeState::Running { .. } => "running",
            NodeState::Pausing { .. } | NodeState::Regrouping { .. } => "restarting",
            NodeState::Terminating { .. } | NodeState::Killing { .. } => "stopping",
            NodeState::Unkillable => "unkillable",
            NodeState::Ended { success: true } => "finished",
            NodeState::Ended { success: false } => "failed",
            NodeState::GivenUp => "given up",
            NodeState::Stopped => "stopped",
        }
    }

    /// When the state must be looked at again.
    pub(crate) fn timer(self) -> Option<Time> {
        match self {
            NodeState::Pausing { until } => Some(until),
            NodeState::Terminating { kill_at } => Some(kill_at),
            NodeState::Killing { overdue_at } => Some(overdue_at),
            _ => None,
        }
    }
}

/// State of the robot as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum RobotState {
    /// Some node has not been started yet.
    Starting,
    /// All nodes are there, or on their way back.
    Running,
    /// Some node is gone for good.
    Degraded,
    /// Being stopped.
    Stopping,
    /// No process is left.
    Stopped,
}

impl RobotState {
    /// The state in one word.
    pub fn word(self) -> &'static str {
        match self {
            RobotState::Starting => "starting",
            RobotState::Running => "running",
            RobotState::Degraded => "degraded",
            RobotState::Stopping => "stopping",
            RobotState::Stopped => "stopped",
        }
    }
}
