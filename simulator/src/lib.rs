//! 2-D worlds, bodies and sensors that answer in the devices' wire protocols.

pub mod geometry;
pub mod mcu;
pub mod world;
