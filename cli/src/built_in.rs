//! What the binary brings along: every node type, and the default robot.

use runtime::NodeType;
use runtime::robot::Embedded;

/// Every node type that is built in, in flow order, and the user's behind them.
pub fn node_types(extra: &[NodeType]) -> Vec<NodeType> {
    let built_in: [&[NodeType]; 6] =
        [simulator::NODES, drivers::NODES, perception::NODES, actions::NODES, coordinator::NODES, motion::NODES];
    built_in.into_iter().flatten().chain(extra).copied().collect()
}

/// Files of the default robot: the Pioneer in its office.
pub const PIONEER: Embedded = &[
    ("robot.toml", include_bytes!("../../robots/pioneer/robot.toml")),
    ("laser.toml", include_bytes!("../../robots/pioneer/laser.toml")),
    ("three_rangers.toml", include_bytes!("../../robots/pioneer/three_rangers.toml")),
    ("worlds/office.toml", include_bytes!("../../robots/pioneer/worlds/office.toml")),
    ("worlds/opening.toml", include_bytes!("../../robots/pioneer/worlds/opening.toml")),
    ("worlds/corridor.toml", include_bytes!("../../robots/pioneer/worlds/corridor.toml")),
];

/// Files of the robot that `sinew barn` drives: the Jackal.
pub const JACKAL: Embedded = &[
    ("robot.toml", include_bytes!("../../robots/jackal/robot.toml")),
    ("worlds/field.toml", include_bytes!("../../robots/jackal/worlds/field.toml")),
];

/// How its file is called in messages.
pub const JACKAL_FILE: &str = "robots/jackal/robot.toml (built in)";

/// How the default robot's file is called in messages.
pub const PIONEER_FILE: &str = "robots/pioneer/robot.toml (built in)";

/// Files of the service robot with a laser.
pub const SERVICE_LASER: Embedded = &[
    ("robot.toml", include_bytes!("../../robots/service/laser.toml")),
    ("worlds/hallway.toml", include_bytes!("../../robots/service/worlds/hallway.toml")),
];

/// Files of the service robot, in which the experiments of `sinew experiments` run.
pub const SERVICE: Embedded = &[
    ("robot.toml", include_bytes!("../../robots/service/robot.toml")),
    ("laser.toml", include_bytes!("../../robots/service/laser.toml")),
    ("worlds/hallway.toml", include_bytes!("../../robots/service/worlds/hallway.toml")),
    ("worlds/office.toml", include_bytes!("../../robots/service/worlds/office.toml")),
    ("worlds/open.toml", include_bytes!("../../robots/service/worlds/open.toml")),
    ("worlds/person.toml", include_bytes!("../../robots/service/worlds/person.toml")),
    ("worlds/trap.toml", include_bytes!("../../robots/service/worlds/trap.toml")),
];
