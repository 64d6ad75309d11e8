//! The client's side: opens what the address names, and again when it is lost.

use std::net::SocketAddr;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, TryRecvError};

use rustix::event::{PollFd, PollFlags};

use super::backoff::BackOff;
use super::stream::Stream;
use super::tcp::{self, Lookup};
use super::terminal::{open_terminal, set_raw};
use crate::Time;
use crate::device::{Address, WhyClosed};
use crate::pump::{GuardLine, Waker};

/// How long one address has to take a connection.
const CONNECT_S: f64 = 3.0;

/// Opens what the address names, and again when it is lost.
pub(super) struct Client {
    back_off: BackOff,
    attempt: Attempt,
    waker: Waker,
    guard: Option<Arc<GuardLine>>,
    /// Whether the guard may still have what a predecessor has left.
    may_claim: bool,
}

/// A connection on its way.
enum Attempt {
    None,
    Resolving(Receiver<Option<Vec<SocketAddr>>>),
    Connecting { socket: OwnedFd, give_up_at: Time, others: Vec<SocketAddr> },
}

impl Client {
    pub fn new(waker: Waker, guard: Option<Arc<GuardLine>>) -> Client {
        Client { back_off: BackOff::new(), attempt: Attempt::None, waker, may_claim: guard.is_some(), guard }
    }

    pub fn advance(&mut self, now: Time, stream: &mut Stream) -> Option<Time> {
        if stream.wire.reopen.swap(false, Ordering::AcqRel) {
            self.give_up(stream);
            stream.opening();
            self.attempt = Attempt::None;
            self.back_off.hurry();
        }
        if stream.line.is_some() {
            self.serve_line(now, stream);
        }
        if stream.line.is_none() {
            self.pursue(now, stream);
        }
        match &self.attempt {
            Attempt::None => self.back_off.next(),
            Attempt::Resolving(_) => None,
            Attempt::Connecting { give_up_at, .. } => Some(*give_up_at),
        }
    }

    /// The open line: a new rate, and bytes that wait.
    fn serve_line(&mut self, now: Time, stream: &mut Stream) {
        let baud = stream.wire.baud.swap(0, Ordering::AcqRel);
        let set = match (&stream.line, baud) {
            (Some(line), 1..) if !line.socket => set_raw(&line.descriptor, Some(baud)),
            _ => Ok(()),
        };
        if let Err(why) = set.and_then(|()| stream.flush()) {
            self.lost(now, stream, why);
        }
    }

    /// The closed line: whatever step towards an open one is due.
    fn pursue(&mut self, now: Time, stream: &mut Stream) {
        match std::mem::replace(&mut self.attempt, Attempt::None) {
            Attempt::None if self.back_off.is_due(now) => self.begin(now, stream),
            Attempt::None => {}
            Attempt::Resolving(answer) => match answer.try_recv() {
                Ok(Some(addresses)) => self.connect(now, stream, addresses, WhyClosed::UnknownHost),
                Ok(None) | Err(TryRecvError::Disconnected) => self.lost(now, stream, WhyClosed::UnknownHost),
                Err(TryRecvError::Empty) => self.attempt = Attempt::Resolving(answer),
            },
            Attempt::Connecting { give_up_at, others, .. } if give_up_at <= now => {
                self.connect(now, stream, others, WhyClosed::Unreachable);
            }
            connecting => self.attempt = connecting,
        }
    }

    fn begin(&mut self, now: Time, stream: &mut Stream) {
        self.back_off.rest();
        if std::mem::take(&mut self.may_claim)
            && stream.wire.will.get().is_some()
            && let Some(kept) = self.guard.as_ref().and_then(|guard| guard.claim(&stream.wire.address.to_string()))
        {
            stream.wire.kept.store(true, Ordering::Release);
            return self.open(stream, kept, matches!(stream.wire.address, Address::Tcp { .. }));
        }
        stream.wire.kept.store(false, Ordering::Release);
        let opened = match stream.wire.address.clone() {
            Address::Serial { path, baud } => open_terminal(&path, Some(baud)),
            Address::Pty { path } => open_terminal(&path, None),
            Address::Tcp { host, port } => {
                match tcp::look_up(&host, port, &self.waker) {
                    Lookup::Known(addresses) => self.connect(now, stream, addresses, WhyClosed::UnknownHost),
                    Lookup::Pending(answer) => self.attempt = Attempt::Resolving(answer),
                }
                return;
            }
            // Never tried again: another host, or another robot file, is needed.
            Address::Simulator | Address::Memory { .. } => return stream.close(WhyClosed::NotPossible),
        };
        match opened {
            Ok(descriptor) => self.open(stream, descriptor, false),
            Err(why) => self.lost(now, stream, why),
        }
    }

    /// Tries the first of `addresses`; with none left, `why` is the reason.
    fn connect(&mut self, now: Time, stream: &mut Stream, mut addresses: Vec<SocketAddr>, mut why: WhyClosed) {
        while !addresses.is_empty() {
            match tcp::begin(addresses.remove(0)) {
                Ok(socket) => {
                    self.attempt =
                        Attempt::Connecting { socket, give_up_at: now.after_s(CONNECT_S), others: addresses };
                    return;
                }
                Err(reason) => why = reason,
            }
        }
        self.lost(now, stream, why);
    }

    fn open(&mut self, stream: &mut Stream, descriptor: OwnedFd, socket: bool) {
        // A rate that was asked for belonged to the old link.
        stream.wire.baud.store(0, Ordering::Release);
        stream.open(descriptor, socket);
        if let (Some(guard), Some(will), Some(line)) = (&self.guard, stream.wire.will.get(), &stream.line) {
            guard.leave(&stream.wire.address.to_string(), &line.descriptor, *will);
        }
    }

    /// The line is closed, and nobody has to stop the device.
    pub fn give_up(&self, stream: &Stream) {
        if let Some(guard) = self.guard.as_ref().filter(|_| stream.line.is_some()) {
            guard.give_up(&stream.wire.address.to_string());
        }
    }

    fn lost(&mut self, now: Time, stream: &mut Stream, why: WhyClosed) {
        // A server that takes a connection and drops it at once is no success.
        if stream.alive {
            self.back_off.succeeded();
            stream.alive = false;
        }
        self.give_up(stream);
        stream.close(why);
        self.attempt = Attempt::None;
        self.back_off.failed(now);
    }

    pub fn watch<'a>(&'a self, stream: &'a Stream, descriptors: &mut Vec<PollFd<'a>>) {
        if let Some(line) = &stream.line {
            descriptors.push(PollFd::from_borrowed_fd(line.descriptor.as_fd(), stream.interest()));
        } else if let Attempt::Connecting { socket, .. } = &self.attempt {
            descriptors.push(PollFd::from_borrowed_fd(socket.as_fd(), PollFlags::OUT));
        }
    }

    pub fn ready(&mut self, now: Time, stream: &mut Stream, events: &[PollFlags]) {
        let Some(events) = events.first().copied().filter(|events| !events.is_empty()) else { return };
        if stream.line.is_some() {
            if let Err(why) = stream.ready(now, events) {
                self.lost(now, stream, why);
            }
            return;
        }
        if let Attempt::Connecting { socket, others, .. } = std::mem::replace(&mut self.attempt, Attempt::None) {
            match tcp::finish(&socket) {
                Ok(()) => self.open(stream, socket, true),
                Err(why) => self.connect(now, stream, others, why),
            }
        }
    }
}
