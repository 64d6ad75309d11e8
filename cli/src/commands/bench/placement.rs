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
    /// A core each, SCHED_FIFO where it is granted: what waking another core adds.
    TwoCores,
    /// Wherever the kernel puts them, SCHED_OTHER: one or two cores, as it comes.
    Free,
}

impl Placement {
    /// Those that this machine has the cores for.
    pub fn all() -> Vec<Placement> {
        let mut all = vec![Placement::SameCore, Placement::TwoCores, Placement::Free];
        all.retain(|placement| *placement != Placement::TwoCores || processors().len() > 1);
        all
    }

    /// Its name in rows.
    pub fn name(self) -> &'static str {
        match self {
            Placement::SameCore => "same_core",
            Placement::TwoCores => "two_cores",
            Placement::Free => "free",
        }
    }

    /// Puts the calling thread there, in the first or the second process; says how it is scheduled now.
    pub fn enter(self, second: bool) -> String {
        if self == Placement::Free {
            realtime::apply(&RealtimeTable::default(), PRIORITY, "bench");
            return "SCHED_OTHER, not pinned".into();
        }
        let cores = processors();
        let back = if second && self == Placement::TwoCores { 2 } else { 1 };
        let core = cores.len().checked_sub(back).map_or(0, |index| cores[index]);
        let pinned = if pin(core) { format!("pinned to core {core}") } else { "not pinned".into() };
        let wishes = RealtimeTable { scheduler: Scheduler::Fifo, lock_memory: false, runaway_ms: 0 };
        match realtime::apply(&wishes, PRIORITY, "bench").scheduler {
            Grant::Granted(what) => format!("{what}, {pinned}"),
            _ => format!("SCHED_OTHER (SCHED_FIFO refused), {pinned}"),
        }
    }
}

/// Whether two answers of [`Placement::enter`] name the same scheduling, whatever the core.
pub fn is_alike(one: &str, other: &str) -> bool {
    one.split(',').next() == other.split(',').next()
}

/// Keeps the calling thread on `core`.
pub fn pin(core: usize) -> bool {
    let mut set = rustix::thread::CpuSet::new();
    set.set(core);
    rustix::thread::sched_setaffinity(None, &set).is_ok()
}
