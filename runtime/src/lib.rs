//! The runtime: paths, channels, calls, nodes, the robot file, and the two hosts that run the same nodes.

pub mod math;
mod time;

pub use time::Time;
