//! Wanted velocity to safe actuator commands.

pub mod footprint;
pub mod zone;
