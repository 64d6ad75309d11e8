//! Behaviours: each proposes motion for one purpose.

pub mod escape;
pub mod follow_gap;
pub mod forward;
pub mod goto;
pub mod place;
pub mod sectors;
pub mod steer_clear;

use runtime::NodeType;

/// Node types of this layer.
pub const NODES: &[NodeType] =
    &[NodeType::of::<forward::Forward>(), NodeType::of::<steer_clear::SteerClear>(), NodeType::of::<goto::Goto>()];
