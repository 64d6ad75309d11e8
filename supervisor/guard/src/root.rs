//! The root of the process tree: starts guard and supervisor, starts either anew when it dies, takes orphans in.
//!
//! It reads nothing and decides one thing: a supervisor that says that the run is over ends the tree. It holds the
//! memory, the sockets and the lock of the robot's folder open for as long as the robot runs.

use std::ffi::{CString, OsString};
use std::os::unix::ffi::OsStrExt;
use std::process::exit;

use rustix::process::{Pid, Signal, WaitOptions, kill_process, set_child_subreaper, waitpid};
use rustix::time::{ClockId, clock_gettime};

use crate::sys::{self, Program, Waiting};
use crate::{DONE, GUARD_WORD, fds};

/// Above the guard: the one thing that must never wait for a robot's node.
const PRIORITY: i32 = 99;
/// More deaths of either child than this within `WINDOW_NS`, and the tree is given up: then every node stops by itself.
const MOST_DEATHS: usize = 50;
const WINDOW_NS: u64 = 10_000_000_000;
/// Exit code of a root that has given up.
const GIVEN_UP: i32 = 70;

struct Child {
    program: Program,
    pid: Option<Pid>,
    deaths: [u64; MOST_DEATHS],
    next: usize,
}

/// Runs the root. `arguments`: the supervisor's program, then its arguments.
pub fn run(arguments: &[OsString]) -> ! {
    let text = |argument: &OsString| CString::new(argument.as_bytes()).unwrap_or_default();
    let supervisor: Vec<CString> = arguments.iter().map(text).collect();
    let Some(path) = supervisor.first().cloned() else { exit(2) };
    let signals = Waiting::for_signals(&[libc::SIGCHLD, libc::SIGTERM, libc::SIGINT, libc::SIGHUP]);
    if set_child_subreaper(Pid::from_raw(1)).is_err() {
        exit(2);
    }
    sys::close_on_exec_but(fds::STATE..=fds::ROOT);
    sys::lock_memory();
    sys::ask_for_priority(PRIORITY);
    let guard = vec![CString::from(c"sinew-guard"), CString::new(GUARD_WORD).unwrap_or_default()];
    // Its own image, also when somebody has replaced the file.
    let mut guard = Child::new(Program::new(c"/proc/self/exe".into(), guard));
    let mut supervisor = Child::new(Program::new(path, supervisor));
    guard.start();
    supervisor.start();
    loop {
        match signals.next() {
            libc::SIGCHLD => reap(&mut guard, &mut supervisor),
            signal @ (libc::SIGTERM | libc::SIGINT | libc::SIGHUP) => {
                let signal = match signal {
                    libc::SIGTERM => Signal::TERM,
                    libc::SIGINT => Signal::INT,
                    _ => Signal::HUP,
                };
                if let Some(pid) = supervisor.pid {
                    let _ = kill_process(pid, signal);
                }
            }
            _ => {}
        }
    }
}

/// Buries whoever has died; one signal may stand for several deaths.
fn reap(guard: &mut Child, supervisor: &mut Child) {
    while let Ok(Some((pid, status))) = waitpid(None, WaitOptions::NOHANG) {
        if Some(pid) == supervisor.pid {
            match status.exit_status() {
                Some(DONE) => end(guard, 0),
                _ => supervisor.start_again(),
            }
        } else if Some(pid) == guard.pid {
            guard.start_again();
        }
    }
}

fn end(guard: &Child, code: i32) -> ! {
    if let Some(pid) = guard.pid {
        let _ = kill_process(pid, Signal::TERM);
        let _ = waitpid(Some(pid), WaitOptions::empty());
    }
    exit(code);
}

impl Child {
    fn new(program: Program) -> Child {
        Child { program, pid: None, deaths: [0; MOST_DEATHS], next: 0 }
    }

    fn start(&mut self) {
        // A robot whose guard or supervisor cannot be had must not go on: without a root every node stops by itself.
        self.pid = self.program.start().ok();
        if self.pid.is_none() {
            exit(GIVEN_UP);
        }
    }

    fn start_again(&mut self) {
        let now = clock_gettime(ClockId::Monotonic);
        let now = now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64;
        let oldest = std::mem::replace(&mut self.deaths[self.next], now);
        self.next = (self.next + 1) % MOST_DEATHS;
        if oldest != 0 && now - oldest < WINDOW_NS {
            exit(GIVEN_UP);
        }
        self.start();
    }
}
