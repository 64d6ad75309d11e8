//! What the supervisor and the governor say to the robot and about it.

use crate::Message;

/// What the robot may do now, as far as its supervisor goes. Written at `/supervisor/robot/state` whenever it changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct SupervisorState {
    /// The rung of the severity ladder.
    #[message(values = "none warn limp hold stop")]
    pub severity: u32,
    /// 1 in limp mode: fewer actions, less speed.
    pub limp: u32,
    /// 1 when the robot must stand still until the cause is gone.
    pub hold: u32,
    /// 1 when the emergency stop is latched.
    pub stop: u32,
    /// Causes that count now.
    pub causes: u32,
    /// Nodes that the robot has to do without now.
    pub lost: u32,
}

/// Something that people may want to know; the tail holds it in words (UTF-8). Written at `/supervisor/robot/incidents`
/// (as JSON, a record as in incidents.jsonl) and `/supervisor/robot/changes`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
#[message(tail = u8)]
pub struct Notice {
    /// Number of the notice in this run, from 1.
    pub number: u64,
    /// Number of the node in the supervisor's plan; 2³²−1 when it concerns the robot.
    pub node: u32,
    /// The rung on which the robot stood afterwards.
    #[message(values = "none warn limp hold stop")]
    pub severity: u32,
}

/// What the governor wants; the tail says in words why (UTF-8). Written at `/coordinator/<governor>/state` in every step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
#[message(tail = u8)]
pub struct Governance {
    /// Decisions so far; 0 while no rule has held yet, and then nothing is wanted.
    pub decisions: u64,
    /// Index in the robot file of the rule that is obeyed, counted from 0.
    pub rule: u32,
    /// The mode that it asks for: the number of its name, as [`path_number`](crate::path_number) counts it.
    pub mode: u32,
    /// Decisions about periods so far; the tail says the newest of them behind the mode's reason.
    pub period_decisions: u64,
}

/// How busy the machine and the robot's nodes are. Written at `/supervisor/robot/load` many times a second by whoever
/// supervises; what the machine does not tell is NaN.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(tail = NodeLoad)]
pub struct Load {
    /// Processors that the robot may use.
    pub processors: f64,
    /// Processors that were busy, whoever used them, since the machine was looked at before.
    pub busy_processors: f64,
    /// Share of the last ten seconds in which something waited for a processor (/proc/pressure/cpu), 0…1.
    pub cpu_pressure: f64,
    /// Share of the last ten seconds in which something waited for memory (/proc/pressure/memory), 0…1.
    pub memory_pressure: f64,
    /// Memory that can still be had [byte].
    pub available_bytes: f64,
}

/// Longest name in a [`NodeLoad`] [byte].
pub const NODE_NAME_BYTES: usize = 32;

/// What one node takes: an entry of [`Load`]. Counters run since the node's process began.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct NodeLoad {
    /// Number of the node's path; see [`path_number`](crate::path_number).
    pub node: u32,
    /// How little the robot can do without it, 0 to 100.
    pub importance: u32,
    /// Its instance name (UTF-8), filled up with zeros.
    pub name: [u8; NODE_NAME_BYTES],
    /// The period that it asks for; 0 for a node without one [ns].
    pub shortest_ns: u64,
    /// The longest period that still is of use; the shortest one where it may not be stretched [ns].
    pub longest_ns: u64,
    /// Steps so far.
    pub steps: u64,
    /// Time on a processor so far [ns].
    pub busy_ns: u64,
    /// Steps that ended after their deadline, so far.
    pub missed_deadlines: u64,
    /// Processors that its process used since the machine was looked at before.
    pub processors: f64,
    /// Memory of its process that is in use [byte].
    pub resident_bytes: f64,
}

/// How far the governor had to go for want of processors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[repr(u32)]
pub enum Shortage {
    /// Every node has the period that it asks for.
    #[default]
    None = 0,
    /// Some periods are stretched.
    Stretched = 1,
    /// Some nodes do not step at all.
    Suspended = 2,
    /// Even that is not enough: limp mode.
    Limp = 3,
}

/// The periods that hosts keep for now, an entry per node that has not its own. Written at
/// `/coordinator/<governor>/periods` in every step; two seconds after the last one every node has its own again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
#[message(tail = NodePeriod)]
pub struct Periods {
    /// Decisions so far.
    pub decisions: u64,
    /// How far it went; see [`Shortage`].
    #[message(values = "none stretched suspended limp")]
    pub shortage: u32,
    /// Entries of the tail.
    pub nodes: u32,
}

/// One node's period: an entry of [`Periods`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
pub struct NodePeriod {
    /// Number of the node's path; see [`path_number`](crate::path_number).
    pub node: u32,
    /// 1 when it does not step at all.
    pub suspended: u32,
    /// The period [ns].
    pub period_ns: u64,
}
