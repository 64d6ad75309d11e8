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
    /// The one before it, dead and known to be: first its successor is started, then it is buried.
    unburied: Option<Process>,
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
    file_name: String,
    command: Command,
    /// The program that is to replace the present one.
    other: Option<Command>,
    /// The one from before the last replacement, while that is on trial.
    before: Option<Command>,
    /// Whether the program is another than the plan's, and whether the one before is.
    replaced: bool,
    replaced_before: bool,
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
            unburied: None,
            standby: None,
            standby_waits: false,
            pid: None,
            ticks: None,
            dead_pid: None,
            file_name,
            command,
            other: None,
            before: None,
            replaced: false,
            replaced_before: false,
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

    /// The program, where that is not the plan's.
    pub fn program(&self) -> Option<String> {
        self.command.program().filter(|_| self.replaced)
    }

    /// The program to go back to, where that is not the plan's.
    pub fn program_before(&self) -> Option<String> {
        self.before.as_ref().filter(|_| self.replaced_before)?.program()
    }

    /// Goes on with the programs that a supervisor before this one had put in the plan's place. One that is gone is left
    /// out: then the plan's starts.
    pub fn adopt_programs(&mut self, program: Option<&str>, before: Option<&str>, on_trial: bool) {
        let other = |name: &str| self.command.with_program(OsStr::new(name)).ok();
        let (program, before) = (program.and_then(other), before.and_then(other));
        self.replaced_before = before.is_some();
        self.before = on_trial.then(|| before.unwrap_or_else(|| self.command.clone()));
        if let Some(program) = program {
            (self.command, self.replaced) = (program, true);
        }
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
            self.log.iter_mut().for_each(NodeLog::mark);
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
                self.log.iter_mut().for_each(NodeLog::unmark);
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
            self.replaced_before = std::mem::replace(&mut self.replaced, true);
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
            (self.command, self.replaced) = (before, self.replaced_before);
        }
    }

    /// Its name as that of a file.
    pub fn file_name(&self) -> &str {
        &self.file_name
    }

    /// The last replacement has stood its trial: nothing goes back behind it.
    pub fn accept(&mut self) {
        self.before = None;
    }

    /// The replacement that was to come is not wanted any more; whether there was one.
    pub fn forget_other(&mut self) -> bool {
        self.other.take().is_some()
    }

    /// How the process ended, if it has.
    pub fn look_for_death(&mut self) -> Option<Exit> {
        let exit = self.process.as_mut().and_then(Process::ended)?;
        self.unburied = self.process.take();
        (self.dead_pid, self.last_exit) = (self.pid, Some(exit));
        // They are read when its successor has been started.
        self.log.iter_mut().for_each(NodeLog::mark);
        Some(exit)
    }

    /// Buries the process of the newest death: the kernel forgets its number.
    pub fn bury(&mut self) {
        self.unburied = None;
    }

    /// What the process of the newest death wrote last; once.
    pub fn last_lines(&mut self) -> Vec<String> {
        self.log.as_mut().map_or_else(Vec::new, NodeLog::marked_lines)
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
            on_trial: false,
            standby: self.standby.as_ref().map(|_| if self.standby_waits { "waiting" } else { "starting" }.to_owned()),
        }
    }
}
