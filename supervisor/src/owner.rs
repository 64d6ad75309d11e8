//! Who runs which robot on this machine: `<root>/.run/supervisor.json`.

use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::proc;

/// Folder of the supervisor's own files below the robot's root.
pub const RUN_FOLDER: &str = ".run";
pub(crate) const OWNER: &str = "supervisor.json";

/// Who holds a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Owner {
    /// Name of the robot.
    pub robot: String,
    /// Process of the supervisor.
    pub pid: i32,
    /// When that process started, in clock ticks since boot: a recycled pid has another.
    pub start_ticks: u64,
    /// When it claimed the robot, s since the Unix epoch.
    pub since_unix_s: f64,
    /// Name of the run, in the environment of all its processes as SINEW_RUN.
    pub run: String,
}

impl Owner {
    /// Whether the supervisor lives.
    pub fn is_alive(&self) -> bool {
        proc::start_ticks(self.pid) == Some(self.start_ticks)
    }
}

/// The supervisor that runs, or last ran, the robot in `root`.
pub fn owner(root: &Path) -> Option<Owner> {
    serde_json::from_slice(&fs::read(root.join(RUN_FOLDER).join(OWNER)).ok()?).ok()
}

/// The living supervisors of the robots below `base`, by name.
pub fn owners(base: &Path) -> Vec<Owner> {
    let entries = fs::read_dir(base).into_iter().flatten().flatten();
    let mut owners: Vec<Owner> = entries.filter_map(|entry| owner(&entry.path())).filter(Owner::is_alive).collect();
    owners.sort_by(|a, b| a.robot.cmp(&b.robot));
    owners
}
