//! sinew-motion
