//! A reading end of a channel: looks, copies, validates; never writes, never waits, never allocates.

use std::fs::File;
use std::os::fd::AsFd;

use super::atomic::{AtomicU64, Ordering};
use super::error::ReadError;
use super::image::Image;
use super::layout::{Geometry, at};
use super::ring::{self, Miss};
use super::sample::{RawSample, SampleBuffer};
use super::wait::WakeWord;

/// What a reader insists on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expect {
    /// Name of the message type.
    pub type_name: String,
    /// Its layout hash.
    pub layout_hash: u64,
}

/// One of any number of readers of a channel.
pub struct RawReader {
    image: Image,
    geometry: Geometry,
    /// The ring's own file, by which one sees that it lost its name.
    file: Option<File>,
}

impl RawReader {
    pub(super) fn new(image: Image, geometry: Geometry, file: Option<File>) -> RawReader {
        RawReader { image, geometry, file }
    }

    /// What the channel holds.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Newest sequence number that can be read; 0 when there is none.
    #[inline]
    pub fn head(&self) -> u64 {
        self.image.head()
    }

    /// Oldest sequence number that the channel promises to keep whole while the next sample is being written.
    #[inline]
    pub fn oldest(&self) -> u64 {
        oldest(self.head(), self.image.shape.depth)
    }

    /// Which writer the channel has, or had last; 0 when it never had one.
    #[inline]
    pub fn generation(&self) -> u64 {
        self.image.word(at::GENERATION).load(Ordering::Relaxed)
    }

    /// Process of the writer; `None` when it left in order or never came. A killed one stays named until its successor
    /// comes.
    pub fn writer_pid(&self) -> Option<u32> {
        u32::try_from(self.image.word(at::WRITER_PID).load(Ordering::Relaxed)).ok().filter(|&pid| pid != 0)
    }

    /// Copies sample `sequence`.
    #[inline]
    pub fn read(&self, sequence: u64, into: &mut SampleBuffer) -> Result<RawSample, ReadError> {
        let shape = &self.image.shape;
        let (fixed, tail) = into.parts(shape).ok_or(ReadError::Buffer)?;
        let copied = self.image.read(sequence, |slot| {
            let sample = facts(sequence, slot, shape.tail_bytes);
            let (fixed_words, tail_words) = slot[ring::DATA..].split_at(shape.fixed_words);
            copy_out(fixed_words, fixed);
            copy_out(tail_words, &mut tail[..sample.tail_bytes.div_ceil(8)]);
            sample
        });
        let sample = self.checked(copied)?;
        into.set_tail_bytes(sample.tail_bytes);
        Ok(sample)
    }

    /// Looks at sample `sequence` in the ring, without a copy. What `look` sees may be torn, so it must take any value
    /// whatever; what it returns is passed on only when the sample was whole to the end.
    #[inline]
    pub fn read_in_place<T>(&self, sequence: u64, look: impl FnOnce(SlotWords<'_>) -> T) -> Result<T, ReadError> {
        let shape = &self.image.shape;
        let seen = self.image.read(sequence, |slot| {
            let sample = facts(sequence, slot, shape.tail_bytes);
            let (fixed, tail) = slot[ring::DATA..].split_at(shape.fixed_words);
            look(SlotWords { sample, fixed, tail: &tail[..sample.tail_bytes.div_ceil(8)] })
        });
        self.checked(seen)
    }

    /// Stamp, generation and tail length of sample `sequence`, without its bytes.
    #[inline]
    pub fn stamp(&self, sequence: u64) -> Result<RawSample, ReadError> {
        let tail_bytes = self.image.shape.tail_bytes;
        self.checked(self.image.read(sequence, |slot| facts(sequence, slot, tail_bytes)))
    }

    /// The newest sample up to `frozen_head` whose stamp is not after `stamp_ns`; its sequence number. Looks at one
    /// slot's header per sample that is newer, at most at all of them; samples that were never finished are passed over.
    pub fn at_or_before(&self, stamp_ns: u64, frozen_head: u64) -> Option<u64> {
        let newest = frozen_head.min(self.head());
        // The promised history and the one slot more, whose sample is whole until the next one is begun.
        let oldest = oldest(newest, self.image.shape.slot_count);
        (oldest..=newest).rev().find(|&sequence| self.stamp(sequence).is_ok_and(|sample| sample.stamp_ns <= stamp_ns))
    }

    /// Whether this ring is over: a successor has taken the path, the channel was removed, or its file was damaged.
    /// Open the path again. Three loads.
    #[inline]
    pub fn retired(&self) -> bool {
        self.image.retired() != 0 || !self.image.sound()
    }

    /// Whether the file has lost its name without a word in it, by a foreign hand. A system call: ask now and then.
    pub fn unlinked(&self) -> bool {
        self.file.as_ref().is_some_and(|file| rustix::fs::fstat(file.as_fd()).is_ok_and(|stat| stat.st_nlink == 0))
    }

    /// The word to sleep on; keeps the ring mapped.
    pub fn word(&self) -> WakeWord {
        WakeWord::new(self.image.memory.clone())
    }

    /// What a read comes to, given that the ring may have been damaged while it ran.
    #[inline]
    fn checked<T>(&self, read: Result<T, Miss>) -> Result<T, ReadError> {
        if self.image.memory.faulted() {
            return Err(ReadError::Fault);
        }
        read.map_err(|miss| match miss {
            _ if !self.image.sound() => ReadError::Fault,
            Miss::NotYet => ReadError::NotYet,
            Miss::Overrun => ReadError::Overrun,
            Miss::Unfinished => ReadError::Unfinished,
        })
    }
}

/// A sample in its ring. Words and not bytes, because its writer may be overwriting them.
#[derive(Clone, Copy)]
pub struct SlotWords<'a> {
    /// Number, stamp, generation and length of tail.
    pub sample: RawSample,
    fixed: &'a [AtomicU64],
    tail: &'a [AtomicU64],
}

impl SlotWords<'_> {
    /// Word `index` of the fixed part; zero beyond its end.
    #[inline]
    pub fn fixed(&self, index: usize) -> u64 {
        self.fixed.get(index).map_or(0, |word| word.load(Ordering::Relaxed))
    }

    /// Word `index` of the tail; zero beyond its end.
    #[inline]
    pub fn tail(&self, index: usize) -> u64 {
        self.tail.get(index).map_or(0, |word| word.load(Ordering::Relaxed))
    }
}

/// Oldest of the newest `depth` sequence numbers.
fn oldest(head: u64, depth: usize) -> u64 {
    head.saturating_sub(depth as u64 - 1).max(1)
}

/// The words before the data; the length of the tail is clamped to what there is room for.
#[inline]
fn facts(sequence: u64, slot: &[AtomicU64], most_tail_bytes: usize) -> RawSample {
    let word = |at: usize| slot[at].load(Ordering::Relaxed);
    RawSample {
        sequence,
        stamp_ns: word(ring::STAMP),
        generation: word(ring::GENERATION),
        tail_bytes: word(ring::TAIL_BYTES).min(most_tail_bytes as u64) as usize,
    }
}

#[inline]
fn copy_out(words: &[AtomicU64], into: &mut [u64]) {
    for (value, word) in into.iter_mut().zip(words) {
        *value = word.load(Ordering::Relaxed);
    }
}
