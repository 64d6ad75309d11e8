//! What reactions of the robot file have done beside the nodes: commands that run, paths that are waited for.
//!
//! A command gets the robot's name and folder (`SINEW_ROBOT`, `SINEW_ROOT`), writes into `reactions.log` beside the
//! nodes' logs, and is killed at the robot's end or after ten minutes, whichever comes first. A path has come when a
//! sample is in it that was written since the wait began.

use std::ffi::OsString;
use std::os::fd::BorrowedFd;
use std::path::{Path, PathBuf};

use runtime::Time;
use runtime::channel::Tree;

use crate::event::Event;
use crate::logs::NodeLog;
use crate::processes::{Command, Launcher, Process};
use crate::ring::Ring;

/// A command that runs for longer is killed, and has failed [s].
const LONGEST_S: f64 = 600.0;
/// How often paths are looked at [s].
const LOOK_S: f64 = 0.01;

/// All of them.
pub(crate) struct Errands {
    told: Vec<(OsString, OsString)>,
    commands: Vec<Vec<String>>,
    paths: Vec<String>,
    tree: Option<Tree>,
    root: PathBuf,
    log: Option<NodeLog>,
    running: Vec<Running>,
    awaited: Vec<Awaited>,
}

struct Running {
    ticket: u32,
    process: Process,
    until: Time,
}

struct Awaited {
    ticket: u32,
    ring: Ring,
    since: Time,
    until: Time,
}

impl Errands {
    /// The commands and paths that reactions name by their number.
    pub fn new(
        robot: &str,
        root: &Path,
        commands: Vec<Vec<String>>,
        paths: Vec<String>,
        log: Option<NodeLog>,
    ) -> Errands {
        let told = vec![("SINEW_ROBOT".into(), robot.into()), ("SINEW_ROOT".into(), root.into())];
        let (running, awaited) = (Vec::new(), Vec::new());
        Errands { told, commands, paths, tree: None, root: root.into(), log, running, awaited }
    }

    /// Starts a command; false when it cannot be started.
    pub fn execute(&mut self, now: Time, ticket: u32, command: usize, launcher: &Launcher) -> bool {
        let Some(words) = self.commands.get(command) else { return false };
        let argv: Vec<OsString> = words.iter().map(OsString::from).collect();
        let log = self.log.as_mut().map(NodeLog::begin);
        let started = Command::new(&argv, &self.told).and_then(|command| launcher.start(&command, 0, log, false));
        let running = started.map(|process| Running { ticket, process, until: now.after_s(LONGEST_S) });
        running.map(|running| self.running.push(running)).is_ok()
    }

    /// Begins to wait for a path.
    pub fn wait_for(&mut self, now: Time, ticket: u32, path: usize, within_s: f64) -> bool {
        let Some(path) = self.paths.get(path) else { return false };
        self.awaited.push(Awaited {
            ticket,
            ring: Ring::new(path.clone(), None),
            since: now,
            until: now.after_s(within_s),
        });
        true
    }

    /// Descriptors that become readable when a command ends.
    pub fn watched(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        self.running.iter().map(|running| running.process.death())
    }

    /// When to look next, if at all.
    pub fn next_look(&self, now: Time) -> Option<Time> {
        let paths = (!self.awaited.is_empty()).then(|| now.after_s(LOOK_S));
        self.running.iter().map(|running| running.until).chain(paths).min()
    }

    /// What has ended since the last look.
    pub fn look(&mut self, now: Time) -> Vec<Event> {
        let mut ended = Vec::new();
        self.running.retain_mut(|Running { ticket, process, until }| {
            // Whoever is dropped is killed and reaped.
            let exit = process.reap();
            let over = exit.is_some() || *until <= now;
            if over {
                let success = exit.is_some_and(|exit| exit.is_success());
                ended.push(Event::Outcome { ticket: *ticket, success });
            }
            !over
        });
        if self.awaited.is_empty() {
            return ended;
        }
        if self.tree.is_none() {
            self.tree = Tree::shared(&self.root).ok();
        }
        let tree = self.tree.as_ref();
        self.awaited.retain_mut(|Awaited { ticket, ring, since, until }| {
            let newest = tree.and_then(|tree| ring.newest(tree));
            let success = newest.is_some_and(|stamp| stamp > *since);
            let over = success || *until <= now;
            if over {
                ended.push(Event::Outcome { ticket: *ticket, success });
            }
            !over
        });
        ended
    }
}
