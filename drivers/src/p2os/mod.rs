//! ActivMedia/MobileRobots Pioneer (P2OS, AROS, ARCOS) over a serial line, TCP or a pseudo-terminal.
//!
//! | file | what |
//! |---|---|
//! | [`protocol`] | frame, checksum, commands; [`numbers`] their numbers |
//! | [`sip`], [`config`] | the robot's packets, parsed and encoded |
//! | [`model`] | factors, sonar poses, body of each model |
//! | [`session`] | handshake, watchdog feeding, recovery |
//! | [`drive`], [`power`] | which motion command goes out next, and who may have the motors |
//! | [`dead_reckoning`], [`sonar_ring`] | from packets to odometry and beams |
//! | [`settings`], [`P2os`] | the node |
//! | [`conformance`] | what every robot at the other end must do |
//!
//! All but the node is pure. `protocol`, `sip`, `config` and `model` serve both ends: a simulated microcontroller uses
//! the same files.

mod base;
pub mod config;
pub mod conformance;
pub mod dead_reckoning;
pub mod drive;
mod encoders;
mod fields;
mod framer;
mod heritage;
pub mod model;
mod node;
pub mod numbers;
mod paths;
mod phases;
pub mod power;
pub mod protocol;
mod queue;
pub mod session;
pub mod settings;
pub mod sip;
pub mod sonar_ring;

pub use encoders::Encoders;
pub use fields::{Fields, MAX_TEXT, Text};
pub use node::P2os;
pub use settings::P2osConfig;
