//! Whether a device can be talked to, and if not, why and what to do.

use std::sync::atomic::{AtomicU64, Ordering};

use rustix::io::Errno;

use super::Address;

/// State of the link to a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceLink {
    /// No bytes flow. The runtime tries again by itself, except after [`WhyClosed::Stopped`].
    Closed {
        /// The reason.
        why: WhyClosed,
    },
    /// Being opened.
    Opening,
    /// Bytes flow.
    Open {
        /// How often the link has come up: a driver that sees another one than before shakes hands again.
        generation: u64,
    },
}

impl DeviceLink {
    /// Whether bytes flow.
    pub fn is_open(self) -> bool {
        matches!(self, DeviceLink::Open { .. })
    }
}

/// Why no bytes flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WhyClosed {
    /// The node has not been started.
    #[error("not started")]
    NotStarted,
    /// The port's file does not exist.
    #[error("no such port")]
    NoSuchPort,
    /// The kernel refuses access.
    #[error("permission denied")]
    PermissionDenied,
    /// Somebody else has it.
    #[error("busy: somebody else has it")]
    Busy,
    /// The path is no terminal.
    #[error("not a serial port")]
    NotATerminal,
    /// The port cannot do the rate.
    #[error("the port cannot do this rate")]
    WrongRate,
    /// Nobody listens at the address.
    #[error("connection refused")]
    Refused,
    /// No answer from the host.
    #[error("host unreachable")]
    Unreachable,
    /// The host's name has no address.
    #[error("unknown host")]
    UnknownHost,
    /// The other end closed, or the adapter disappeared.
    #[error("hung up")]
    HungUp,
    /// Serving, and no client is there.
    #[error("no client")]
    NoClient,
    /// The address cannot be used on this side or by this host.
    #[error("not possible here")]
    NotPossible,
    /// The node has been stopped.
    #[error("stopped")]
    Stopped,
    /// Anything else: the kernel's error number.
    #[error("{}", Errno::from_raw_os_error(*.0))]
    Other(i32),
}

impl WhyClosed {
    /// The reason in the words of an operator's console: where, why, what to do. Allocates: not for a step.
    pub fn explain(self, address: &Address) -> String {
        format!("device {address}: {self}: {}", self.advice(address))
    }

    fn advice(self, address: &Address) -> &'static str {
        let tcp = matches!(address, Address::Tcp { .. });
        let pty = matches!(address, Address::Pty { .. });
        match self {
            WhyClosed::NotStarted => "start the node",
            WhyClosed::NoSuchPort if pty => "start the program that makes it, or correct the path",
            WhyClosed::NoSuchPort => "plug it in, or name another port in the node's config (see /dev/serial/by-id)",
            WhyClosed::PermissionDenied if tcp => "choose a port from 1024 on",
            WhyClosed::PermissionDenied => "add the user to the port's group, often dialout or uucp (ls -l shows it)",
            WhyClosed::Busy if tcp => "another program listens there: stop it or choose another port",
            WhyClosed::Busy => "another program has it, perhaps ModemManager (fuser shows it): stop that program",
            WhyClosed::NotATerminal => "name a serial port (see /dev/serial/by-id)",
            WhyClosed::WrongRate => "choose another rate, or another adapter",
            WhyClosed::Refused => "start the program that should listen there, or correct the address",
            WhyClosed::Unreachable => "check power and network of the device",
            WhyClosed::UnknownHost => "correct the host name, or write its number",
            WhyClosed::HungUp => "check cable and power; it is tried again by itself",
            WhyClosed::NoClient => "connect a client",
            WhyClosed::NotPossible => {
                "use an address of another kind here (memory: and simulator belong to a simulated host)"
            }
            WhyClosed::Stopped => "start the node again",
            WhyClosed::Other(_) => "it is tried again by itself",
        }
    }

    /// The reason behind a failed open, connect, bind or transfer.
    pub(crate) fn from_errno(error: Errno) -> WhyClosed {
        match error {
            Errno::NOENT | Errno::NODEV | Errno::NXIO | Errno::NOTDIR => WhyClosed::NoSuchPort,
            Errno::ACCESS | Errno::PERM | Errno::ROFS => WhyClosed::PermissionDenied,
            Errno::BUSY | Errno::ADDRINUSE | Errno::EXIST => WhyClosed::Busy,
            Errno::NOTTY | Errno::ISDIR => WhyClosed::NotATerminal,
            Errno::CONNREFUSED => WhyClosed::Refused,
            Errno::HOSTUNREACH | Errno::NETUNREACH | Errno::TIMEDOUT | Errno::HOSTDOWN | Errno::NETDOWN => {
                WhyClosed::Unreachable
            }
            Errno::IO | Errno::PIPE | Errno::CONNRESET | Errno::CONNABORTED => WhyClosed::HungUp,
            Errno::ADDRNOTAVAIL => WhyClosed::UnknownHost,
            other => WhyClosed::Other(other.raw_os_error()),
        }
    }
}

/// A [`DeviceLink`] in one word, written by the pump and read by the step.
#[derive(Debug)]
pub(crate) struct LinkWord(AtomicU64);

const REASONS: [WhyClosed; 13] = [
    WhyClosed::NotStarted,
    WhyClosed::NoSuchPort,
    WhyClosed::PermissionDenied,
    WhyClosed::Busy,
    WhyClosed::NotATerminal,
    WhyClosed::WrongRate,
    WhyClosed::Refused,
    WhyClosed::Unreachable,
    WhyClosed::UnknownHost,
    WhyClosed::HungUp,
    WhyClosed::NoClient,
    WhyClosed::NotPossible,
    WhyClosed::Stopped,
];

const CLOSED: u64 = 0;
const OPENING: u64 = 1;
const OPEN: u64 = 2;
const OTHER: u64 = 3;

impl LinkWord {
    /// A link that was never opened.
    pub fn new() -> LinkWord {
        LinkWord(AtomicU64::new(pack(DeviceLink::Closed { why: WhyClosed::NotStarted })))
    }

    pub fn get(&self) -> DeviceLink {
        unpack(self.0.load(Ordering::Acquire))
    }

    pub fn set(&self, link: DeviceLink) {
        self.0.store(pack(link), Ordering::Release);
    }
}

/// The low two bits say which, the rest holds the reason's index, the error number or the generation.
pub(super) fn pack(link: DeviceLink) -> u64 {
    match link {
        DeviceLink::Opening => OPENING,
        DeviceLink::Open { generation } => generation << 2 | OPEN,
        DeviceLink::Closed { why: WhyClosed::Other(number) } => u64::from(number.unsigned_abs()) << 2 | OTHER,
        DeviceLink::Closed { why } => {
            let index = REASONS.iter().position(|reason| *reason == why).unwrap_or(0);
            (index as u64) << 2 | CLOSED
        }
    }
}

pub(super) fn unpack(word: u64) -> DeviceLink {
    let value = word >> 2;
    match word & 3 {
        OPENING => DeviceLink::Opening,
        OPEN => DeviceLink::Open { generation: value },
        OTHER => DeviceLink::Closed { why: WhyClosed::Other(value as i32) },
        _ => DeviceLink::Closed { why: REASONS.get(value as usize).copied().unwrap_or(WhyClosed::NotStarted) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_survives_the_word() {
        let word = LinkWord::new();
        let reasons = REASONS.into_iter().chain([WhyClosed::Other(110)]);
        let closed = reasons.map(|why| DeviceLink::Closed { why });
        for link in closed.chain([DeviceLink::Opening, DeviceLink::Open { generation: 7_000_000_000 }]) {
            word.set(link);
            assert_eq!(word.get(), link);
        }
    }

    #[test]
    fn an_explanation_names_the_port_the_reason_and_the_remedy() {
        let address: Address = "/dev/ttyUSB7".parse().unwrap();
        let text = WhyClosed::PermissionDenied.explain(&address);
        assert!(
            text.contains("/dev/ttyUSB7") && text.contains("permission denied") && text.contains("dialout"),
            "{text}"
        );
        let text = WhyClosed::from_errno(Errno::NOENT).explain(&address);
        assert!(text.contains("no such port") && text.contains("plug it in"), "{text}");
    }
}
