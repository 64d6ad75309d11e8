//! A node's call socket, as its pump runs it.

use std::collections::VecDeque;
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;

use rustix::event::{PollFd, PollFlags};
use rustix::io::Errno;
use rustix::net::sockopt::socket_peercred;

use super::desk::{CallerNumber, Desk};
use super::socket::{Listener, Received, Sent, ServeError, receive_buffer, receive_message, send_message};
use super::stage::Sender;
use super::wire::{self, Header, Kind, Name};
use super::{Refusal, RefusalCode};
use crate::Time;
use crate::pump::Part;

/// Callers that may be connected at once.
pub(super) const MAX_CALLERS: usize = 64;
/// Messages of one caller that one look takes, so that none starves the others.
const MESSAGES_PER_LOOK: usize = 16;
/// Messages that wait for a caller who does not read, before it is dropped.
const MAX_WAITING: usize = 64;
/// How long not to accept when the process has no descriptor left.
const PAUSE_S: f64 = 0.1;

/// A node's call socket.
pub(crate) struct Server {
    /// None when the node has ended.
    listener: Option<Listener>,
    desk: Desk,
    connections: Vec<Connection>,
    last_caller: CallerNumber,
    /// When to accept again, after a pause for want of descriptors.
    accept_from: Option<Time>,
    notify: Box<dyn Fn() + Send>,
    /// Users that are heard besides root and this process's own; `None`: whoever can connect.
    callers: Option<Vec<u32>>,
    buffer: Box<[u8]>,
}

struct Connection {
    socket: OwnedFd,
    caller: CallerNumber,
    pid: i32,
    uid: u32,
    waiting: VecDeque<(Kind, Vec<u8>)>,
    gone: bool,
}

impl Server {
    /// Listens for calls of `node` below `root`; `notify` tells the step of requests.
    pub fn open(
        root: &Path,
        node: &str,
        desk: Desk,
        notify: Box<dyn Fn() + Send>,
        take_over: bool,
        callers: Option<Vec<u32>>,
    ) -> Result<Server, ServeError> {
        let listener = Some(Listener::open(root, node, take_over)?);
        let buffer = receive_buffer();
        let (connections, last_caller, accept_from) = (Vec::new(), 0, None);
        Ok(Server { listener, desk, connections, last_caller, accept_from, notify, callers, buffer })
    }

    /// Sends what the desk has for its callers, forgets those who have gone, and tells the step what is new.
    fn settle(&mut self) {
        for reply in self.desk.take_replies() {
            if let Some(connection) = self.connections.iter_mut().find(|found| found.caller == reply.caller) {
                connection.queue(reply.header.kind, reply.header.message(&reply.body));
            }
        }
        for connection in &mut self.connections {
            connection.flush();
        }
        let desk = &mut self.desk;
        self.connections.retain(|connection| {
            if connection.gone {
                desk.caller_gone(connection.caller);
            }
            !connection.gone
        });
        if desk.take_news_for_step() {
            (self.notify)();
        }
    }

    /// Whether the user `uid` may call: by the kernel's word, not by its own.
    fn hears(&self, uid: u32) -> bool {
        let Some(callers) = &self.callers else { return true };
        uid == 0 || uid == rustix::process::geteuid().as_raw() || callers.contains(&uid)
    }

    fn accept(&mut self, now: Time) {
        let Some(listener) = &self.listener else { return };
        match listener.accept() {
            Ok(socket) if self.connections.len() >= MAX_CALLERS => {
                let reason = format!("{MAX_CALLERS} callers are connected already: close some");
                if let Ok(peer) = socket_peercred(&socket) {
                    let (pid, uid) = (peer.pid.as_raw_nonzero().get(), peer.uid.as_raw());
                    self.desk.turned_away(Sender { name: Name::default(), pid, uid }, &reason);
                }
                let refusal = Refusal::new(RefusalCode::TooManyCallers, reason).to_bytes();
                let _ = send_message(&socket, &Header::new(Kind::Refused, 0).message(&refusal));
            }
            Ok(socket) => {
                let Ok(peer) = socket_peercred(&socket) else { return };
                if !self.hears(peer.uid.as_raw()) {
                    let reason = format!("user {} is no caller of this node by the robot file", peer.uid.as_raw());
                    let refusal = Refusal::new(RefusalCode::NotAllowed, reason).to_bytes();
                    let _ = send_message(&socket, &Header::new(Kind::Refused, 0).message(&refusal));
                    return;
                }
                self.last_caller += 1;
                self.connections.push(Connection {
                    socket,
                    caller: self.last_caller,
                    pid: peer.pid.as_raw_nonzero().get(),
                    uid: peer.uid.as_raw(),
                    waiting: VecDeque::new(),
                    gone: false,
                });
            }
            // The caller stays in the backlog and the socket readable: without a pause the pump would spin.
            Err(Errno::MFILE | Errno::NFILE | Errno::NOBUFS | Errno::NOMEM) => {
                self.accept_from = Some(now.after_s(PAUSE_S));
            }
            Err(_) => {}
        }
    }

    fn hear(&mut self, now: Time, index: usize) {
        let Server { desk, connections, buffer, .. } = self;
        let connection = &mut connections[index];
        for _ in 0..MESSAGES_PER_LOOK {
            match receive_message(&connection.socket, buffer) {
                Received::Message(message) => match wire::parse(message) {
                    Ok((header, body)) => {
                        desk.receive(now, connection.caller, connection.sender(&header), &header, body);
                    }
                    Err(error) => desk.malformed(connection.caller, connection.nameless(), error.to_string()),
                },
                Received::TooLong(length) => {
                    let reason = format!("a message of {length} bytes; at most {} are allowed", buffer.len());
                    desk.malformed(connection.caller, connection.nameless(), reason);
                }
                Received::Nothing => return,
                Received::Gone => {
                    connection.gone = true;
                    return;
                }
            }
        }
    }
}

impl Part for Server {
    fn advance(&mut self, now: Time) -> Option<Time> {
        self.desk.advance(now);
        self.settle();
        if self.accept_from.is_some_and(|from| from <= now) {
            self.accept_from = None;
        }
        self.desk.next_deadline().into_iter().chain(self.accept_from).min()
    }

    fn watch<'a>(&'a self, descriptors: &mut Vec<PollFd<'a>>) {
        for connection in &self.connections {
            let writable = if connection.waiting.is_empty() { PollFlags::empty() } else { PollFlags::OUT };
            descriptors.push(PollFd::from_borrowed_fd(connection.socket.as_fd(), PollFlags::IN | writable));
        }
        if let Some(listener) = &self.listener {
            let interest = if self.accept_from.is_none() { PollFlags::IN } else { PollFlags::empty() };
            descriptors.push(PollFd::from_borrowed_fd(listener.socket.as_fd(), interest));
        }
    }

    fn ready(&mut self, now: Time, events: &[PollFlags]) {
        let of_callers = events.len().min(self.connections.len());
        for (index, event) in events[..of_callers].iter().enumerate() {
            if event.intersects(PollFlags::IN | PollFlags::HUP | PollFlags::ERR) {
                self.hear(now, index);
            }
        }
        if events[of_callers..].iter().any(|event| !event.is_empty()) {
            self.accept(now);
        }
        self.settle();
    }

    fn close(&mut self) -> bool {
        // No new callers; the answers of the last step still go out, then every connection ends.
        self.listener = None;
        self.desk.advance(Time::ZERO);
        self.settle();
        if self.connections.iter().any(|connection| !connection.waiting.is_empty()) {
            return false;
        }
        self.connections.clear();
        true
    }
}

impl Connection {
    /// Who speaks: in its own words, and in the kernel's.
    fn sender(&self, header: &Header) -> Sender {
        Sender { name: header.sender, pid: self.pid, uid: self.uid }
    }

    /// Who speaks, where what it says cannot be read.
    fn nameless(&self) -> Sender {
        Sender { name: Name::default(), pid: self.pid, uid: self.uid }
    }

    fn queue(&mut self, kind: Kind, message: Vec<u8>) {
        // Progress is a state: what has not been sent is replaced by the newer one of the same call.
        if kind == Kind::Progress {
            self.waiting.retain(|(waiting, old)| *waiting != Kind::Progress || old[8..16] != message[8..16]);
        }
        self.waiting.push_back((kind, message));
        self.gone |= self.waiting.len() > MAX_WAITING;
    }

    fn flush(&mut self) {
        while let Some((_, message)) = self.waiting.front() {
            match send_message(&self.socket, message) {
                Sent::Whole => drop(self.waiting.pop_front()),
                Sent::Later => return,
                Sent::Gone => {
                    self.gone = true;
                    return;
                }
            }
        }
    }
}
