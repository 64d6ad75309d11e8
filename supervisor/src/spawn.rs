//! `spawn`: a node that the robot file does not name, put under care while the robot runs.
//!
//! Who asks has checked it already (types, wires, deadlines), has opened it once for trial and has written it where every
//! process of the run reads the robot. Here it gets what a node of the file gets: a place in the policy, a line of the
//! table of heartbeats, a log, its load told. It comes last in the table, so that no other line moves; a supervisor that
//! takes over finds it there.

use runtime::clock;
use serde::{Deserialize, Serialize};

use crate::care::Care;
use crate::host::Host;
use crate::load::NodeTask;
use crate::logs::NodeLog;
use crate::observer::Report;
use crate::policy::Policy;
use crate::rule::Rule;
use crate::slot::Slot;
use crate::state::RobotState;

/// What is asked for, behind the word `spawn`, as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Newcomer {
    /// Its path.
    pub path: String,
    /// Its instance name.
    pub instance: String,
    /// Its type and its wires, for the record.
    pub words: String,
    /// Nodes in the table before it.
    pub line: usize,
    /// When it stops: those of lower numbers first.
    pub stop_group: u8,
    /// How little the robot can do without it.
    pub importance: u8,
    /// Its own period; 0 for none [ns].
    pub shortest_ns: u64,
    /// The longest that it may be given [ns].
    pub longest_ns: u64,
}

/// The node that `text` describes, or why it cannot be had; `lines` of the table are taken.
pub(crate) fn accept(
    text: &str,
    instances: &[String],
    policy: &Policy,
    lines: Option<usize>,
) -> Result<Newcomer, String> {
    let new: Newcomer = serde_json::from_str(text).map_err(|e| format!("\"{text}\" is no node: {e}"))?;
    if !matches!(policy.robot(), RobotState::Running | RobotState::Degraded) {
        return Err(format!("the robot is {}", policy.robot().word()));
    }
    if instances.contains(&new.path) {
        return Err(format!("{} is there already: a path has one writer", new.path));
    }
    let lines = lines.ok_or("this robot has no process tree")?;
    if new.line != lines {
        return Err(format!("the robot has {lines} nodes, not {}: somebody else has changed it", new.line));
    }
    // The last line is the supervisor's own.
    if lines + 1 >= guard::LINES {
        return Err(format!("there is no room for more than {} nodes", guard::LINES - 1));
    }
    Ok(new)
}

/// The answer to who asked, and what is to be done.
pub(crate) fn accepted(new: Newcomer) -> (String, Option<Newcomer>) {
    (r#"{"ok":true}"#.to_owned(), Some(new))
}

/// The answer to who asked.
pub(crate) fn refused(why: String) -> (String, Option<Newcomer>) {
    (serde_json::json!({ "error": why }).to_string(), None)
}

impl Host<'_> {
    /// Puts a node that was accepted under care; the next event starts it.
    pub(crate) fn spawn(&mut self, new: &Newcomer) {
        let Some(inside) = &mut self.inside else { return };
        let program = self.slots.len();
        let command = self.slots.iter().find_map(|slot| slot.like(&new.path, new.line));
        let Some(Ok(command)) = command else {
            self.observer.report(Report::Note("not spawned: no node is there whose program could run it"));
            return;
        };
        let file_name = new.path.trim_start_matches('/').replace('/', ".");
        let folder = self.log_folder.as_deref().map(std::path::Path::new);
        let log = folder.and_then(|folder| NodeLog::create(folder, &file_name).ok());
        let task = NodeTask {
            program,
            path: new.path.clone(),
            instance: new.instance.clone(),
            importance: new.importance,
            shortest_ns: new.shortest_ns,
            longest_ns: new.longest_ns,
            governs: false,
        };
        inside.beats.add(&inside.tree.table, program, clock::now());
        inside.load.add(&inside.tree.table, new.line, &task);
        self.detectors.add(&new.path);
        self.slots.push(Slot::new(new.path.clone(), file_name, command, true, log));
        self.policy.add(crate::supervise::beating(Care::plain(Rule { stop_group: new.stop_group, ..Rule::default() })));
        self.channels.change(clock::now(), Some(program), &format!("spawn {}", new.words));
    }
}
