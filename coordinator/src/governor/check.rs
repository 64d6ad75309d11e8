//! What one node cannot know by itself: whether the modes that rules ask for exist where the governor is followed.

use super::{Governor, GovernorConfig};
use crate::arbiter::{Arbiter, ArbiterConfig};
use runtime::Node;
use runtime::robot::{NodeSpec, Robot};
use serde::Deserialize;

/// Says what is wrong with the governors of a robot: where, why, what to do.
pub fn contradictions(robot: &Robot) -> Vec<String> {
    let of_type = |kind: &'static str| robot.nodes.iter().filter(move |node| node.kind.name == kind);
    let mut all = Vec::new();
    for governor in of_type(Governor::TYPE) {
        let state = governor.port_path("state");
        let follows = |node: &&NodeSpec| node.reads.get("governor").is_some_and(|wire| wire.from.contains(&state));
        let mut followers = of_type(Arbiter::TYPE).filter(follows).peekable();
        if followers.peek().is_none() && !governs_periods_alone(governor) {
            all.push(format!(
                "nobody follows [nodes.{}]: add reads.governor = \"{state}\" to the arbiter",
                governor.instance
            ));
        }
        // Settings that cannot be read are told when the node opens.
        let Ok(rules) = GovernorConfig::deserialize(governor.config.clone()) else { continue };
        for (index, rule) in rules.rules.iter().enumerate() {
            let places = rule.periods_ms.iter().filter_map(|(name, ms)| Some((name, period(robot, name, *ms)?)));
            all.extend(places.map(|(name, why)| {
                format!("[nodes.{}] config.rules[{index}].periods_ms.{name}: {why}", governor.instance)
            }));
        }
        for follower in followers {
            let Ok(modes) = ArbiterConfig::deserialize(follower.config.clone()) else { continue };
            let names: Vec<&str> = modes.modes.iter().map(|mode| mode.name.as_str()).collect();
            for (index, rule) in rules.rules.iter().enumerate() {
                if !names.contains(&rule.mode.as_str()) {
                    all.push(format!(
                        "[nodes.{}] config.rules[{index}].mode: [nodes.{}] has no mode \"{}\"; its modes are {}",
                        governor.instance,
                        follower.instance,
                        rule.mode,
                        names.join(", ")
                    ));
                }
            }
        }
    }
    all
}

/// Whether the governor has no rule, and so no mode to be followed in.
fn governs_periods_alone(governor: &NodeSpec) -> bool {
    GovernorConfig::deserialize(governor.config.clone()).is_ok_and(|config| config.rules.is_empty())
}

/// What is wrong with a rule's period of `ms` for the node `name`.
fn period(robot: &Robot, name: &str, ms: f64) -> Option<String> {
    let Some(node) = robot.nodes.iter().find(|node| node.instance == name) else {
        return Some("the robot has no such node".to_owned());
    };
    let bounds = node.period_ns.zip(node.longest_period_ns).filter(|(shortest, longest)| shortest < longest);
    let Some((shortest, longest)) = bounds else {
        return Some(format!("[nodes.{name}] has no period that gives way: write period_ms = {{ min = …, max = … }}"));
    };
    let (least, most) = (shortest as f64 * 1e-6, longest as f64 * 1e-6);
    (!(least..=most).contains(&ms)).then(|| format!("{ms} ms lies outside its period_ms of {least} to {most} ms"))
}
