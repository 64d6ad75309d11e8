//! The stop latch as nodes see it, and what a node leaves its successor.
//!
//! A node that moves something asks for the latch and obeys it in its own step; a node that sees danger asks for a
//! source and raises or holds it. Neither waits for anybody. On a live robot the guard keeps the latch, in the simulated
//! host the host does; elsewhere motion is always allowed.

use guard::{KEPT_BYTES, LatchPage, Line, Word};
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::journal::{EntryKind, Note};
use crate::pump::Waker;
use crate::{Time, clock};

/// Where a node's latch is.
#[derive(Debug, Clone, Default)]
pub(crate) enum LatchPlace {
    /// Nowhere: motion is allowed.
    #[default]
    None,
    /// The guard's memory.
    Shared(LatchPage),
    /// The simulated host's own.
    Simulated(Rc<Cell<Word>>),
}

/// What ports and host share of the latch.
#[derive(Debug, Default)]
pub(crate) struct LatchCell {
    pub place: RefCell<LatchPlace>,
    /// Whether the node asked for it.
    pub declared: Cell<bool>,
    /// As it was when the step began.
    frozen: Cell<Word>,
    /// The newest word that the node has obeyed.
    pub obeyed: Cell<Word>,
    /// When it said so on a live robot: at that moment, not at the end of its step.
    pub obeyed_at: Cell<Time>,
}

impl LatchCell {
    /// Fixes what the step sees.
    #[inline]
    pub fn freeze(&self) {
        if self.declared.get() {
            self.frozen.set(match &*self.place.borrow() {
                LatchPlace::None => Word::default(),
                LatchPlace::Shared(page) => page.word(),
                LatchPlace::Simulated(word) => word.get(),
            });
        }
    }

    /// What the step saw.
    pub fn seen(&self) -> Word {
        self.frozen.get()
    }

    /// Lets the step see `word`, as a recorded one did.
    pub fn show(&self, word: Word) {
        self.frozen.set(word);
    }

    /// The word that a live node sleeps on, if it has asked for the latch.
    pub fn futex(&self) -> Option<&'static AtomicU32> {
        match &*self.place.borrow() {
            LatchPlace::Shared(page) if self.declared.get() => Some(page.futex()),
            _ => None,
        }
    }
}

/// The stop latch, to obey.
#[derive(Debug, Clone)]
pub struct StopLatch(pub(crate) Rc<LatchCell>);

impl StopLatch {
    /// Whether motion was allowed when the step began.
    pub fn allows_motion(&self) -> bool {
        self.0.frozen.get().allows_motion()
    }

    /// A number that grows with every change of the latch.
    pub fn change(&self) -> u32 {
        self.0.frozen.get().epoch()
    }

    /// A driver says that it has written what stops its device.
    pub fn obeyed(&self) {
        self.0.obeyed.set(self.0.frozen.get());
        if matches!(&*self.0.place.borrow(), LatchPlace::Shared(_)) {
            // For whoever measures; the step itself sees no clock.
            self.0.obeyed_at.set(clock::now());
        }
    }
}

/// What a source wants, shared by the step and the pump that tells the guard.
#[derive(Debug)]
pub(crate) struct SourceWord {
    pub name: String,
    /// Twice the count of raises, plus one while it holds.
    wanted: AtomicU32,
    reason: AtomicU32,
    pub reasons: &'static [&'static str],
    waker: std::sync::OnceLock<Waker>,
}

impl SourceWord {
    pub fn attach(&self, waker: Waker) {
        let _ = self.waker.set(waker);
    }

    /// Count of raises, whether it holds, and why.
    pub fn wanted(&self) -> (u32, bool, &'static str) {
        let wanted = self.wanted.load(Ordering::Acquire);
        let reason = self.reasons.get(self.reason.load(Ordering::Relaxed) as usize).copied().unwrap_or("");
        (wanted >> 1, wanted & 1 != 0, reason)
    }

    fn want(&self, change: impl Fn(u32) -> u32) {
        let before = self.wanted.load(Ordering::Relaxed);
        let after = change(before);
        if after != before {
            self.wanted.store(after, Ordering::Release);
            if let Some(waker) = self.waker.get() {
                waker.wake();
            }
        }
    }
}

/// A node's right to stop the robot.
#[derive(Debug, Clone)]
pub struct StopSource(pub(crate) Arc<SourceWord>);

impl StopSource {
    pub(crate) fn new(name: String, reasons: &'static [&'static str]) -> StopSource {
        StopSource(Arc::new(SourceWord {
            name,
            wanted: AtomicU32::new(0),
            reason: AtomicU32::new(0),
            reasons,
            waker: std::sync::OnceLock::new(),
        }))
    }

    /// Stops the robot, for the reason with this number in the list that the source was declared with.
    pub fn raise(&self, reason: usize) {
        self.0.reason.store(reason as u32, Ordering::Relaxed);
        self.0.want(|wanted| wanted.wrapping_add(2));
    }

    /// Stops the robot for as long as the cause is there: no reset is accepted meanwhile. Saying it again is free.
    pub fn hold(&self, reason: usize) {
        if self.0.wanted.load(Ordering::Relaxed) & 1 == 0 {
            self.0.reason.store(reason as u32, Ordering::Relaxed);
        }
        self.0.want(|wanted| wanted | 1);
    }

    /// The cause is gone. The robot stands until a person resets and resumes it.
    pub fn lower(&self) {
        self.0.want(|wanted| wanted & !1);
    }
}

/// What a node leaves its successor: a few bytes that outlive its process.
#[derive(Debug, Clone, Default)]
pub struct Keepsake {
    pub(crate) place: Rc<RefCell<KeepPlace>>,
    /// Its place in the node's journal: what was left is an input of the life that reads it.
    note: Option<Note>,
}

/// Where it lies.
#[derive(Debug, Default)]
pub(crate) enum KeepPlace {
    /// In the host's own memory.
    #[default]
    Nowhere,
    /// In the table that the root of the process tree holds.
    Line(Line),
    /// In this process.
    Local(Vec<u8>),
    /// In the simulated host, which keeps it while the node is dead.
    Host(Keepsake),
}

impl Keepsake {
    /// Most bytes.
    pub const MOST_BYTES: usize = KEPT_BYTES;

    /// Lets this be the same as `other`, which outlives it.
    pub(crate) fn share(&self, other: &Keepsake) {
        *self.place.borrow_mut() = KeepPlace::Host(other.clone());
    }

    /// The same keepsake, whose use is written down, or played back.
    pub(crate) fn noted(&self, note: Option<Note>) -> Keepsake {
        Keepsake { place: self.place.clone(), note }
    }

    /// Leaves `bytes`; false when they are too many.
    pub fn keep(&self, bytes: &[u8]) -> bool {
        if let Some(note) = &self.note {
            note.say(EntryKind::Left, &[bytes]);
            if note.plays() {
                return bytes.len() <= KEPT_BYTES;
            }
        }
        match &mut *self.place.borrow_mut() {
            KeepPlace::Line(line) => line.keep(bytes),
            KeepPlace::Host(other) => other.keep(bytes),
            KeepPlace::Local(kept) if bytes.len() <= KEPT_BYTES => {
                kept.clear();
                kept.extend_from_slice(bytes);
                true
            }
            place @ KeepPlace::Nowhere if bytes.len() <= KEPT_BYTES => {
                *place = KeepPlace::Local(Vec::with_capacity(KEPT_BYTES));
                if let KeepPlace::Local(kept) = place {
                    kept.extend_from_slice(bytes);
                }
                true
            }
            _ => false,
        }
    }

    /// What the predecessor left, copied into `out`; empty when it left nothing.
    pub fn kept<'a>(&self, out: &'a mut [u8; KEPT_BYTES]) -> &'a [u8] {
        let Some(note) = &self.note else { return self.look(out) };
        if note.plays() {
            let played = note.played(EntryKind::Inherited).unwrap_or_default();
            let length = played.len().min(KEPT_BYTES);
            out[..length].copy_from_slice(&played[..length]);
            return &out[..length];
        }
        let kept = self.look(out);
        match kept.is_empty() {
            true => note.nothing(EntryKind::Inherited),
            false => note.say(EntryKind::Inherited, &[kept]),
        }
        kept
    }

    fn look<'a>(&self, out: &'a mut [u8; KEPT_BYTES]) -> &'a [u8] {
        match &*self.place.borrow() {
            KeepPlace::Line(line) => line.kept(out).unwrap_or_default(),
            KeepPlace::Host(other) => other.kept(out),
            KeepPlace::Local(kept) => {
                out[..kept.len()].copy_from_slice(kept);
                &out[..kept.len()]
            }
            KeepPlace::Nowhere => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_counts_raises_and_remembers_what_it_holds() {
        let source = StopSource::new("/actions/watch".into(), &["too near", "too fast"]);
        assert_eq!(source.0.wanted(), (0, false, "too near"));
        source.raise(1);
        source.hold(0);
        source.hold(1);
        assert_eq!(source.0.wanted(), (1, true, "too near"));
        source.lower();
        source.raise(7);
        assert_eq!(source.0.wanted(), (2, false, ""));
    }

    #[test]
    fn without_a_latch_motion_is_allowed_and_with_one_the_step_sees_it_as_it_began() {
        let cell = Rc::new(LatchCell::default());
        let latch = StopLatch(cell.clone());
        cell.freeze();
        assert!(latch.allows_motion());
        let word = Rc::new(Cell::new(Word(4)));
        *cell.place.borrow_mut() = LatchPlace::Simulated(word.clone());
        cell.declared.set(true);
        cell.freeze();
        word.set(Word(9));
        assert!(latch.allows_motion());
        cell.freeze();
        assert!(!latch.allows_motion());
        latch.obeyed();
        assert_eq!(cell.obeyed.get(), Word(9));
    }

    #[test]
    fn a_keepsake_of_this_process_alone_is_found_again() {
        let keepsake = Keepsake::default();
        let mut out = [0; KEPT_BYTES];
        assert_eq!(keepsake.kept(&mut out), b"");
        assert!(keepsake.keep(b"halted"));
        assert_eq!(keepsake.kept(&mut out), b"halted");
        assert!(!keepsake.keep(&[0; KEPT_BYTES + 1]));
    }
}
