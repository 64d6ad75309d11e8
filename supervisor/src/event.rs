//! What goes into the policy and what comes out of it.

use runtime::Time;

use crate::exit::Exit;

/// What has happened. Nodes are numbered as in the list that the policy was made from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// Start the robot.
    Begin,
    /// The node says that it is ready.
    Ready { node: usize },
    /// The node's process has ended, or could not be started.
    Died { node: usize, exit: Exit },
    /// `next_timer` has come. An early or superfluous one does no harm.
    Timer,
    /// Stop the robot in order.
    StopRequested,
    /// Stop the robot now, without grace.
    KillRequested,
}

/// What the host must do now, in this order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// Start the node's process; if that fails, answer with `Event::Died`.
    Start { node: usize },
    /// Ask the node to stop (SIGTERM).
    Terminate { node: usize },
    /// End the node (SIGKILL).
    Kill { node: usize },
    /// Tell people and keep a record.
    Notify(Incident),
    /// No process is left and none will be started.
    Done,
}

/// Something that an operator would want to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incident {
    /// The node concerned.
    pub node: usize,
    /// When the policy learned of it.
    pub at: Time,
    /// What it is.
    pub kind: IncidentKind,
}

/// The kinds of incident.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IncidentKind {
    /// The process ended unasked after `lived_s`, or badly while stopping.
    Died { exit: Exit, lived_s: f64, next: Next },
    /// The process was started again, for the `attempt`-th time since it last was healthy.
    Restarted { attempt: u32, down_s: f64 },
    /// The restarted node is ready again.
    Recovered { down_s: f64 },
    /// The node has not said that it is ready; the next group is started all the same.
    NotReady { waited_s: f64 },
    /// The node did not stop within its grace and was killed.
    Killed { grace_s: f64 },
    /// The process is still there after SIGKILL: it hangs in the kernel. The rest of the robot stops meanwhile.
    Unkillable,
}

/// What follows a death.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    /// A new start after this delay.
    Restart { delay_s: f64 },
    /// Nothing: this was one restart too many.
    GiveUp { restarts: u32, window_s: f64 },
    /// Nothing: the restart rule says so.
    End,
    /// Nothing: the robot is stopping.
    Stop,
}
