//! A ring in its memory: the header's changing words and the slots, always within the cached shape.

use std::sync::Arc;

use super::atomic::{AtomicU64, Ordering};
use super::layout::{self, Geometry, Shape, at};
use super::memory::Memory;
use super::ring::{self, Miss, Whole};

/// Sequence numbers beyond this are damage: at a million samples a second they take 18,000 years.
const MOST_SEQUENCE: u64 = 1 << 59;

/// A ring and the sizes by which it is accessed.
#[derive(Clone)]
pub(super) struct Image {
    pub memory: Arc<Memory>,
    pub shape: Shape,
}

impl Image {
    /// A new, empty ring in zeroed memory.
    pub fn format(memory: Memory, geometry: &Geometry, shape: Shape, created_ns: u64) -> Image {
        layout::write_header(memory.words(), geometry, &shape, created_ns);
        Image::of(memory, shape)
    }

    /// The ring in `memory`, which has at least the shape's words.
    pub fn of(memory: Memory, shape: Shape) -> Image {
        debug_assert!(memory.words().len() >= shape.total_words());
        Image { memory: Arc::new(memory), shape }
    }

    /// A word of the header.
    #[inline]
    pub fn word(&self, at: usize) -> &AtomicU64 {
        &self.memory.words()[at]
    }

    /// The slot of `sequence`.
    #[inline]
    pub fn slot(&self, sequence: u64) -> &[AtomicU64] {
        let start = self.shape.slot_start(sequence);
        &self.memory.words()[start..start + self.shape.slot_words]
    }

    /// The newest sequence number that counts; a retired ring's head stays where its successor took over.
    #[inline]
    pub fn head(&self) -> u64 {
        let head = ring::head::<Whole>(self.word(at::HEAD));
        match self.retired() {
            0 => head,
            limit => head.min(limit - 1),
        }
    }

    /// 0 while in use, else 1 + the last sequence number that counts.
    #[inline]
    pub fn retired(&self) -> u64 {
        self.word(at::RETIRED).load(Ordering::Relaxed)
    }

    /// Runs `copy` over the slot of `sequence` and keeps what it returns only if the sample was whole all the time.
    #[inline]
    pub fn read<T>(&self, sequence: u64, copy: impl FnOnce(&[AtomicU64]) -> T) -> Result<T, Miss> {
        if sequence == 0 {
            return Err(Miss::Overrun);
        }
        ring::read::<Whole, T>(self.slot(sequence), self.head(), sequence, copy)
    }

    /// Whether the ring can be read and written at all: its file is whole.
    #[inline]
    pub fn sound(&self) -> bool {
        // A file that was cut off and grown again raises no signal, but has lost its header.
        let magic = self.word(at::MAGIC).load(Ordering::Relaxed);
        magic == layout::MAGIC && !self.memory.faulted()
    }

    /// Bumps the wake word and wakes whoever sleeps on it.
    #[inline]
    pub fn wake(&self) {
        ring::bump::<Whole>(self.memory.wake_word());
        self.memory.wake_sleepers();
    }

    /// The newest complete and the newest begun sequence number, whatever a dead writer left; `None` when the marks are
    /// such that no writer can have left them. Only for who holds the writer's place.
    pub fn survey(&self) -> Option<Survey> {
        let head = self.word(at::HEAD).load(Ordering::Relaxed);
        let mut survey = Survey { complete: head, begun: head };
        for index in 0..self.shape.slot_count as u64 {
            let mark = self.slot(index)[ring::MARK].load(Ordering::Relaxed);
            let sequence = mark / 2;
            if mark == 0 {
                continue;
            }
            if sequence % self.shape.slot_count as u64 != index {
                return None;
            }
            survey.begun = survey.begun.max(sequence);
            if mark.is_multiple_of(2) {
                survey.complete = survey.complete.max(sequence);
            }
        }
        (survey.begun < MOST_SEQUENCE && self.sound()).then_some(survey)
    }
}

/// What the slots of a ring tell its next writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Survey {
    /// Newest complete sample; the dead writer may not have come to show it.
    pub complete: u64,
    /// Newest sample that was begun: the next number is one more.
    pub begun: u64,
}
