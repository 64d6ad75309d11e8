//! Samples from drivers to quantities of the world.

pub mod echo_memory;
pub mod echoes;
pub mod odometry;
pub mod track;

use runtime::NodeType;

/// Node types of this layer.
pub const NODES: &[NodeType] = &[NodeType::of::<odometry::Odometry>(), NodeType::of::<echoes::Echoes>()];
