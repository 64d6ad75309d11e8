//! Combines proposals under the mode into one wanted velocity.

pub mod arbiter;
pub mod arbitration;
pub mod opinion;
pub mod priority;
pub mod response;
pub mod weighted;

use runtime::NodeType;

/// Node types of this layer.
pub const NODES: &[NodeType] = &[NodeType::of::<arbiter::Arbiter>()];
