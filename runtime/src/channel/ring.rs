//! The slot algorithm: one writer, any number of readers that never write, no lock.
//!
//! A ring has a *head* (the newest complete sequence number) and slots; sequence `n` lives in slot `n % count`. A slot
//! begins with its *mark*, `2 n` when sample `n` is complete and `2 n + 1` while it is being written, so that a mark
//! never repeats: a reader that finds the mark of `n` behind its copy has copied `n` and nothing else.
//!
//! ```text
//! writer of n                             reader of n
//!   mark  := 2 n + 1                        head → h, not yet if h < n
//!   ── after_odd (release)                  ── after_head (acquire)
//!   words := …                              mark → early out if it is not 2 n
//!   mark  := 2 n                            copy := words
//!   ── before_head (release)                ── after_copy (acquire)
//!   head  := n                              mark → n was overtaken if it is not 2 n
//! ```
//!
//! `before_head`/`after_head`: who sees head `n` sees the whole sample, or a later one. `after_odd`/`after_copy`: who
//! has copied one word of a later sample sees that sample's mark. All accesses are relaxed and of 8 bytes, the only
//! ones that Rust defines on memory that is mapped read-only; the fences do the ordering (Boehm, "Can seqlocks get
//! along with programming language memory models?", 2012). `tests/channel_loom.rs` deletes each fence in turn and
//! must find the torn or missing sample; for that this file is generic over its fences and imports its atomics from
//! the parent module.

use super::atomic::{AtomicU32, AtomicU64, Ordering, fence};

/// Word of a slot that holds the mark.
pub const MARK: usize = 0;
/// Word of a slot that holds the stamp, in nanoseconds.
pub const STAMP: usize = 1;
/// Word of a slot that holds the generation of its writer.
pub const GENERATION: usize = 2;
/// Word of a slot that holds the tail's length, in bytes.
pub const TAIL_BYTES: usize = 3;
/// First word of the data.
pub const DATA: usize = 4;

/// The six orderings, each of them necessary.
pub trait Fences {
    /// Writer: the odd mark before the words.
    #[inline(always)]
    fn after_odd() {
        fence(Ordering::Release);
    }
    /// Writer: the sample and its even mark before the head.
    #[inline(always)]
    fn before_head() {
        fence(Ordering::Release);
    }
    /// Reader: the head before the sample.
    #[inline(always)]
    fn after_head() {
        fence(Ordering::Acquire);
    }
    /// Reader: the copy before the second look at the mark.
    #[inline(always)]
    fn after_copy() {
        fence(Ordering::Acquire);
    }
    /// Writer: the head before the wake word.
    #[inline(always)]
    fn before_wake() {
        fence(Ordering::Release);
    }
    /// Reader: the wake word before the head.
    #[inline(always)]
    fn after_wake() {
        fence(Ordering::Acquire);
    }
}

/// All six.
pub struct Whole;
impl Fences for Whole {}

/// Why a sample cannot be had.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Miss {
    /// The head has not come to it.
    NotYet,
    /// A later sample has taken its slot.
    Overrun,
    /// Its writer died while writing it.
    Unfinished,
}

/// Marks the slot as being overwritten by `sequence`: from here no reader takes it for anything.
#[inline]
pub fn begin<F: Fences>(slot: &[AtomicU64], sequence: u64) {
    slot[MARK].store(sequence.wrapping_mul(2) | 1, Ordering::Relaxed);
    F::after_odd();
}

/// Marks the slot as holding `sequence` whole.
#[inline]
pub fn commit(slot: &[AtomicU64], sequence: u64) {
    slot[MARK].store(sequence.wrapping_mul(2), Ordering::Relaxed);
}

/// Shows everything up to `sequence` to the readers.
#[inline]
pub fn show<F: Fences>(head: &AtomicU64, sequence: u64) {
    F::before_head();
    head.store(sequence, Ordering::Relaxed);
}

/// Bumps the wake word: whoever snapshot it before will not go to sleep.
#[inline]
pub fn bump<F: Fences>(wake: &AtomicU32) {
    F::before_wake();
    wake.fetch_add(1, Ordering::Relaxed);
}

/// A snapshot of the wake word, to be taken before looking at the head.
#[inline]
pub fn look<F: Fences>(wake: &AtomicU32) -> u32 {
    let value = wake.load(Ordering::Relaxed);
    F::after_wake();
    value
}

/// The newest complete sequence number; 0 when there is none.
#[inline]
pub fn head<F: Fences>(head: &AtomicU64) -> u64 {
    let value = head.load(Ordering::Relaxed);
    F::after_head();
    value
}

/// Runs `copy` over the slot of `sequence` and says whether what it saw was that sample, whole. One try: a mark never
/// comes back, so a second one could not do better. `newest` is what [`head`] returned.
#[inline]
pub fn read<F: Fences, T>(
    slot: &[AtomicU64],
    newest: u64,
    sequence: u64,
    copy: impl FnOnce(&[AtomicU64]) -> T,
) -> Result<T, Miss> {
    if sequence > newest {
        return Err(Miss::NotYet);
    }
    let wanted = sequence.wrapping_mul(2);
    classify(slot[MARK].load(Ordering::Relaxed), wanted)?;
    let copied = copy(slot);
    F::after_copy();
    classify(slot[MARK].load(Ordering::Relaxed), wanted)?;
    Ok(copied)
}

/// What a mark says about the sample whose own mark is `wanted`. Only called for samples up to the head, so a lower
/// mark means that `wanted` was begun by nobody or never ended.
#[inline]
fn classify(mark: u64, wanted: u64) -> Result<(), Miss> {
    match mark {
        _ if mark == wanted => Ok(()),
        _ if mark > wanted | 1 => Err(Miss::Overrun),
        _ => Err(Miss::Unfinished),
    }
}
