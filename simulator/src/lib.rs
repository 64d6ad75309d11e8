//! sinew-simulator
