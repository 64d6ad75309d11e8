//! sinew-coordinator
