//! Talking to the guard.

use std::fmt;
use std::io::{IoSlice, IoSliceMut};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::net::{self, AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType};

use crate::wire::{Kept, PACKET_BYTES, Will};

/// Name of the guard's socket in the robot's folder.
pub const SOCKET: &str = ".guard";

/// Why the guard had no answer.
#[derive(Debug)]
pub enum ClientError {
    /// Nobody listens.
    NoGuard(PathBuf),
    /// It did not answer in time.
    TimedOut(PathBuf, f64),
    /// The system refused.
    Io(PathBuf, Errno),
}

impl fmt::Display for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClientError::NoGuard(root) => write!(f, "no guard in {}: the robot does not run there", root.display()),
            ClientError::TimedOut(root, s) => {
                write!(f, "the guard in {} has not answered within {s} s", root.display())
            }
            ClientError::Io(root, error) => write!(f, "cannot talk to the guard in {}: {error}", root.display()),
        }
    }
}

impl std::error::Error for ClientError {}

/// An answer, and the descriptor that came with it.
pub type Answer = (Vec<u8>, Option<OwnedFd>);

/// A connection to the guard that never waits.
#[derive(Debug)]
pub struct Client(OwnedFd);

impl Client {
    /// Connects to the guard of the robot in `root`.
    pub fn connect(root: &Path) -> Result<Client, ClientError> {
        let failed = |error| match error {
            Errno::NOENT | Errno::CONNREFUSED | Errno::NOTDIR => ClientError::NoGuard(root.to_owned()),
            error => ClientError::Io(root.to_owned(), error),
        };
        let address = SocketAddrUnix::new(root.join(SOCKET)).map_err(failed)?;
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let socket = net::socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None).map_err(failed)?;
        net::connect(&socket, &address).map_err(failed)?;
        Ok(Client(socket))
    }

    /// Says who this is: the guard watches the process from now on.
    pub fn attach(&self, node: &str) -> Result<(), Errno> {
        self.say(&format!("attach {node}"))
    }

    /// Sends one request.
    pub fn say(&self, request: &str) -> Result<(), Errno> {
        net::send(&self.0, request.as_bytes(), SendFlags::NOSIGNAL | SendFlags::DONTWAIT).map(drop)
    }

    /// Leaves the guard a descriptor of the device at `address` and what stops it.
    pub fn leave(&self, address: &str, device: BorrowedFd<'_>, will: &Will) -> Result<(), Errno> {
        let mut packet = format!("will {} {} {address}\n", will.repeat, will.spacing_us).into_bytes();
        packet.extend_from_slice(will.bytes);
        send_with(self.0.as_fd(), &packet, Some(device))
    }

    /// The next answer, if one has come; a descriptor may come with it.
    pub fn hear(&self) -> Result<Option<Answer>, Errno> {
        let mut packet = [0; PACKET_BYTES];
        match receive_with(self.0.as_fd(), &mut packet) {
            Ok((0, _)) => Err(Errno::CONNRESET),
            Ok((length, descriptor)) => Ok(Some((packet[..length].to_vec(), descriptor))),
            Err(Errno::AGAIN | Errno::INTR) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Asks for the descriptor that a predecessor has left, and waits for the answer.
    pub fn claim(&self, address: &str, within_s: f64) -> Result<Kept, Errno> {
        self.say(&format!("claim {address}"))?;
        if !self.wait(within_s) {
            return Ok(Kept(None));
        }
        let heard = self.hear()?;
        Ok(Kept(heard.filter(|(word, _)| word == b"kept").and_then(|(_, descriptor)| descriptor)))
    }

    /// Waits until something can be heard; false when the time is over.
    pub fn wait(&self, within_s: f64) -> bool {
        let within = Timespec { tv_sec: within_s as i64, tv_nsec: ((within_s % 1.0) * 1e9) as i64 };
        let mut watched = [PollFd::new(&self.0, PollFlags::IN)];
        matches!(rustix::io::retry_on_intr(|| poll(&mut watched, Some(&within))), Ok(1..))
    }
}

impl AsFd for Client {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

/// One request to the guard of the robot in `root`, and its answer.
pub fn ask(root: &Path, request: &str, within_s: f64) -> Result<(String, Option<OwnedFd>), ClientError> {
    let client = Client::connect(root)?;
    let failed = |error| ClientError::Io(root.to_owned(), error);
    client.say(request).map_err(failed)?;
    if !client.wait(within_s) {
        return Err(ClientError::TimedOut(root.to_owned(), within_s));
    }
    match client.hear().map_err(failed)? {
        Some((answer, descriptor)) => Ok((String::from_utf8_lossy(&answer).into_owned(), descriptor)),
        None => Err(ClientError::TimedOut(root.to_owned(), within_s)),
    }
}

/// Sends one packet with at most one descriptor.
pub(crate) fn send_with(
    socket: BorrowedFd<'_>,
    packet: &[u8],
    descriptor: Option<BorrowedFd<'_>>,
) -> Result<(), Errno> {
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut control = net::SendAncillaryBuffer::new(&mut space);
    let descriptors: &[BorrowedFd<'_>] = descriptor.as_slice();
    if !descriptors.is_empty() {
        control.push(net::SendAncillaryMessage::ScmRights(descriptors));
    }
    let flags = SendFlags::NOSIGNAL | SendFlags::DONTWAIT;
    net::sendmsg(socket, &[IoSlice::new(packet)], &mut control, flags).map(drop)
}

/// Takes one packet and at most one descriptor; further ones are closed.
pub(crate) fn receive_with(socket: BorrowedFd<'_>, packet: &mut [u8]) -> Result<(usize, Option<OwnedFd>), Errno> {
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
    let mut control = net::RecvAncillaryBuffer::new(&mut space);
    let flags = RecvFlags::DONTWAIT | RecvFlags::CMSG_CLOEXEC;
    let received = net::recvmsg(socket, &mut [IoSliceMut::new(packet)], &mut control, flags)?;
    let mut first = None;
    for message in control.drain() {
        if let net::RecvAncillaryMessage::ScmRights(descriptors) = message {
            for descriptor in descriptors {
                first.get_or_insert(descriptor);
            }
        }
    }
    Ok((received.bytes, first))
}
