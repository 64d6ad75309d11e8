//! The server's side over TCP: listens, for one client at a time.

use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::Ordering;

use rustix::event::{PollFd, PollFlags};

use super::backoff::BackOff;
use super::stream::Stream;
use super::tcp::{self, Lookup};
use crate::Time;
use crate::device::{Address, WhyClosed};
use crate::pump::Waker;

/// Listens, for one client at a time; others are turned away at once.
pub(super) struct Listen {
    back_off: BackOff,
    listener: Option<OwnedFd>,
    waker: Waker,
}

impl Listen {
    pub fn new(waker: Waker) -> Listen {
        Listen { back_off: BackOff::new(), listener: None, waker }
    }

    pub fn advance(&mut self, now: Time, stream: &mut Stream) -> Option<Time> {
        if stream.wire.reopen.swap(false, Ordering::AcqRel) && stream.line.is_some() {
            stream.close(WhyClosed::NoClient);
        }
        if let Err(_gone) = stream.flush() {
            stream.close(WhyClosed::NoClient);
        }
        if self.listener.is_none() && self.back_off.is_due(now) {
            match self.listen(stream) {
                Ok((listener, port)) => {
                    self.listener = Some(listener);
                    self.back_off.rest();
                    stream.wire.port.store(port, Ordering::Release);
                    stream.close(WhyClosed::NoClient);
                }
                Err(why) => self.failed(now, stream, why),
            }
        }
        self.back_off.next()
    }

    fn listen(&self, stream: &Stream) -> Result<(OwnedFd, u16), WhyClosed> {
        let Address::Tcp { host, port } = &stream.wire.address else { return Err(WhyClosed::NotPossible) };
        // A server names an address of this machine by number; a name would be looked up while others wait.
        match tcp::look_up(host, *port, &self.waker) {
            Lookup::Known(addresses) => {
                addresses.first().map_or(Err(WhyClosed::UnknownHost), |address| tcp::serve(*address))
            }
            Lookup::Pending(_) => Err(WhyClosed::UnknownHost),
        }
    }

    fn failed(&mut self, now: Time, stream: &mut Stream, why: WhyClosed) {
        self.listener = None;
        stream.close(why);
        match why {
            // Another robot file is needed.
            WhyClosed::NotPossible => self.back_off.rest(),
            _ => self.back_off.failed(now),
        }
    }

    pub fn watch<'a>(&'a self, stream: &'a Stream, descriptors: &mut Vec<PollFd<'a>>) {
        if let Some(line) = &stream.line {
            descriptors.push(PollFd::from_borrowed_fd(line.descriptor.as_fd(), stream.interest()));
        }
        if let Some(listener) = &self.listener {
            descriptors.push(PollFd::from_borrowed_fd(listener.as_fd(), PollFlags::IN));
        }
    }

    pub fn ready(&mut self, now: Time, stream: &mut Stream, events: &[PollFlags]) {
        let (of_line, of_listener) = match stream.line.is_some() {
            true => (events.first(), events.get(1)),
            false => (None, events.first()),
        };
        let of_listener = of_listener.is_some_and(|events| !events.is_empty());
        // Before a newcomer is judged: the old client may just have gone.
        if let Some(of_line) = of_line.copied().or(of_listener.then_some(PollFlags::IN))
            && !of_line.is_empty()
            && stream.ready(now, of_line).is_err()
        {
            stream.close(WhyClosed::NoClient);
        }
        let Some(listener) = self.listener.as_ref().filter(|_| of_listener) else { return };
        match tcp::next_client(listener) {
            Ok(Some(client)) if stream.line.is_none() => stream.open(client, true),
            // Dropping it tells the second client that this place is taken.
            Ok(_) => {}
            Err(error) => self.failed(now, stream, WhyClosed::from_errno(error)),
        }
    }
}
