//! What each node asks of the processors: measured from the counters that the supervisor publishes, and the periods
//! under which all of them fit.
//!
//! The cost C of a node is the mean time on a processor of its newest steps, smoothed; its load is C over its period, and
//! C times its rate where samples release it. Where there is too little for all, the least important nodes are stretched
//! first, those of one importance together as Buttazzo's springs ([`super::elastic`]); when all are stretched out, the
//! least important ones that may be are suspended, one by one, and the others are stretched anew.

use super::elastic::{Task, compress};
use messages::{NODE_NAME_BYTES, NodeLoad};

/// Weight of the newest steps in the mean cost of a step.
const NEWEST: f64 = 0.5;
/// Weight of the newest look in a node's rate.
const RATE_NEWEST: f64 = 0.2;

/// One node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// Number of its path.
    pub node: u32,
    /// Its instance name, filled up with zeros.
    pub name: [u8; NODE_NAME_BYTES],
    /// How little the robot can do without it.
    pub importance: u32,
    /// The period that the robot file asks for; 0 where samples release it [s].
    pub shortest_s: f64,
    /// The longest that it allows [s].
    pub longest_s: f64,
    /// The period that the present rule asks for, within those [s].
    pub asked_s: f64,
    /// Mean time on a processor of a step [s].
    pub cost_s: f64,
    /// Deadlines missed since the look before.
    pub misses: u64,
    /// The period that it has now [s].
    pub period_s: f64,
    /// It does not step now.
    pub suspended: bool,
    rate_hz: f64,
    counters: [u64; 3],
    seen: bool,
}

impl Demand {
    /// A node that was not seen before, with its own period.
    pub fn new(load: &NodeLoad) -> Demand {
        let shortest_s = load.shortest_ns as f64 * 1e-9;
        Demand {
            node: load.node,
            name: load.name,
            importance: load.importance,
            shortest_s,
            longest_s: (load.longest_ns as f64 * 1e-9).max(shortest_s),
            asked_s: shortest_s,
            cost_s: 0.0,
            misses: 0,
            period_s: shortest_s,
            suspended: false,
            rate_hz: 0.0,
            counters: [0; 3],
            seen: false,
        }
    }

    /// Takes in what it has done in `dt_s`.
    pub fn measure(&mut self, load: &NodeLoad, dt_s: f64) {
        let now = [load.steps, load.busy_ns, load.missed_deadlines];
        let before = std::mem::replace(&mut self.counters, now);
        // The first look, or another process of the node: nothing to compare with.
        let known = std::mem::replace(&mut self.seen, true) && now.iter().zip(&before).all(|(now, then)| now >= then);
        self.misses = if known { now[2] - before[2] } else { 0 };
        if !known || dt_s <= 0.0 {
            return;
        }
        let steps = (now[0] - before[0]) as f64;
        self.rate_hz += RATE_NEWEST * (steps / dt_s - self.rate_hz);
        if steps > 0.0 {
            let cost_s = (now[1] - before[1]) as f64 * 1e-9 / steps;
            self.cost_s = if self.cost_s > 0.0 { self.cost_s + NEWEST * (cost_s - self.cost_s) } else { cost_s };
        }
    }

    /// Processors that it takes at `period_s`.
    fn load(&self, period_s: f64) -> f64 {
        let released = self.cost_s * self.rate_hz;
        match period_s > 0.0 {
            false => released,
            // The grid alone: a starved node does not get to step as often as it would.
            true if self.is_elastic() => self.cost_s / period_s,
            true => released.max(self.cost_s / period_s),
        }
    }

    /// Processors that it takes as it is.
    pub fn present(&self) -> f64 {
        if self.suspended { 0.0 } else { self.load(self.period_s) }
    }

    /// Whether its period may be stretched.
    pub fn is_elastic(&self) -> bool {
        self.longest_s > self.shortest_s
    }

    /// Its name.
    pub fn name(&self) -> &str {
        let end = self.name.iter().position(|byte| *byte == 0).unwrap_or(self.name.len());
        std::str::from_utf8(&self.name[..end]).unwrap_or("?")
    }
}

/// What a node is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Given {
    /// Its period [s].
    pub period_s: f64,
    /// Whether it does not step at all.
    pub suspended: bool,
}

/// Finds periods; made once, so that finding them allocates nothing.
#[derive(Debug, Clone)]
pub struct Planner {
    /// What each node is given, in the order of the demands.
    pub given: Vec<Given>,
    tasks: Vec<Task>,
    periods_s: Vec<f64>,
}

impl Planner {
    /// For up to `nodes` nodes.
    pub fn new(nodes: usize) -> Planner {
        Planner {
            given: Vec::with_capacity(nodes),
            tasks: Vec::with_capacity(nodes),
            periods_s: Vec::with_capacity(nodes),
        }
    }

    /// Gives every node a period so that together they take no more than `wanted` processors, as far as that can be;
    /// nodes less important than `suspend_below` may be suspended for it. Answers what they take then.
    pub fn plan(&mut self, demands: &[Demand], wanted: f64, suspend_below: u32) -> f64 {
        self.given.clear();
        let own = |demand: &Demand| Given { period_s: demand.asked_s, suspended: false };
        self.given.extend(demands.iter().map(own));
        loop {
            let taken = self.stretch(demands, wanted);
            if taken <= wanted + 1e-9 {
                return taken;
            }
            let candidates = demands.iter().zip(&self.given).enumerate().filter(|(_, (demand, given))| {
                demand.importance < suspend_below && demand.shortest_s > 0.0 && !given.suspended && demand.cost_s > 0.0
            });
            let least = candidates.min_by_key(|(_, (demand, _))| (demand.importance, demand.node));
            let Some(index) = least.map(|(index, _)| index) else { return taken };
            self.given[index].suspended = true;
        }
    }

    /// Stretches those that are not suspended, the least important first.
    fn stretch(&mut self, demands: &[Demand], wanted: f64) -> f64 {
        let Planner { given, tasks, periods_s } = self;
        given.iter_mut().zip(demands).for_each(|(given, demand)| given.period_s = demand.asked_s);
        let mut above = None;
        loop {
            let loads = demands.iter().zip(given.iter()).filter(|(_, given)| !given.suspended);
            let taken: f64 = loads.map(|(demand, given)| demand.load(given.period_s)).sum();
            let classes = demands.iter().filter(|demand| demand.is_elastic()).map(|demand| demand.importance);
            let class = classes.filter(|importance| above.is_none_or(|above| *importance > above)).min();
            let Some(class) = class.filter(|_| taken > wanted + 1e-9) else { return taken };
            above = Some(class);
            tasks.clear();
            periods_s.clear();
            for (demand, given) in demands.iter().zip(given.iter()).filter(|(_, given)| !given.suspended) {
                let gives_way = demand.is_elastic() && demand.importance == class;
                // One that does not give way counts with its load, whatever its period.
                tasks.push(Task {
                    execution_s: if gives_way { demand.cost_s } else { demand.load(given.period_s) },
                    shortest_s: if gives_way { demand.asked_s } else { 1.0 },
                    longest_s: if gives_way { demand.longest_s } else { 1.0 },
                    elasticity: f64::from(u8::from(gives_way)),
                });
                periods_s.push(0.0);
            }
            compress(tasks, wanted, periods_s);
            let running = demands.iter().zip(given.iter_mut()).filter(|(_, given)| !given.suspended);
            for ((demand, given), period_s) in running.zip(periods_s.iter()) {
                if demand.is_elastic() && demand.importance == class {
                    given.period_s = *period_s;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn demand(node: u32, importance: u32, cost_ms: f64, shortest_ms: f64, longest_ms: f64) -> Demand {
        let ns = |ms: f64| (ms * 1e6) as u64;
        let load = NodeLoad {
            node,
            importance,
            shortest_ns: ns(shortest_ms),
            longest_ns: ns(longest_ms),
            ..NodeLoad::default()
        };
        Demand { cost_s: cost_ms / 1e3, ..Demand::new(&load) }
    }

    fn planned(demands: &[Demand], wanted: f64, suspend_below: u32) -> (f64, Vec<Given>) {
        let mut planner = Planner::new(demands.len());
        let taken = planner.plan(demands, wanted, suspend_below);
        (taken, planner.given)
    }

    fn ms(given: &Given) -> f64 {
        (given.period_s * 1e5).round() / 100.0
    }

    #[test]
    fn the_least_important_give_way_first_and_the_others_only_when_that_is_not_enough() {
        let demands = [demand(1, 90, 4.0, 10.0, 40.0), demand(2, 20, 4.0, 10.0, 40.0), demand(3, 50, 2.0, 10.0, 10.0)];
        let (taken, given) = planned(&demands, 0.8, 0);
        assert_eq!((ms(&given[0]), ms(&given[1])), (10.0, 20.0));
        assert!((taken - 0.8).abs() < 1e-9);
        let (_, given) = planned(&demands, 0.5, 0);
        assert_eq!((ms(&given[0]), ms(&given[1])), (20.0, 40.0));
    }

    #[test]
    fn whoever_may_be_is_suspended_when_all_are_stretched_out_and_the_others_have_more_again() {
        let demands = [demand(1, 90, 4.0, 10.0, 20.0), demand(2, 20, 4.0, 10.0, 20.0)];
        let (taken, given) = planned(&demands, 0.3, 50);
        assert!(given[1].suspended && !given[0].suspended);
        assert!((taken - 0.3).abs() < 1e-9 && ms(&given[0]) < 20.0, "{given:?}");
        let (taken, given) = planned(&demands, 0.3, 10);
        assert!(given.iter().all(|given| !given.suspended) && taken > 0.39, "nobody may be");
    }

    #[test]
    fn a_process_that_begins_anew_is_measured_anew() {
        let mut demand = demand(1, 50, 0.0, 10.0, 10.0);
        let load = |steps: u64, busy_ns: u64| NodeLoad { steps, busy_ns, ..NodeLoad::default() };
        demand.measure(&load(100, 50_000_000), 0.02);
        assert_eq!(demand.cost_s, 0.0, "nobody knows since when");
        demand.measure(&load(102, 54_000_000), 0.02);
        assert!((demand.cost_s - 2e-3).abs() < 1e-9);
        demand.measure(&load(1, 9_000_000), 0.02);
        assert!((demand.cost_s - 2e-3).abs() < 1e-9, "another process");
    }

    proptest! {
        #[test]
        fn nobody_leaves_its_bounds_and_no_more_is_taken_away_than_need_be(
            nodes in prop::collection::vec((0..4u32, 0.1..5.0f64, 5.0..50.0f64, 1.0..5.0f64), 1..10), wanted in 0.05..2.0f64,
        ) {
            let demands: Vec<Demand> = nodes.iter().enumerate().map(|(k, &(importance, cost, shortest, factor))| {
                demand(k as u32, 10 * importance, cost, shortest, shortest * factor)
            }).collect();
            let asked: f64 = demands.iter().map(Demand::present).sum();
            let (taken, given) = planned(&demands, wanted, 15);
            for (demand, given) in demands.iter().zip(&given) {
                prop_assert!((demand.shortest_s - 1e-12..=demand.longest_s + 1e-12).contains(&given.period_s));
                prop_assert!(!given.suspended || demand.importance < 15);
            }
            if given.iter().all(|given| !given.suspended) {
                prop_assert!(taken >= asked.min(wanted) - 1e-6);
            }
            // A more important one is stretched only when all less important ones are stretched out.
            for (a, given_a) in demands.iter().zip(&given).filter(|(_, given)| !given.suspended) {
                for (b, given_b) in demands.iter().zip(&given).filter(|(_, given)| !given.suspended) {
                    if a.importance > b.importance && given_a.period_s > a.asked_s * (1.0 + 1e-9) {
                        prop_assert!(given_b.period_s >= b.longest_s * (1.0 - 1e-9));
                    }
                }
            }
        }
    }
}
