//! What the simulator's integration tests share.
#![allow(dead_code, clippy::unwrap_used, reason = "each test file uses its part; a test fails by panicking")]

pub mod lasers;
pub mod recording;
