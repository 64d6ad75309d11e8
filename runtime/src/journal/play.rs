//! The entries of recorded steps, waiting to be played back.

use std::collections::VecDeque;

use super::{EntryKind, FIRST_OUTPUT, HEADER_BYTES};

/// Entries in their order, as they lie in a [`messages::StepEvents`]; ends at what is no entry.
pub(crate) struct Entries<'a>(pub &'a [u8]);

/// One entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry<'a> {
    pub kind: u8,
    pub port: u8,
    /// Empty answers before it.
    pub before: u16,
    pub payload: &'a [u8],
}

impl<'a> Iterator for Entries<'a> {
    type Item = Entry<'a>;

    fn next(&mut self) -> Option<Entry<'a>> {
        let (header, rest) = self.0.split_first_chunk::<HEADER_BYTES>()?;
        let [kind, port, low, high, length @ ..] = *header;
        let length = u32::from_le_bytes(length) as usize;
        let (payload, rest) = rest.split_at_checked(length)?;
        self.0 = rest;
        Some(Entry { kind, port, before: u16::from_le_bytes([low, high]), payload })
    }
}

/// An input entry that no question has been answered with yet.
#[derive(Debug)]
struct Waiting {
    kind: u8,
    port: u8,
    before: u16,
    payload: Vec<u8>,
    /// Bytes of a device that a smaller buffer has taken already.
    done: usize,
}

/// Input entries that wait for their questions.
#[derive(Debug, Default)]
pub(super) struct Play {
    waiting: VecDeque<Waiting>,
}

impl Play {
    /// Adds the input entries of the next step. What an earlier step did not ask for (a changed node) is there at once, as
    /// it would be in the world.
    pub fn fill(&mut self, recorded: &[u8]) {
        self.waiting.retain(|entry| entry.kind != EntryKind::SendFailed as u8);
        for entry in &mut self.waiting {
            entry.before = 0;
        }
        for entry in Entries(recorded).filter(|entry| entry.kind < FIRST_OUTPUT) {
            let Entry { kind, port, before, payload } = entry;
            self.waiting.push_back(Waiting { kind, port, before, payload: payload.to_vec(), done: 0 });
        }
    }

    pub fn is_due(&self, kind: EntryKind, port: usize, asked: u16) -> bool {
        self.find(kind, port).is_some_and(|index| asked >= self.waiting[index].before)
    }

    fn find(&self, kind: EntryKind, port: usize) -> Option<usize> {
        self.waiting.iter().position(|entry| entry.kind == kind as u8 && usize::from(entry.port) == port)
    }

    /// Takes the next entry's payload.
    pub fn take(&mut self, kind: EntryKind, port: usize) -> Option<Vec<u8>> {
        let index = self.find(kind, port)?;
        self.waiting.remove(index).map(|entry| entry.payload)
    }

    /// Takes as many bytes of the next entry as `buffer` holds, after its first eight; these, and how many.
    pub fn take_bytes(&mut self, kind: EntryKind, port: usize, buffer: &mut [u8]) -> Option<(u64, usize)> {
        let index = self.find(kind, port)?;
        let entry = &mut self.waiting[index];
        let (stamp, bytes) = entry.payload.split_first_chunk::<8>()?;
        let stamp = u64::from_le_bytes(*stamp);
        let rest = &bytes[entry.done.min(bytes.len())..];
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        entry.done += count;
        entry.before = 0;
        if entry.done >= bytes.len() {
            self.waiting.remove(index);
        }
        Some((stamp, count))
    }
}
