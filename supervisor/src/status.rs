//! What `status` answers.

use serde::{Deserialize, Serialize};

/// The state of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Name of the robot.
    pub robot: String,
    /// Process of the supervisor.
    pub pid: i32,
    /// Name of the run.
    pub run: String,
    /// When it began, UTC.
    pub since: String,
    /// How long it has run, s.
    pub running_s: f64,
    /// `starting`, `running`, `degraded` or `stopping`.
    pub state: String,
    /// Folder of the logs, if any are kept.
    pub log_folder: Option<String>,
    /// The nodes, in the order of the plan.
    pub nodes: Vec<NodeStatus>,
}

/// The state of one node.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NodeStatus {
    /// Its name in the plan.
    pub instance: String,
    /// `waiting`, `starting`, `running`, `restarting`, `stopping`, `unkillable`, `finished`, `failed`, `given up` or
    /// `stopped`.
    pub state: String,
    /// Its process, while there is one.
    pub pid: Option<i32>,
    /// How long that has lived, s.
    pub lived_s: Option<f64>,
    /// How often it was started again.
    pub restarts: u32,
    /// How it last ended, in words.
    pub last_exit: Option<String>,
    /// A process that is to take over from it: `starting`, or `waiting` once it has opened.
    #[serde(default)]
    pub standby: Option<String>,
    /// Whether it has been replaced, set or wired so lately that a death would take that back.
    #[serde(default)]
    pub on_trial: bool,
}
