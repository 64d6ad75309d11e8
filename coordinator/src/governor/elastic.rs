//! Elastic periods: which node steps how often when there is not time enough for all.
//!
//! Each task asks for the utilisation U₀ = C/T_min and may be stretched to T_max. Where ΣU₀ exceeds what is to be had,
//! U_d, every elastic task gives way in proportion to its elasticity E like a spring:
//! U = U₀ − (ΣU₀ − U_d)·E/ΣE; a task that would be stretched beyond T_max is left there, and the others give way anew
//! (G. Buttazzo, G. Lipari, L. Abeni: Elastic task model for adaptive rate control, RTSS 1998). That is the least sum of
//! squared losses weighted by 1/E (T. Chantem, X. Hu, M. Lemmon 2006), by which the tests judge it.

/// One node's demand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task {
    /// Time of one step [s].
    pub execution_s: f64,
    /// The period that it asks for [s].
    pub shortest_s: f64,
    /// The longest one that still is of use [s].
    pub longest_s: f64,
    /// How readily it gives way; 0: never.
    pub elasticity: f64,
}

impl Task {
    /// Utilisation at the period `period_s`.
    fn utilisation(&self, period_s: f64) -> f64 {
        self.execution_s / period_s
    }

    fn is_elastic(&self) -> bool {
        self.elasticity > 0.0 && self.longest_s > self.shortest_s && self.execution_s > 0.0
    }
}

/// Utilisation of all tasks at the periods that they ask for.
pub fn demand(tasks: &[Task]) -> f64 {
    tasks.iter().map(|task| task.utilisation(task.shortest_s)).sum()
}

/// Finds periods under which the tasks together need no more than `wanted`, as far as their longest periods allow.
/// Answers the utilisation that is left. `periods_s` is as long as `tasks`.
pub fn compress(tasks: &[Task], wanted: f64, periods_s: &mut [f64]) -> f64 {
    // 0 marks a task that still gives way.
    for (period_s, task) in periods_s.iter_mut().zip(tasks) {
        *period_s = if task.is_elastic() { 0.0 } else { task.shortest_s };
    }
    loop {
        let (mut fixed, mut asked, mut elasticity) = (0.0, 0.0, 0.0);
        for (task, &period_s) in tasks.iter().zip(periods_s.iter()) {
            if period_s > 0.0 {
                fixed += task.utilisation(period_s);
            } else {
                asked += task.utilisation(task.shortest_s);
                elasticity += task.elasticity;
            }
        }
        let excess = (fixed + asked - wanted).max(0.0);
        let left = |task: &Task| task.utilisation(task.shortest_s) - excess * task.elasticity / elasticity;
        let mut stretched_out = false;
        for (task, period_s) in tasks.iter().zip(periods_s.iter_mut()) {
            if *period_s == 0.0 && left(task) < task.utilisation(task.longest_s) {
                *period_s = task.longest_s;
                stretched_out = true;
            }
        }
        if !stretched_out {
            for (task, period_s) in tasks.iter().zip(periods_s.iter_mut()) {
                if *period_s == 0.0 {
                    *period_s = (task.execution_s / left(task)).clamp(task.shortest_s, task.longest_s);
                }
            }
            return tasks.iter().zip(periods_s.iter()).map(|(task, &period_s)| task.utilisation(period_s)).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn task(execution_ms: f64, shortest_ms: f64, longest_ms: f64, elasticity: f64) -> Task {
        Task { execution_s: execution_ms / 1e3, shortest_s: shortest_ms / 1e3, longest_s: longest_ms / 1e3, elasticity }
    }

    fn periods_ms(tasks: &[Task], wanted: f64) -> Vec<f64> {
        let mut periods_s = vec![0.0; tasks.len()];
        compress(tasks, wanted, &mut periods_s);
        periods_s.iter().map(|s| s * 1e3).collect()
    }

    #[test]
    fn nothing_gives_way_while_there_is_room() {
        let tasks = [task(2.0, 10.0, 40.0, 1.0), task(3.0, 10.0, 40.0, 1.0)];
        assert_eq!(periods_ms(&tasks, 0.6), [10.0, 10.0]);
    }

    #[test]
    fn the_loss_is_shared_by_elasticity_and_rigid_tasks_keep_theirs() {
        // 0.2 + 0.3 + 0.4 = 0.9; 0.3 too much, shared 1 : 2.
        let tasks = [task(2.0, 10.0, 100.0, 1.0), task(3.0, 10.0, 100.0, 2.0), task(4.0, 10.0, 10.0, 5.0)];
        let periods = periods_ms(&tasks, 0.6);
        assert!((periods[0] - 20.0).abs() < 1e-9 && (periods[1] - 30.0).abs() < 1e-9, "{periods:?}");
        assert_eq!(periods[2], 10.0);
    }

    #[test]
    fn who_is_stretched_out_leaves_the_rest_to_the_others() {
        let tasks = [task(2.0, 10.0, 100.0, 1.0), task(3.0, 10.0, 12.0, 2.0)];
        let periods = periods_ms(&tasks, 0.35);
        assert_eq!(periods[1], 12.0);
        assert!((periods[0] - 20.0).abs() < 1e-9, "{periods:?}");
    }

    #[test]
    fn more_than_all_can_give_is_answered_with_what_is_left() {
        let tasks = [task(5.0, 10.0, 20.0, 1.0), task(5.0, 10.0, 10.0, 0.0)];
        let mut periods_s = [0.0; 2];
        assert_eq!(compress(&tasks, 0.3, &mut periods_s), 0.75);
    }

    fn some_task() -> impl Strategy<Value = Task> {
        (0.1..5.0f64, 5.0..50.0f64, 1.0..5.0f64, prop_oneof![Just(0.0), 0.1..5.0f64]).prop_map(
            |(execution, shortest, factor, elasticity)| task(execution, shortest, shortest * factor, elasticity),
        )
    }

    proptest! {
        #[test]
        fn periods_stay_within_bounds_and_the_load_within_what_is_to_be_had(
            tasks in prop::collection::vec(some_task(), 1..12), wanted in 0.05..2.0f64,
        ) {
            let mut periods_s = vec![0.0; tasks.len()];
            let left = compress(&tasks, wanted, &mut periods_s);
            let longest = |task: &Task| if task.is_elastic() { task.longest_s } else { task.shortest_s };
            let least: f64 = tasks.iter().map(|task| task.utilisation(longest(task))).sum();
            for (task, period_s) in tasks.iter().zip(&periods_s) {
                prop_assert!((task.shortest_s..=longest(task)).contains(period_s));
            }
            prop_assert!(left <= wanted.max(least) + 1e-9, "{left} of {wanted}, least {least}");
            prop_assert!(left >= demand(&tasks).min(wanted) - 1e-9, "no more is taken away than need be");
        }

        /// No exchange of a little load between two tasks makes the weighted sum of squared losses smaller.
        #[test]
        fn no_other_sharing_loses_less(tasks in prop::collection::vec(some_task(), 2..8), share in 0.05..0.95f64) {
            let mut periods_s = vec![0.0; tasks.len()];
            let least = compress(&tasks, 0.0, &mut periods_s);
            let wanted = least + share * (demand(&tasks) - least);
            let left = compress(&tasks, wanted, &mut periods_s);
            prop_assert!((left - wanted).abs() < 1e-9);
            let loss = |k: usize, period_s: f64| {
                let task = &tasks[k];
                let lost = task.utilisation(task.shortest_s) - task.utilisation(period_s);
                lost * lost / task.elasticity
            };
            for (a, b) in (0..tasks.len()).flat_map(|a| (0..tasks.len()).map(move |b| (a, b))) {
                if a == b || !tasks[a].is_elastic() || !tasks[b].is_elastic() {
                    continue;
                }
                let little = 1e-4;
                let other = |k: usize, change: f64| {
                    let u = tasks[k].utilisation(periods_s[k]) + change;
                    (u > 0.0).then(|| tasks[k].execution_s / u)
                        .filter(|s| (tasks[k].shortest_s..=tasks[k].longest_s).contains(s))
                };
                if let (Some(more), Some(less)) = (other(a, little), other(b, -little)) {
                    let now = loss(a, periods_s[a]) + loss(b, periods_s[b]);
                    prop_assert!(loss(a, more) + loss(b, less) >= now - 1e-12);
                }
            }
        }
    }
}
