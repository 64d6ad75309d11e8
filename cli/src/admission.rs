//! Whether the nodes of a robot file can keep their deadlines together, by response-time analysis at their budgets.
//!
//! A node counts with `budget_ms`, its deadline, its priority and the shortest time between two of its releases: its
//! period, or that of whoever triggers it. Nodes without a budget are not reckoned with; `sinew check` says how many are.
//! On a running robot they count with what was measured ([`judge_with`]).

use coordinator::response::{Task, misses, utilization};
use runtime::robot::{Graph, NodeSpec, RobotError};

/// What the analysis found.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Nodes that were reckoned with.
    pub reckoned: usize,
    /// Their load, 1 for one whole processor.
    pub utilization: f64,
    /// Each node that can miss its deadline.
    pub errors: Vec<RobotError>,
    /// Their names, in the same order.
    pub missing: Vec<String>,
}

/// The shortest time between two releases of node `index` [ns]; `None` where nobody knows.
fn period_ns(graph: &Graph, index: usize, depth: usize) -> Option<u64> {
    let spec = &graph.nodes[index].spec;
    let by_device = spec.triggers.iter().any(|trigger| trigger == "device");
    let triggers = graph.edges.iter().filter(|edge| edge.to == index && edge.triggers);
    // A chain that is longer than the robot has nodes runs in a circle.
    let triggered = triggers.filter_map(|edge| period_ns(graph, edge.from, depth.checked_sub(1)?)).min();
    match (spec.period_ns, triggered) {
        (Some(own), Some(other)) => Some(own.min(other)),
        (Some(own), None) => Some(own),
        (None, other) if !by_device => other,
        (None, _) => None,
    }
}

/// Reckons with every node of `graph` that has a budget.
pub fn judge(graph: &Graph, file: &str) -> Verdict {
    judge_with(graph, file, &|_| None)
}

/// The same, with what was `measured` of nodes without a budget [ns].
pub fn judge_with(graph: &Graph, file: &str, measured: &dyn Fn(&NodeSpec) -> Option<u64>) -> Verdict {
    let task = |index: usize| {
        let spec = &graph.nodes[index].spec;
        let execution_ns = spec.budget_ns.or_else(|| measured(spec))?;
        let period_ns = period_ns(graph, index, graph.nodes.len())?;
        let deadline_ns = spec.deadline_ns.unwrap_or(period_ns).min(period_ns);
        Some(Task { name: spec.instance.clone(), period_ns, deadline_ns, execution_ns, priority: spec.priority })
    };
    let tasks: Vec<Task> = (0..graph.nodes.len()).filter_map(task).collect();
    let ms = |ns: u64| ns as f64 * 1e-6;
    let found = misses(&tasks);
    let missing = found.iter().map(|miss| miss.name.clone()).collect();
    let errors = found.into_iter().map(|miss| {
        let reason = format!(
            "node \"{}\" can miss its deadline of {} ms by {} ms or more: its response reaches {} ms",
            miss.name,
            ms(miss.deadline_ns),
            ms(miss.response_ns - miss.deadline_ns),
            ms(miss.response_ns)
        );
        let advice = match miss.because_of.as_slice() {
            [] => "its own budget is longer than its deadline: raise deadline_ms or lower budget_ms".to_owned(),
            others => format!("{} stand above it: stretch their periods, or raise its priority", others.join(", ")),
        };
        RobotError::plain(file, reason).advise(advice)
    });
    Verdict { reckoned: tasks.len(), utilization: utilization(&tasks), errors: errors.collect(), missing }
}

#[cfg(test)]
mod tests {
    use crate::built_in::{PIONEER, PIONEER_FILE, node_types};
    use runtime::robot::{Override, Resources, Robot};

    fn verdict(budgets: &[(&str, &str)]) -> super::Verdict {
        let types = node_types(&[]);
        let text = std::str::from_utf8(PIONEER[0].1).unwrap();
        let robot = Robot::parse(text, PIONEER_FILE, Resources::Embedded(PIONEER), &types).unwrap();
        let change =
            |(node, ms): &(&str, &str)| Override { key: format!("nodes.{node}.budget_ms"), value: (*ms).into() };
        let changes: Vec<Override> = budgets.iter().map(change).collect();
        let robot = robot.with_overrides(&changes, &types).unwrap();
        super::judge(&robot.graph().unwrap(), "pioneer")
    }

    #[test]
    fn what_fits_is_admitted_and_what_has_no_budget_is_not_reckoned_with() {
        assert_eq!(verdict(&[]).reckoned, 0);
        let fits = verdict(&[("base", "2.0"), ("drive", "1.0")]);
        assert!(fits.errors.is_empty() && fits.reckoned == 2, "{fits:?}");
        assert!(fits.utilization > 0.2);
    }

    #[test]
    fn an_infeasible_set_is_refused_with_who_misses_by_how_much_and_because_of_whom() {
        let errors = verdict(&[("base", "8.0"), ("drive", "19.0")]).errors;
        let text = errors[0].to_string();
        assert!(text.contains("node \"drive\" can miss its deadline of 10 ms") || text.contains("drive"), "{text}");
        assert!(text.contains("by") && text.contains("base stand above it"), "{text}");
    }
}
