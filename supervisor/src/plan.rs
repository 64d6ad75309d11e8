//! What a run consists of: the robot's name, its folders, and the programs that are its nodes.

use std::collections::HashSet;
use std::ffi::OsString;
use std::path::PathBuf;

use crate::care::Supervision;
use crate::control::StopHandle;
use crate::isolation::Ownership;
use crate::load::NodeTask;
use crate::logs::log_folder;
use crate::robot_plan::Crew;
use crate::rule::Rule;

/// One node process.
#[derive(Debug, Clone)]
pub struct Program {
    /// Name, unique in the plan, `base` or `/drivers/base`. It names the log too, with dots: `drivers.base.log`.
    pub instance: String,
    /// The program, looked up in PATH if it has no slash, and its arguments.
    pub argv: Vec<OsString>,
    /// Additions to the supervisor's own environment.
    pub env: Vec<(OsString, OsString)>,
    /// When to start it again, how to stop it.
    pub rule: Rule,
    /// Heartbeats that it keeps: one per node in it; none for programs that know nothing of them.
    pub beats: usize,
}

impl Program {
    /// A node that is always restarted, stops in group 0 and says when it is ready.
    pub fn new(instance: impl Into<String>, argv: impl IntoIterator<Item = impl Into<OsString>>) -> Program {
        let argv = argv.into_iter().map(Into::into).collect();
        Program { instance: instance.into(), argv, env: Vec::new(), rule: Rule::default(), beats: 0 }
    }

    /// The instance as the name of a file.
    pub fn file_name(&self) -> String {
        self.instance.strip_prefix('/').unwrap_or(&self.instance).replace('/', ".")
    }
}

/// One run of a robot.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The robot's name: letters, digits, `_`, `-`, `.`.
    pub robot: String,
    /// The robot's shared-memory folder. It is claimed, emptied of what a dead supervisor left, and removed at the end.
    pub root: PathBuf,
    /// Where logs go; `None`: nowhere.
    pub log_folder: Option<PathBuf>,
    /// The nodes.
    pub programs: Vec<Program>,
    /// Care beyond each program's own rule, numbered like the programs; `None`: only hangs are looked after.
    pub supervision: Option<Supervision>,
    /// The robot's processes, numbered like the programs, whose channels are looked at; empty for other programs.
    pub crews: Vec<Crew>,
    /// The robot's nodes in the order of the table of heartbeats, whose load is told; empty for other programs.
    pub tasks: Vec<NodeTask>,
    /// Commands that reactions execute, by number.
    pub commands: Vec<Vec<String>>,
    /// Paths that reactions wait for, by number.
    pub awaited: Vec<String>,
    /// Whose what is in the robot's folder, where nodes have users of their own.
    pub ownership: Option<Ownership>,
    /// Ends the run from another thread.
    pub stop: Option<StopHandle>,
}

impl Plan {
    /// A run of `robot` in its usual folders: below `$SINEW_SHM` (else /dev/shm/sinew) and `$SINEW_STATE`.
    pub fn new(robot: impl Into<String>, programs: Vec<Program>) -> Plan {
        let robot = robot.into();
        Plan {
            root: root_folder(&robot),
            log_folder: log_folder(&robot),
            robot,
            programs,
            supervision: None,
            crews: Vec::new(),
            tasks: Vec::new(),
            commands: Vec::new(),
            awaited: Vec::new(),
            ownership: None,
            stop: None,
        }
    }

    /// Why this cannot be run, if so.
    pub(crate) fn flaw(&self) -> Option<String> {
        if !is_name(&self.robot) {
            return Some(format!("`{}` is no name for a robot: {NAME_RULE}", self.robot));
        }
        if self.root.file_name() != Some(self.robot.as_ref()) {
            return Some(format!(
                "the folder {} does not end in the robot's name `{}`",
                self.root.display(),
                self.robot
            ));
        }
        if self.programs.is_empty() {
            return Some(format!("robot `{}` has no nodes", self.robot));
        }
        let mut seen = HashSet::new();
        for program in &self.programs {
            let instance = &program.instance;
            if !instance.strip_prefix('/').unwrap_or(instance).split('/').all(is_name) {
                return Some(format!("`{instance}` is no name for a node: {NAME_RULE}"));
            }
            if !seen.insert(program.file_name()) {
                return Some(format!("two nodes are called `{instance}`: rename one"));
            }
        }
        None
    }
}

const NAME_RULE: &str = "use 1 to 64 letters, digits, `_`, `-` or `.`, beginning with a letter or digit";

fn is_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    (1..=64).contains(&name.len()) && name.chars().all(plain) && name.starts_with(|c: char| c.is_ascii_alphanumeric())
}

/// The folder that holds the robots of this machine: `$SINEW_SHM`, else /dev/shm/sinew.
pub fn base_folder() -> PathBuf {
    let set = std::env::var_os("SINEW_SHM").filter(|value| !value.is_empty());
    set.map_or_else(|| PathBuf::from("/dev/shm/sinew"), PathBuf::from)
}

/// The shared-memory folder of `robot`.
pub fn root_folder(robot: &str) -> PathBuf {
    base_folder().join(robot)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(robot: &str, instances: &[&str]) -> Plan {
        Plan::new(robot, instances.iter().map(|name| Program::new(*name, ["true"])).collect())
    }

    #[test]
    fn a_sound_plan_has_no_flaw() {
        assert_eq!(plan("pioneer", &["base", "/motion/base"]).flaw(), None);
    }

    #[test]
    fn names_that_would_leave_the_folder_are_refused() {
        for robot in ["", "..", "a/b", ".run", "-x", "a b"] {
            assert!(plan(robot, &["base"]).flaw().unwrap().contains("no name for a robot"), "{robot}");
        }
        assert!(plan("pioneer", &["/drivers/../base"]).flaw().unwrap().contains("no name for a node"));
    }

    #[test]
    fn two_nodes_of_one_name_are_refused_by_name() {
        assert!(plan("pioneer", &["base", "base"]).flaw().unwrap().contains("two nodes are called `base`"));
        assert!(plan("pioneer", &[]).flaw().unwrap().contains("no nodes"));
    }
}
