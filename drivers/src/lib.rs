//! sinew-drivers
