//! Combines proposals under the mode into one wanted velocity.

pub mod arbiter;
pub mod arbitration;
pub mod fuzzy;
pub mod governor;
pub mod minimum;
pub mod mode;
pub mod opinion;
pub mod priority;
pub mod priority_with_veto;
pub mod response;
pub mod round;
pub mod switch_80cm;
pub mod weighted;

use runtime::NodeType;

/// Node types of this layer.
pub const NODES: &[NodeType] = &[NodeType::of::<governor::Governor>(), NodeType::of::<arbiter::Arbiter>()];
