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

/// What the governor decided.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(tail = u8)]
pub struct GovernorState {
    /// Number of the decision, from 1.
    pub decision: u64,
    /// Index of the mode among the governor's modes.
    pub mode: u32,
    /// Index of the rule that chose it; 2³²−1 for the default.
    pub rule: u32,
    /// Load of the processors by all nodes at the present periods; one whole processor is 1.
    pub utilization: f64,
    /// The same at the periods that the robot file wants.
    pub wanted_utilization: f64,
    /// Share of the time in which some task waited for a processor, over the last ten seconds (pressure stall information), 0 to 1.
    pub cpu_pressure: f64,
    /// The same for memory, 0 to 1.
    pub memory_pressure: f64,
    /// Nodes whose periods are stretched now.
    pub stretched: u32,
    /// Nodes that are suspended now.
    pub suspended: u32,
}
