//! Sinew: a real-time control runtime for mobile robots.
//!
//! A user's robot is a crate of its own that depends on this one and hands its nodes to [`main`]:
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     sinew::main(&[])
//! }
//! ```

mod admission;
pub mod batch;
pub mod built_in;
mod commands;
mod cycles;
pub mod exit;
pub mod experiments;
pub mod launch;
pub mod live;
pub mod load;
pub mod output;
mod picture;
pub mod simulation;
pub mod view;

pub use commands::main;
pub use messages;
pub use runtime;
// For settings of one's own nodes: `#[serde(crate = "sinew::serde")]`, `#[schemars(crate = "sinew::schemars")]`.
pub use runtime::{Bench, Fault, Layer, Node, NodeType, OpenError, Ports, Reader, Sample, Set, Time, Writer};
pub use schemars;
pub use serde;
