//! What reaches a step other than by its read ports, and what leaves it other than by its written ones: written down
//! entry by entry while the step runs, or played back to it.
//!
//! A device, a command, a caller and a keepsake each hold a [`Note`]: their place in the node's journal. In a node whose inputs are
//! not recorded there is none, and nothing is done. Writing down allocates nothing: the journal has a fixed capacity,
//! and an entry beyond it is counted as lost, which makes the step one that cannot be replayed.
//!
//! A question that had no answer ("no bytes", "no request") is no entry of its own: each entry says how many such answers
//! its port had given since the entry before. So a playback answers every question as it was answered, also where
//! something came in the middle of a step.

mod kind;
mod note;
mod play;

pub(crate) use kind::{EntryKind, FIRST_OUTPUT, name};
pub(crate) use note::{Note, PolledState};
pub(crate) use play::Entries;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use play::Play;

/// Bytes of entries that one step can have where the node has a device.
pub(crate) const DEVICE_BYTES: usize = 20 * 1024;
/// Bytes of entries that one step can have where it has calls only.
pub(crate) const CALL_BYTES: usize = 4 * 1024;
/// Ports of one kind that a journal tells apart.
const PORTS: usize = 32;
/// Kinds of input entries.
const INPUT_KINDS: usize = 9;
const HEADER_BYTES: usize = 8;

/// The journal of one node. Clones are the same journal.
#[derive(Clone)]
pub(crate) struct Journal(Arc<Mutex<Book>>);

struct Book {
    entries: Vec<u8>,
    lost: bool,
    /// Empty answers since the last entry, per input kind and port.
    asked: [[u16; PORTS]; INPUT_KINDS],
    /// The link's word that each device had last.
    links: [Option<u64>; PORTS],
    /// Whether each device said last that its link is a predecessor's.
    kept: [bool; PORTS],
    /// Requests taken from each command so far.
    taken: [u64; PORTS],
    /// What is played back instead of asking the world.
    play: Option<Play>,
}

impl Journal {
    /// An empty journal that writes down; without capacity until [`Journal::reserve`].
    pub fn recording() -> Journal {
        Journal::new(None)
    }

    /// A journal that plays back what is put into it.
    pub fn playing() -> Journal {
        Journal::new(Some(Play::default()))
    }

    fn new(play: Option<Play>) -> Journal {
        Journal(Arc::new(Mutex::new(Book {
            entries: Vec::new(),
            lost: false,
            asked: [[0; PORTS]; INPUT_KINDS],
            links: [None; PORTS],
            kept: [false; PORTS],
            taken: [0; PORTS],
            play,
        })))
    }

    /// Gives it its capacity.
    pub fn reserve(&self, bytes: usize) {
        self.book().entries.reserve_exact(bytes);
    }

    /// The place of port `port` in it.
    pub fn note(&self, port: usize) -> Note {
        Note::new(self.clone(), port)
    }

    /// Begins a step; in playback with the entries that were written down for it.
    pub fn begin(&self, recorded: &[u8]) {
        let mut book = self.book();
        book.entries.clear();
        book.lost = false;
        book.asked = [[0; PORTS]; INPUT_KINDS];
        if let Some(play) = &mut book.play {
            play.fill(recorded);
        }
    }

    /// The entries of the step, and whether one of them was lost.
    pub fn read<T>(&self, look: impl FnOnce(&[u8], bool) -> T) -> T {
        let book = self.book();
        look(&book.entries, book.lost)
    }

    fn book(&self) -> MutexGuard<'_, Book> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl std::fmt::Debug for Journal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Journal")
    }
}

impl Book {
    /// Appends an entry, all of it or nothing.
    fn write(&mut self, kind: EntryKind, port: usize, parts: &[&[u8]]) {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        let before = self.asked_mut(kind, port).map_or(0, std::mem::take);
        // A playback may be of a node that says more than it did: there memory is no matter.
        let fits = self.play.is_some() || self.entries.len() + HEADER_BYTES + length <= self.entries.capacity();
        if !fits || port >= PORTS {
            self.lost = true;
            return;
        }
        self.entries.extend_from_slice(&[kind as u8, port as u8]);
        self.entries.extend_from_slice(&before.to_le_bytes());
        self.entries.extend_from_slice(&(length as u32).to_le_bytes());
        for part in parts {
            self.entries.extend_from_slice(part);
        }
    }

    fn asked_mut(&mut self, kind: EntryKind, port: usize) -> Option<&mut u16> {
        self.asked.get_mut(kind as usize)?.get_mut(port)
    }

    /// Counts a question without an answer.
    fn nothing(&mut self, kind: EntryKind, port: usize) {
        if let Some(asked) = self.asked_mut(kind, port) {
            *asked = asked.saturating_add(1);
        }
    }

    /// Playback: whether the next entry of this kind is due at this question.
    fn is_due(&mut self, kind: EntryKind, port: usize) -> bool {
        let asked = self.asked_mut(kind, port).map_or(0, |asked| *asked);
        let due = self.play.as_ref().is_some_and(|play| play.is_due(kind, port, asked));
        if !due {
            self.nothing(kind, port);
        }
        due
    }
}
