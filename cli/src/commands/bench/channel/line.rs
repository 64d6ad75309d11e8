//! A two-way line between two processes, over one of several engines. Each end sleeps in the kernel until the other has
//! sent; every payload is written from the sender's memory and copied out into the receiver's.

use super::futex_pair;
use super::pipe_pair;
use super::sinew_channels;
use crate::exit::Failure;
use std::path::Path;
use std::process::Child;

/// One end of a line.
pub trait Line {
    /// Sends `payload` and wakes the other end.
    fn send(&mut self, payload: &[u8]) -> Result<(), Failure>;
    /// Sleeps until the other end has sent; first and last word of the payload that came.
    fn receive(&mut self) -> Result<Proof, Failure>;
}

/// First and last word of a payload: enough to see that all of it came.
pub type Proof = [u64; 2];

/// Which end of the line a process has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Sends first and takes the time.
    Asking,
    /// Answers.
    Answering,
}

/// What carries the payloads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Engine {
    /// Two channels, each reader waiting on two words: the trigger and its private control word.
    Sinew,
    /// One futex word each way on shared memory: nothing can be simpler.
    Futex,
    /// The same with `futex_waitv` on two words, one of them idle.
    FutexWaitv,
    /// A pair of pipes.
    Pipe,
    /// iceoryx2 publish-subscribe and its event service.
    #[cfg(feature = "iceoryx2")]
    Iceoryx2,
}

impl Engine {
    /// Those that this program was built with.
    pub const ALL: &[Engine] = &[
        Engine::Sinew,
        Engine::Futex,
        Engine::FutexWaitv,
        Engine::Pipe,
        #[cfg(feature = "iceoryx2")]
        Engine::Iceoryx2,
    ];

    /// Its name in rows.
    pub fn name(self) -> &'static str {
        match self {
            Engine::Sinew => "sinew",
            Engine::Futex => "futex",
            Engine::FutexWaitv => "futex_waitv",
            Engine::Pipe => "pipe",
            #[cfg(feature = "iceoryx2")]
            Engine::Iceoryx2 => "iceoryx2",
        }
    }

    /// Makes in `folder` what both ends need.
    pub fn prepare(self, folder: &Path, size: usize) -> Result<(), Failure> {
        match self {
            Engine::Sinew => sinew_channels::prepare(folder, size),
            Engine::Futex | Engine::FutexWaitv => futex_pair::prepare(folder, size),
            Engine::Pipe => Ok(()),
            #[cfg(feature = "iceoryx2")]
            Engine::Iceoryx2 => super::iceoryx2_services::prepare(folder),
        }
    }

    /// Opens one end. The asking end has the answering process as its `partner`.
    pub fn open(
        self,
        folder: &Path,
        size: usize,
        end: End,
        partner: Option<&mut Child>,
    ) -> Result<Box<dyn Line>, Failure> {
        Ok(match self {
            Engine::Sinew => Box::new(sinew_channels::Channels::open(folder, size, end)?),
            Engine::Futex => Box::new(futex_pair::FutexPair::open(folder, size, end, false)?),
            Engine::FutexWaitv => Box::new(futex_pair::FutexPair::open(folder, size, end, true)?),
            Engine::Pipe => pipe_pair::open(size, partner)?,
            #[cfg(feature = "iceoryx2")]
            Engine::Iceoryx2 => Box::new(super::iceoryx2_services::Services::open(folder, size, end)?),
        })
    }
}

/// First and last word of `bytes`; zeros where it has less than eight.
pub fn proof(bytes: &[u8]) -> Proof {
    let first = bytes.first_chunk().map_or(0, |word| u64::from_le_bytes(*word));
    let last = bytes.last_chunk().map_or(0, |word| u64::from_le_bytes(*word));
    [first, last]
}

/// Writes `count` to both ends of `bytes`.
pub fn mark(bytes: &mut [u8], count: u64) {
    if let Some(word) = bytes.first_chunk_mut() {
        *word = count.to_le_bytes();
    }
    if let Some(word) = bytes.last_chunk_mut() {
        *word = count.to_le_bytes();
    }
}
