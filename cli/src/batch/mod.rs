//! Batches of missions: a scenario, a mission per seed, what each was like, and what they say together.
//!
//! Every finished mission is a line of the CSV file at once, so that whatever ends the batch loses nothing; `--resume`
//! goes on with the seeds that are not in it. Tracks are not kept: a failure is simulated anew when it is drawn, and is
//! the same to the last bit.

mod compare;
mod faults;
mod figures;
mod histogram;
mod mission;
mod report;
mod scenario;
mod shrink;
mod table;

pub use compare::{Comparison, compare};
pub use faults::{Faults, to_toml};
pub use figures::Figures;
pub use mission::{Mission, NodeCost};
pub use report::{Failed, Frame, html};
pub use scenario::{Scenario, ScenarioError};
pub use shrink::shrink;
pub use table::{Table, TableError, heading, line, parse};

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Works `seeds` off on `jobs` threads, and hands each mission to `done`, which says whether to go on. Answers the
/// missions that were finished, in the order of their seeds, and the first error.
pub fn work<E: Send>(
    seeds: &[u64],
    jobs: usize,
    mission: &(dyn Fn(u64) -> Result<Mission, E> + Sync),
    done: &mut (dyn FnMut(&Mission) -> bool + Send),
) -> (Vec<Mission>, Option<E>) {
    let next = AtomicUsize::new(0);
    let shared = Mutex::new((Vec::new(), None, done));
    let worker = || {
        while let Some(seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
            let outcome = mission(*seed);
            let mut shared = shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let (missions, error, done) = &mut *shared;
            let go_on = match outcome {
                Ok(mission) => {
                    let go_on = done(&mission);
                    missions.push(mission);
                    go_on
                }
                Err(e) => {
                    error.get_or_insert(e);
                    false
                }
            };
            if !go_on {
                next.store(seeds.len(), Ordering::Relaxed);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..jobs.clamp(1, seeds.len().max(1)) {
            scope.spawn(worker);
        }
        worker();
    });
    let (mut missions, error, _) = shared.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    missions.sort_by_key(|mission: &Mission| mission.seed);
    (missions, error)
}

#[cfg(test)]
mod tests;
