//! The table of nodes: a line per node, with its heartbeat and its keepsake, in a sealed memfd.
//!
//! The *heartbeat*: the node counts at every step and every idle wake; the supervisor looks. The *keepsake*: a few bytes
//! that a node leaves its successor (an operator's stop, the identity of its device); they outlive the node, the
//! supervisor and the guard, because the root holds the memory. Every node of a robot can write the whole table.

use std::sync::atomic::{AtomicU64, Ordering, fence};

use crate::memory::Words;
use crate::state_file::crc32;

/// Lines of a table.
pub const LINES: usize = 128;
/// The line of the supervisor itself, which the guard looks at.
pub const SUPERVISOR_LINE: usize = LINES - 1;
/// Words of a line.
const LINE_WORDS: usize = 40;
/// Most bytes of a keepsake.
pub const KEPT_BYTES: usize = (LINE_WORDS - KEPT - 1) * 8;

const BEATS: usize = 0;
const THREAD: usize = 1;
const LIMIT: usize = 2;
const BEAT_AT: usize = 3;
const PHASE: usize = 4;
const OBEYED: usize = 5;
const OBEYED_AT: usize = 6;
/// A fault that chaos wants of the node.
const FAULT: usize = 7;
/// What the node has done so far: steps, time in them [ns], steps that ended too late.
const STEPS: usize = 8;
const BUSY: usize = 9;
const MISSED: usize = 10;
/// Length and checksum of the keepsake; its bytes follow.
const KEPT: usize = 16;

/// What a node's thread was doing when it last counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Not yet running.
    Absent,
    /// Waiting for triggers.
    Waiting,
    /// In a step.
    Stepping,
    /// Ended in order.
    Ended,
}

/// What a node's thread has done since its process began.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Steps.
    pub steps: u64,
    /// Time in them [ns].
    pub busy_ns: u64,
    /// Steps that ended after their deadline.
    pub missed_deadlines: u64,
}

/// A fault that a node is told to have, where the run allows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Injected {
    /// Its step waits for ever.
    Hang = 1,
    /// Its step computes for ever.
    Spin,
    /// Its step takes memory for ever.
    Hog,
}

/// All lines.
#[derive(Debug, Clone, Copy)]
pub struct Table(Words);

/// One node's line.
#[derive(Debug, Clone, Copy)]
pub struct Line(&'static [AtomicU64]);

impl Table {
    /// Bytes of the memory.
    pub const BYTES: usize = LINES * LINE_WORDS * 8;

    /// The table in `memfd`.
    pub fn map(memfd: impl std::os::fd::AsFd) -> std::io::Result<Table> {
        Words::map(memfd, LINES * LINE_WORDS, true).map(Table)
    }

    /// Line `index`, if there is one.
    pub fn line(&self, index: usize) -> Option<Line> {
        self.0.all().get(index * LINE_WORDS..(index + 1) * LINE_WORDS).map(Line)
    }
}

impl Line {
    /// A line of this process alone.
    pub fn local() -> Line {
        Line(Words::local(LINE_WORDS).all())
    }

    /// The node's thread says who it is, and how long it may be silent [ns].
    pub fn begin(&self, process: u32, thread: u32, limit_ns: u64) {
        self.0[LIMIT].store(limit_ns, Ordering::Relaxed);
        self.0[PHASE].store(0, Ordering::Relaxed);
        self.count(Work::default());
        self.0[THREAD].store(u64::from(process) << 32 | u64::from(thread), Ordering::Release);
    }

    /// The node lives, at `now_ns`.
    #[inline]
    pub fn beat(&self, now_ns: u64, phase: Phase) {
        self.0[PHASE].store(phase as u64, Ordering::Relaxed);
        self.0[BEAT_AT].store(now_ns, Ordering::Relaxed);
        // One writer: a load and a store count as well as an atomic addition, and cost less.
        let beats = self.0[BEATS].load(Ordering::Relaxed);
        self.0[BEATS].store(beats.wrapping_add(1), Ordering::Release);
    }

    /// Count of beats.
    pub fn beats(&self) -> u64 {
        self.0[BEATS].load(Ordering::Acquire)
    }

    /// When the last beat was [ns].
    pub fn beat_at_ns(&self) -> u64 {
        self.0[BEAT_AT].load(Ordering::Relaxed)
    }

    /// What the node did then.
    pub fn phase(&self) -> Phase {
        match self.0[PHASE].load(Ordering::Relaxed) {
            1 => Phase::Waiting,
            2 => Phase::Stepping,
            3 => Phase::Ended,
            _ => Phase::Absent,
        }
    }

    /// The process and the thread that write the line.
    pub fn writer(&self) -> (u32, u32) {
        let both = self.0[THREAD].load(Ordering::Acquire);
        ((both >> 32) as u32, both as u32)
    }

    /// How long the node may be silent [ns].
    pub fn limit_ns(&self) -> u64 {
        self.0[LIMIT].load(Ordering::Relaxed)
    }

    /// The node has done so much since its process began.
    #[inline]
    pub fn count(&self, work: Work) {
        self.0[BUSY].store(work.busy_ns, Ordering::Relaxed);
        self.0[MISSED].store(work.missed_deadlines, Ordering::Relaxed);
        self.0[STEPS].store(work.steps, Ordering::Release);
    }

    /// What the node has done. Read while it counts, the numbers may be a step apart.
    pub fn work(&self) -> Work {
        let steps = self.0[STEPS].load(Ordering::Acquire);
        let (busy_ns, missed_deadlines) =
            (self.0[BUSY].load(Ordering::Relaxed), self.0[MISSED].load(Ordering::Relaxed));
        Work { steps, busy_ns, missed_deadlines }
    }

    /// The node has obeyed this word of the latch, at `now_ns`.
    pub fn obeyed(&self, word: u32, now_ns: u64) {
        self.0[OBEYED_AT].store(now_ns, Ordering::Relaxed);
        self.0[OBEYED].store(u64::from(word), Ordering::Release);
    }

    /// The newest word of the latch that the node has obeyed, and when [ns].
    pub fn last_obeyed(&self) -> (u32, u64) {
        let word = self.0[OBEYED].load(Ordering::Acquire);
        (word as u32, self.0[OBEYED_AT].load(Ordering::Relaxed))
    }

    /// Tells the node to have a fault in its next step.
    pub fn inject(&self, fault: Injected) {
        self.0[FAULT].store(fault as u64, Ordering::Release);
    }

    /// The fault that the node is to have, once.
    pub fn take_injected(&self) -> Option<Injected> {
        if self.0[FAULT].load(Ordering::Relaxed) == 0 {
            return None;
        }
        match self.0[FAULT].swap(0, Ordering::Acquire) {
            1 => Some(Injected::Hang),
            2 => Some(Injected::Spin),
            3 => Some(Injected::Hog),
            _ => None,
        }
    }

    /// Leaves `bytes` to the successor; false when they are too many. Neither allocates nor blocks.
    pub fn keep(&self, bytes: &[u8]) -> bool {
        if bytes.len() > KEPT_BYTES {
            return false;
        }
        // A death in between leaves a length of zero: nothing kept, rather than half of it.
        self.0[KEPT].store(0, Ordering::Relaxed);
        fence(Ordering::Release);
        for (word, chunk) in self.0[KEPT + 1..].iter().zip(bytes.chunks(8)) {
            let mut whole = [0; 8];
            whole[..chunk.len()].copy_from_slice(chunk);
            word.store(u64::from_le_bytes(whole), Ordering::Relaxed);
        }
        self.0[KEPT].store((bytes.len() as u64 + 1) << 32 | u64::from(crc32(bytes)), Ordering::Release);
        true
    }

    /// What the predecessor left, copied into `out`; `None` when it left nothing whole.
    pub fn kept<'a>(&self, out: &'a mut [u8; KEPT_BYTES]) -> Option<&'a [u8]> {
        let head = self.0[KEPT].load(Ordering::Acquire);
        let length = ((head >> 32) as usize).checked_sub(1).filter(|length| *length <= KEPT_BYTES)?;
        for (word, chunk) in self.0[KEPT + 1..].iter().zip(out.chunks_mut(8)) {
            chunk.copy_from_slice(&word.load(Ordering::Relaxed).to_le_bytes()[..chunk.len()]);
        }
        let bytes = &out[..length];
        (crc32(bytes) == head as u32).then_some(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_successor_finds_what_was_kept_and_nothing_else() {
        let line = Line::local();
        let mut out = [0; KEPT_BYTES];
        assert_eq!(line.kept(&mut out), None);
        assert!(line.keep(b""));
        assert_eq!(line.kept(&mut out), Some(&b""[..]));
        assert!(line.keep(b"halted, p3dx"));
        assert_eq!(line.kept(&mut out), Some(&b"halted, p3dx"[..]));
        assert!(line.keep(&[7; KEPT_BYTES]));
        assert!(!line.keep(&[8; KEPT_BYTES + 1]));
        assert_eq!(line.kept(&mut out).unwrap(), [7; KEPT_BYTES]);
    }

    #[test]
    fn a_keepsake_that_was_half_written_is_none() {
        let line = Line::local();
        line.keep(b"whole");
        line.0[KEPT + 1].fetch_xor(1, Ordering::Relaxed);
        assert_eq!(line.kept(&mut [0; KEPT_BYTES]), None);
    }

    #[test]
    fn beats_count_and_say_when_and_in_which_phase() {
        let line = Line::local();
        line.begin(7, 8, 100);
        line.beat(42, Phase::Stepping);
        line.beat(43, Phase::Waiting);
        assert_eq!((line.beats(), line.beat_at_ns(), line.phase()), (2, 43, Phase::Waiting));
        assert_eq!((line.writer(), line.limit_ns()), ((7, 8), 100));
    }
}
