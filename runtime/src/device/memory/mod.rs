//! Byte streams within one simulated host, on its virtual time, with a line rate and injected faults.
//!
//! A link has two ends, client and server, that find each other by name in any order. A byte sent at t over an idle
//! line of rate b arrives at t + 10/b (8N1), the next one 10/b later; without a rate all arrive at t. Ends that are
//! set to different rates receive garbage, as on a real line.

mod lane;
mod line;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use line::Line;

use super::{Address, Device, DeviceError, DeviceLink};
use crate::Time;

/// Which way a byte goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the client to the server: commands.
    ToServer,
    /// From the server to the client: what the device says.
    ToClient,
}

/// What becomes of a byte: itself, another, or none. Called in the order of sending; seed it.
type Fault = Box<dyn FnMut(Time, Direction, u8) -> Option<u8> + Send>;

/// All memory links of one simulated host, and its time.
#[derive(Debug, Clone, Default)]
pub struct MemoryLinks {
    shared: Arc<Hub>,
}

#[derive(Debug, Default)]
struct Hub {
    now_ns: AtomicU64,
    links: Mutex<BTreeMap<String, Arc<Mutex<Line>>>>,
}

impl MemoryLinks {
    /// No links yet, time zero.
    pub fn new() -> MemoryLinks {
        MemoryLinks::default()
    }

    /// The client's end of link `name`, at `baud` when the line has a rate. Takes the place of an earlier client.
    pub fn client(&self, name: &str, baud: Option<u32>) -> Device {
        self.end(name, baud, Direction::ToServer)
    }

    /// The server's end of link `name`. Takes the place of an earlier server.
    pub fn server(&self, name: &str, baud: Option<u32>) -> Device {
        self.end(name, baud, Direction::ToClient)
    }

    /// Sets the virtual time that bytes are sent and received at.
    pub fn set_now(&self, now: Time) {
        self.shared.now_ns.store(now.nanos(), Ordering::Relaxed);
    }

    /// The link `name`, to inject faults; none when no end of it exists.
    pub fn link(&self, name: &str) -> Option<MemoryLink> {
        lock(&self.shared.links).get(name).map(|line| MemoryLink { line: Arc::clone(line) })
    }

    /// Names of all links, sorted.
    pub fn names(&self) -> Vec<String> {
        lock(&self.shared.links).keys().cloned().collect()
    }

    fn end(&self, name: &str, baud: Option<u32>, sends: Direction) -> Device {
        let line = Arc::clone(lock(&self.shared.links).entry(name.into()).or_default());
        let tenancy = lock(&line).move_in(sends, baud);
        let address = Address::Memory { name: name.into(), baud };
        Device::memory(End { hub: Arc::clone(&self.shared), line, sends, tenancy, address })
    }
}

/// Faults for one link.
#[derive(Debug, Clone)]
pub struct MemoryLink {
    line: Arc<Mutex<Line>>,
}

impl MemoryLink {
    /// Unplugs the cable (what is under way is lost), or plugs it in again.
    pub fn set_up(&self, up: bool) {
        let mut line = lock(&self.line);
        line.unplugged = !up;
        line.settle();
    }

    /// Sends every byte through `fault`, which may change or lose it.
    pub fn set_fault(&self, fault: impl FnMut(Time, Direction, u8) -> Option<u8> + Send + 'static) {
        lock(&self.line).fault = Some(Box::new(fault));
    }

    /// The first instant after `after` at which the last byte of one `send` in this direction comes.
    pub fn next_arrival(&self, direction: Direction, after: Time) -> Option<Time> {
        lock(&self.line).lane(direction).next_last(after.nanos())
    }

    /// Becomes the client's end, as who holds a duplicate of a dead client's descriptor does, and sends `bytes`.
    pub fn take_over_client(&self, now: Time, bytes: &[u8]) {
        let mut line = lock(&self.line);
        line.move_in(Direction::ToServer, None);
        // A device that is gone, too, cannot be stopped.
        let _ = line.send(now.nanos(), Direction::ToServer, bytes);
    }

    /// Every byte arrives as it was sent again.
    pub fn clear_fault(&self) {
        lock(&self.line).fault = None;
    }
}

/// One end of a link.
#[derive(Debug)]
pub(crate) struct End {
    hub: Arc<Hub>,
    line: Arc<Mutex<Line>>,
    sends: Direction,
    /// Which of the ends that ever had this side it is: a successor takes the side over.
    tenancy: u64,
    address: Address,
}

impl End {
    pub fn address(&self) -> &Address {
        &self.address
    }

    pub fn link(&self) -> DeviceLink {
        self.line().link(self.sends, self.tenancy)
    }

    pub fn receive(&self, buffer: &mut [u8], arrived: &mut Time) -> usize {
        let now_ns = self.hub.now_ns.load(Ordering::Relaxed);
        let mut line = self.line();
        if line.side(self.sends).tenancy != self.tenancy {
            return 0;
        }
        line.lane(self.sends.opposite()).take(now_ns, buffer, arrived)
    }

    pub fn send(&self, bytes: &[u8]) -> Result<(), DeviceError> {
        let now_ns = self.hub.now_ns.load(Ordering::Relaxed);
        let mut line = self.line();
        let sent = match line.link(self.sends, self.tenancy) {
            DeviceLink::Open { .. } => line.send(now_ns, self.sends, bytes),
            DeviceLink::Opening => Err(DeviceError::Opening),
            DeviceLink::Closed { why } => Err(DeviceError::Closed(why)),
        };
        if sent.is_err() {
            line.side(self.sends).refused_sends += 1;
        }
        sent
    }

    pub fn reopen(&self) {
        let mut line = self.line();
        if line.side(self.sends).tenancy == self.tenancy {
            line.open = false;
            line.settle();
        }
    }

    pub fn set_baud(&self, baud: u32) {
        let mut line = self.line();
        if line.side(self.sends).tenancy == self.tenancy {
            line.side(self.sends).baud = Some(baud.max(1));
        }
    }

    pub fn refused_sends(&self) -> u64 {
        self.line().side(self.sends).refused_sends
    }

    pub fn next_arrival(&self, after: Time) -> Option<Time> {
        self.line().lane(self.sends.opposite()).next_last(after.nanos())
    }

    fn line(&self) -> MutexGuard<'_, Line> {
        lock(&self.line)
    }
}

impl Drop for End {
    fn drop(&mut self) {
        let mut line = self.line();
        if line.side(self.sends).tenancy == self.tenancy {
            line.side(self.sends).present = false;
            line.settle();
        }
    }
}

impl Direction {
    fn opposite(self) -> Direction {
        match self {
            Direction::ToServer => Direction::ToClient,
            Direction::ToClient => Direction::ToServer,
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
