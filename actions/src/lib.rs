//! Behaviours: each proposes motion for one purpose.

pub mod avoid;
pub mod emergency_stop;
pub mod escape;
pub mod follow_gap;
pub mod forward;
pub mod goto;
pub mod r#move;
pub mod place;
pub mod sectors;
pub mod steer_clear;

use runtime::NodeType;

/// Node types of this layer.
pub const NODES: &[NodeType] = &[
    NodeType::of::<forward::Forward>(),
    NodeType::of::<steer_clear::SteerClear>(),
    NodeType::of::<goto::Goto>(),
    NodeType::of::<follow_gap::FollowGap>(),
    NodeType::of::<avoid::Avoid>(),
    NodeType::of::<r#move::Move>(),
    NodeType::of::<emergency_stop::EmergencyStop>(),
];
