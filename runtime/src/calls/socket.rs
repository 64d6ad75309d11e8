//! Unix seqpacket sockets: one message per call of the kernel, and the kernel says who is at the other end.

use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, chmod};
use rustix::io::Errno;
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType, accept_with, bind, connect, listen,
    recv, send, socket_with,
};

use super::target::{TargetError, socket_path};
use super::wire::MAX_MESSAGE_BYTES;

/// Callers that may wait to be accepted.
const BACKLOG: i32 = 64;

/// Why a node's socket cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The node's path does not fit.
    #[error(transparent)]
    Path(#[from] TargetError),
    /// A command cannot be served.
    #[error(transparent)]
    Command(#[from] super::CommandError),
    /// Another process answers there.
    #[error("another process answers calls at {}: is this robot running already? `sinew down` ends it", .0.display())]
    Taken(PathBuf),
    /// The kernel refuses.
    #[error("the call socket {} cannot be made: {error}", .path.display())]
    Kernel {
        /// The socket.
        path: PathBuf,
        /// The kernel's reason.
        error: std::io::Error,
    },
}

/// A node's listening socket; it leaves the file system with it.
#[derive(Debug)]
pub(super) struct Listener {
    pub socket: OwnedFd,
    path: PathBuf,
    inode: u64,
}

impl Listener {
    /// Listens for calls of the node at `node`. A socket file that a killed predecessor left is replaced; one on which
    /// somebody listens only with `take_over`.
    pub fn open(root: &Path, node: &str, take_over: bool) -> Result<Listener, ServeError> {
        let path = socket_path(root, node)?;
        if !take_over && connect_to(&path).is_ok() {
            return Err(ServeError::Taken(path));
        }
        let failed = |error: std::io::Error| ServeError::Kernel { path: path.clone(), error };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        // Listening before it has its name: whoever finds it can connect. The name aside is no longer than the final one.
        let aside = path.with_file_name(format!(".c{:x}", std::process::id() & 0xf_ffff));
        let _ = std::fs::remove_file(&aside);
        let socket = listen_at(&aside).map_err(|error| failed(error.into()))?;
        let inode = rustix::fs::stat(&aside).map_err(|error| failed(error.into()))?.st_ino;
        std::fs::rename(&aside, &path).map_err(failed)?;
        Ok(Listener { socket, path, inode })
    }

    /// The next caller that waits.
    pub fn accept(&self) -> Result<OwnedFd, Errno> {
        accept_with(&self.socket, SocketFlags::NONBLOCK | SocketFlags::CLOEXEC)
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        // Unless a successor's socket stands there already.
        if rustix::fs::stat(&self.path).is_ok_and(|found| found.st_ino == self.inode) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

fn listen_at(path: &Path) -> Result<OwnedFd, Errno> {
    let socket = new_socket()?;
    bind(&socket, &SocketAddrUnix::new(path)?)?;
    // The node's user and group may call; others not. Where the umask says so already nothing is asked of the kernel: a
    // confined node may not change modes.
    let mode = Mode::from_raw_mode(rustix::fs::stat(path)?.st_mode);
    if mode.intersects(Mode::RWXO) || !mode.contains(Mode::RGRP | Mode::WGRP) {
        chmod(path, Mode::RUSR | Mode::WUSR | Mode::RGRP | Mode::WGRP)?;
    }
    listen(&socket, BACKLOG)?;
    Ok(socket)
}

fn new_socket() -> Result<OwnedFd, Errno> {
    socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::NONBLOCK | SocketFlags::CLOEXEC, None)
}

/// Why a node cannot be reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unreachable {
    /// No socket, or nobody listens on it.
    NotRunning,
    /// Too many callers wait: try again.
    Crowded,
    /// The kernel refuses.
    Kernel(Errno),
}

/// Connects to the node's socket at `path`, without waiting.
pub(super) fn connect_to(path: &Path) -> Result<OwnedFd, Unreachable> {
    let attempt = || {
        let socket = new_socket()?;
        connect(&socket, &SocketAddrUnix::new(path)?)?;
        Ok(socket)
    };
    attempt().map_err(|error| match error {
        Errno::NOENT | Errno::CONNREFUSED | Errno::NOTDIR => Unreachable::NotRunning,
        Errno::AGAIN => Unreachable::Crowded,
        other => Unreachable::Kernel(other),
    })
}

/// What became of a send.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sent {
    Whole,
    /// The other end does not read: try again when the socket is writable.
    Later,
    /// The other end has gone.
    Gone,
}

/// Sends one message without waiting.
pub(super) fn send_message(socket: impl AsFd, message: &[u8]) -> Sent {
    loop {
        return match send(&socket, message, SendFlags::NOSIGNAL | SendFlags::DONTWAIT) {
            Ok(_) => Sent::Whole,
            Err(Errno::INTR) => continue,
            Err(Errno::AGAIN | Errno::NOBUFS | Errno::NOMEM) => Sent::Later,
            Err(_) => Sent::Gone,
        };
    }
}

/// What a look at a socket brought.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Received<'a> {
    Message(&'a [u8]),
    /// Longer than any message may be; this long.
    TooLong(usize),
    Nothing,
    /// The other end has gone.
    Gone,
}

/// A buffer for [`receive_message`].
pub(super) fn receive_buffer() -> Box<[u8]> {
    vec![0; MAX_MESSAGE_BYTES].into()
}

/// Receives one message without waiting.
pub(super) fn receive_message(socket: impl AsFd, buffer: &mut [u8]) -> Received<'_> {
    loop {
        // With TRUNC the kernel tells the message's whole length; descriptors that come along are dropped by it.
        return match recv(&socket, &mut *buffer, RecvFlags::DONTWAIT | RecvFlags::TRUNC) {
            // An empty message cannot be told from the end; nobody who speaks this protocol sends one.
            Ok((0, _)) => Received::Gone,
            Ok((_, whole)) if whole > buffer.len() => Received::TooLong(whole),
            Ok((length, _)) => Received::Message(&buffer[..length]),
            // The kernel says once that the other end closed with unread messages; its own last word still waits here.
            Err(Errno::INTR | Errno::CONNRESET) => continue,
            Err(Errno::AGAIN) => Received::Nothing,
            Err(_) => Received::Gone,
        };
    }
}
