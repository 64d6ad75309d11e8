//! What the simulator's integration tests share.

pub mod recording;
