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
        if followers.peek().is_none() {
            all.push(format!(
                "nobody follows [nodes.{}]: add reads.governor = \"{state}\" to the arbiter",
                governor.instance
            ));
        }
        // Settings that cannot be read are told when the node opens.
        let Ok(rules) = GovernorConfig::deserialize(governor.config.clone()) else { continue };
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
