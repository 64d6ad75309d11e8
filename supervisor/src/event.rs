//! What goes into the policy and what comes out of it.
//!
//! Nodes are numbered as in the list that the policy was made from. Whatever an event says of a node that it does not
//! fit (a beat of a dead one, an end of one that never lived) does no harm: hosts need not filter.

use runtime::Time;

use crate::exit::Exit;
use crate::severity::{CauseKind, Severity};

/// What has happened.
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
    /// The node has missed this many beats in a row. `starved`: its threads were ready to run and got no processor, or
    /// the whole machine stood still, so that it is not hung.
    Missed { node: usize, beats: u32, starved: bool },
    /// The node beats again.
    Beat { node: usize },
    /// The node ended so many steps after their deadlines since the last look. `idle`: share 0…1 of the processors that
    /// nobody used meanwhile.
    Late { node: usize, misses: u32, idle: f64 },
    /// The newest sample of a path that the node must keep fresh is older than promised.
    Stale { node: usize, age_s: f64 },
    /// All its samples are fresh again.
    Fresh { node: usize },
    /// A process that the supervisor did not start came under its care.
    Attached { node: usize },
    /// It left the supervisor's care in order.
    Detached { node: usize },
    /// Somebody says that something about the node is wrong.
    Raised { node: usize, code: u16, severity: Severity },
    /// The same is right again.
    Lowered { node: usize, code: u16 },
    /// The node's warm standby has opened and waits.
    StandbyReady { node: usize },
    /// The node's warm standby has ended.
    StandbyDied { node: usize, exit: Exit },
    /// How an `Action::Execute` or `Action::Await` with this ticket ended.
    Outcome { ticket: u32, success: bool },
    /// Somebody asks for something.
    Call(Request),
}

/// What may be asked of a running supervisor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Start a node that was stopped, has ended or was given up; its count of restarts begins anew.
    Start { node: usize },
    /// Stop a node until somebody starts it.
    Stop { node: usize },
    /// Stop a node in order and start it again.
    Restart { node: usize },
    /// Start the node's other program beside it, and let it take over once it is ready.
    Replace { node: usize },
    /// A person says that causes which wait for one are over. Never starts motion by itself.
    Reset,
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
    /// Start a second process of the node that opens, warms up and waits; answer with `Event::StandbyReady`.
    /// `other`: from the program that is to replace the present one.
    StartStandby { node: usize, other: bool },
    /// The waiting process takes over: the node is alive again. If that fails, answer with `Event::Died`.
    Promote { node: usize },
    /// End the waiting process.
    KillStandby { node: usize },
    /// From now on `Start` means the program from before the last replacement, with the settings from before.
    Revert { node: usize },
    /// The replacement has stood its trial, or a person wants it: nothing goes back behind it.
    Accept { node: usize },
    /// The replacement that was to come does not come.
    Dismiss { node: usize },
    /// Schedule the node's threads this much above the priority that the robot file gives it.
    Reprioritise { node: usize, above: u8 },
    /// Count the node's heartbeat as healthy from now on.
    Heal { node: usize },
    /// The robot stands still, or may move again. Not latched.
    Hold { on: bool },
    /// Limp mode begins or ends.
    Limp { on: bool },
    /// Latch the emergency stop because of this node. There is no action that undoes it.
    Stop { node: usize },
    /// Run the command with this number in the robot file; answer with `Event::Outcome`.
    Execute { ticket: u32, command: usize },
    /// Wait for the path with this number in the robot file; answer with `Event::Outcome`.
    Await { ticket: u32, path: usize, within_s: f64 },
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
    /// The node missed beats, fewer than a hung one.
    Sluggish { beats: u32, starved: bool },
    /// The node hung and was killed.
    Hung { beats: u32 },
    /// The node never got ready and was killed.
    HungAtStart { waited_s: f64 },
    /// Its samples are older than promised.
    Silent { age_s: f64 },
    /// It misses deadlines; its priority is now this much above the robot file's.
    Raised { misses: u32, above: u8 },
    /// It misses deadlines, and no processor is to be had.
    Overload { misses: u32, idle: f64 },
    /// It keeps its deadlines; its priority is now this much above the robot file's.
    Eased { above: u8 },
    /// A cause began to hold the robot back.
    CauseBegan { cause: CauseKind, severity: Severity },
    /// A cause no longer holds the robot back, after so long.
    CauseEnded { cause: CauseKind, severity: Severity, lasted_s: f64 },
    /// Ended or started with its group, because another member died.
    WithGroup { group: usize, began: bool },
    /// Somebody asked for it.
    Asked { request: Request },
    /// What was asked for does not fit the node's state.
    Refused { request: Request },
    /// The standby took over.
    TookOver { down_s: f64 },
    /// The replacement took over; it is on trial.
    Replaced,
    /// The replacement failed its trial; the old program is back.
    Reverted,
    /// A reaction of the robot file acted, or one of its actions failed.
    Reaction { reaction: usize, act: usize, failed: bool },
    /// It came under the supervisor's care, or left it.
    Care { attached: bool },
}

/// What follows a death.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    /// A new start after this delay.
    Restart { delay_s: f64 },
    /// The waiting standby takes over at once.
    Promote,
    /// Its group is stopped, then started again after this delay.
    RestartGroup { group: usize, delay_s: f64 },
    /// Nothing: this was one restart too many.
    GiveUp { restarts: u32, window_s: f64 },
    /// Nothing: the restart rule says so.
    End,
    /// Nothing: the robot, or the node, was asked to stop.
    Stop,
}
