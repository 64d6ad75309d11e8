//! Device drivers: nodes that own a device, speak its real wire protocol and offer typed paths under `/drivers`.
//!
//! One folder per device model; inside it `protocol` is pure (bytes in, values out) and apart from the node.

// A unit at the end of a doc line, `[m]`, looks like a link to rustdoc.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod contact;
pub mod estop_line;
pub mod laser;
pub mod lms200;
pub mod p2os;
pub mod port;
pub mod urg;

use runtime::NodeType;

/// The drivers that a robot file can name.
pub const NODES: &[NodeType] = &[
    NodeType::of::<p2os::P2os>(),
    NodeType::of::<lms200::Lms200>(),
    NodeType::of::<urg::Urg>(),
    NodeType::of::<estop_line::EstopLine>(),
];
