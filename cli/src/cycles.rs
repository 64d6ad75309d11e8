//! Cycles without delay: nodes of which each one's sample releases the next one's step, round and round. They would
//! step without end. A node with a device, whose samples come when the device speaks, delays.

use runtime::PortKind;
use runtime::robot::Graph;

/// The paths of the nodes of a cycle without delay, if there is one.
pub fn without_delay(graph: &Graph) -> Option<Vec<String>> {
    let delays = |node: usize| graph.nodes[node].declared.iter().any(|port| matches!(port.kind, PortKind::Device(..)));
    let nexts =
        |node: usize| graph.edges.iter().filter(move |edge| edge.from == node && edge.triggers).map(|edge| edge.to);
    for start in (0..graph.nodes.len()).filter(|&node| !delays(node)) {
        // By whom each node was come to, nearest first.
        let mut from: Vec<Option<usize>> = vec![None; graph.nodes.len()];
        let mut queue = std::collections::VecDeque::from([start]);
        while let Some(node) = queue.pop_front() {
            for next in nexts(node).filter(|&next| !delays(next)) {
                if next == start {
                    let mut back = vec![node];
                    while let Some(before) = back.last().filter(|&&last| last != start).and_then(|&last| from[last]) {
                        back.push(before);
                    }
                    return Some(back.iter().rev().map(|&node| graph.nodes[node].spec.path()).collect());
                }
                if from[next].is_none() {
                    from[next] = Some(node);
                    queue.push_back(next);
                }
            }
        }
    }
    None
}

/// Says so, with what to do.
pub fn refusal(graph: &Graph) -> Option<String> {
    without_delay(graph).map(|cycle| {
        format!(
            "{} would release each other without end: a cycle without delay; give one of them a period_ms and take the \
             trigger away",
            cycle.join(" → ")
        )
    })
}

#[cfg(test)]
mod tests {
    use crate::built_in::{PIONEER, PIONEER_FILE, node_types};
    use runtime::robot::{Override, Resources, Robot};

    fn refusal(changes: &[(&str, &str)]) -> Option<String> {
        let types = node_types(&[]);
        let text = std::str::from_utf8(PIONEER[0].1).unwrap();
        let robot = Robot::parse(text, PIONEER_FILE, Resources::Embedded(PIONEER), &types).unwrap();
        let over = |(key, value): &(&str, &str)| Override { key: (*key).into(), value: (*value).into() };
        let changes: Vec<Override> = changes.iter().map(over).collect();
        super::refusal(&robot.with_overrides(&changes, &types).unwrap().graph().unwrap())
    }

    #[test]
    fn the_loop_through_the_wheels_is_delayed_by_the_device() {
        assert_eq!(refusal(&[]), None);
    }

    #[test]
    fn nodes_that_release_each_other_are_named() {
        let echo = [
            ("nodes.a.type", "\"arbiter\""),
            ("nodes.a.trigger", "\"governor\""),
            ("nodes.a.reads.proposals", "\"/actions/*/proposal\""),
            ("nodes.a.reads.governor", "\"/coordinator/b/state\""),
            ("nodes.b.type", "\"governor\""),
            ("nodes.b.trigger", "\"motion\""),
            ("nodes.b.config.load", "{}"),
            ("nodes.b.reads.motion", "\"/motion/drive/state\""),
            ("nodes.drive.trigger", "\"velocity\""),
            ("nodes.drive.reads.velocity", "\"/coordinator/a/velocity\""),
        ];
        let said = refusal(&echo).unwrap();
        for name in ["/coordinator/a", "/coordinator/b", "/motion/drive", "a cycle without delay"] {
            assert!(said.contains(name), "{said}");
        }
    }
}
