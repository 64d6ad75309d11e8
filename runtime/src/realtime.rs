//! What a thread asked of the kernel, and what it got.

use crate::robot::{RealtimeTable, Scheduler};
use crate::sys;
use std::fmt;

/// Stack that a step may use without a page fault, besides what `open` and `start` touched [byte].
const STACK_BYTES: usize = 48 * 1024;

/// What one thread was granted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grants {
    /// The thread.
    pub thread: String,
    /// Scheduling: what was asked, and the kernel's refusal if there was one.
    pub scheduler: Grant,
    /// Memory locked.
    pub memory: Grant,
    /// Limit on running without a sleep.
    pub runaway: Grant,
}

/// The kernel's answer to one wish.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Grant {
    /// The robot file does not ask for it.
    NotAsked,
    /// Granted: what.
    Granted(String),
    /// Refused: what, why, and what to do.
    Refused(String),
}

impl Grants {
    /// Whether anything was refused.
    pub fn refused(&self) -> bool {
        [&self.scheduler, &self.memory, &self.runaway].iter().any(|grant| matches!(grant, Grant::Refused(_)))
    }
}

/// Asks the kernel for what `wishes` say, for the calling thread.
pub fn apply(wishes: &RealtimeTable, priority: u8, thread: &str) -> Grants {
    sys::no_timer_slack();
    let memory = if wishes.lock_memory {
        match sys::lock_memory() {
            Ok(()) => {
                sys::prefault_stack::<STACK_BYTES>();
                Grant::Granted("locked on touch, stack prefaulted".into())
            }
            Err(e) => Grant::Refused(format!(
                "memory not locked ({e}): raise `ulimit -l` (memlock in /etc/security/limits.conf) or grant CAP_IPC_LOCK"
            )),
        }
    } else {
        Grant::NotAsked
    };
    let runaway = match wishes.runaway_ms {
        0 => Grant::NotAsked,
        ms => match sys::limit_runaway(u64::from(ms) * 1000) {
            Ok(()) => Grant::Granted(format!("{ms} ms without a sleep")),
            Err(e) => Grant::Refused(format!("no limit on runaways ({e})")),
        },
    };
    // Last: from here on the thread may shut others out.
    let scheduler = match wishes.scheduler {
        Scheduler::Other => Grant::NotAsked,
        Scheduler::Fifo => match sys::set_fifo(priority) {
            Ok(()) => Grant::Granted(format!("SCHED_FIFO {priority}")),
            Err(e) => Grant::Refused(format!(
                "SCHED_FIFO {priority} refused ({e}): grant CAP_SYS_NICE or rtprio in /etc/security/limits.conf; inside a \
                 cpu control group also cpu.rt_runtime_us"
            )),
        },
    };
    Grants { thread: thread.into(), scheduler, memory, runaway }
}

/// Asks for SCHED_FIFO at `priority` for the calling thread; whether it was granted. For what stands above nodes.
pub fn ask_for_fifo(priority: u8) -> bool {
    sys::set_fifo(priority).is_ok()
}

impl fmt::Display for Grants {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.thread)?;
        let named = [("scheduler", &self.scheduler), ("memory", &self.memory), ("runaway limit", &self.runaway)];
        for (index, (name, grant)) in named.into_iter().enumerate() {
            let separator = if index == 0 { "" } else { "; " };
            match grant {
                Grant::NotAsked => write!(f, "{separator}{name} not asked for")?,
                Grant::Granted(what) => write!(f, "{separator}{name} granted ({what})")?,
                Grant::Refused(why) => write!(f, "{separator}{name} REFUSED: {why}")?,
            }
        }
        Ok(())
    }
}

/// Shifts the real-time priority of every thread of process `pid` by `by`; threads that are gone or have none are left
/// out.
pub fn shift_priorities(pid: i32, by: i32) {
    let tasks = std::fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
    for tid in tasks.filter_map(|entry| entry.file_name().to_str()?.parse().ok()) {
        // One that ended meanwhile needs no priority; one that may not be raised goes on as it is.
        let _ = sys::shift_fifo(tid, by);
    }
}
