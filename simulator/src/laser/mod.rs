//! Simulated laser scanners: a mirror that turns over a world, and a server that answers in the device's own protocol.

mod lms;
mod mirror;
mod scip;
mod server;
mod unit;

pub use unit::LaserSetup;
pub(crate) use unit::{Laser, Movers};
