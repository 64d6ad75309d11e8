//! How a session sees its port, and what it wants of it.

use runtime::Device;
use runtime::device::{Address, DeviceLink};

/// What the port is doing, as the node sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Port {
    /// Not open.
    Closed,
    /// Being opened.
    Opening,
    /// Open; the number changes with every new opening.
    Open(u64),
}

/// What the port should do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Demand {
    /// Close and open again.
    Reopen,
    /// Switch the line to this speed [baud].
    Baud(u32),
}

impl From<DeviceLink> for Port {
    fn from(link: DeviceLink) -> Port {
        match link {
            DeviceLink::Closed { .. } => Port::Closed,
            DeviceLink::Opening => Port::Opening,
            DeviceLink::Open { generation } => Port::Open(generation),
        }
    }
}

/// The rate of a device's line, where it has one [baud].
pub fn line_baud(device: &Device) -> Option<u32> {
    match device.address() {
        Address::Serial { baud, .. } => Some(*baud),
        Address::Memory { baud, .. } => *baud,
        _ => None,
    }
}
