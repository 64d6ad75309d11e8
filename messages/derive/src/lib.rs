//! sinew-messages-derive
