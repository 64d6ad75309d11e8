//! Byte-stream devices: serial ports, terminals, TCP, and the simulated host's memory links, behind one type.
//!
//! A live device is declared by [`Device::detached`] and comes to life when a [pump](crate::pump) that it was attached
//! to starts: the pump opens it, reads it into a private ring, and opens it again with back-off when it is lost. The
//! step's side never blocks and never allocates. The simulated host makes its devices by [`MemoryLinks`].

mod address;
mod link;
mod live;
mod memory;
mod ring;
mod wire;

use std::sync::Arc;
use std::sync::atomic::Ordering;

pub use address::{Address, AddressError, DEFAULT_BAUD};
pub use link::{DeviceLink, WhyClosed};
pub(crate) use live::LiveDevice;
pub use memory::{Direction, MemoryLink, MemoryLinks};
pub(crate) use wire::{Side, Wire};

use crate::Time;
use crate::journal::{EntryKind, Note};

/// Why bytes were not sent. None of them was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// The link is closed.
    #[error("the device is not connected: {0}")]
    Closed(WhyClosed),
    /// The link is being opened.
    #[error("the device is being opened")]
    Opening,
    /// The line is slower than what was sent.
    #[error("the device takes no more bytes for now")]
    Full,
}

/// One end of a byte stream to or from a device.
#[derive(Debug)]
pub struct Device {
    back: Back,
    arrived: Time,
    /// Where its bytes are written down, or played back from.
    note: Option<Note>,
}

#[derive(Debug)]
enum Back {
    Live(Arc<Wire>),
    Memory(memory::End),
}

impl Device {
    /// A device that this node uses, closed until a pump runs it.
    pub fn detached(address: Address) -> Device {
        Device::live(address, Side::Client)
    }

    /// A device that this node offers to others (the simulator's side), closed until a pump runs it.
    pub fn detached_server(address: Address) -> Device {
        Device::live(address, Side::Server)
    }

    fn live(address: Address, side: Side) -> Device {
        Device { back: Back::Live(Arc::new(Wire::new(address, side))), arrived: Time::ZERO, note: None }
    }

    pub(crate) fn memory(end: memory::End) -> Device {
        Device { back: Back::Memory(end), arrived: Time::ZERO, note: None }
    }

    /// Has everything that passes between the device and the step written down, or played back.
    pub(crate) fn noted(&mut self, note: Note) {
        self.note = Some(note);
    }

    fn played(&self) -> Option<&Note> {
        self.note.as_ref().filter(|note| note.plays())
    }

    pub(crate) fn wire(&self) -> Option<&Arc<Wire>> {
        match &self.back {
            Back::Live(wire) => Some(wire),
            Back::Memory(_) => None,
        }
    }

    /// Moves the bytes that have come into `buffer`, oldest first, and gives how many: 0 when there is nothing now.
    pub fn receive(&mut self, buffer: &mut [u8]) -> usize {
        if let Some(note) = self.note.as_ref().filter(|note| note.plays()) {
            return note.played_bytes(buffer, &mut self.arrived);
        }
        let count = self.take(buffer);
        if let Some(note) = &self.note {
            note.received(self.arrived, &buffer[..count]);
        }
        count
    }

    fn take(&mut self, buffer: &mut [u8]) -> usize {
        match &self.back {
            Back::Live(wire) => {
                let arrived = Time::from_nanos(wire.arrived_ns.load(Ordering::Acquire));
                let count = wire.receive(buffer);
                if count > 0 {
                    self.arrived = arrived;
                }
                count
            }
            Back::Memory(end) => end.receive(buffer, &mut self.arrived),
        }
    }

    /// Sends all of `bytes`, or none and says why. Never waits.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        let Some(note) = &self.note else { return self.put(bytes) };
        let sent = match note.plays() {
            true => note.played(EntryKind::SendFailed).map_or(Ok(()), |payload| Err(error_of(&payload))),
            false => {
                let sent = self.put(bytes);
                match sent {
                    Ok(()) => note.nothing(EntryKind::SendFailed),
                    Err(error) => note.say(EntryKind::SendFailed, &[&word_of(error).to_le_bytes()]),
                }
                sent
            }
        };
        note.say(EntryKind::Sent, &[bytes]);
        sent
    }

    fn put(&self, bytes: &[u8]) -> Result<(), DeviceError> {
        match &self.back {
            Back::Live(wire) => wire.send(bytes),
            Back::Memory(end) => end.send(bytes),
        }
    }

    /// State of the link.
    pub fn link(&self) -> DeviceLink {
        let Some(note) = &self.note else { return self.state() };
        if note.plays() {
            return link::unpack(note.played_link(link::pack(DeviceLink::Closed { why: WhyClosed::NotStarted })));
        }
        let link = self.state();
        note.link(link::pack(link));
        link
    }

    fn state(&self) -> DeviceLink {
        match &self.back {
            Back::Live(wire) => wire.link.get(),
            Back::Memory(end) => end.link(),
        }
    }

    /// Drops the link and opens it anew, for a device that has lost its mind.
    pub fn reopen(&mut self) {
        if let Some(note) = &self.note {
            note.say(EntryKind::Reopened, &[]);
        }
        if self.played().is_some() {
            return;
        }
        match &self.back {
            Back::Live(wire) => {
                wire.reopen.store(true, Ordering::Release);
                wire.wake_pump();
            }
            Back::Memory(end) => end.reopen(),
        }
    }

    /// Sets the line's rate [baud]. Bytes that the kernel still holds go out at the new rate: leave them time.
    /// A later link begins at the address's rate again.
    pub fn set_baud(&mut self, baud: u32) {
        if let Some(note) = &self.note {
            note.say(EntryKind::Baud, &[&baud.to_le_bytes()]);
        }
        if self.played().is_some() {
            return;
        }
        match &self.back {
            Back::Live(wire) => {
                wire.baud.store(baud, Ordering::Release);
                wire.wake_pump();
            }
            Back::Memory(end) => end.set_baud(baud),
        }
    }

    /// What stops this device when its driver is dead: the guard writes it then, and when an emergency stop finds the
    /// driver dead. Say it in `open`.
    pub fn will(&self, will: guard::Will) {
        if let Back::Live(wire) = &self.back {
            // A second will changes nothing: the first may be with the guard already.
            let _ = wire.will.set(will);
        }
    }

    /// Whether the open link is the one that a predecessor of this process had: the device has noticed nothing.
    pub fn is_kept(&self) -> bool {
        let Some(note) = &self.note else { return self.has_kept() };
        if note.plays() {
            return note.played_kept();
        }
        let kept = self.has_kept();
        note.kept(kept);
        kept
    }

    fn has_kept(&self) -> bool {
        match &self.back {
            Back::Live(wire) => wire.kept.load(Ordering::Acquire),
            Back::Memory(_) => false,
        }
    }

    /// When the newest of the bytes that [`receive`](Device::receive) has given came.
    pub fn arrived(&self) -> Time {
        self.arrived
    }

    /// Where the device is.
    pub fn address(&self) -> &Address {
        match &self.back {
            Back::Live(wire) => &wire.address,
            Back::Memory(end) => end.address(),
        }
    }

    /// The state of the link in the words of an operator's console: where, what or why, what to do. Allocates: not for
    /// a step.
    pub fn explain(&self) -> String {
        match (&self.back, self.state()) {
            (Back::Live(wire), link) => wire.explain(link),
            (Back::Memory(end), DeviceLink::Closed { why }) => why.explain(end.address()),
            (Back::Memory(end), _) => format!("device {}: open", end.address()),
        }
    }

    /// The TCP port that a served address listens on, once it does: address port 0 lets the kernel choose.
    pub fn listening_port(&self) -> Option<u16> {
        self.wire().map(|wire| wire.port.load(Ordering::Acquire)).filter(|port| *port != 0)
    }

    /// Sends refused because the link was closed or full, since the start.
    pub fn refused_sends(&self) -> u64 {
        match &self.back {
            Back::Live(wire) => wire.refused_sends.load(Ordering::Relaxed),
            Back::Memory(end) => end.refused_sends(),
        }
    }

    /// For the simulated host's triggers: the first instant after `after` at which the last byte of one `send` comes.
    /// None on a live device.
    pub fn next_arrival(&self, after: Time) -> Option<Time> {
        match &self.back {
            Back::Live(_) => None,
            Back::Memory(end) => end.next_arrival(after),
        }
    }
}

/// All ones: the line was full.
const FULL: u64 = u64::MAX;

fn word_of(error: DeviceError) -> u64 {
    match error {
        DeviceError::Closed(why) => link::pack(DeviceLink::Closed { why }),
        DeviceError::Opening => link::pack(DeviceLink::Opening),
        DeviceError::Full => FULL,
    }
}

fn error_of(payload: &[u8]) -> DeviceError {
    let word = payload.first_chunk().map_or(FULL, |bytes| u64::from_le_bytes(*bytes));
    match (word, link::unpack(word)) {
        (FULL, _) | (_, DeviceLink::Open { .. }) => DeviceError::Full,
        (_, DeviceLink::Opening) => DeviceError::Opening,
        (_, DeviceLink::Closed { why }) => DeviceError::Closed(why),
    }
}
