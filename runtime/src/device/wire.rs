//! What the step thread and the pump share of one live device.

use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, AtomicU64, Ordering, fence};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};

use guard::Will;
use rustix::io::Errno;
use rustix::net::SendFlags;

use super::link::LinkWord;
use super::ring::ByteRing;
use super::{Address, DeviceError, DeviceLink, WhyClosed};
use crate::pump::Waker;

/// Bytes that may wait for the step.
const INCOMING_BYTES: usize = 16 * 1024;
/// Bytes that may wait for the device.
const OUTGOING_BYTES: usize = 4 * 1024;

/// Which end of the line this process is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    /// Opens what the address names.
    Client,
    /// Makes what the address names, for one client at a time.
    Server,
}

/// An open descriptor of a device.
#[derive(Debug, Clone)]
pub(crate) struct Line {
    pub descriptor: Arc<OwnedFd>,
    pub socket: bool,
}

impl Line {
    /// Writes without waiting, and without the signal that a closed socket would raise.
    fn write(&self, bytes: &[u8]) -> Result<usize, Errno> {
        match self.socket {
            true => rustix::net::send(&self.descriptor, bytes, SendFlags::NOSIGNAL | SendFlags::DONTWAIT),
            false => rustix::io::write(&self.descriptor, bytes),
        }
    }
}

/// What the step thread and the pump share of one live device.
#[derive(Debug)]
pub(crate) struct Wire {
    pub address: Address,
    pub side: Side,
    pub link: LinkWord,
    /// From the device to the step; the pump writes.
    pub incoming: ByteRing,
    /// What the kernel would not take at once; the step writes.
    pub outgoing: ByteRing,
    /// When the newest byte in `incoming` came [ns].
    pub arrived_ns: AtomicU64,
    /// The pump stopped reading because `incoming` was full: the step wakes it when there is room.
    pub paused: AtomicBool,
    /// The step asks for a new link.
    pub reopen: AtomicBool,
    /// Rate that the step asked for; 0: as addressed [baud].
    pub baud: AtomicU32,
    /// Port that a listening TCP address got from the kernel.
    pub port: AtomicU16,
    /// Sends refused because `outgoing` was full or the link closed.
    pub refused_sends: AtomicU64,
    /// What stops the device when its driver cannot.
    pub will: OnceLock<Will>,
    /// Whether the open line is one that a predecessor has left.
    pub kept: AtomicBool,
    line: Mutex<Option<Line>>,
    waker: OnceLock<Waker>,
}

impl Wire {
    pub fn new(address: Address, side: Side) -> Wire {
        Wire {
            address,
            side,
            link: LinkWord::new(),
            incoming: ByteRing::new(INCOMING_BYTES),
            outgoing: ByteRing::new(OUTGOING_BYTES),
            arrived_ns: AtomicU64::new(0),
            paused: AtomicBool::new(false),
            reopen: AtomicBool::new(false),
            baud: AtomicU32::new(0),
            port: AtomicU16::new(0),
            refused_sends: AtomicU64::new(0),
            will: OnceLock::new(),
            kept: AtomicBool::new(false),
            line: Mutex::new(None),
            waker: OnceLock::new(),
        }
    }

    /// Pump's thread, before it runs: how the step wakes it. False when a pump has it already.
    pub fn attach(&self, waker: Waker) -> bool {
        self.waker.set(waker).is_ok()
    }

    pub fn wake_pump(&self) {
        if let Some(waker) = self.waker.get() {
            waker.wake();
        }
    }

    /// The state of the link in the words of an operator's console: where, what or why, what to do.
    pub fn explain(&self, link: DeviceLink) -> String {
        let address = &self.address;
        match (link, self.side) {
            (DeviceLink::Open { generation: 1 }, _) => format!("device {address}: open"),
            (DeviceLink::Open { generation }, _) => format!("device {address}: open, for the {generation}. time"),
            (DeviceLink::Opening, _) => format!("device {address}: opening"),
            (DeviceLink::Closed { why: WhyClosed::NoSuchPort }, Side::Server) => {
                format!("device {address}: cannot be made: its folder does not exist; make the folder")
            }
            (DeviceLink::Closed { why: WhyClosed::Busy }, Side::Server) if matches!(address, Address::Pty { .. }) => {
                format!("device {address}: something else than a link is there; remove it or choose another path")
            }
            (DeviceLink::Closed { why }, _) => why.explain(address),
        }
    }

    /// Step: moves what has come into `buffer`.
    pub fn receive(&self, buffer: &mut [u8]) -> usize {
        let count = self.incoming.pop(buffer);
        if count > 0 {
            // The flag is looked at after the room was made, the room by the pump after it set the flag: the fences
            // make one of the two see the other.
            fence(Ordering::SeqCst);
            if self.paused.load(Ordering::Relaxed) && self.paused.swap(false, Ordering::Relaxed) {
                self.wake_pump();
            }
        }
        count
    }

    /// Pump: whether bytes from the device have room. When they have none, the step wakes the pump as soon as they do.
    pub fn has_room(&self) -> bool {
        if self.incoming.free() > 0 {
            return true;
        }
        self.paused.store(true, Ordering::Relaxed);
        fence(Ordering::SeqCst);
        self.incoming.free() > 0
    }

    /// Step: hands all of `bytes` to the kernel or to the ring behind it, or none.
    pub fn send(&self, bytes: &[u8]) -> Result<(), DeviceError> {
        let sent = self.try_send(bytes);
        if sent.is_err() {
            self.refused_sends.fetch_add(1, Ordering::Relaxed);
        }
        sent
    }

    fn try_send(&self, bytes: &[u8]) -> Result<(), DeviceError> {
        match self.link.get() {
            DeviceLink::Open { .. } => {}
            DeviceLink::Opening => return Err(DeviceError::Opening),
            DeviceLink::Closed { why } => return Err(DeviceError::Closed(why)),
        }
        if bytes.len() > self.outgoing.free() {
            return Err(DeviceError::Full);
        }
        let mut rest = bytes;
        // Bytes in the ring go first. The pump holds the slot while it moves them, so an empty ring and a free slot mean
        // that nothing is on its way.
        if let Some(slot) = self.try_line()
            && self.outgoing.is_empty()
            && let Some(line) = slot.as_ref()
        {
            match line.write(rest) {
                Ok(count) => rest = &rest[count..],
                Err(Errno::AGAIN | Errno::INTR) => {}
                // The pump sees the same end and says why.
                Err(error) => return Err(DeviceError::Closed(WhyClosed::from_errno(error))),
            }
        }
        if !rest.is_empty() {
            self.outgoing.push(rest);
            self.wake_pump();
        }
        Ok(())
    }

    fn try_line(&self) -> Option<MutexGuard<'_, Option<Line>>> {
        match self.line.try_lock() {
            Ok(guard) => Some(guard),
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// Pump: the current line. Held for a few system calls at most; the step only ever tries.
    fn line(&self) -> MutexGuard<'_, Option<Line>> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Pump: puts a new line, or none, in the place of the old one. What was not sent belonged to the old one.
    pub fn set_line(&self, line: Option<Line>) {
        let mut slot = self.line();
        self.outgoing.discard(usize::MAX);
        *slot = line;
    }

    /// Pump: moves bytes from the outgoing ring into the kernel, until one of them is done.
    pub fn flush(&self) -> Result<(), Errno> {
        let slot = self.line();
        let Some(line) = slot.as_ref() else { return Ok(()) };
        let mut chunk = [0; 512];
        loop {
            let count = self.outgoing.peek(&mut chunk);
            if count == 0 {
                return Ok(());
            }
            match line.write(&chunk[..count]) {
                Ok(written) => self.outgoing.discard(written),
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
    }
}
