//! The processes of a run, found from beside it: root, supervisor, guard, nodes, and their signs of life.

use crate::exit::Failure;
use guard::{Line, SUPERVISOR_LINE, Table, fds};
use std::fs;
use std::path::{Path, PathBuf};
use supervisor::Plan;

/// One process that can be hit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Member {
    /// The supervisor.
    Supervisor,
    /// The guard.
    Guard,
    /// The node process of this place in the plan.
    Node(usize),
}

/// A running robot, seen from outside.
pub struct Census {
    /// The root of the process tree.
    pub root: u32,
    /// Name of the run.
    pub run: String,
    /// The robot's folder.
    pub folder: PathBuf,
    table: Table,
    /// Name and first line of each node process.
    nodes: Vec<(String, usize)>,
}

impl Census {
    /// The robot that runs in `folder` by `plan`; `None` while it is still being started.
    pub fn take(folder: &Path, plan: &Plan) -> Option<Census> {
        let owner = supervisor::owner(folder)?;
        let memory = fs::File::options().read(true).write(true).open(format!("/proc/{}/fd/{}", owner.pid, fds::TABLE));
        let table = Table::map(memory.ok()?).ok()?;
        let mut next = 0;
        let nodes = plan.programs.iter().map(|program| {
            let line = next;
            next += program.beats;
            (program.instance.clone(), line)
        });
        Some(Census {
            root: u32::try_from(owner.pid).ok()?,
            run: owner.run,
            folder: folder.to_owned(),
            nodes: nodes.collect(),
            table,
        })
    }

    /// What a member is called.
    pub fn name(&self, member: &Member) -> &str {
        match member {
            Member::Supervisor => "supervisor",
            Member::Guard => "guard",
            Member::Node(node) => &self.nodes[*node].0,
        }
    }

    /// The line of a member that beats; the guard does not.
    pub fn line(&self, member: &Member) -> Option<Line> {
        match member {
            Member::Supervisor => self.table.line(SUPERVISOR_LINE),
            Member::Guard => None,
            Member::Node(node) => self.table.line(self.nodes[*node].1),
        }
    }

    /// The process of a member now.
    pub fn pid(&self, member: &Member) -> Option<u32> {
        match member {
            Member::Guard => children(self.root).into_iter().find(|pid| says(*pid, guard::GUARD_WORD)),
            Member::Supervisor => children(self.root).into_iter().find(|pid| says(*pid, "supervise")),
            Member::Node(_) => self.line(member).map(|line| line.writer().0).filter(|pid| *pid != 0),
        }
    }

    /// Whether every node beats.
    pub fn all_beat(&self) -> bool {
        (0..self.nodes.len()).all(|node| {
            let line = self.line(&Member::Node(node));
            line.is_some_and(|line| line.beats() > 0 && Path::new(&format!("/proc/{}", line.writer().0)).exists())
        })
    }

    /// Beats of all nodes so far, of those that live now.
    pub fn total_beats(&self) -> u64 {
        (0..self.nodes.len()).filter_map(|node| self.line(&Member::Node(node))).map(|line| line.beats()).sum()
    }

    /// Processes that carry the name of the run, or belong to its tree: what is left after its end is a leak.
    pub fn processes(&self) -> Vec<u32> {
        let mark = format!("SINEW_RUN={}", self.run);
        let carries = |pid: u32| {
            let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
            environment.split(|byte| *byte == 0).any(|entry| entry == mark.as_bytes())
        };
        let folder = self.folder.display().to_string();
        let of_tree = |pid: u32| pid == self.root || (says(pid, "supervise") && says(pid, &folder));
        pids().filter(|pid| carries(*pid) || of_tree(*pid)).collect()
    }
}

/// Open descriptors of a process.
pub fn descriptors(pid: u32) -> Result<usize, Failure> {
    Ok(fs::read_dir(format!("/proc/{pid}/fd"))?.count())
}

fn pids() -> impl Iterator<Item = u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok())
}

fn children(of: u32) -> Vec<u32> {
    let text = fs::read_to_string(format!("/proc/{of}/task/{of}/children")).unwrap_or_default();
    text.split_ascii_whitespace().filter_map(|word| word.parse().ok()).collect()
}

/// Whether one of the process's arguments is `word`.
fn says(pid: u32, word: &str) -> bool {
    let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    line.split(|byte| *byte == 0).any(|argument| argument == word.as_bytes())
}
