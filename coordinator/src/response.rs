//! Whether every task meets its deadline in the worst case: response-time analysis.
//!
//! R = C + Σ ⌈R / T_j⌉·C_j over all tasks j of higher or equal priority, iterated from R = C until it stands still or
//! passes the deadline (Joseph and Pandya 1986; Audsley et al. 1993; exact for preemptive fixed priorities on one
//! processor and D ≤ T; equal priorities are counted against each other, which is safe). All times in nanoseconds.
//! Reckoned with one processor: more of them make it safer.

/// One task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Task {
    /// Its name, for the answer.
    pub name: String,
    /// Shortest time between two releases [ns].
    pub period_ns: u64,
    /// A step must have ended this long after its release [ns].
    pub deadline_ns: u64,
    /// Longest execution of a step [ns].
    pub execution_ns: u64,
    /// A greater one interrupts a smaller one.
    pub priority: u8,
}

/// A task that can miss its deadline.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Miss {
    /// Which.
    pub name: String,
    /// Its deadline [ns].
    pub deadline_ns: u64,
    /// A response that is reached and lies behind the deadline; the worst may be later still [ns].
    pub response_ns: u64,
    /// Those of higher or equal priority that take most of it, the greatest share first.
    pub because_of: Vec<String>,
}

/// Load of the set, 1 for one whole processor.
pub fn utilization(tasks: &[Task]) -> f64 {
    tasks.iter().map(|task| task.execution_ns as f64 / task.period_ns.max(1) as f64).sum()
}

/// The worst response of task `index` if it lies within its deadline, else the first one found behind it [ns].
fn response_ns(tasks: &[Task], index: usize) -> Result<u64, u64> {
    let task = &tasks[index];
    let mut response_ns = task.execution_ns;
    loop {
        if response_ns > task.deadline_ns {
            return Err(response_ns);
        }
        let others = interferers(tasks, index).map(|other| releases(other, response_ns) * other.execution_ns);
        let next_ns = task.execution_ns + others.sum::<u64>();
        if next_ns <= response_ns {
            return Ok(response_ns);
        }
        response_ns = next_ns;
    }
}

fn interferers(tasks: &[Task], index: usize) -> impl Iterator<Item = &Task> {
    let priority = tasks[index].priority;
    tasks.iter().enumerate().filter(move |(k, other)| *k != index && other.priority >= priority).map(|(_, other)| other)
}

fn releases(task: &Task, within_ns: u64) -> u64 {
    within_ns.div_ceil(task.period_ns.max(1))
}

/// Every task that can miss its deadline; none, and the set may be admitted.
pub fn misses(tasks: &[Task]) -> Vec<Miss> {
    let miss = |index: usize| {
        let response_ns = response_ns(tasks, index).err()?;
        let mut shares: Vec<(u64, &str)> = interferers(tasks, index)
            .map(|other| (releases(other, response_ns) * other.execution_ns, other.name.as_str()))
            .filter(|(share, _)| *share > 0)
            .collect();
        shares.sort_by(|a, b| b.cmp(a));
        Some(Miss {
            name: tasks[index].name.clone(),
            deadline_ns: tasks[index].deadline_ns,
            response_ns,
            because_of: shares.into_iter().take(3).map(|(_, name)| name.to_owned()).collect(),
        })
    };
    (0..tasks.len()).filter_map(miss).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn task(name: &str, period_ns: u64, execution_ns: u64, priority: u8) -> Task {
        Task { name: name.into(), period_ns, deadline_ns: period_ns, execution_ns, priority }
    }

    #[test]
    fn the_textbook_set_has_the_textbook_responses() {
        // Burns and Wellings: T = 7, 12, 20; C = 3, 3, 5; R = 3, 6, 20.
        let tasks = [task("a", 7, 3, 3), task("b", 12, 3, 2), task("c", 20, 5, 1)];
        assert_eq!([0, 1, 2].map(|k| response_ns(&tasks, k)), [Ok(3), Ok(6), Ok(20)]);
        assert_eq!(misses(&tasks), []);
    }

    #[test]
    fn who_misses_by_how_much_because_of_whom_is_told() {
        let tasks = [task("fast", 10, 6, 9), task("slow", 20, 9, 5)];
        let miss = &misses(&tasks)[0];
        assert_eq!((miss.name.as_str(), miss.deadline_ns, miss.response_ns), ("slow", 20, 21));
        assert_eq!(miss.because_of, ["fast"]);
    }

    /// All released at once and as often as they may be: preemptive fixed priorities on one processor, to the last
    /// nanosecond. Whether a deadline is missed before `until`.
    fn schedule_misses(tasks: &[Task], until: u64) -> bool {
        let mut left: Vec<u64> = vec![0; tasks.len()];
        let mut released: Vec<u64> = vec![0; tasks.len()];
        for now in 0..until {
            for (k, task) in tasks.iter().enumerate() {
                if now % task.period_ns == 0 {
                    if left[k] > 0 {
                        return true;
                    }
                    (left[k], released[k]) = (task.execution_ns, now);
                }
            }
            let ready = (0..tasks.len()).filter(|&k| left[k] > 0);
            if let Some(k) = ready.max_by_key(|&k| (tasks[k].priority, usize::MAX - k)) {
                left[k] -= 1;
                if left[k] == 0 && now + 1 > released[k] + tasks[k].deadline_ns {
                    return true;
                }
            }
            if (0..tasks.len()).any(|k| left[k] > 0 && now + 1 > released[k] + tasks[k].deadline_ns) {
                return true;
            }
        }
        false
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

        /// Sound: nothing that is admitted misses. Exact: with priorities of its own each, whatever is refused misses.
        #[test]
        fn the_analysis_agrees_with_the_schedule(
            sets in prop::collection::vec((2u64..24, 1u64..8, 1u64..100), 1..5),
        ) {
            let tasks: Vec<Task> = sets.iter().enumerate().map(|(k, &(period_ns, execution_ns, share))| Task {
                name: k.to_string(),
                period_ns,
                deadline_ns: (period_ns * share / 100).max(1),
                execution_ns: execution_ns.min(period_ns),
                priority: k as u8,
            }).collect();
            // The worst case begins when all are released at once; a level's busy period ends within this.
            prop_assert_eq!(!misses(&tasks).is_empty(), schedule_misses(&tasks, 24 * 23 * 22));
        }
    }
}
