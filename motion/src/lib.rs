//! Wanted velocity to safe actuator commands.

pub mod drive;
pub mod footprint;
pub mod guard_zone;
pub mod kinematics;
pub mod memory;
pub mod obstacles;
pub mod profile;
pub mod protection;
pub mod ramp;
pub mod reaction;
pub mod restraint;
pub mod safe_motion;
pub mod zone;

use runtime::NodeType;

/// Node types of this layer.
pub const NODES: &[NodeType] = &[NodeType::of::<drive::Drive>()];
