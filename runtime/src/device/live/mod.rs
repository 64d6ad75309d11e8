//! The pump's side of a live device.

mod backoff;
mod client;
mod listen;
mod serve_pty;
mod stream;
mod tcp;
mod terminal;

use std::sync::Arc;

use rustix::event::{PollFd, PollFlags};

use client::Client;
use listen::Listen;
use serve_pty::ServePty;
use stream::Stream;

use super::{Address, Side, WhyClosed, Wire};
use crate::Time;
use crate::pump::{GuardLine, Log, Part, Waker};

/// A device as the pump runs it.
pub(crate) struct LiveDevice {
    stream: Stream,
    source: Source,
}

enum Source {
    Client(Client),
    Listen(Listen),
    ServePty(ServePty),
}

impl LiveDevice {
    /// Runs `wire`; `notify` tells the step of bytes and of changes of the link, `log` tells people of the latter.
    pub fn new(
        wire: Arc<Wire>,
        notify: Box<dyn Fn() + Send>,
        log: Log,
        waker: Waker,
        guard: Option<Arc<GuardLine>>,
    ) -> LiveDevice {
        let source = match (wire.side, &wire.address) {
            (Side::Client, _) => Source::Client(Client::new(waker, guard)),
            (Side::Server, Address::Pty { .. }) => Source::ServePty(ServePty::new()),
            (Side::Server, _) => Source::Listen(Listen::new(waker)),
        };
        let mut stream = Stream::new(wire, notify, log);
        stream.opening();
        LiveDevice { stream, source }
    }
}

impl Part for LiveDevice {
    fn advance(&mut self, now: Time) -> Option<Time> {
        match &mut self.source {
            Source::Client(client) => client.advance(now, &mut self.stream),
            Source::Listen(listen) => listen.advance(now, &mut self.stream),
            Source::ServePty(pty) => pty.advance(now, &mut self.stream),
        }
    }

    fn watch<'a>(&'a self, descriptors: &mut Vec<PollFd<'a>>) {
        match &self.source {
            Source::Client(client) => client.watch(&self.stream, descriptors),
            Source::Listen(listen) => listen.watch(&self.stream, descriptors),
            Source::ServePty(pty) => pty.watch(&self.stream, descriptors),
        }
    }

    fn ready(&mut self, now: Time, events: &[PollFlags]) {
        match &mut self.source {
            Source::Client(client) => client.ready(now, &mut self.stream, events),
            Source::Listen(listen) => listen.ready(now, &mut self.stream, events),
            Source::ServePty(pty) => pty.ready(now, &mut self.stream, events),
        }
    }

    fn close(&mut self) -> bool {
        if self.stream.line.is_some() && self.stream.flush().is_ok() && !self.stream.wire.outgoing.is_empty() {
            return false;
        }
        if let Source::Client(client) = &self.source {
            // The driver has said its last word itself.
            client.give_up(&self.stream);
        }
        self.stream.close(WhyClosed::Stopped);
        if let Source::ServePty(pty) = &mut self.source {
            pty.close();
        }
        true
    }
}
