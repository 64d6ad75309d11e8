//! The runtime: paths, channels, calls, nodes, the robot file, and the two hosts that run the same nodes.

mod announced;
mod bench;
pub mod calls;
pub mod channel;
pub mod clock;
pub mod device;
mod host;
mod journal;
pub mod live;
pub mod math;
mod node;
pub mod path;
mod ports;
pub mod pump;
pub mod realtime;
mod record;
pub mod replay;
pub mod robot;
pub mod schedule;
mod simulated;
mod statistics;
mod stop;
mod sys;
mod time;

pub use announced::{GOVERNOR, PERIODS};
pub use bench::{Bench, BenchBuilder};
pub use calls::{CallPort, Caller, OrderPort, Request};
pub use device::Device;
pub use guard::Will;
pub use node::{AnyNode, Fault, Node, NodeType, OpenError};
pub use path::Layer;
pub use ports::{
    Declaration, LOAD_DEPTH, LOAD_NODES, PortKind, Ports, Reader, STATE_DEPTH, SUPERVISOR_LOAD, SUPERVISOR_STATE,
    Sample, Set, TWINS, Writer,
};
pub use robot::Body;
pub use simulated::{ExecutionModel, SimulatedHost, Stepped};
pub use statistics::{Statistics, StepTimes};
pub use stop::{Keepsake, StopLatch, StopSource};
pub use time::Time;
