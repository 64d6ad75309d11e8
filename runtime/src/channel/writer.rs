//! The writing end of a channel: bytes in, never blocking, never allocating.

use super::atomic::{AtomicU64, Ordering};
use super::image::Image;
use super::layout::at;
use super::ring::{self, Whole};
use super::sample::RawSample;
use super::succession::Start;

/// What became of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Published {
    /// Its number, from 1.
    pub sequence: u64,
    /// Its tail was longer than the channel's capacity and was cut to whole elements.
    pub cut: bool,
    /// Nobody can read it: a successor has taken the path over, or the file was removed or cut off. The writer has
    /// lost its place for good and must be opened again.
    pub lost: bool,
}

/// Where a simulated death falls within a publication.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Death {
    /// In the middle of the words.
    InMidWrite,
    /// The sample is whole, but the head was not moved.
    BeforeHead,
    /// The head was moved, but nobody was woken.
    BeforeWake,
}

/// The one writer of a channel. Gives its place up when dropped.
pub struct RawWriter {
    image: Image,
    next: u64,
    generation: u64,
    died: bool,
    /// Ends the writer's claim when dropped.
    _place: Box<dyn Send>,
}

impl RawWriter {
    pub(super) fn new(image: Image, start: Start, place: Box<dyn Send>) -> RawWriter {
        RawWriter { image, next: start.next, generation: start.generation, died: false, _place: place }
    }

    /// Publishes one sample and wakes whoever sleeps on the channel. `fixed` is the message without its tail: bytes
    /// beyond the channel's fixed size are ignored, missing ones become zero.
    #[inline]
    pub fn publish(&mut self, stamp_ns: u64, fixed: &[u8], tail: &[u8]) -> Published {
        self.publish_in_place(stamp_ns, fixed, tail.len(), |words| copy_in(words.0, tail))
    }

    /// Publishes one sample whose tail of `tail_bytes` bytes `fill` writes straight into the ring, for tails too large
    /// to be copied twice. `fill` must write all the words that it is given; what it leaves out is an older sample's.
    #[inline]
    pub fn publish_in_place(
        &mut self,
        stamp_ns: u64,
        fixed: &[u8],
        tail_bytes: usize,
        fill: impl FnOnce(TailWords<'_>),
    ) -> Published {
        let sequence = self.next;
        let (cut, lost) = self.write(stamp_ns, fixed, tail_bytes, fill);
        if !lost {
            ring::show::<Whole>(self.image.word(at::HEAD), sequence);
            self.image.wake();
        }
        // Asked again, because the file may have been cut off under this very sample.
        Published { sequence, cut, lost: lost || self.lost() }
    }

    /// Dies while publishing: what a kill at that moment leaves in the ring. For the simulated host and for tests.
    pub fn die_publishing(mut self, when: Death, stamp_ns: u64, fixed: &[u8], tail: &[u8]) {
        let sequence = self.next;
        self.died = true;
        self.write(stamp_ns, fixed, tail.len(), |words| copy_in(words.0, tail));
        match when {
            Death::InMidWrite => {
                let slot = self.image.slot(sequence);
                ring::begin::<Whole>(slot, sequence);
                // Not even the first word is right.
                slot[ring::DATA..].iter().for_each(|word| word.store(0xdead_dead_dead_dead, Ordering::Relaxed));
            }
            Death::BeforeHead => {}
            Death::BeforeWake => ring::show::<Whole>(self.image.word(at::HEAD), sequence),
        }
    }

    /// Publishes a sample of another channel under its own number and generation: for playing recordings. Numbers that
    /// are passed over count as overtaken, so that nobody takes a sample that was not recorded for one that never was.
    /// The number must not be one that was given already; then nothing is done.
    pub fn place(&mut self, sample: &RawSample, fixed: &[u8], tail: &[u8]) -> bool {
        if sample.sequence < self.next {
            return false;
        }
        let slots = self.image.shape.slot_count as u64;
        for missing in self.next.max(sample.sequence.saturating_sub(slots)).max(1)..sample.sequence {
            let slot = self.image.slot(missing);
            slot[ring::MARK].store((missing + slots).wrapping_mul(2), Ordering::Relaxed);
        }
        self.next = sample.sequence;
        self.generation = sample.generation;
        self.image.word(at::GENERATION).store(sample.generation, Ordering::Relaxed);
        self.publish(sample.stamp_ns, fixed, tail);
        true
    }

    /// Which writer of the channel this is: 1 is the first, each restart counts one up.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Number that the next sample gets.
    pub fn next_sequence(&self) -> u64 {
        self.next
    }

    /// Whether the writer has lost its place: see [`Published::lost`].
    #[inline]
    pub fn lost(&self) -> bool {
        self.image.retired() != 0 || !self.image.sound()
    }

    /// Writes the next slot, up to and with its even mark. A lost writer writes nothing.
    #[inline]
    fn write(
        &mut self,
        stamp_ns: u64,
        fixed: &[u8],
        tail_bytes: usize,
        fill: impl FnOnce(TailWords<'_>),
    ) -> (bool, bool) {
        let shape = &self.image.shape;
        let cut = tail_bytes > shape.tail_bytes;
        let tail_bytes = tail_bytes.min(shape.tail_bytes);
        if self.lost() {
            return (cut, true);
        }
        let sequence = self.next;
        // First, so that a `fill` that panics leaves an unfinished sample and not a number used twice.
        self.next += 1;
        let slot = self.image.slot(sequence);
        ring::begin::<Whole>(slot, sequence);
        slot[ring::STAMP].store(stamp_ns, Ordering::Relaxed);
        slot[ring::GENERATION].store(self.generation, Ordering::Relaxed);
        slot[ring::TAIL_BYTES].store(tail_bytes as u64, Ordering::Relaxed);
        let (fixed_words, tail_words) = slot[ring::DATA..].split_at(shape.fixed_words);
        copy_in(fixed_words, &fixed[..fixed.len().min(shape.fixed_bytes)]);
        fixed_words.iter().skip(fixed.len().div_ceil(8)).for_each(|word| word.store(0, Ordering::Relaxed));
        fill(TailWords(&tail_words[..tail_bytes.div_ceil(8)]));
        ring::commit(slot, sequence);
        (cut, false)
    }
}

impl Drop for RawWriter {
    fn drop(&mut self) {
        if !self.died && self.image.retired() == 0 {
            self.image.word(at::WRITER_PID).store(0, Ordering::Relaxed);
        }
    }
}

/// A sample's tail in the ring, as words: byte `i` of the tail is byte `i % 8` of word `i / 8`, little-endian. Words
/// and not bytes, because readers look at the memory all the time.
#[derive(Clone, Copy)]
pub struct TailWords<'a>(&'a [AtomicU64]);

impl TailWords<'_> {
    /// Number of words: the bytes of the tail, cut to the capacity, over 8, rounded up.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether the tail is empty.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Sets word `index`; does nothing beyond the end.
    #[inline]
    pub fn set(&self, index: usize, word: u64) {
        if let Some(place) = self.0.get(index) {
            place.store(word, Ordering::Relaxed);
        }
    }

    /// Copies `bytes` to the words from `first` on, up to the end; the last word is filled up with zeros.
    pub fn copy_from(&self, first: usize, bytes: &[u8]) {
        copy_in(self.0.get(first..).unwrap_or_default(), bytes);
    }
}

/// Copies `bytes` into `words`, as many as fit; a last incomplete word is filled up with zeros.
#[inline]
fn copy_in(words: &[AtomicU64], bytes: &[u8]) {
    let (whole, rest) = bytes.as_chunks::<8>();
    for (word, chunk) in words.iter().zip(whole) {
        word.store(u64::from_le_bytes(*chunk), Ordering::Relaxed);
    }
    if let (false, Some(word)) = (rest.is_empty(), words.get(whole.len())) {
        let mut padded = [0; 8];
        padded[..rest.len()].copy_from_slice(rest);
        word.store(u64::from_le_bytes(padded), Ordering::Relaxed);
    }
}
