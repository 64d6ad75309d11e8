//! What stands below everything: the root of the process tree, the guard, and the memory that both share with others.
//!
//! ```text
//! root ── guard        holds the stop latch and the drivers' last wills
//!  │  └── supervisor   starts and watches nodes; replaced at once when it dies
//!  └───── nodes        their parent is the supervisor that started them; when that dies they come home to the root
//! ```
//!
//! The root is never replaced: it takes in orphans, waits, and starts guard or supervisor anew. When the root dies, every
//! process of the robot stops by itself. All that must outlive a process lies in sealed memfds and listening sockets
//! that the root holds open for its children, under the numbers of [`fds`].
//!
//! Root and guard are single threads that allocate nothing after their start, lock their memory and ask for the highest
//! priority. They use `libc` and `rustix` and nothing else, so that they run in a small program of their own
//! (`sinew-guard`) or, where that is not installed, in the image of the program that starts the robot.

mod client;
mod confined;
mod keeper;
pub mod latch;
mod latch_page;
mod memory;
mod root;
mod state_file;
mod sys;
mod table;
mod wills;
mod wire;

pub use client::{Answer, Client, ClientError, SOCKET, ask};
pub use confined::is_confined;
pub use latch_page::{LatchPage, SourceInfo, Word};
pub use memory::{Words, make_memfd};
pub use state_file::{Loaded, StateError, StateFile};
pub use sys::{become_program, exit_of, inherited, place};
pub use table::{Injected, KEPT_BYTES, LINES, Line, Phase, SUPERVISOR_LINE, Table, Work};
pub use wire::{Kept, Will};

use std::ffi::OsString;

/// Numbers of the descriptors that the root holds for its children.
pub mod fds {
    /// The supervisor's state, two checked slots.
    pub const STATE: i32 = 100;
    /// The stop latch; the guard writes, all others only look.
    pub const LATCH: i32 = 101;
    /// The table of heartbeats and keepsakes.
    pub const TABLE: i32 = 102;
    /// The guard's listening socket.
    pub const GUARD: i32 = 103;
    /// The supervisor's listening socket.
    pub const CONTROL: i32 = 104;
    /// The connection to the program that started the robot.
    pub const FRONT: i32 = 105;
    /// A pidfd of the root, for guard and supervisor.
    pub const ROOT: i32 = 106;
}

/// First word of the command line of the root: then the supervisor's program and its arguments.
pub const ROOT_WORD: &str = "root-of-the-tree";
/// First word of the command line of the guard.
pub const GUARD_WORD: &str = "guard-of-the-tree";
/// Exit code by which a supervisor says that the run is over in order, and the tree with it.
pub const DONE: i32 = 0;

/// Runs root or guard when `arguments` (without the program's name) ask for one; returns otherwise.
pub fn main_of(arguments: Vec<OsString>) {
    match arguments.first().and_then(|word| word.to_str()) {
        Some(ROOT_WORD) => root::run(&arguments[1..]),
        Some(GUARD_WORD) => keeper::run(),
        _ => {}
    }
}
