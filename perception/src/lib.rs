//! Samples from drivers to quantities of the world.

pub mod cross_check;
pub mod echo_memory;
pub mod echoes;
pub mod odometry;
pub mod place;
pub mod ranges;
pub mod recall;
pub mod scan;
pub mod track;
pub mod tracks;

use runtime::NodeType;

/// Node types of this layer.
pub const NODES: &[NodeType] = &[
    NodeType::of::<odometry::Odometry>(),
    NodeType::of::<echoes::Echoes>(),
    NodeType::of::<ranges::BodyRanges>(),
    NodeType::of::<cross_check::CrossCheck>(),
    NodeType::of::<recall::Recall>(),
    NodeType::of::<tracks::Tracks>(),
];
