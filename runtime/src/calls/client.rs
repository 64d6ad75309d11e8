//! The blocking end of a call, for programs that may wait: the command line, tests, tools.

use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use messages::Message;
use messages::bytemuck::{bytes_of, bytes_of_mut};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::call_error::CallError;
use super::description::{Command, Commands};
use super::refusal::{Refusal, RefusalCode};
use super::socket::{Received, Sent, Unreachable, connect_to, receive_buffer, receive_message, send_message};
use super::target::socket_path;
use super::wire::{self, Header, Kind, MAX_BODY_BYTES, Name};
use crate::Time;
use crate::pump::monotonic;

/// How much longer than the deadline to wait for the node's own word about it [s].
const GRACE_S: f64 = 0.25;
/// How long to try when too many callers wait at the node [s].
const CROWDED_S: f64 = 1.0;
/// How long `describe`, which needs no step, may take [s].
const DESCRIBE_S: f64 = 2.0;

/// What is asked of a node.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The command.
    pub command: &'a str,
    /// Layout hash of the request message; 0 for `ping` and `state`.
    pub layout_hash: u64,
    /// The request message's bytes.
    pub body: &'a [u8],
    /// 255 first.
    pub priority: u8,
    /// How long the node has to answer, or to accept a long order [s].
    pub timeout_s: f64,
}

/// What came back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reply {
    /// Layout hash of the answer message; 0: JSON text.
    pub layout_hash: u64,
    /// The answer message's bytes, or JSON.
    pub body: Vec<u8>,
}

/// News of a long order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Update<'a> {
    /// The node works on it.
    Accepted,
    /// How far it is.
    Progress {
        /// Layout hash of the progress message.
        layout_hash: u64,
        /// The progress message's bytes.
        body: &'a [u8],
    },
}

/// A connection to one node. Calls one thing at a time.
#[derive(Debug)]
pub struct Client {
    socket: Arc<OwnedFd>,
    node: String,
    sender: String,
    current: Arc<AtomicU64>,
    buffer: Box<[u8]>,
}

/// Cancels whatever its [`Client`] is waiting for, from another thread.
#[derive(Debug, Clone)]
pub struct Canceller {
    socket: Arc<OwnedFd>,
    current: Arc<AtomicU64>,
}

impl Canceller {
    /// Asks the node to stop; the client then learns how the call ended.
    pub fn cancel(&self) {
        // A node that does not read its socket is left to the deadline.
        let id = self.current.load(Ordering::Acquire);
        let _ = send_message(&*self.socket, &Header::new(Kind::Cancel, id).message(&[]));
    }
}

impl Client {
    /// Connects to the node at `node` (`/<layer>/<instance>`) of the robot whose folder is `root`; calls as `sender`.
    pub fn connect(root: &Path, node: &str, sender: &str) -> Result<Client, CallError> {
        let path = socket_path(root, node)?;
        let give_up_at = monotonic().after_s(CROWDED_S);
        let socket = loop {
            match connect_to(&path) {
                Ok(socket) => break socket,
                Err(Unreachable::NotRunning) => return Err(CallError::NodeNotRunning { node: node.into() }),
                Err(Unreachable::Crowded) if monotonic() < give_up_at => pause(),
                Err(Unreachable::Crowded) => {
                    let reason = "too many callers wait there, or the process is stopped".into();
                    return Err(CallError::Connection { node: node.into(), reason });
                }
                Err(Unreachable::Kernel(error)) => {
                    return Err(CallError::Connection { node: node.into(), reason: error.to_string() });
                }
            }
        };
        let (socket, current) = (Arc::new(socket), Arc::new(AtomicU64::new(0)));
        Ok(Client { socket, node: node.into(), sender: sender.into(), current, buffer: receive_buffer() })
    }

    /// What can be asked of the node.
    pub fn describe(&mut self) -> Result<Commands, CallError> {
        self.describe_by("")
    }

    /// All about one command.
    pub fn describe_command(&mut self, command: &str) -> Result<Command, CallError> {
        self.describe_by(command)
    }

    /// Calls and waits for the last word.
    pub fn call(&mut self, request: &Request<'_>) -> Result<Reply, CallError> {
        self.call_with(request, |_| {})
    }

    /// Calls and waits for the last word; `on_update` hears how a long order goes.
    pub fn call_with(&mut self, request: &Request<'_>, on_update: impl FnMut(Update<'_>)) -> Result<Reply, CallError> {
        self.exchange(Kind::Request, request, on_update)
    }

    /// Calls with messages whose types are known here.
    pub fn call_message<Q: Message, A: Message>(
        &mut self,
        command: &str,
        message: &Q,
        priority: u8,
        timeout_s: f64,
    ) -> Result<A, CallError> {
        let (layout_hash, body) = (Q::layout_hash(), bytes_of(message));
        let reply = self.call(&Request { command, layout_hash, body, priority, timeout_s })?;
        let expected_hash = A::layout_hash();
        if reply.layout_hash != expected_hash || reply.body.len() != size_of::<A>() {
            let reason = format!(
                "\"{command}\" of {} answers with layout {:016x}, expected is {} with {expected_hash:016x}: use programs \
                 of one release",
                self.node,
                reply.layout_hash,
                A::NAME
            );
            return Err(CallError::WrongLayout { expected_hash, reason });
        }
        let mut answer = A::zeroed();
        bytes_of_mut(&mut answer).copy_from_slice(&reply.body);
        Ok(answer)
    }

    /// Cancels from another thread what this one waits for.
    pub fn canceller(&self) -> Canceller {
        Canceller { socket: Arc::clone(&self.socket), current: Arc::clone(&self.current) }
    }

    fn describe_by<T: serde::de::DeserializeOwned>(&mut self, command: &str) -> Result<T, CallError> {
        let request = Request { command, layout_hash: 0, body: &[], priority: 0, timeout_s: DESCRIBE_S };
        let reply = self.exchange(Kind::Describe, &request, |_| {})?;
        serde_json::from_slice(&reply.body).map_err(|error| CallError::Connection {
            node: self.node.clone(),
            reason: format!("its description cannot be read ({error}): use programs of one release"),
        })
    }

    fn exchange(
        &mut self,
        kind: Kind,
        request: &Request<'_>,
        mut on_update: impl FnMut(Update<'_>),
    ) -> Result<Reply, CallError> {
        let command = request.command;
        if request.body.len() > MAX_BODY_BYTES || command.len() > wire::COMMAND_BYTES {
            let reason = "the message is over 64 KiB, or the command's name over 32 bytes".into();
            return Err(self.refused(command, reason));
        }
        let id = self.current.fetch_add(1, Ordering::AcqRel) + 1;
        let deadline = monotonic().after_s(request.timeout_s);
        let header = Header {
            deadline_ns: deadline.nanos(),
            layout_hash: request.layout_hash,
            priority: request.priority,
            command: Name::new(command),
            sender: Name::new(&self.sender),
            ..Header::new(kind, id)
        };
        let mut give_up_at = Some(deadline.after_s(GRACE_S));
        self.send(&header.message(request.body), command, give_up_at)?;
        loop {
            let (reply, body) = match receive_message(&*self.socket, &mut self.buffer) {
                Received::Message(message) => match wire::parse(message) {
                    Ok(reply) => reply,
                    Err(error) => {
                        let reason = format!("its answer cannot be read: {error}");
                        return Err(CallError::Connection { node: self.node.clone(), reason });
                    }
                },
                Received::Nothing => {
                    if !wait(&self.socket, PollFlags::IN, give_up_at) {
                        return Err(self.silent(command, id));
                    }
                    continue;
                }
                Received::Gone | Received::TooLong(_) => return Err(self.died(command)),
            };
            // 0: the node could not read the call, or has no room for this caller.
            if reply.id != id && reply.id != 0 {
                continue;
            }
            match reply.kind {
                Kind::Accepted => {
                    give_up_at = None;
                    on_update(Update::Accepted);
                }
                Kind::Progress => on_update(Update::Progress { layout_hash: reply.layout_hash, body }),
                Kind::Answer => return Ok(Reply { layout_hash: reply.layout_hash, body: body.to_vec() }),
                Kind::Cancelled => {
                    return Err(CallError::Cancelled { node: self.node.clone(), command: command.into() });
                }
                Kind::Refused | Kind::Failed => {
                    let refusal = Refusal::from_bytes(body);
                    return Err(self.refusal(command, reply.kind, refusal));
                }
                Kind::Describe | Kind::Request | Kind::Cancel => {}
            }
        }
    }

    fn send(&self, message: &[u8], command: &str, give_up_at: Option<Time>) -> Result<(), CallError> {
        loop {
            match send_message(&*self.socket, message) {
                Sent::Whole => return Ok(()),
                Sent::Later if wait(&self.socket, PollFlags::OUT, give_up_at) => {}
                Sent::Later => return Err(self.silent(command, 0)),
                // A refusal may still lie in the socket, as when the node has too many callers.
                Sent::Gone => return Ok(()),
            }
        }
    }

    fn silent(&self, command: &str, id: u64) -> CallError {
        let _ = send_message(&*self.socket, &Header::new(Kind::Cancel, id).message(&[]));
        CallError::TimedOut {
            node: self.node.clone(),
            command: command.into(),
            reason: "no answer, not even from the node's pump: its process is stopped, or starved of processor time"
                .into(),
        }
    }

    fn died(&self, command: &str) -> CallError {
        CallError::Died { node: self.node.clone(), command: command.into() }
    }

    fn refused(&self, command: &str, reason: String) -> CallError {
        CallError::Refused { node: self.node.clone(), command: command.into(), reason }
    }

    fn refusal(&self, command: &str, kind: Kind, refusal: Refusal) -> CallError {
        let (node, command, reason) = (self.node.clone(), command.to_owned(), refusal.reason);
        match (refusal.code, kind) {
            (RefusalCode::UnknownCommand, _) => {
                CallError::Unknown { command, nearest: refusal.nearest.as_str().into(), reason }
            }
            (RefusalCode::WrongLayout, _) => CallError::WrongLayout { expected_hash: refusal.expected_hash, reason },
            (RefusalCode::NotInTime, _) => CallError::TimedOut { node, command, reason },
            (_, Kind::Failed) => CallError::Failed { node, command, reason },
            _ => CallError::Refused { node, command, reason },
        }
    }
}

/// Waits until the socket is ready; false when `until` comes first.
fn wait(socket: &OwnedFd, interest: PollFlags, until: Option<Time>) -> bool {
    let nanos = until.map(|until| until.nanos_since(monotonic()));
    if nanos == Some(0) {
        return false;
    }
    let timeout = nanos.map(timespec);
    // Interrupted or not, the caller looks at the socket again.
    let _ = poll(&mut [PollFd::new(socket, interest)], timeout.as_ref());
    true
}

fn pause() {
    let _ = poll(&mut [], Some(&timespec(2_000_000)));
}

fn timespec(nanos: u64) -> Timespec {
    Timespec { tv_sec: (nanos / 1_000_000_000) as i64, tv_nsec: (nanos % 1_000_000_000) as i64 }
}
