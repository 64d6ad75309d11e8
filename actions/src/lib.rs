//! sinew-actions
