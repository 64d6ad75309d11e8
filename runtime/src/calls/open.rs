//! A request that a step has taken: its place in the stage, or in a recording that is played back.

use std::sync::Arc;

use messages::Message;
use messages::bytemuck;

use super::stage::{Cancellation, End, Particulars, Sender, Stage};
use super::wire::Name;
use crate::Time;
use crate::journal::{EntryKind, Note};

/// A request that the step holds.
#[derive(Debug)]
pub(super) struct Open {
    stage: Arc<Stage>,
    /// None in a playback.
    place: Option<usize>,
    /// Counts the command's requests, for the journal.
    number: u64,
    note: Option<Note>,
}

impl Open {
    /// The next request for the command, and what comes with it.
    pub fn take<Q: Message>(stage: &Arc<Stage>, note: Option<&Note>) -> Option<(Q, Particulars, Open)> {
        let open = |place, number| Open { stage: Arc::clone(stage), place, number, note: note.cloned() };
        if let Some(note) = note.filter(|note| note.plays()) {
            let payload = note.played(EntryKind::Taken)?;
            let (message, particulars) = parse(&payload)?;
            return Some((message, particulars, open(None, note.count_taken())));
        }
        let place = stage.take();
        if let (None, Some(note)) = (place, note) {
            note.nothing(EntryKind::Taken);
        }
        let place = place?;
        let (message, particulars) = stage.read::<Q>(place);
        let number = note.map_or(0, Note::count_taken);
        if let Some(note) = note {
            let Particulars { sender, priority, deadline } = &particulars;
            let name = sender.name.as_str().as_bytes();
            note.say(
                EntryKind::Taken,
                &[
                    &number.to_le_bytes(),
                    &deadline.nanos().to_le_bytes(),
                    &sender.pid.to_le_bytes(),
                    &sender.uid.to_le_bytes(),
                    &[*priority, name.len() as u8],
                    name,
                    bytemuck::bytes_of(&message),
                ],
            );
        }
        Some((message, particulars, open(Some(place), number)))
    }

    /// Why the request is no longer wanted, if so.
    pub fn cancellation(&self) -> Option<Cancellation> {
        let asked = |place| self.stage.cancellation(place);
        let Some(note) = &self.note else { return self.place.and_then(asked) };
        if note.plays() {
            let payload = note.played(EntryKind::Cancelled)?;
            return Some(if payload.last() == Some(&1) { Cancellation::Asked } else { Cancellation::CallerGone });
        }
        let why = self.place.and_then(asked);
        match why {
            Some(why) => note.say(EntryKind::Cancelled, &[&self.number.to_le_bytes(), &[why as u8]]),
            None => note.nothing(EntryKind::Cancelled),
        }
        why
    }

    /// Ends the request; `body` is the answer message, or nothing.
    pub fn end(&self, end: End, body: &[u8]) {
        if let Some(note) = &self.note {
            let (how, text) = match end {
                End::Answered => (0, ""),
                End::Refused(reason) => (1, reason),
                End::Failed(reason) => (2, reason),
                End::Cancelled => (3, ""),
                End::Forgotten => (4, ""),
            };
            note.say(EntryKind::Ended, &[&self.number.to_le_bytes(), &[how], body, text.as_bytes()]);
        }
        if let Some(place) = self.place {
            self.stage.end(place, end, body);
        }
    }

    /// Accepts a long order.
    pub fn accept(&self) {
        if let Some(note) = &self.note {
            note.say(EntryKind::Accepted, &[&self.number.to_le_bytes()]);
        }
        if let Some(place) = self.place {
            self.stage.accept(place);
        }
    }

    /// Reports progress.
    pub fn report(&self, body: &[u8]) {
        if let Some(note) = &self.note {
            note.say(EntryKind::Reported, &[&self.number.to_le_bytes(), body]);
        }
        if let Some(place) = self.place {
            // While the pump sends the report before, this one is left out; the next follows soon.
            let _ = self.stage.report(place, body);
        }
    }
}

/// Reads the payload of a `Taken` entry.
fn parse<Q: Message>(payload: &[u8]) -> Option<(Q, Particulars)> {
    let (_number, rest) = payload.split_first_chunk::<8>()?;
    let (deadline, rest) = rest.split_first_chunk::<8>()?;
    let (pid, rest) = rest.split_first_chunk::<4>()?;
    let (uid, rest) = rest.split_first_chunk::<4>()?;
    let ([priority, length], rest) = rest.split_first_chunk::<2>()?;
    let (name, body) = rest.split_at_checked(usize::from(*length))?;
    let mut message = Q::zeroed();
    let bytes = bytemuck::bytes_of_mut(&mut message);
    if bytes.len() != body.len() {
        return None;
    }
    bytes.copy_from_slice(body);
    let sender = Sender {
        name: Name::new(std::str::from_utf8(name).ok()?),
        pid: i32::from_le_bytes(*pid),
        uid: u32::from_le_bytes(*uid),
    };
    let deadline = Time::from_nanos(u64::from_le_bytes(*deadline));
    Some((message, Particulars { sender, priority: *priority, deadline }))
}
