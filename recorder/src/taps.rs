//! Reads everything that a robot's rings hold and writes it down. Never waits, never wakes anybody, writes no ring.

use std::collections::BTreeMap;

use runtime::channel::{ChannelError, RawReader, ReadError, SampleBuffer, Tree};
use runtime::path;

use crate::error::RecordError;
use crate::feed::{ChannelKey, Feed, Outlet};

/// All channels of a robot that are recorded.
pub struct Taps {
    tree: Tree,
    wanted: Vec<String>,
    taps: BTreeMap<String, Tap>,
    samples: u64,
    /// What a ring held before it was found is not read, but for the newest sample.
    skips_history: bool,
}

struct Tap {
    ring: RawReader,
    key: ChannelKey,
    buffer: SampleBuffer,
    next: u64,
    lost: u64,
}

impl Taps {
    /// Taps on the channels of `tree`; with `wanted`, on those that one of them names: a path, a folder, or a pattern.
    pub fn new(tree: Tree, wanted: Vec<String>) -> Taps {
        Taps { tree, wanted, taps: BTreeMap::new(), samples: 0, skips_history: false }
    }

    /// Begins each channel at its newest sample instead of the oldest that its ring holds.
    pub fn without_history(self) -> Taps {
        Taps { skips_history: true, ..self }
    }

    fn wants(&self, path: &str) -> bool {
        let covers = |wanted: &String| {
            path == wanted
                || path.strip_prefix(wanted.trim_end_matches('/')).is_some_and(|rest| rest.starts_with('/'))
                || path::covers(wanted, path)
        };
        self.wanted.is_empty() || self.wanted.iter().any(covers)
    }

    /// Opens what is new, and what was replaced. A ring that continues its predecessor's numbers continues its channel.
    pub fn look_around<O: Outlet>(&mut self, out: &mut Feed<O>) -> Result<(), O::Error> {
        for path in self.tree.list().map_err(RecordError::from)? {
            let current = self.taps.get(&path).is_some_and(|tap| !tap.ring.retired() && !tap.ring.unlinked());
            if current || !self.wants(&path) {
                continue;
            }
            // What is no channel, or no longer, is not recorded.
            let ring = match self.tree.reader(&path, None) {
                Ok(ring) => ring,
                Err(ChannelError::Missing { .. } | ChannelError::NotAChannel { .. }) => continue,
                Err(e) => return Err(RecordError::from(e).into()),
            };
            let buffer = SampleBuffer::new(ring.geometry());
            let before = self.taps.remove(&path);
            let (key, next, lost) = match before {
                Some(tap) if tap.ring.geometry() == ring.geometry() && ring.head() + 1 >= tap.next => {
                    (tap.key, tap.next, tap.lost)
                }
                before => {
                    let lost = before.map_or(0, |tap| tap.lost);
                    let first = if self.skips_history { ring.head().max(1) } else { ring.oldest() };
                    (out.channel(&path, ring.geometry())?, first, lost)
                }
            };
            self.taps.insert(path, Tap { ring, key, buffer, next, lost });
        }
        Ok(())
    }

    /// Writes down all that is new.
    pub fn drain<O: Outlet>(&mut self, out: &mut Feed<O>) -> Result<(), O::Error> {
        for tap in self.taps.values_mut() {
            let head = tap.ring.head();
            while tap.next <= head {
                match tap.ring.read(tap.next, &mut tap.buffer) {
                    Ok(sample) => {
                        out.sample(tap.key, &sample, tap.buffer.fixed(), tap.buffer.tail())?;
                        self.samples += 1;
                        tap.next += 1;
                    }
                    Err(ReadError::Overrun) => {
                        let oldest = tap.ring.oldest().max(tap.next + 1);
                        tap.lost += oldest - tap.next;
                        tap.next = oldest;
                    }
                    // A hole that a dead writer left: nothing was ever published there.
                    Err(ReadError::Unfinished) => tap.next += 1,
                    Err(ReadError::NotYet | ReadError::Fault | ReadError::Buffer) => break,
                }
            }
        }
        Ok(())
    }

    /// Hands the newest sample of the channel at `path` over once more, for somebody who has only now begun to look.
    pub fn repeat<O: Outlet>(&mut self, path: &str, out: &mut Feed<O>) -> Result<(), O::Error> {
        let Some(tap) = self.taps.get_mut(path) else { return Ok(()) };
        // What is not yet handed over comes by itself.
        match tap.ring.read(tap.next.saturating_sub(1), &mut tap.buffer) {
            Ok(sample) => out.sample(tap.key, &sample, tap.buffer.fixed(), tap.buffer.tail()),
            Err(_) => Ok(()),
        }
    }

    /// Samples written down.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Samples that were overwritten before they could be read, per path that lost any.
    pub fn losses(&self) -> BTreeMap<String, u64> {
        self.taps.iter().filter(|(_, tap)| tap.lost > 0).map(|(path, tap)| (path.clone(), tap.lost)).collect()
    }

    /// Channels that are recorded.
    pub fn channels(&self) -> usize {
        self.taps.len()
    }
}
