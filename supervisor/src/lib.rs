//! sinew-supervisor
