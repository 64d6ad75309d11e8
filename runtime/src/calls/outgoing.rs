//! A node's calls to another node, as its pump makes them.

use std::os::fd::{AsFd, OwnedFd};
use std::path::PathBuf;
use std::sync::Arc;

use rustix::event::{PollFd, PollFlags};

use super::call_line::{CallEnd, CallHead, CallLine};
use super::caller::Loss;
use super::refusal::{Reason, Refusal, RefusalCode};
use super::socket::{Received, Sent, Unreachable, connect_to, receive_buffer, receive_message, send_message};
use super::target::socket_path;
use super::wire::{self, Header, Kind, Name};
use crate::Time;
use crate::pump::Part;

/// How soon to try again when too many callers wait at the node.
const CROWDED_S: f64 = 0.005;

/// The pump's side of a [`Caller`](super::Caller).
pub(crate) struct Outgoing {
    root: PathBuf,
    line: Arc<CallLine>,
    /// Who calls.
    path: String,
    notify: Box<dyn Fn() + Send>,
    socket: Option<OwnedFd>,
    current: Option<Current>,
    buffer: Box<[u8]>,
}

struct Current {
    head: CallHead,
    /// What is still to be sent of it, in order.
    unsent: Vec<Vec<u8>>,
    /// Whether the node may have seen it.
    begun: bool,
    accepted: bool,
}

impl Outgoing {
    pub fn new(root: PathBuf, line: Arc<CallLine>, path: &str, notify: Box<dyn Fn() + Send>) -> Outgoing {
        let buffer = receive_buffer();
        Outgoing { root, line, path: path.into(), notify, socket: None, current: None, buffer }
    }

    /// Takes what the step wants.
    fn fetch(&mut self) {
        if let Some((head, body)) = self.line.fetch() {
            // The old call is no longer wanted; its answer would belong to nobody.
            self.drop_current();
            let header = Header {
                deadline_ns: head.deadline.nanos(),
                layout_hash: self.line.request.hash,
                priority: head.priority,
                command: Name::new(&self.line.target.command),
                sender: Name::new(&self.path),
                ..Header::new(Kind::Request, head.id)
            };
            self.current = Some(Current { head, unsent: vec![header.message(&body)], begun: false, accepted: false });
        }
        if let Some(id) = self.line.fetch_cancel()
            && let Some(current) = self.current.as_mut().filter(|current| current.head.id == id)
        {
            match current.begun {
                true => current.unsent.push(Header::new(Kind::Cancel, id).message(&[])),
                false => self.end(CallEnd::Cancelled, &[]),
            }
        }
    }

    /// Gives up the current call. One try to tell the node: its deadline and the next connection's end do the rest.
    fn drop_current(&mut self) {
        if let (Some(current), Some(socket)) = (self.current.take(), &self.socket)
            && current.begun
        {
            let _ = send_message(socket, &Header::new(Kind::Cancel, current.head.id).message(&[]));
        }
    }

    /// Sends what is unsent; gives when to try again if the node is crowded.
    fn send(&mut self, now: Time) -> Option<Time> {
        while let Some(current) = self.current.as_mut().filter(|current| !current.unsent.is_empty()) {
            let Some(socket) = &self.socket else {
                match self.connect() {
                    Ok(socket) => self.socket = Some(socket),
                    Err(Unreachable::Crowded) => return Some(now.after_s(CROWDED_S)),
                    Err(_) => self.end(CallEnd::Lost(Loss::NotRunning), &[]),
                }
                continue;
            };
            match send_message(socket, &current.unsent[0]) {
                Sent::Whole => {
                    current.unsent.remove(0);
                    current.begun = true;
                }
                Sent::Later => return None,
                Sent::Gone => self.hung_up(),
            }
        }
        None
    }

    fn connect(&self) -> Result<OwnedFd, Unreachable> {
        let path = socket_path(&self.root, &self.line.target.path).map_err(|_| Unreachable::NotRunning)?;
        connect_to(&path)
    }

    /// The node has closed. What it has never seen can be sent to its successor.
    fn hung_up(&mut self) {
        self.socket = None;
        if self.current.as_ref().is_some_and(|current| current.begun) {
            self.end(CallEnd::Lost(Loss::Died), &[]);
        }
    }

    fn end(&mut self, end: CallEnd, body: &[u8]) {
        if let Some(current) = self.current.take() {
            self.line.ended(current.head.id, end, body);
            (self.notify)();
        }
    }

    fn hear(&mut self) {
        let mut buffer = std::mem::take(&mut self.buffer);
        while let Some(socket) = &self.socket {
            match receive_message(socket, &mut buffer) {
                Received::Message(message) => match wire::parse(message) {
                    Ok((header, body)) => self.take_reply(&header, body),
                    // Whoever answers there is no node of this release.
                    Err(_) => self.hung_up(),
                },
                Received::TooLong(_) | Received::Gone => self.hung_up(),
                Received::Nothing => break,
            }
        }
        self.buffer = buffer;
    }

    fn take_reply(&mut self, header: &Header, body: &[u8]) {
        // 0: the node has no room for this caller.
        let meant = |current: &&mut Current| header.id == current.head.id || header.id == 0;
        let Some(current) = self.current.as_mut().filter(meant) else { return };
        let id = current.head.id;
        match header.kind {
            Kind::Accepted => {
                current.accepted = true;
                self.line.accepted(id);
                (self.notify)();
            }
            Kind::Progress => {
                self.line.progress(id, header.layout_hash, body);
                (self.notify)();
            }
            _ => {
                if let Some(end) = end_of(&self.line, header, body) {
                    self.end(end, body);
                }
            }
        }
    }
}

/// How a last word ends the call; none when it is no last word.
pub(super) fn end_of(line: &CallLine, header: &Header, body: &[u8]) -> Option<CallEnd> {
    Some(match header.kind {
        Kind::Answer if header.layout_hash != line.answer.hash || body.len() != line.answer.bytes => {
            let reason = format!(
                "{} answers with layout {:016x}, this node expects {:016x}: use programs of one release",
                line.target, header.layout_hash, line.answer.hash
            );
            CallEnd::Refused(Reason::new(&Refusal::new(RefusalCode::WrongLayout, reason)))
        }
        Kind::Answer => CallEnd::Answered,
        Kind::Cancelled => CallEnd::Cancelled,
        Kind::Refused | Kind::Failed => {
            let refusal = Refusal::from_bytes(body);
            match (refusal.code, header.kind) {
                (RefusalCode::NotInTime, _) => CallEnd::TimedOut,
                (_, Kind::Failed) => CallEnd::Failed(Reason::new(&refusal)),
                _ => CallEnd::Refused(Reason::new(&refusal)),
            }
        }
        _ => return None,
    })
}

impl Part for Outgoing {
    fn advance(&mut self, now: Time) -> Option<Time> {
        self.fetch();
        let retry_at = self.send(now);
        let Some(current) = &self.current else { return None };
        if !current.accepted && current.head.deadline <= now {
            // The node says so itself, with its reason, unless it is stopped or unreachable.
            self.line.ended(current.head.id, CallEnd::TimedOut, &[]);
            self.drop_current();
            (self.notify)();
            return None;
        }
        let deadline = (!current.accepted).then_some(current.head.deadline);
        retry_at.into_iter().chain(deadline).min()
    }

    fn watch<'a>(&'a self, descriptors: &mut Vec<PollFd<'a>>) {
        if let Some(socket) = &self.socket {
            let unsent = self.current.as_ref().is_some_and(|current| !current.unsent.is_empty());
            let writable = if unsent { PollFlags::OUT } else { PollFlags::empty() };
            descriptors.push(PollFd::from_borrowed_fd(socket.as_fd(), PollFlags::IN | writable));
        }
    }

    fn ready(&mut self, _now: Time, events: &[PollFlags]) {
        if events.iter().any(|event| event.intersects(PollFlags::IN | PollFlags::HUP | PollFlags::ERR)) {
            self.hear();
        }
    }

    fn close(&mut self) -> bool {
        self.drop_current();
        self.socket = None;
        true
    }
}
