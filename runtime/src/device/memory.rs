//! Byte streams within one simulated host, on its virtual time, with a line rate and injected faults.
//!
//! A link has two ends, client and server, that find each other by name in any order. A byte sent at t over an idle
//! line of rate b arrives at t + 10/b (8N1), the next one 10/b later; without a rate all arrive at t. Ends that are
//! set to different rates receive garbage, as on a real line.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Address, Device, DeviceError, DeviceLink, WhyClosed};
use crate::Time;

/// Bytes that may be under way in each direction: 4 s at 9600 baud.
const CAPACITY: usize = 4096;
/// Marks the last byte of one `send` in its time of arrival.
const LAST: u64 = 1 << 63;
/// Start, eight data and stop bit.
const BITS_PER_BYTE: u64 = 10;

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

/// Both lanes of a link and who is at its ends.
#[derive(Default)]
struct Line {
    client: Party,
    server: Party,
    to_server: Lane,
    to_client: Lane,
    unplugged: bool,
    open: bool,
    generation: u64,
    fault: Option<Fault>,
}

#[derive(Debug, Default)]
struct Party {
    present: bool,
    tenancy: u64,
    baud: Option<u32>,
    refused_sends: u64,
}

impl Line {
    fn move_in(&mut self, sends: Direction, baud: Option<u32>) -> u64 {
        let side = self.side(sends);
        *side = Party { present: true, tenancy: side.tenancy + 1, baud, refused_sends: 0 };
        let tenancy = side.tenancy;
        // A successor is a new link to the other end, as a reopened port is.
        self.open = false;
        self.settle();
        tenancy
    }

    /// Opens the link when it can be open, closes it when it cannot; what was under way belongs to the old link.
    fn settle(&mut self) {
        let possible = self.client.present && self.server.present && !self.unplugged;
        if possible && self.open {
            return;
        }
        self.to_server.clear();
        self.to_client.clear();
        self.open = possible;
        self.generation += u64::from(possible);
    }

    fn link(&mut self, sends: Direction, tenancy: u64) -> DeviceLink {
        let why = match (self.side(sends).tenancy == tenancy, self.open, sends) {
            (true, true, _) => return DeviceLink::Open { generation: self.generation },
            (false, ..) => WhyClosed::HungUp,
            (true, false, _) if self.unplugged => WhyClosed::HungUp,
            (true, false, Direction::ToServer) => WhyClosed::NoSuchPort,
            (true, false, Direction::ToClient) => WhyClosed::NoClient,
        };
        DeviceLink::Closed { why }
    }

    fn send(&mut self, now_ns: u64, direction: Direction, bytes: &[u8]) -> Result<(), DeviceError> {
        let sender_baud = self.side(direction).baud;
        let receiver_baud = self.side(direction.opposite()).baud;
        let byte_ns = sender_baud.or(receiver_baud).map_or(0, |baud| 1_000_000_000 * BITS_PER_BYTE / u64::from(baud));
        let garbled = matches!((sender_baud, receiver_baud), (Some(ours), Some(theirs)) if ours != theirs);
        let Line { fault, to_server, to_client, .. } = self;
        let lane = match direction {
            Direction::ToServer => to_server,
            Direction::ToClient => to_client,
        };
        if bytes.len() > lane.free() {
            return Err(DeviceError::Full);
        }
        for (index, byte) in bytes.iter().enumerate() {
            let arrives_ns = lane.idle_ns.max(now_ns) + byte_ns;
            lane.idle_ns = arrives_ns;
            let byte = if garbled { garble(*byte) } else { *byte };
            let survivor = match fault {
                Some(fault) => fault(Time::from_nanos(now_ns), direction, byte),
                None => Some(byte),
            };
            let last = index + 1 == bytes.len();
            match survivor {
                Some(byte) => lane.put(byte, arrives_ns, last),
                None if last => lane.mark_last(),
                None => {}
            }
        }
        Ok(())
    }

    fn side(&mut self, sends: Direction) -> &mut Party {
        match sends {
            Direction::ToServer => &mut self.client,
            Direction::ToClient => &mut self.server,
        }
    }

    fn lane(&mut self, direction: Direction) -> &mut Lane {
        match direction {
            Direction::ToServer => &mut self.to_server,
            Direction::ToClient => &mut self.to_client,
        }
    }
}

impl fmt::Debug for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Line(open: {}, generation: {})", self.open, self.generation)
    }
}

/// Bytes under way in one direction, each with its time of arrival.
struct Lane {
    bytes: Box<[u8]>,
    /// [ns], with [`LAST`].
    arrivals: Box<[u64]>,
    first: usize,
    count: usize,
    /// When the line has sent all that it was given [ns].
    idle_ns: u64,
}

impl Default for Lane {
    fn default() -> Lane {
        Lane { bytes: vec![0; CAPACITY].into(), arrivals: vec![0; CAPACITY].into(), first: 0, count: 0, idle_ns: 0 }
    }
}

impl Lane {
    fn free(&self) -> usize {
        CAPACITY - self.count
    }

    fn clear(&mut self) {
        self.count = 0;
        self.idle_ns = 0;
    }

    fn put(&mut self, byte: u8, arrives_ns: u64, last: bool) {
        let place = (self.first + self.count) % CAPACITY;
        self.bytes[place] = byte;
        self.arrivals[place] = arrives_ns | if last { LAST } else { 0 };
        self.count += 1;
    }

    fn mark_last(&mut self) {
        if self.count > 0 {
            self.arrivals[(self.first + self.count - 1) % CAPACITY] |= LAST;
        }
    }

    fn take(&mut self, now_ns: u64, buffer: &mut [u8], arrived: &mut Time) -> usize {
        let mut taken = 0;
        while taken < buffer.len() && self.count > 0 && self.arrivals[self.first] & !LAST <= now_ns {
            buffer[taken] = self.bytes[self.first];
            *arrived = Time::from_nanos(self.arrivals[self.first] & !LAST);
            self.first = (self.first + 1) % CAPACITY;
            self.count -= 1;
            taken += 1;
        }
        taken
    }

    fn next_last(&self, after_ns: u64) -> Option<Time> {
        let arrivals = (0..self.count).map(|offset| self.arrivals[(self.first + offset) % CAPACITY]);
        let mut lasts = arrivals.filter(|arrival| arrival & LAST != 0).map(|arrival| arrival & !LAST);
        lasts.find(|arrival_ns| *arrival_ns > after_ns).map(Time::from_nanos)
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

/// What a receiver at another rate makes of a byte: never the byte itself.
fn garble(byte: u8) -> u8 {
    byte.rotate_left(3) ^ 0xA5 ^ u8::from(byte.rotate_left(3) ^ 0xA5 == byte)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
