//! The pump's line to the guard: devices and their last wills, stops that the node wants, stops that it has obeyed.
//!
//! A guard that died is replaced within milliseconds: the line is made anew, and everything is said once more.

use std::os::fd::{AsFd, OwnedFd};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use guard::{Client, Will};
use rustix::event::{PollFd, PollFlags};

use super::{Part, Waker};
use crate::Time;
use crate::stop::SourceWord;

/// Time between two tries to reach the guard [s].
const AGAIN_S: f64 = 0.01;
/// How long a starting driver waits to be told whether its predecessor has left its device [s].
const CLAIM_WITHIN_S: f64 = 0.1;

/// What steps and devices of one node tell its guard.
#[derive(Debug)]
pub(crate) struct GuardLine {
    root: PathBuf,
    node: String,
    /// The newest word of the latch that the node has obeyed.
    obeyed: AtomicU32,
    waker: OnceLock<Waker>,
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    client: Option<Client>,
    devices: Vec<(String, Arc<OwnedFd>, Will)>,
    sources: Vec<(Arc<SourceWord>, u32, bool)>,
    said_obeyed: u32,
}

impl GuardLine {
    pub fn new(root: PathBuf, node: &str, sources: &[Arc<SourceWord>]) -> GuardLine {
        let sources = sources.iter().map(|source| (source.clone(), 0, false)).collect();
        GuardLine {
            root,
            node: node.to_owned(),
            obeyed: AtomicU32::new(0),
            waker: OnceLock::new(),
            inner: Mutex::new(Inner { sources, ..Inner::default() }),
        }
    }

    pub fn attach(&self, waker: Waker) {
        self.with(|inner| inner.sources.iter().for_each(|(source, ..)| source.attach(waker.clone())));
        let _ = self.waker.set(waker);
    }

    fn with<T>(&self, act: impl FnOnce(&mut Inner) -> T) -> T {
        // Only the pump's thread ever takes it.
        act(&mut self.inner.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Step's thread: the node has obeyed this word.
    pub fn obeyed(&self, word: u32) {
        self.obeyed.store(word, Ordering::Release);
        if let Some(waker) = self.waker.get() {
            waker.wake();
        }
    }

    /// The device at `address` that a predecessor has left open.
    pub fn claim(&self, address: &str) -> Option<OwnedFd> {
        self.with(|inner| {
            self.reach(inner);
            inner.client.as_ref()?.claim(address, CLAIM_WITHIN_S).ok()?.0
        })
    }

    /// Leaves the guard a device, now and whenever the guard is replaced.
    pub fn leave(&self, address: &str, device: &Arc<OwnedFd>, will: Will) {
        self.with(|inner| {
            inner.devices.retain(|(known, ..)| known != address);
            inner.devices.push((address.to_owned(), device.clone(), will));
            match &inner.client {
                Some(client) => {
                    let _ = client.leave(address, device.as_fd(), &will);
                }
                None => self.reach(inner),
            }
        });
    }

    /// The device is closed, and nobody has to stop it.
    pub fn give_up(&self, address: &str) {
        self.with(|inner| {
            let before = inner.devices.len();
            inner.devices.retain(|(known, ..)| known != address);
            if inner.devices.len() < before
                && let Some(client) = &inner.client
            {
                let _ = client.say(&format!("drop {address}"));
            }
        });
    }

    /// Connects, if need be, and says everything once more.
    fn reach(&self, inner: &mut Inner) {
        if inner.client.is_some() {
            return;
        }
        let Ok(client) = Client::connect(&self.root) else { return };
        if client.attach(&self.node).is_err() {
            return;
        }
        for (address, device, will) in &inner.devices {
            let _ = client.leave(address, device.as_fd(), will);
        }
        // Raises that were said are in the latch already; what is held must be said to the new guard.
        inner.sources.iter_mut().for_each(|(_, _, held)| *held = false);
        inner.said_obeyed = 0;
        inner.client = Some(client);
    }

    fn say_all(&self, inner: &mut Inner) {
        self.reach(inner);
        let obeyed = self.obeyed.load(Ordering::Acquire);
        let Some(client) = &inner.client else { return };
        if obeyed != inner.said_obeyed && client.say(&format!("stopped {obeyed}")).is_ok() {
            inner.said_obeyed = obeyed;
        }
        for (source, raises, held) in &mut inner.sources {
            let (wanted, holds, reason) = source.wanted();
            let name = &source.name;
            if wanted != *raises && client.say(&format!("stop {name}\n{reason}")).is_ok() {
                *raises = wanted;
            }
            let word = if holds { format!("hold {name}\n{reason}") } else { format!("lower {name}") };
            if holds != *held && client.say(&word).is_ok() {
                *held = holds;
            }
        }
    }
}

/// The line as the pump runs it.
pub(crate) struct GuardPart(pub Arc<GuardLine>, Option<OwnedFd>);

impl GuardPart {
    pub fn new(line: Arc<GuardLine>) -> GuardPart {
        GuardPart(line, None)
    }
}

impl Part for GuardPart {
    fn advance(&mut self, now: Time) -> Option<Time> {
        let line = self.0.clone();
        line.with(|inner| {
            line.say_all(inner);
            // What poll is lent must live outside of the lock.
            if self.1.is_none() {
                self.1 = inner.client.as_ref().and_then(|client| client.as_fd().try_clone_to_owned().ok());
            }
        });
        self.1.is_none().then(|| now.after_s(AGAIN_S))
    }

    fn watch<'a>(&'a self, descriptors: &mut Vec<PollFd<'a>>) {
        descriptors.extend(self.1.as_ref().map(|client| PollFd::from_borrowed_fd(client.as_fd(), PollFlags::IN)));
    }

    fn ready(&mut self, _now: Time, events: &[PollFlags]) {
        if events.iter().all(|event| event.is_empty()) {
            return;
        }
        let gone = self.0.with(|inner| {
            loop {
                match inner.client.as_ref().map(Client::hear) {
                    // Answers to `stop` and the like: nothing depends on them.
                    Some(Ok(Some(_))) => {}
                    Some(Ok(None)) => return false,
                    Some(Err(_)) | None => {
                        inner.client = None;
                        return true;
                    }
                }
            }
        });
        if gone {
            self.1 = None;
        }
    }

    fn close(&mut self) -> bool {
        true
    }
}
