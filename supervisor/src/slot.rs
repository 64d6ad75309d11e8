//! The place of one node: its process, and what is known of those before it.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::Path;

use runtime::{Time, clock};

use crate::exit::Exit;
use crate::logs::NodeLog;
use crate::proc;
use crate::processes::{Command, Launcher, Process};
use crate::state::NodeState;
use crate::status::NodeStatus;

/// One node of a run.
pub(crate) struct Slot {
    pub instance: String,
    pub process: Option<Process>,
    /// A second process that has opened, or is about to, and waits.
    pub standby: Option<Process>,
    /// Whether it has opened and waits.
    pub standby_waits: bool,
    /// Process of the newest start.
    pub pid: Option<i32>,
    /// When the present process was started, in clock ticks since boot.
    pub ticks: Option<u64>,
    /// Process of the newest death: by the time that it is told, its successor may run.
    pub dead_pid: Option<i32>,
    /// What that process wrote last.
    pub last_lines: Vec<String>,
    file_name: String,
    command: Command,
    /// The program that is to replace the present one.
    other: Option<Command>,
    /// The one from before the last replacement.
    before: Option<Command>,
    reports_ready: bool,
    /// `None`: what the node says goes to /dev/null.
    log: Option<NodeLog>,
    /// Priority above the robot file's.
    above: u8,
    starts: u32,
    started: Time,
    last_exit: Option<Exit>,
}

impl Slot {
    /// A node that has not been started.
    pub fn new(
        instance: String,
        file_name: String,
        command: Command,
        reports_ready: bool,
        log: Option<NodeLog>,
    ) -> Slot {
        Slot {
            instance,
            process: None,
            standby: None,
            standby_waits: false,
            pid: None,
            ticks: None,
            dead_pid: None,
            last_lines: Vec::new(),
            file_name,
            command,
            other: None,
            before: None,
            reports_ready,
            log,
            above: 0,
            starts: 0,
            started: Time::ZERO,
            last_exit: None,
        }
    }

    /// The command of another node, `path`, with heartbeats from `line` on; `None` for programs that run no nodes.
    pub fn like(&self, path: &str, line: usize) -> Option<io::Result<Command>> {
        self.instance.starts_with('/').then(|| self.command.for_node(path, line))
    }

    /// Processes that came before the present one.
    pub fn restarts(&self) -> u32 {
        self.starts.saturating_sub(1)
    }

    /// Processes so far.
    pub fn starts(&self) -> u32 {
        self.starts
    }

    /// When the newest process was started.
    pub fn started(&self) -> Time {
        self.started
    }

    /// Takes over what a supervisor before this one has started; whether its process still lives.
    pub fn adopt(&mut self, process: Option<(i32, u64)>, starts: u32, started: Time) -> bool {
        (self.starts, self.started) = (starts, started);
        let Some((pid, ticks)) = process else { return false };
        (self.pid, self.ticks) = (Some(pid), Some(ticks));
        self.process = proc::open(pid, ticks).and_then(|descriptor| Process::adopt(pid, descriptor));
        if self.process.is_none() {
            self.dead_pid = Some(pid);
            self.last_exit = Some(Exit::Unknown);
            self.last_lines = self.log.as_ref().map_or_else(Vec::new, NodeLog::last_lines);
        }
        self.process.is_some()
    }

    /// Starts a process and writes its number into `run_folder`; why there is none, if that fails.
    pub fn start(&mut self, launcher: &Launcher, run_folder: &Path) -> Result<(), Exit> {
        self.starts += 1;
        self.above = 0;
        self.started = clock::now();
        let log = self.log.as_mut().map(NodeLog::begin);
        match launcher.start(&self.command, self.starts - 1, log, self.reports_ready) {
            Ok(process) => {
                self.lives(process, run_folder);
                Ok(())
            }
            Err(error) => {
                let exit = Exit::NotStarted(error.raw_os_error().unwrap_or(libc::EINVAL));
                (self.pid, self.dead_pid, self.last_exit) = (None, None, Some(exit));
                self.last_lines.clear();
                Err(exit)
            }
        }
    }

    fn lives(&mut self, process: Process, run_folder: &Path) {
        let pid = process.pid();
        (self.pid, self.process) = (Some(pid), Some(process));
        // For the next supervisor, should this one be killed. A full disk is made up for by SINEW_RUN.
        self.ticks = proc::start_ticks(pid);
        let line = format!("{pid} {}\n", self.ticks.unwrap_or(0));
        let _ = fs::write(run_folder.join(format!("{}.pid", self.file_name)), line);
    }

    /// Names the program of the next replacement; `None` for the present one's file, as it is then.
    pub fn replace_with(&mut self, program: Option<&OsStr>) -> io::Result<()> {
        let program = program.map_or_else(|| Ok(self.command.clone()), |program| self.command.with_program(program));
        self.other = Some(program?);
        Ok(())
    }

    /// Starts a standby, of the `other` program where that is asked for.
    pub fn start_standby(&mut self, launcher: &Launcher, other: bool) -> Result<(), Exit> {
        if !self.reports_ready {
            // A program that never says that it is ready cannot say that it waits.
            return Err(Exit::NotStarted(libc::ENOTSUP));
        }
        let command = self.other.as_ref().filter(|_| other).unwrap_or(&self.command);
        match launcher.start_standby(command, self.starts, self.log.as_ref().map(NodeLog::beside)) {
            Ok(process) => {
                (self.standby, self.standby_waits) = (Some(process), false);
                Ok(())
            }
            Err(error) => Err(Exit::NotStarted(error.raw_os_error().unwrap_or(libc::EINVAL))),
        }
    }

    /// How the standby ended, if it has.
    pub fn look_for_standby_death(&mut self) -> Option<Exit> {
        let exit = self.standby.as_mut().and_then(Process::reap)?;
        self.standby = None;
        Some(exit)
    }

    /// The standby takes over; why not, if it is gone.
    pub fn promote(&mut self, run_folder: &Path) -> Result<(), Exit> {
        self.starts += 1;
        self.above = 0;
        self.started = clock::now();
        let Some(mut process) = self.standby.take() else { return Err(Exit::NotStarted(libc::ESRCH)) };
        if !process.promote() {
            return Err(Exit::NotStarted(libc::EPIPE));
        }
        if let Some(other) = self.other.take() {
            self.before = Some(std::mem::replace(&mut self.command, other));
        }
        if let Some(log) = &mut self.log {
            log.hand_over();
        }
        self.lives(process, run_folder);
        Ok(())
    }

    /// Goes back to the program from before the last replacement.
    pub fn revert(&mut self) {
        self.other = None;
        if let Some(before) = self.before.take() {
            self.command = before;
        }
    }

    /// How the process ended, if it has.
    pub fn look_for_death(&mut self) -> Option<Exit> {
        let exit = self.process.as_mut().and_then(Process::reap)?;
        self.process = None;
        (self.dead_pid, self.last_exit) = (self.pid, Some(exit));
        self.last_lines = self.log.as_ref().map_or_else(Vec::new, NodeLog::last_lines);
        Some(exit)
    }

    /// Schedules the node's threads `above` the priority that they had when it was first asked for. Threads without
    /// real-time priority stay without: there is no order among them to raise them in.
    pub fn reprioritise(&mut self, above: u8) {
        let raised = std::mem::replace(&mut self.above, above);
        if let Some(process) = &self.process {
            runtime::realtime::shift_priorities(process.pid(), i32::from(above) - i32::from(raised));
        }
    }

    /// What `status` tells of the node.
    pub fn status(&self, state: NodeState) -> NodeStatus {
        NodeStatus {
            instance: self.instance.clone(),
            state: state.word().to_owned(),
            pid: self.process.as_ref().map(Process::pid),
            lived_s: self.process.as_ref().map(|_| clock::now().since(self.started)),
            restarts: self.restarts(),
            last_exit: self.last_exit.map(|exit| exit.to_string()),
            standby: self.standby.as_ref().map(|_| if self.standby_waits { "waiting" } else { "starting" }.to_owned()),
        }
    }
}
