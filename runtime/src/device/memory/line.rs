//! Both directions of a memory link, and who is at its ends.

use std::fmt;

use super::lane::Lane;
use super::{Direction, Fault};
use crate::Time;
use crate::device::{DeviceError, DeviceLink, WhyClosed};

/// Start, eight data and stop bit.
const BITS_PER_BYTE: u64 = 10;

/// Both lanes of a link and who is at its ends.
#[derive(Default)]
pub(super) struct Line {
    client: Party,
    server: Party,
    to_server: Lane,
    to_client: Lane,
    pub unplugged: bool,
    pub open: bool,
    generation: u64,
    pub fault: Option<Fault>,
}

#[derive(Debug, Default)]
pub(super) struct Party {
    pub present: bool,
    pub tenancy: u64,
    pub baud: Option<u32>,
    pub refused_sends: u64,
}

impl Line {
    pub fn move_in(&mut self, sends: Direction, baud: Option<u32>) -> u64 {
        let side = self.side(sends);
        *side = Party { present: true, tenancy: side.tenancy + 1, baud, refused_sends: 0 };
        let tenancy = side.tenancy;
        // A successor is a new link to the other end, as a reopened port is.
        self.open = false;
        self.settle();
        tenancy
    }

    /// Opens the link when it can be open, closes it when it cannot; what was under way belongs to the old link.
    pub fn settle(&mut self) {
        let possible = self.client.present && self.server.present && !self.unplugged;
        if possible && self.open {
            return;
        }
        self.to_server.clear();
        self.to_client.clear();
        self.open = possible;
        self.generation += u64::from(possible);
    }

    pub fn link(&mut self, sends: Direction, tenancy: u64) -> DeviceLink {
        let why = match (self.side(sends).tenancy == tenancy, self.open, sends) {
            (true, true, _) => return DeviceLink::Open { generation: self.generation },
            (false, ..) => WhyClosed::HungUp,
            (true, false, _) if self.unplugged => WhyClosed::HungUp,
            (true, false, Direction::ToServer) => WhyClosed::NoSuchPort,
            (true, false, Direction::ToClient) => WhyClosed::NoClient,
        };
        DeviceLink::Closed { why }
    }

    pub fn send(&mut self, now_ns: u64, direction: Direction, bytes: &[u8]) -> Result<(), DeviceError> {
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

    pub fn side(&mut self, sends: Direction) -> &mut Party {
        match sends {
            Direction::ToServer => &mut self.client,
            Direction::ToClient => &mut self.server,
        }
    }

    pub fn lane(&mut self, direction: Direction) -> &mut Lane {
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

/// What a receiver at another rate makes of a byte: never the byte itself.
fn garble(byte: u8) -> u8 {
    byte.rotate_left(3) ^ 0xA5 ^ u8::from(byte.rotate_left(3) ^ 0xA5 == byte)
}
