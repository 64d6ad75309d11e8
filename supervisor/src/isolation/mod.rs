//! What a node's process may touch, and what keeps it to that.
//!
//! | layer | enforced by | what it keeps apart |
//! |---|---|---|
//! | `user` | file modes, signals, scheduling: the kernel's oldest rules | nodes from each other and from people |
//! | `files` | Landlock | a node from every file, port and process that the robot file does not name for it |
//! | `calls` | seccomp | a node from system calls that it never needs |
//!
//! Users are given only by root: a robot run by an ordinary user has one user, and its strict nodes are kept apart by
//! the other two. All three are taken by the node's own program at its start, while it is a single thread and has read
//! nothing but what its supervisor wrote for it (`.run/launch.json`, `SINEW_IDENTITY`): between fork and exec nothing
//! but a system call is safe, and a second exec would need the right to execute. None of the three can be taken back.

mod calls;
mod confine;
mod files;
mod identity;
mod needs;
mod ownership;

pub use calls::flaw as seccomp;
pub use confine::{Confined, confine};
pub use files::{Landlock, landlock};
pub use identity::{IDENTITY, Identity, flaws, warnings};
pub use ownership::Ownership;
