//! Channels as bytes: a ring of the newest samples per path, one writer, any number of readers, nobody ever blocked.
//!
//! A [`Tree`] holds the channels of a robot, in files under `/dev/shm` or, for the simulated host, on the heap; both
//! run the same algorithm (`ring`) over the same bytes ([`layout`]) and pass the same tests
//! (`tests/channel_conformance`). Typed ports are built on top of this module and live elsewhere.
//!
//! | file | what |
//! |---|---|
//! | `layout` | the file format, for other languages too |
//! | `ring` | the slot algorithm and its six fences |
//! | `image`, `memory` | a ring in its memory; a map or the heap |
//! | `fault` | a file cut off under its map is a fault and not a death |
//! | `writer`, `reader`, `sample` | the two ends, and what passes between them |
//! | `succession` | from one writer to the next |
//! | `tree`, `shared`, `local`, `folder`, `path`, `lock` | names; one writer per name |
//! | `wait`, `helper`, `futex` | sleeping on several channels at once |
//! | `bare` | the floor that benchmarks compare with |
//!
//! What one writer per path rests on: between users the files' modes, which the kernel enforces; under one user the lock,
//! which honest programs take, and the supervisor.
#![allow(unsafe_code)] // maps, atomics over them, signals: each block says why it holds

mod bare;
mod error;
mod fault;
mod folder;
mod futex;
mod helper;
mod image;
pub mod layout;
mod local;
mod lock;
mod memory;
mod path;
mod reader;
mod ring;
mod sample;
mod shared;
mod succession;
mod tree;
mod wait;
mod writer;

/// Where `ring` finds its atomics; the model checker puts its own in this place.
mod atomic {
    pub use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};
}

pub use bare::BarePair;
pub use error::{ChannelError, ReadError};
pub use layout::Geometry;
pub use reader::{Expect, RawReader, SlotWords};
pub use sample::{RawSample, SampleBuffer};
pub use tree::{Claim, Tree};
pub use wait::{Method, PrivateWord, Waiter, WakeWord, Woken, tighten_timer_slack};
pub use writer::{Death, Published, RawWriter, TailWords};
