//! Witnesses: a thread per processor that does nothing but note when it was not woken in time.
//!
//! Virtual machines stand still for tens or hundreds of milliseconds. What happened then is nobody's hang.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use runtime::{Time, clock};
use rustix::thread::{CpuSet, sched_setaffinity};

/// How often a witness looks [s].
const LOOK_S: f64 = 0.01;
/// A wake that is later than this is a stall [s].
const STALL_S: f64 = 0.005;
/// Stalls that a witness remembers.
const REMEMBERED: usize = 64;

/// One per processor.
pub(crate) struct Witnesses {
    seen: Vec<Arc<Seen>>,
    stop: Arc<AtomicBool>,
}

/// The last stalls, as (begin, end) [ns], in a ring.
struct Seen {
    stalls: [(AtomicU64, AtomicU64); REMEMBERED],
    count: AtomicU64,
}

impl Witnesses {
    /// None: nothing is ever excused.
    #[cfg(test)]
    pub fn none() -> Witnesses {
        Witnesses { seen: Vec::new(), stop: Arc::default() }
    }

    /// Starts one per processor that this process may use.
    pub fn start() -> Witnesses {
        let stop: Arc<AtomicBool> = Arc::default();
        let allowed = rustix::thread::sched_getaffinity(None).ok();
        let processors = (0..CpuSet::MAX_CPU).filter(|&cpu| allowed.as_ref().is_some_and(|set| set.is_set(cpu)));
        let mut seen = Vec::new();
        for cpu in processors {
            let own = Arc::new(Seen { stalls: std::array::from_fn(|_| Default::default()), count: AtomicU64::new(0) });
            let (theirs, stop) = (own.clone(), stop.clone());
            let thread = std::thread::Builder::new().name(format!("witness.{cpu}")).stack_size(64 << 10);
            if thread.spawn(move || watch(cpu, &theirs, &stop)).is_ok() {
                seen.push(own);
            }
        }
        Witnesses { seen, stop }
    }

    /// For how long between `from` and `to` some processor stood still [s].
    pub fn stalled_s(&self, from: Time, to: Time) -> f64 {
        let overlap = |stall: &(AtomicU64, AtomicU64)| {
            let begin = stall.0.load(Ordering::Relaxed).max(from.nanos());
            let end = stall.1.load(Ordering::Relaxed).min(to.nanos());
            end.saturating_sub(begin) as f64 * 1e-9
        };
        let of_one = |seen: &Arc<Seen>| seen.stalls.iter().map(overlap).sum::<f64>();
        self.seen.iter().map(of_one).fold(0.0, f64::max)
    }
}

impl Drop for Witnesses {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn watch(cpu: usize, seen: &Seen, stop: &AtomicBool) {
    let mut set = CpuSet::new();
    set.set(cpu);
    // On another processor it would witness that one: no harm.
    let _ = sched_setaffinity(None, &set);
    runtime::realtime::ask_for_fifo(WITNESS_PRIORITY);
    let mut next = clock::now();
    while !stop.load(Ordering::Relaxed) {
        next = next.after_s(LOOK_S);
        clock::sleep_until(next);
        let now = clock::now();
        if now.since(next) > STALL_S {
            let slot = seen.count.fetch_add(1, Ordering::Relaxed) as usize % REMEMBERED;
            seen.stalls[slot].0.store(next.nanos(), Ordering::Relaxed);
            seen.stalls[slot].1.store(now.nanos(), Ordering::Relaxed);
            next = now;
        }
    }
}

/// Above every node: a node's own work is no stall of the machine.
const WITNESS_PRIORITY: u8 = 97;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stalls_count_as_far_as_they_overlap_and_the_worst_processor_counts() {
        let seen = |stalls: &[(u64, u64)]| {
            let own = Seen { stalls: std::array::from_fn(|_| Default::default()), count: AtomicU64::new(0) };
            for (slot, (begin, end)) in own.stalls.iter().zip(stalls) {
                slot.0.store(begin * 1_000_000, Ordering::Relaxed);
                slot.1.store(end * 1_000_000, Ordering::Relaxed);
            }
            Arc::new(own)
        };
        let witnesses = Witnesses { seen: vec![seen(&[(0, 50), (90, 200)]), seen(&[(60, 70)])], stop: Arc::default() };
        let at = |ms: u64| Time::from_nanos(ms * 1_000_000);
        assert!((witnesses.stalled_s(at(40), at(100)) - 0.020).abs() < 1e-9);
        assert_eq!(witnesses.stalled_s(at(50), at(90)), 0.010);
        assert_eq!(witnesses.stalled_s(at(300), at(400)), 0.0);
    }
}
