//! ActivMedia/MobileRobots Pioneer (P2OS, AROS, ARCOS) over a serial line, TCP or a pseudo-terminal.

pub mod config;
pub mod dead_reckoning;
pub mod drive;
mod fields;
mod framer;
pub mod model;
pub mod numbers;
pub mod protocol;
mod queue;
pub mod session;
pub mod sip;
pub mod sonar_ring;

pub use fields::{Fields, MAX_TEXT, Text};
