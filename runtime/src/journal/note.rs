//! The place of one device, command, caller or keepsake in its node's journal.

use super::{EntryKind, Journal};
use crate::Time;

/// One port's place. Every method is called by the step.
#[derive(Debug, Clone)]
pub(crate) struct Note {
    journal: Journal,
    port: usize,
}

/// A call's state in a journal, without the answer's type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum PolledState {
    Running = 1,
    Answered = 2,
    Refused = 3,
    Failed = 4,
    Cancelled = 5,
    NotRunning = 6,
    Died = 7,
    TimedOut = 8,
}

impl Note {
    pub(super) fn new(journal: Journal, port: usize) -> Note {
        Note { journal, port }
    }

    /// Whether the step is played back to: then the world is not asked, and not told.
    pub fn plays(&self) -> bool {
        self.journal.book().play.is_some()
    }

    /// Writes an entry down.
    pub fn say(&self, kind: EntryKind, parts: &[&[u8]]) {
        self.journal.book().write(kind, self.port, parts);
    }

    /// Counts a question that had no answer.
    pub fn nothing(&self, kind: EntryKind) {
        self.journal.book().nothing(kind, self.port);
    }

    /// Playback: the next answer of this kind, if it is due.
    pub fn played(&self, kind: EntryKind) -> Option<Vec<u8>> {
        let mut book = self.journal.book();
        if !book.is_due(kind, self.port) {
            return None;
        }
        let payload = book.play.as_mut().and_then(|play| play.take(kind, self.port));
        if let Some(asked) = book.asked_mut(kind, self.port) {
            *asked = 0;
        }
        payload
    }

    /// Bytes that a device gave; none counts as a question without an answer.
    pub fn received(&self, arrived: Time, bytes: &[u8]) {
        match bytes.is_empty() {
            true => self.nothing(EntryKind::Received),
            false => self.say(EntryKind::Received, &[&arrived.nanos().to_le_bytes(), bytes]),
        }
    }

    /// Playback: bytes that the device gave then.
    pub fn played_bytes(&self, buffer: &mut [u8], arrived: &mut Time) -> usize {
        let mut book = self.journal.book();
        if !book.is_due(EntryKind::Received, self.port) {
            return 0;
        }
        let taken = book.play.as_mut().and_then(|play| play.take_bytes(EntryKind::Received, self.port, buffer));
        if let Some(asked) = book.asked_mut(EntryKind::Received, self.port) {
            *asked = 0;
        }
        let Some((stamp, count)) = taken else { return 0 };
        *arrived = Time::from_nanos(stamp);
        count
    }

    /// The link's word that the step was told; only changes are entries.
    pub fn link(&self, word: u64) {
        let mut book = self.journal.book();
        match book.links.get(self.port).copied() {
            Some(known) if known != Some(word) => {
                book.links[self.port] = Some(word);
                book.write(EntryKind::Link, self.port, &[&word.to_le_bytes()]);
            }
            Some(_) => book.nothing(EntryKind::Link, self.port),
            None => book.lost = true,
        }
    }

    /// Playback: the link's word that the step was told then; `unknown` before the first.
    pub fn played_link(&self, unknown: u64) -> u64 {
        let change = self.played(EntryKind::Link).and_then(|payload| Some(u64::from_le_bytes(*payload.first_chunk()?)));
        let mut book = self.journal.book();
        let Some(link) = book.links.get_mut(self.port) else { return unknown };
        *link = change.or(*link);
        link.unwrap_or(unknown)
    }

    /// Whether the step was told that the device's link is a predecessor's; only changes are entries.
    pub fn kept(&self, kept: bool) {
        let mut book = self.journal.book();
        match book.kept.get(self.port).copied() {
            Some(known) if known != kept => {
                book.kept[self.port] = kept;
                book.write(EntryKind::Kept, self.port, &[&[u8::from(kept)]]);
            }
            Some(_) => book.nothing(EntryKind::Kept, self.port),
            None => book.lost = true,
        }
    }

    /// Playback: what the step was told of it then; no before the first change.
    pub fn played_kept(&self) -> bool {
        let change = self.played(EntryKind::Kept).and_then(|payload| payload.first().map(|byte| *byte != 0));
        let mut book = self.journal.book();
        let Some(kept) = book.kept.get_mut(self.port) else { return false };
        *kept = change.unwrap_or(*kept);
        *kept
    }

    /// Number of the next request that the step takes from this command.
    pub fn count_taken(&self) -> u64 {
        let mut book = self.journal.book();
        let Some(taken) = book.taken.get_mut(self.port) else { return 0 };
        *taken += 1;
        *taken
    }
}
