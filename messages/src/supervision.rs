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
}
