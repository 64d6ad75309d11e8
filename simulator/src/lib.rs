//! 2-D worlds, bodies and sensors that answer in the devices' wire protocols.

mod body;
mod contact;
pub mod geometry;
mod laser;
pub mod mcu;
mod node;
mod noise;
mod realism;
mod scene;
mod simulation;
mod sonar;
mod statistics;
pub mod svg;
pub mod swarm;
pub mod world;

pub use contact::{BROKEN_FOR_S, BROKEN_GAP_M};
pub use laser::LaserSetup;
pub use node::{BodyConfig, LaserConfig, World, WorldConfig};
pub use realism::{LaserRealism, LineFaults, Realism, SonarRealism, WheelRealism};
pub use scene::Thing;
pub use simulation::{BodySetup, Chassis, STEP_NS, STEP_S, Setup, SetupError, Simulation, Way, people_along};
pub use statistics::Statistics;

use runtime::NodeType;

/// Node types of this layer.
pub const NODES: &[NodeType] = &[NodeType::of::<node::World>()];
