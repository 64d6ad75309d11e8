//! The robot file, read and checked: one manifest per robot *is* its architecture.

mod care;
mod error;
mod file;
mod locate;
mod resources;
mod schema;
mod spec;
mod wiring;

pub use care::{CareTable, Do, GroupTable, Leave, Limp, Period, ReactionTable, Rung, Strategy, SupervisionTable, When};
pub use error::{RobotError, nearest_advice};
pub use file::{Body, Isolate, Missed, RealtimeTable, RecordTable, Restart, RobotFile, Scheduler};
pub use resources::{Embedded, Resources};
pub use schema::json_schema;
pub use spec::{NodeSpec, Override, ReadWire, Robot};
pub use wiring::{Declared, Graph, GraphEdge, GraphNode};
pub(crate) use wiring::{STATISTICS, open_declared, open_replayed};
