//! Requests to a running supervisor.
//!
//! `<root>/.run/control` is a Unix seqpacket socket. A request is one word, an answer one JSON object:
//! `down` begins the ordered stop and answers `{"ok":true}`; the connection ends when nothing of the run is left.
//! `status` answers with a `Status`. Anything else answers `{"error":…}`. Only the supervisor's user and root are heard, and no confined node.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use runtime::clock;
use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::io::Errno;
use rustix::net::{self, AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType};

use crate::owner::{RUN_FOLDER, owner};

/// More connections than this are turned away.
const MOST_CONNECTIONS: usize = 16;
/// After the end of the supervisor the rest of the tree is gone within milliseconds [s].
const LEAVES_WITHIN_S: f64 = 0.5;
/// No request is longer.
const LONGEST_REQUEST_BYTES: usize = 1024;
const UNKNOWN: &str =
    r#"{"error":"unknown request; known are: down, status, start NODE, stop NODE, restart NODE, clear"}"#;
/// No answer is longer.
const LONGEST_ANSWER_BYTES: usize = 128 << 10;

/// Ends a run from another thread of the supervisor's process.
#[derive(Debug, Clone)]
pub struct StopHandle(Arc<OwnedFd>);

impl StopHandle {
    /// A handle for one run.
    pub fn new() -> io::Result<StopHandle> {
        Ok(StopHandle(Arc::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?)))
    }

    /// Asks for the ordered stop; a second time: for the immediate one.
    pub fn stop(&self) {
        // The counter cannot overflow in the life of a robot, and nothing else can go wrong.
        let _ = rustix::io::write(&self.0, &1_u64.to_ne_bytes());
    }

    pub(crate) fn requested(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }

    /// How often `stop` was called since the last look.
    pub(crate) fn take(&self) -> u64 {
        let mut count = [0; 8];
        rustix::io::read(&self.0, &mut count).map_or(0, |_| u64::from_ne_bytes(count))
    }
}

/// The socket and those who talk over it.
#[derive(Debug)]
pub struct Control {
    listener: OwnedFd,
    connections: Vec<OwnedFd>,
}

impl Control {
    /// Listens below the robot's root.
    pub fn listen(root: &Path) -> io::Result<Control> {
        let path = socket_path(root);
        let address = address(&path)?;
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let listener = net::socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None)?;
        net::bind(&listener, &address)?;
        net::listen(&listener, MOST_CONNECTIONS as i32)?;
        Ok(Control::adopt(listener))
    }

    /// Goes on listening where a supervisor before this one did.
    pub fn adopt(listener: OwnedFd) -> Control {
        Control { listener, connections: Vec::new() }
    }

    /// The listening socket.
    pub fn listener(&self) -> BorrowedFd<'_> {
        self.listener.as_fd()
    }

    /// Everything to be watched for reading: the listener first, then the connections.
    pub fn watched(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        std::iter::once(&self.listener).chain(&self.connections).map(AsFd::as_fd)
    }

    /// Serves whoever has something to say; `status` is the answer to `status`, `answer_other` has the others. True: somebody said `down`.
    pub fn serve(&mut self, status: &str, answer_other: &mut dyn FnMut(&str) -> Option<String>) -> bool {
        while let Ok(connection) = net::accept_with(&self.listener, SocketFlags::CLOEXEC | SocketFlags::NONBLOCK) {
            if self.connections.len() < MOST_CONNECTIONS && is_trusted(&connection) {
                self.connections.push(connection);
            }
        }
        let mut down = false;
        self.connections.retain(|connection| {
            let mut word = [0_u8; LONGEST_REQUEST_BYTES];
            let length = match net::recv(connection, &mut word, RecvFlags::DONTWAIT) {
                Ok((_, length)) => length,
                Err(Errno::AGAIN | Errno::INTR) => return true,
                Err(_) => return false,
            };
            // An empty packet is the end of the connection.
            let other;
            let answer = match word.get(..length) {
                None | Some(b"") => return false,
                Some(b"down") => {
                    down = true;
                    r#"{"ok":true}"#
                }
                Some(b"status") => status,
                Some(words) => {
                    other =
                        std::str::from_utf8(words).ok().and_then(&mut *answer_other).unwrap_or_else(|| UNKNOWN.into());
                    other.as_str()
                }
            };
            // Who does not take his answer loses the connection: nobody is waited for.
            net::send(connection, answer.as_bytes(), SendFlags::DONTWAIT | SendFlags::NOSIGNAL).is_ok()
        });
        down
    }
}

fn is_trusted(connection: &OwnedFd) -> bool {
    let own = rustix::process::geteuid();
    net::sockopt::socket_peercred(connection).is_ok_and(|peer| {
        // A node without a user of its own has the supervisor's, and is still no person.
        (peer.uid == own || peer.uid.is_root()) && !guard::is_confined(peer.pid.as_raw_nonzero().get() as u32)
    })
}

/// Why a request had no answer.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// Nobody listens.
    #[error("no robot is running in {0}")]
    NotRunning(PathBuf),
    /// It did not answer in time.
    #[error("the supervisor in {0} has not answered within {1} s; is it stopped?")]
    TimedOut(PathBuf, f64),
    /// The system refused.
    #[error("cannot talk to the supervisor in {0}: {1}")]
    Io(PathBuf, io::Error),
}

/// Sends one request to the supervisor of the robot in `root` and returns its answer, JSON.
pub fn ask(root: &Path, request: &str, within_s: f64) -> Result<String, ControlError> {
    let connection = connect(root)?;
    send(root, &connection, request)?;
    let answer = receive(root, &connection, within_s)?;
    answer.ok_or_else(|| ControlError::NotRunning(root.to_owned()))
}

/// Stops the robot in `root` in order; returns when nothing is left of it.
pub fn down(root: &Path, within_s: f64) -> Result<(), ControlError> {
    let connection = connect(root)?;
    let until = clock::now().after_s(within_s);
    send(root, &connection, "down")?;
    let tree = owner(root).and_then(|owner| crate::proc::open(owner.pid, owner.start_ticks));
    // The answer, then the end of the connection, then the end of the process tree.
    while receive(root, &connection, until.since(clock::now()))?.is_some() {}
    if let Some(tree) = tree {
        let left_s = until.since(clock::now()).clamp(0.0, LEAVES_WITHIN_S);
        let timeout = Timespec::try_from(Duration::from_secs_f64(left_s)).ok();
        // Where the supervisor is a part of a larger program, that lives on.
        let _ = rustix::io::retry_on_intr(|| poll(&mut [PollFd::new(&tree, PollFlags::IN)], timeout.as_ref()));
    }
    Ok(())
}

fn socket_path(root: &Path) -> PathBuf {
    root.join(RUN_FOLDER).join("control")
}

fn address(path: &Path) -> io::Result<SocketAddrUnix> {
    SocketAddrUnix::new(path).map_err(|error| match error {
        Errno::NAMETOOLONG => io::Error::other(format!(
            "the socket's path {} is longer than the 107 bytes that the system takes; choose a shorter SINEW_SHM or name",
            path.display()
        )),
        error => error.into(),
    })
}

fn connect(root: &Path) -> Result<OwnedFd, ControlError> {
    let failed = |error: io::Error| ControlError::Io(root.to_owned(), error);
    let address = address(&socket_path(root)).map_err(failed)?;
    let socket = net::socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None);
    let socket = socket.map_err(|error| failed(error.into()))?;
    match net::connect(&socket, &address) {
        Ok(()) => Ok(socket),
        Err(Errno::NOENT | Errno::CONNREFUSED | Errno::NOTDIR) => Err(ControlError::NotRunning(root.to_owned())),
        Err(error) => Err(failed(error.into())),
    }
}

fn send(root: &Path, connection: &OwnedFd, request: &str) -> Result<(), ControlError> {
    let sent = net::send(connection, request.as_bytes(), SendFlags::NOSIGNAL);
    sent.map(|_| ()).map_err(|error| ControlError::Io(root.to_owned(), error.into()))
}

/// `None`: the supervisor has ended the connection.
fn receive(root: &Path, connection: &OwnedFd, within_s: f64) -> Result<Option<String>, ControlError> {
    let failed = |error: Errno| ControlError::Io(root.to_owned(), error.into());
    let timeout = Timespec::try_from(Duration::from_secs_f64(within_s.clamp(0.0, 1e9))).ok();
    let mut watched = [PollFd::new(connection, PollFlags::IN)];
    if rustix::io::retry_on_intr(|| poll(&mut watched, timeout.as_ref())).map_err(failed)? == 0 {
        return Err(ControlError::TimedOut(root.to_owned(), within_s));
    }
    let mut answer = vec![0; LONGEST_ANSWER_BYTES];
    match rustix::io::retry_on_intr(|| net::recv(connection, &mut answer[..], RecvFlags::empty())) {
        Ok((0, _)) | Err(Errno::CONNRESET) => Ok(None),
        Ok((length, _)) => Ok(Some(String::from_utf8_lossy(&answer[..length]).into_owned())),
        Err(error) => Err(failed(error)),
    }
}
