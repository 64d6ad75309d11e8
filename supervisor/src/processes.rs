//! Births, signals and deaths of node processes.
//!
//! A node is a session of its own: a terminal's Ctrl-C and hang-up do not reach it, and what it forks can be killed
//! with it. It gets no parent-death signal, so that it outlives a supervisor that is being replaced. Standard input is
//! /dev/null, output and errors go straight to the node's log file: never through a pipe, which a dead supervisor would
//! leave broken and a slow one full. Descriptor 3 is the write end of the pipe on which the node says that it is ready.

use std::ffi::{CString, OsStr, OsString};
use std::fs::File;
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd, RawFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use nix::spawn::{PosixSpawnAttr, PosixSpawnFileActions, PosixSpawnFlags, posix_spawn};
use nix::sys::signal::SigSet;
use runtime::clock;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::pipe::{PipeFlags, pipe_with};
use rustix::process::{self, Pid, PidfdFlags, Signal, WaitId, WaitIdOptions};

use crate::exit::Exit;

/// Number of the descriptor on which a node says that it is ready.
pub const READY_FD: i32 = 3;
/// Number of the descriptor on which a standby waits for the word to go.
const GO_FD: i32 = 6;

/// Where a standby finds its `GO_FD`.
const STANDBY_NAME: &str = "SINEW_STANDBY_FD";

/// A program made ready to be started again and again.
#[derive(Debug, Clone)]
pub struct Command {
    path: CString,
    arguments: Vec<CString>,
    environment: Vec<CString>,
}

impl Command {
    /// Looks the program up and takes this process' environment, changed by `changes`.
    pub fn new(argv: &[OsString], changes: &[(OsString, OsString)]) -> io::Result<Command> {
        let program = argv.first().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "no program named"))?;
        let path = find_program(program)?;
        // A supervisor may itself be somebody's node: what it was told about itself is not for its own nodes.
        let told_anew = |name: &OsStr| name == "SINEW_READY_FD" || name == "SINEW_RESTARTS" || name == STANDBY_NAME;
        let changed = |name: &OsStr| changes.iter().any(|(other, _)| other == name);
        let kept = std::env::vars_os().filter(|(name, _)| !told_anew(name) && !changed(name));
        let environment = kept.chain(changes.iter().cloned()).map(|(name, value)| {
            let mut entry = name;
            entry.push("=");
            entry.push(value);
            text(&entry)
        });
        Ok(Command {
            path: text(path.as_os_str())?,
            arguments: argv.iter().map(|argument| text(argument)).collect::<io::Result<_>>()?,
            environment: environment.collect::<io::Result<_>>()?,
        })
    }

    /// The file that is run.
    pub fn program(&self) -> Option<String> {
        self.path.to_str().ok().map(str::to_owned)
    }

    /// The same for the single node `path` of the same robot, with its heartbeats in `line`.
    pub fn for_node(&self, path: &str, line: usize) -> io::Result<Command> {
        // What stands before the paths is the same for every node: program, `node`, `--root`, folder.
        let before = self.arguments.iter().take_while(|argument| argument.to_bytes() != b"--root").count() + 2;
        let node = text(OsStr::new(path))?;
        let arguments = self.arguments.iter().take(before).cloned().chain([node]).collect();
        let told = |entry: &CString| -> io::Result<CString> {
            let value = |name: &str| entry.to_str().ok()?.strip_prefix(name)?.strip_prefix('=');
            match (value("SINEW_NODE"), value("SINEW_TABLE")) {
                (Some(_), _) => text(OsStr::new(&format!("SINEW_NODE={path}"))),
                (_, Some(table)) => {
                    let memory = table.split(' ').next().unwrap_or_default();
                    text(OsStr::new(&format!("SINEW_TABLE={memory} {line} 1")))
                }
                _ => Ok(entry.clone()),
            }
        };
        let environment = self.environment.iter().map(told).collect::<io::Result<_>>()?;
        Ok(Command { path: self.path.clone(), arguments, environment })
    }

    /// The same with another program; what it is told stays.
    pub fn with_program(&self, program: &OsStr) -> io::Result<Command> {
        let path = text(find_program(program)?.as_os_str())?;
        let arguments = [path.clone()].into_iter().chain(self.arguments.iter().skip(1).cloned()).collect();
        Ok(Command { path, arguments, environment: self.environment.clone() })
    }
}

/// What all nodes have in common at their start.
#[derive(Debug)]
pub struct Launcher {
    null: File,
    /// Descriptors that this process was started with and would hand on: a lock or a pipe of somebody who waits for
    /// its end.
    inherited: Vec<RawFd>,
    /// What every node finds under these numbers.
    given: Vec<(OwnedFd, RawFd)>,
}

impl Launcher {
    /// Looks at what this process was started with.
    pub fn new() -> io::Result<Launcher> {
        let null = File::options().read(true).write(true).open("/dev/null")?;
        let entries = std::fs::read_dir("/proc/self/fdinfo").into_iter().flatten().flatten();
        let numbers = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        let inherited = numbers.filter(|&number: &RawFd| number >= READY_FD && is_inheritable(number)).collect();
        Ok(Launcher { null, inherited, given: Vec::new() })
    }

    /// Gives every node a duplicate of `descriptor` under `number`.
    pub fn give(&mut self, descriptor: OwnedFd, number: RawFd) {
        self.given.push((descriptor, number));
    }

    /// Starts `command` with `log` (else /dev/null) for its words; `restarts` tells how many processes came before.
    pub fn start(
        &self,
        command: &Command,
        restarts: u32,
        log: Option<&File>,
        reports_ready: bool,
    ) -> io::Result<Process> {
        self.start_with(command, restarts, log, reports_ready, None)
    }

    /// The same for a standby: it opens, says so on the ready pipe, and takes no path before [`Process::promote`].
    pub fn start_standby(&self, command: &Command, restarts: u32, log: Option<&File>) -> io::Result<Process> {
        // The word to go must not get lost in a full pipe or wait for anybody: one byte always fits.
        let (read, write) = pipe_with(PipeFlags::CLOEXEC)?;
        // Above all numbers that the child is given something under.
        let read = rustix::io::fcntl_dupfd_cloexec(read, 64)?;
        let mut process = self.start_with(command, restarts, log, true, Some(&read))?;
        process.go = Some(write);
        Ok(process)
    }

    fn start_with(
        &self,
        command: &Command,
        restarts: u32,
        log: Option<&File>,
        reports_ready: bool,
        go: Option<&OwnedFd>,
    ) -> io::Result<Process> {
        let ready = if reports_ready { Some(pipe_with(PipeFlags::CLOEXEC | PipeFlags::NONBLOCK)?) } else { None };
        let log = log.unwrap_or(&self.null).as_raw_fd();
        let mut files = PosixSpawnFileActions::init()?;
        for (from, to) in [(self.null.as_raw_fd(), 0), (log, 1), (log, 2)] {
            files.add_dup2(from, to)?;
        }
        if let Some((_, write)) = &ready {
            files.add_dup2(write.as_raw_fd(), READY_FD)?;
        }
        for (descriptor, number) in &self.given {
            files.add_dup2(descriptor.as_raw_fd(), *number)?;
        }
        if let Some(read) = go {
            files.add_dup2(read.as_raw_fd(), GO_FD)?;
        }
        for &number in self
            .inherited
            .iter()
            .filter(|&&number| !(reports_ready && number == READY_FD || go.is_some() && number == GO_FD))
        {
            files.add_close(number)?;
        }
        let mut attributes = PosixSpawnAttr::init()?;
        let session = PosixSpawnFlags::from_bits_retain(libc::POSIX_SPAWN_SETSID.into());
        let signals = PosixSpawnFlags::POSIX_SPAWN_SETSIGDEF | PosixSpawnFlags::POSIX_SPAWN_SETSIGMASK;
        attributes.set_flags(session | signals)?;
        attributes.set_sigdefault(&SigSet::all())?;
        attributes.set_sigmask(&SigSet::empty())?;

        let restarts = text(OsStr::new(&format!("SINEW_RESTARTS={restarts}")))?;
        let standby = text(OsStr::new(&format!("{STANDBY_NAME}={GO_FD}")))?;
        let told = [&restarts].into_iter().chain(go.map(|_| &standby));
        let environment: Vec<&CString> = command.environment.iter().chain(told).collect();
        let pid = posix_spawn(command.path.as_c_str(), &files, &attributes, &command.arguments, &environment)?;
        let pid = Pid::from_raw(pid.as_raw()).ok_or(Errno::SRCH)?;
        // Until it is reaped the pid stays taken, even if the process has ended already.
        match process::pidfd_open(pid, PidfdFlags::empty()) {
            Ok(descriptor) => {
                Ok(Process { pid, descriptor, ready: ready.map(|(read, _)| read), go: None, reaped: false, own: true })
            }
            Err(error) => {
                let _ = process::kill_process(pid, Signal::KILL);
                let _ = process::waitpid(Some(pid), process::WaitOptions::empty());
                Err(error.into())
            }
        }
    }
}

/// A process that has been started and not yet reaped. Dropping it kills it.
#[derive(Debug)]
pub struct Process {
    pid: Pid,
    descriptor: OwnedFd,
    ready: Option<OwnedFd>,
    /// A standby waits for a byte on it. Closed unwritten, it ends the standby.
    go: Option<OwnedFd>,
    reaped: bool,
    /// Whether this process started it, and so is the one to reap it.
    own: bool,
}

/// How long the root of the process tree may take to reap an orphan, s.
const REAPED_WITHIN_S: f64 = 0.05;

impl Process {
    /// A process that a supervisor before this one has started.
    pub fn adopt(pid: i32, descriptor: OwnedFd) -> Option<Process> {
        Some(Process { pid: Pid::from_raw(pid)?, descriptor, ready: None, go: None, reaped: false, own: false })
    }

    /// Number of the process.
    pub fn pid(&self) -> i32 {
        self.pid.as_raw_nonzero().get()
    }

    /// Becomes readable when the process has ended.
    pub fn death(&self) -> BorrowedFd<'_> {
        self.descriptor.as_fd()
    }

    /// Becomes readable when the process says that it is ready, until `take_ready`.
    pub fn ready(&self) -> Option<BorrowedFd<'_>> {
        self.ready.as_ref().map(AsFd::as_fd)
    }

    /// Whether the process has said that it is ready. A pipe closed without a word is looked at no more.
    pub fn take_ready(&mut self) -> bool {
        let Some(pipe) = &self.ready else { return false };
        match rustix::io::read(pipe, &mut [0_u8; 8]) {
            Err(Errno::AGAIN | Errno::INTR) => false,
            Ok(0) | Err(_) => {
                self.ready = None;
                false
            }
            Ok(_) => {
                // A standby says it twice: that it waits, and that it has taken over.
                if self.go.is_none() {
                    self.ready = None;
                }
                true
            }
        }
    }

    /// Lets a standby take over; false when it is not there any more to hear it.
    pub fn promote(&mut self) -> bool {
        self.go.take().is_some_and(|go| rustix::io::write(&go, &[1]) == Ok(1))
    }

    /// Asks the process to stop; a stopped one is woken so that it can.
    pub fn terminate(&self) {
        for signal in [Signal::TERM, Signal::CONT] {
            // A process that is gone already is what was asked for.
            let _ = process::pidfd_send_signal(&self.descriptor, signal);
        }
    }

    /// Ends the process and what it has forked.
    pub fn kill(&self) {
        let _ = process::pidfd_send_signal(&self.descriptor, Signal::KILL);
        let _ = process::kill_process_group(self.pid, Signal::KILL);
    }

    /// How the process ended, if it has, without burying it: that may take its time, and is done when this is dropped.
    /// What it forked and left in its group is killed first: a successor must find devices and locks free.
    pub fn ended(&mut self) -> Option<Exit> {
        if !self.own {
            return self.reaped_by_root();
        }
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        let status = match process::waitid(WaitId::PidFd(self.descriptor.as_fd()), options) {
            Ok(None) | Err(Errno::INTR) => return None,
            status => status,
        };
        // The group keeps the number of its dead leader until that is reaped, so no stranger can be hit.
        let _ = process::kill_process_group(self.pid, Signal::KILL);
        let Ok(Some(status)) = status else { return Some(Exit::Unknown) };
        let signalled = || Exit::Signal { signal: status.terminating_signal().unwrap_or(0), core: status.dumped() };
        Some(status.exit_status().map_or_else(signalled, Exit::Code))
    }

    /// The same, and buries it.
    pub fn reap(&mut self) -> Option<Exit> {
        let exit = self.ended()?;
        if self.own {
            let _ =
                process::waitid(WaitId::PidFd(self.descriptor.as_fd()), WaitIdOptions::EXITED | WaitIdOptions::NOHANG);
        }
        self.reaped = true;
        Some(exit)
    }
}

impl Process {
    /// How an adopted process ended, if it has: its parent is the root, which reaps it, and the kernel tells all others.
    fn reaped_by_root(&mut self) -> Option<Exit> {
        let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
        let mut death = [PollFd::new(&self.descriptor, PollFlags::IN)];
        if !matches!(rustix::io::retry_on_intr(|| poll(&mut death, Some(&at_once))), Ok(1..)) {
            return None;
        }
        // The numbers of a group with living members are not given to anybody else.
        let _ = process::kill_process_group(self.pid, Signal::KILL);
        self.reaped = true;
        let until = clock::now().after_s(REAPED_WITHIN_S);
        loop {
            match guard::exit_of(&self.descriptor) {
                Some(status) => return Some(Exit::of_status(status)),
                // Before Linux 6.15 nobody but the parent is told.
                None if clock::now() >= until => return Some(Exit::Unknown),
                None => clock::sleep_s(0.0002),
            }
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if !self.reaped && self.own {
            self.kill();
            let _ = process::waitid(WaitId::PidFd(self.descriptor.as_fd()), WaitIdOptions::EXITED);
        }
    }
}

/// Whether a program started by this one finds the descriptor open (proc_pid_fdinfo(5): octal open flags).
fn is_inheritable(number: RawFd) -> bool {
    let Ok(text) = std::fs::read_to_string(format!("/proc/self/fdinfo/{number}")) else { return false };
    let flags = text.lines().find_map(|line| line.strip_prefix("flags:"));
    let flags = flags.and_then(|octal| i32::from_str_radix(octal.trim(), 8).ok());
    flags.is_some_and(|flags| flags & libc::O_CLOEXEC == 0)
}

/// The file that a shell would run for `program`.
pub(crate) fn find_program(program: &OsStr) -> io::Result<PathBuf> {
    let executable = |path: &Path| path.is_file() && rustix::fs::access(path, rustix::fs::Access::EXEC_OK).is_ok();
    let missing = || io::Error::new(io::ErrorKind::NotFound, format!("no program {}", program.display()));
    if program.as_bytes().contains(&b'/') {
        let path = PathBuf::from(program);
        return if executable(&path) { Ok(path) } else { Err(missing()) };
    }
    let path = std::env::var_os("PATH").unwrap_or_else(|| "/usr/local/bin:/usr/bin:/bin".into());
    std::env::split_paths(&path).map(|folder| folder.join(program)).find(|path| executable(path)).ok_or_else(missing)
}

fn text(text: &OsStr) -> io::Result<CString> {
    Ok(CString::new(text.as_bytes())?)
}
