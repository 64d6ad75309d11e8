//! From one writer to the next: in the same ring, or into a new one.

use super::atomic::Ordering;
use super::image::Image;
use super::layout::{Geometry, at};
use super::ring::{self, Whole};

/// What a writer starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Start {
    /// Number of its first sample.
    pub next: u64,
    /// Its own generation.
    pub generation: u64,
}

/// Takes the place of a dead writer in its own ring. Continues after the newest number that any slot shows, not after
/// the head: a number used twice would put two samples behind one mark, and a reader of the first could copy half of each.
/// `None` when the ring is retired or damaged and a new one is needed.
pub(super) fn resume(image: &Image, pid: u32) -> Option<Start> {
    if image.retired() != 0 {
        return None;
    }
    let survey = image.survey()?;
    // A sample that was complete is shown, although its writer did not live to show it.
    ring::show::<Whole>(image.word(at::HEAD), survey.complete);
    let generation = image.word(at::GENERATION).load(Ordering::Relaxed).wrapping_add(1);
    image.word(at::GENERATION).store(generation, Ordering::Relaxed);
    image.word(at::WRITER_PID).store(u64::from(pid), Ordering::Relaxed);
    // Whoever waits for a writer (or for its restart) looks now.
    image.wake();
    Some(Start { next: survey.begun + 1, generation })
}

/// Ends a ring: what its writer, should it wake up, writes from now on counts for nobody.
pub(super) fn retire(image: &Image) {
    if image.retired() == 0 {
        let last = image.survey().map_or_else(|| image.head(), |survey| survey.begun);
        image.word(at::RETIRED).store(last.wrapping_add(1).max(1), Ordering::Relaxed);
    }
}

/// Fills the new, empty ring `to` from its retired predecessor: the count of writers always, and, when the messages
/// are the same, the numbers and as much of the history as fits.
pub(super) fn inherit(from: &Image, from_geometry: &Geometry, to: &Image, to_geometry: &Geometry) {
    let generation = from.word(at::GENERATION).load(Ordering::Relaxed);
    to.word(at::GENERATION).store(generation, Ordering::Relaxed);
    let Some(survey) = from.survey() else { return };
    if !from_geometry.same_layout(to_geometry) {
        return;
    }
    // Unless its writer is still at it, a ring's begun numbers end at its limit.
    let last = survey.begun.min(from.retired().wrapping_sub(1));
    let first = last.saturating_sub(to.shape.depth as u64).max(1);
    let complete = (first..=last).fold(0, |newest, sequence| if copy(from, to, sequence) { sequence } else { newest });
    if complete < last {
        // Keeps the number of a sample that could not be carried from being given twice.
        to.slot(last)[ring::MARK].store(2 * last + 1, Ordering::Relaxed);
    }
    ring::show::<Whole>(to.word(at::HEAD), complete);
}

/// Copies one sample, unless it is incomplete or too long for the new ring. Its writer may be at it this very moment.
fn copy(from: &Image, to: &Image, sequence: u64) -> bool {
    let target = to.slot(sequence);
    // The sample counts as shown: it may be one that the dead writer completed without showing it.
    let copied = ring::read::<Whole, _>(from.slot(sequence), sequence, sequence, |source| {
        for (word, value) in target.iter().zip(source).skip(ring::STAMP) {
            word.store(value.load(Ordering::Relaxed), Ordering::Relaxed);
        }
        source[ring::TAIL_BYTES].load(Ordering::Relaxed) <= to.shape.tail_bytes as u64
    });
    let whole = copied == Ok(true);
    if whole {
        ring::commit(target, sequence);
    }
    whole
}
