//! Stall witnesses: a thread per core that sleeps a millisecond at a time and notes every gap. On a shared or virtual
//! machine the whole core is taken away now and then; a witness tells such a moment from a slow program.

use super::machine::processors;
use runtime::clock;
use runtime::realtime::{self, Grant};
use runtime::robot::{RealtimeTable, Scheduler};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Sleep of a witness [s].
pub const PERIOD_S: f64 = 0.001;
/// A wake-up later than this after the one before is a gap [ns].
pub const GAP_NS: u64 = 3_000_000;
/// Gaps that are kept, per core; more are counted only.
const MOST_GAPS: usize = 1 << 16;
/// Above everything else.
const PRIORITY: u8 = 99;

/// A time in which a core did not run its witness, on CLOCK_MONOTONIC [ns].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gap {
    /// Last sign of life before.
    pub from_ns: u64,
    /// First sign of life after.
    pub to_ns: u64,
}

/// What the witnesses of all cores saw.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Testimony {
    /// Gaps by their beginning.
    pub gaps: Vec<Gap>,
    /// How the witnesses were scheduled.
    pub scheduler: String,
}

impl Testimony {
    /// The longest gap [ms].
    pub fn longest_ms(&self) -> f64 {
        let longest = self.gaps.iter().map(|gap| gap.to_ns - gap.from_ns).max();
        longest.unwrap_or(0) as f64 * 1e-6
    }
}

/// Running witnesses.
pub struct Witnesses {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<(Vec<Gap>, Grant)>>,
}

impl Witnesses {
    /// Starts one per core that this process may use.
    pub fn start() -> std::io::Result<Witnesses> {
        let stop = Arc::new(AtomicBool::new(false));
        let mut threads = Vec::new();
        for core in processors() {
            let stop = stop.clone();
            let name = format!("witness {core}");
            threads.push(std::thread::Builder::new().name(name).spawn(move || watch(core, &stop))?);
        }
        Ok(Witnesses { stop, threads })
    }

    /// Ends them and collects what they saw.
    pub fn stop(self) -> Testimony {
        self.stop.store(true, Ordering::Relaxed);
        let mut all = Testimony::default();
        for thread in self.threads {
            let Ok((gaps, grant)) = thread.join() else { continue };
            all.gaps.extend(gaps);
            all.scheduler = match grant {
                Grant::Granted(what) => what,
                Grant::Refused(_) => "SCHED_OTHER (real-time scheduling refused)".into(),
                Grant::NotAsked => "SCHED_OTHER".into(),
            };
        }
        all.gaps.sort_by_key(|gap| gap.from_ns);
        all
    }
}

fn watch(core: usize, stop: &AtomicBool) -> (Vec<Gap>, Grant) {
    super::placement::pin(core);
    let wishes = RealtimeTable { scheduler: Scheduler::Fifo, lock_memory: false, runaway_ms: 0 };
    let grant = realtime::apply(&wishes, PRIORITY, "witness").scheduler;
    let mut gaps = Vec::with_capacity(MOST_GAPS);
    let mut last = clock::now();
    while !stop.load(Ordering::Relaxed) {
        clock::sleep_until(last.after_s(PERIOD_S));
        let now = clock::now();
        if now.nanos() - last.nanos() > GAP_NS && gaps.len() < MOST_GAPS {
            gaps.push(Gap { from_ns: last.nanos(), to_ns: now.nanos() });
        }
        last = now;
    }
    (gaps, grant)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_gap_is_told_in_milliseconds() {
        let gaps = vec![Gap { from_ns: 10, to_ns: 20 }, Gap { from_ns: 50, to_ns: 2_000_050 }];
        let seen = Testimony { gaps, scheduler: String::new() };
        assert_eq!(seen.longest_ms(), 2.0);
    }

    #[test]
    fn a_witness_lives_until_it_is_told_to_stop() {
        let witnesses = Witnesses::start().unwrap();
        assert_eq!(witnesses.threads.len(), processors().len());
        let seen = witnesses.stop();
        assert!(!seen.scheduler.is_empty());
    }
}
