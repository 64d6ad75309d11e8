//! The stop latch in shared memory: one word that drivers and motion sleep on, and who wanted the stop, when and why.
//!
//! The guard alone writes it; all others map it read-only. It outlives the guard: a new one goes on where it stands.

use std::io;
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

use crate::latch::State;
use crate::memory::Words;

/// Slots for sources.
pub(crate) const SOURCES: usize = 30;
const HEAD_WORDS: usize = 16;
const SOURCE_WORDS: usize = 32;
const WORDS: usize = HEAD_WORDS + SOURCES * SOURCE_WORDS;
const WORD: usize = 0;
const CHANGED_AT: usize = 1;
const WILLS: usize = 2;
const WILL_AT: usize = 3;

const USED: u64 = 1;
const HELD: u64 = 2;
const RAISED: u64 = 4;
const NAME: usize = 4;
const REASON: usize = 12;
/// Most bytes of a source's name.
pub const NAME_BYTES: usize = (REASON - NAME) * 8;

/// The latch's word: a number that grows with every change, and the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Word(pub u32);

impl Word {
    pub(crate) fn new(epoch: u32, state: State) -> Word {
        Word(epoch << 2 | state as u32)
    }

    /// The word after a change to `state`.
    pub fn changed_to(self, state: State) -> Word {
        Word::new(self.epoch().wrapping_add(1), state)
    }

    /// Count of changes.
    pub fn epoch(self) -> u32 {
        self.0 >> 2
    }

    /// Where the latch stands.
    pub fn state(self) -> State {
        State::from_number(self.0)
    }

    /// Whether motion is allowed.
    pub fn allows_motion(self) -> bool {
        self.state() == State::Run
    }
}

/// One source, as people read it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceInfo {
    /// Its name: a path of a node, or who it was.
    pub name: String,
    /// Why.
    pub reason: String,
    /// Whether it still holds its cause.
    pub held: bool,
    /// When, on the robot's clock [ns].
    pub at_ns: u64,
    /// When, since the Unix epoch [ms].
    pub unix_ms: u64,
    /// The process and the user that wanted it.
    pub by: (u32, u32),
}

/// The latch's memory.
#[derive(Debug, Clone, Copy)]
pub struct LatchPage(Words);

impl LatchPage {
    /// Bytes of the memory.
    pub const BYTES: usize = WORDS * 8;

    /// The latch in `memfd`, to look at.
    pub fn map(memfd: impl AsFd) -> io::Result<LatchPage> {
        Words::map(memfd, WORDS, false).map(LatchPage)
    }

    /// The latch in `memfd`, to write: the guard, and whoever makes it.
    pub fn map_writable(memfd: impl AsFd) -> io::Result<LatchPage> {
        Words::map(memfd, WORDS, true).map(LatchPage)
    }

    /// A latch of this process alone, for the simulated host and tests.
    pub fn local() -> LatchPage {
        LatchPage(Words::local(WORDS))
    }

    /// The word now.
    #[inline]
    pub fn word(&self) -> Word {
        let word = self.0.futex(WORD).load(Ordering::Relaxed);
        fence(Ordering::Acquire);
        Word(word)
    }

    /// What to sleep on; all of a robot's processes share it.
    pub fn futex(&self) -> &'static AtomicU32 {
        self.0.futex(WORD)
    }

    /// When the word last changed [ns].
    pub fn changed_at_ns(&self) -> u64 {
        self.0.all()[CHANGED_AT].load(Ordering::Relaxed)
    }

    /// How many last wills the guard has begun to write, and when the newest one's first bytes were written [ns].
    pub fn last_will(&self) -> (u64, u64) {
        let count = self.0.all()[WILLS].load(Ordering::Acquire);
        (count, self.0.all()[WILL_AT].load(Ordering::Relaxed))
    }

    pub(crate) fn note_will(&self, now_ns: u64) {
        self.0.all()[WILL_AT].store(now_ns, Ordering::Relaxed);
        self.0.all()[WILLS].fetch_add(1, Ordering::Release);
    }

    /// Sets the word and wakes all who sleep on it: for the guard, and for hosts without one.
    pub fn set(&self, state: State, now_ns: u64) {
        self.0.all()[CHANGED_AT].store(now_ns, Ordering::Relaxed);
        let epoch = self.word().epoch().wrapping_add(1);
        self.0.futex(WORD).store(Word::new(epoch, state).0, Ordering::Release);
        // Fails only when the page is gone, and then nobody sleeps there.
        let _ = rustix::thread::futex::wake(self.0.futex(WORD), rustix::thread::futex::Flags::empty(), i32::MAX as u32);
    }

    /// Everyone who has wanted a stop since the last reset, or still holds one.
    pub fn sources(&self) -> Vec<SourceInfo> {
        let slots = (0..SOURCES).map(|index| self.slot(index));
        let wanted = slots.filter(|slot| slot[0].load(Ordering::Relaxed) & (HELD | RAISED) != 0);
        let text = |words: &[AtomicU64]| {
            let bytes: Vec<u8> = words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes()).collect();
            let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
            String::from_utf8_lossy(&bytes[..end]).into_owned()
        };
        let all = wanted.map(|slot| SourceInfo {
            name: text(&slot[NAME..REASON]),
            reason: text(&slot[REASON..]),
            held: slot[0].load(Ordering::Relaxed) & HELD != 0,
            at_ns: slot[1].load(Ordering::Relaxed),
            unix_ms: slot[2].load(Ordering::Relaxed),
            by: split(slot[3].load(Ordering::Relaxed)),
        });
        let mut all: Vec<SourceInfo> = all.collect();
        all.sort_by_key(|source| source.at_ns);
        all
    }

    fn slot(&self, index: usize) -> &'static [AtomicU64] {
        let at = HEAD_WORDS + index * SOURCE_WORDS;
        &self.0.all()[at..at + SOURCE_WORDS]
    }

    /// What slot `index` says: held, raised.
    pub(crate) fn flags(&self, index: usize) -> (bool, bool) {
        let flags = self.slot(index)[0].load(Ordering::Relaxed);
        (flags & HELD != 0, flags & RAISED != 0)
    }

    pub(crate) fn set_flags(&self, index: usize, held: bool, raised: bool) {
        let flags = USED | if held { HELD } else { 0 } | if raised { RAISED } else { 0 };
        self.slot(index)[0].store(flags, Ordering::Relaxed);
    }

    /// The slot of the source `name`: its own, a free one, or one that nobody needs any more.
    pub(crate) fn find(&self, name: &[u8]) -> Option<usize> {
        let name = &name[..name.len().min(NAME_BYTES)];
        let flags = |index: usize| self.slot(index)[0].load(Ordering::Relaxed);
        let own =
            (0..SOURCES).find(|&index| flags(index) & USED != 0 && is_text(&self.slot(index)[NAME..REASON], name));
        own.or_else(|| (0..SOURCES).find(|&index| flags(index) & USED == 0))
            .or_else(|| (0..SOURCES).find(|&index| flags(index) & (HELD | RAISED) == 0))
    }

    /// Writes who wants the stop and why into slot `index`.
    pub(crate) fn describe(&self, index: usize, name: &[u8], reason: &[u8], at_ns: u64, unix_ms: u64, by: (u32, u32)) {
        let slot = self.slot(index);
        set_text(&slot[NAME..REASON], name);
        set_text(&slot[REASON..], reason);
        slot[1].store(at_ns, Ordering::Relaxed);
        slot[2].store(unix_ms, Ordering::Relaxed);
        slot[3].store(u64::from(by.0) << 32 | u64::from(by.1), Ordering::Relaxed);
    }

    /// Process and user of whoever filled slot `index` last.
    pub(crate) fn by(&self, index: usize) -> (u32, u32) {
        split(self.slot(index)[3].load(Ordering::Relaxed))
    }

    /// The name in slot `index`, without an allocation.
    pub(crate) fn name<'a>(&self, index: usize, out: &'a mut [u8; NAME_BYTES]) -> &'a [u8] {
        for (word, chunk) in self.slot(index)[NAME..REASON].iter().zip(out.chunks_mut(8)) {
            chunk.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes());
        }
        let end = out.iter().position(|byte| *byte == 0).unwrap_or(NAME_BYTES);
        &out[..end]
    }

    /// Begins a run with a stop that an earlier one was left with: a power cycle never starts motion.
    pub fn begin_stopped(&self, state: State, sources: &[SourceInfo], now_ns: u64) {
        for (index, source) in sources.iter().take(SOURCES).enumerate() {
            self.describe(index, source.name.as_bytes(), source.reason.as_bytes(), now_ns, source.unix_ms, source.by);
            // What held it is of the run before: it holds again if its cause is still there.
            self.set_flags(index, false, true);
        }
        self.set(state, now_ns);
    }
}

fn split(both: u64) -> (u32, u32) {
    ((both >> 32) as u32, both as u32)
}

fn set_text(words: &[AtomicU64], text: &[u8]) {
    for (index, word) in words.iter().enumerate() {
        let mut whole = [0; 8];
        for (to, from) in whole.iter_mut().zip(text.iter().skip(index * 8)) {
            *to = *from;
        }
        word.store(u64::from_le_bytes(whole), Ordering::Relaxed);
    }
}

fn is_text(words: &[AtomicU64], text: &[u8]) -> bool {
    let bytes = words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes());
    let padded = text.iter().copied().chain(std::iter::repeat(0));
    bytes.zip(padded).all(|(found, wanted)| found == wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_keeps_its_slot_and_a_full_page_gives_up_those_that_nobody_needs() {
        let page = LatchPage::local();
        for n in 0..SOURCES {
            let name = format!("source {n}");
            let slot = page.find(name.as_bytes()).unwrap();
            page.describe(slot, name.as_bytes(), b"why", n as u64, 0, (1, 2));
            page.set_flags(slot, n == 3, n != 5);
            assert_eq!((slot, page.find(name.as_bytes())), (n, Some(n)));
        }
        assert_eq!(page.find(b"one more"), Some(5));
        page.set_flags(5, true, true);
        assert_eq!(page.find(b"one more"), None);
    }

    #[test]
    fn sources_are_told_with_name_reason_time_and_whoever_it_was() {
        let page = LatchPage::local();
        page.describe(4, b"/actions/guard", "zu nah: 0.1 m".as_bytes(), 77, 1234, (10, 20));
        page.set_flags(4, true, true);
        let info = SourceInfo {
            name: "/actions/guard".into(),
            reason: "zu nah: 0.1 m".into(),
            held: true,
            at_ns: 77,
            unix_ms: 1234,
            by: (10, 20),
        };
        assert_eq!(page.sources(), [info]);
        page.set_flags(4, false, false);
        assert_eq!(page.sources(), []);
    }

    #[test]
    fn the_word_changes_with_every_setting_even_of_the_same_state() {
        let page = LatchPage::local();
        assert!(page.word().allows_motion());
        page.set(State::Stopping, 1);
        let first = page.word();
        page.set(State::Stopping, 2);
        assert_ne!(first, page.word());
        assert_eq!((page.word().state(), page.changed_at_ns()), (State::Stopping, 2));
    }

    #[test]
    fn a_run_that_begins_stopped_says_why() {
        let page = LatchPage::local();
        page.describe(0, b"operator", b"smoke", 1, 2, (3, 4));
        page.set_flags(0, true, true);
        let later = LatchPage::local();
        later.begin_stopped(State::Latched, &page.sources(), 9);
        assert_eq!(later.word().state(), State::Latched);
        let source = &later.sources()[0];
        assert_eq!((source.name.as_str(), source.reason.as_str(), source.held), ("operator", "smoke", false));
    }
}
