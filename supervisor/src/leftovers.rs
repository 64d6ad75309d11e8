//! What a supervisor that was killed has left: processes that did not stop by themselves, and files.

use std::fs;
use std::os::fd::{AsFd, OwnedFd};
use std::time::Duration;

use runtime::{Time, clock};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Signal, pidfd_send_signal};

use crate::claim::Claim;
use crate::owner::{Owner, owner};
use crate::proc;

/// Time that leftover processes have between SIGTERM and SIGKILL, s; and to vanish after it.
const GRACE_S: f64 = 2.0;
/// What processes fork while they are being killed is looked for again, so many times.
const SWEEPS: usize = 20;

/// What was found and removed.
#[derive(Debug, Clone, PartialEq)]
pub struct Leftovers {
    /// The supervisor that left it, if it can still be told.
    pub owner: Option<Owner>,
    /// Processes that were stopped.
    pub stopped: usize,
    /// Processes among them that had to be killed.
    pub killed: usize,
    /// Files removed.
    pub files: usize,
}

impl Leftovers {
    /// All of it in one line.
    pub fn sentence(&self) -> String {
        let who = self.owner.as_ref().map_or("an earlier run".to_owned(), |owner| format!("process {}", owner.pid));
        let killed = if self.killed > 0 { format!(" ({} of them killed)", self.killed) } else { String::new() };
        format!(
            "{who} ended without cleaning up: stopped {} processes{killed}, removed {} files",
            self.stopped, self.files
        )
    }
}

/// Stops the processes and removes the files of the run that last held this claim. `None`: it had cleaned up itself.
pub fn clear(claim: &Claim) -> std::io::Result<Option<Leftovers>> {
    let owner = owner(claim.root());
    let processes = owner.as_ref().map_or_else(Vec::new, |owner| processes(claim, owner));
    let (stopped, killed) = stop(processes);
    let also = owner.as_ref().map_or(0, kill_run);
    let files = claim.clear()?;
    let found = Leftovers { owner, stopped: stopped + also, killed: killed + also, files };
    Ok((found.stopped + found.files > 0).then_some(found))
}

/// Kills every process that carries the name of the run; tells how many there were.
pub fn kill_run(owner: &Owner) -> usize {
    let mut killed = 0;
    for _ in 0..SWEEPS {
        let processes = proc::processes_of(&owner.run, owner.start_ticks);
        if processes.is_empty() {
            break;
        }
        killed += processes.len();
        let mut descriptors: Vec<OwnedFd> = processes.into_iter().map(|(_, descriptor)| descriptor).collect();
        signal(&descriptors, Signal::KILL);
        await_deaths(&mut descriptors, clock::now().after_s(GRACE_S));
    }
    killed
}

/// The living processes of an earlier run: those written down, and those that carry its name.
fn processes(claim: &Claim, owner: &Owner) -> Vec<OwnedFd> {
    let mut found = proc::processes_of(&owner.run, owner.start_ticks);
    let entries = fs::read_dir(claim.run_folder()).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| entry.file_name().to_string_lossy().ends_with(".pid")) {
        let text = fs::read_to_string(entry.path()).unwrap_or_default();
        let mut numbers = text.split_ascii_whitespace();
        let pid = numbers.next().and_then(|word| word.parse().ok());
        let ticks = numbers.next().and_then(|word| word.parse().ok());
        if let (Some(pid), Some(ticks)) = (pid, ticks)
            && found.iter().all(|(known, _)| *known != pid)
            && let Some(descriptor) = proc::open(pid, ticks)
        {
            found.push((pid, descriptor));
        }
    }
    found.into_iter().map(|(_, descriptor)| descriptor).collect()
}

/// Asks the processes to stop and kills those that do not; tells how many there were, and how many were killed.
fn stop(mut processes: Vec<OwnedFd>) -> (usize, usize) {
    let all = processes.len();
    signal(&processes, Signal::TERM);
    signal(&processes, Signal::CONT);
    await_deaths(&mut processes, clock::now().after_s(GRACE_S));
    let stubborn = processes.len();
    signal(&processes, Signal::KILL);
    await_deaths(&mut processes, clock::now().after_s(GRACE_S));
    (all, stubborn)
}

fn signal(processes: &[OwnedFd], signal: Signal) {
    for process in processes {
        // One that is gone already is what is wanted.
        let _ = pidfd_send_signal(process, signal);
    }
}

/// Removes from `processes` those that have ended, until none is left or `until` has come.
fn await_deaths(processes: &mut Vec<OwnedFd>, until: Time) {
    while !processes.is_empty() {
        let left_ns = until.nanos_since(clock::now());
        let timeout = Timespec::try_from(Duration::from_nanos(left_ns)).ok();
        let mut watched: Vec<PollFd<'_>> =
            processes.iter().map(|process| PollFd::from_borrowed_fd(process.as_fd(), PollFlags::IN)).collect();
        let ended = poll(&mut watched, timeout.as_ref());
        let living: Vec<bool> = watched.iter().map(|watch| watch.revents().is_empty()).collect();
        let mut index = 0;
        processes.retain(|_| {
            index += 1;
            living[index - 1]
        });
        if left_ns == 0 || matches!(ended, Err(error) if error != rustix::io::Errno::INTR) {
            return;
        }
    }
}
