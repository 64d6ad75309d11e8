//! Where the two processes of a measurement run, and how they are scheduled.

use super::machine::processors;
use runtime::realtime::{self, Grant};
use runtime::robot::{RealtimeTable, Scheduler};

/// Real-time priority of both processes: below the witnesses, above everything ordinary.
const PRIORITY: u8 = 80;

/// Cores and scheduling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Placement {
    /// Both on one core, SCHED_FIFO where it is granted: the cost of the software.
    SameCore,
    /// Wherever the kernel puts them, SCHED_OTHER: includes waking another core.
    Free,
}

impl Placement {
    /// All.
    pub const ALL: [Placement; 2] = [Placement::SameCore, Placement::Free];

    /// Its name in rows.
    pub fn name(self) -> &'static str {
        match self {
            Placement::SameCore => "same_core",
            Placement::Free => "free",
        }
    }

    /// Puts the calling thread there; says how it is scheduled now.
    pub fn enter(self) -> String {
        match self {
            Placement::Free => {
                realtime::apply(&RealtimeTable::default(), PRIORITY, "bench");
                "SCHED_OTHER, not pinned".into()
            }
            Placement::SameCore => {
                let core = processors().last().copied().unwrap_or(0);
                let pinned = if pin(core) { format!("pinned to core {core}") } else { "not pinned".into() };
                let wishes = RealtimeTable { scheduler: Scheduler::Fifo, lock_memory: false, runaway_ms: 0 };
                match realtime::apply(&wishes, PRIORITY, "bench").scheduler {
                    Grant::Granted(what) => format!("{what}, {pinned}"),
                    _ => format!("SCHED_OTHER (SCHED_FIFO refused), {pinned}"),
                }
            }
        }
    }
}

/// Keeps the calling thread on `core`.
pub fn pin(core: usize) -> bool {
    let mut set = rustix::thread::CpuSet::new();
    set.set(core);
    rustix::thread::sched_setaffinity(None, &set).is_ok()
}
