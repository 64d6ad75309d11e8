//! A channel read as data: bytes out of the ring, decoded by the schema that stands in the ring's own header.

use crate::exit::Failure;
use messages::Schema;
use runtime::Time;
use runtime::channel::{ChannelError, Geometry, RawReader, RawSample, ReadError, SampleBuffer, Tree};
use serde_json::Value;

/// An open channel, and how far it has been read.
pub struct Tap {
    tree: Tree,
    path: String,
    ring: RawReader,
    schema: Schema,
    buffer: SampleBuffer,
    next: u64,
    dropped: u64,
}

/// A sample as data.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// When it was taken, on the robot's clock.
    pub stamp: Time,
    /// Its number in the channel, from 1.
    pub sequence: u64,
    /// Which writer wrote it.
    pub generation: u64,
    /// Samples lost by this reader so far, because it was slower than the writer.
    pub dropped: u64,
    /// The message, as JSON.
    pub message: Value,
}

impl Tap {
    /// Opens the channel `path`. The next sample that `next` gives is the first one written from now on.
    pub fn open(tree: &Tree, path: &str) -> Result<Tap, ChannelError> {
        let ring = tree.reader(path, None)?;
        let schema = schema_of(path, ring.geometry())?;
        let buffer = SampleBuffer::new(ring.geometry());
        let next = ring.head() + 1;
        Ok(Tap { tree: tree.clone(), path: path.to_owned(), ring, schema, buffer, next, dropped: 0 })
    }

    /// The channel's path.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The ring below.
    pub fn ring(&self) -> &RawReader {
        &self.ring
    }

    /// The message's layout.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Samples lost so far, because this reader was slower than the writer.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Goes back, so that the newest `samples` that the ring still holds come next.
    pub fn rewind(&mut self, samples: u64) {
        let head = self.ring.head();
        self.next = (head + 1).saturating_sub(samples).max(self.ring.oldest());
    }

    /// Skips whatever is not the newest sample; what is skipped by wish is not dropped.
    pub fn skip_to_newest(&mut self) {
        self.next = self.next.max(self.ring.head());
    }

    /// The oldest sample that has not been read yet; `None` when all have been.
    pub fn next_unread(&mut self) -> Option<Seen> {
        let raw = self.next_raw()?;
        Some(Seen {
            stamp: Time::from_nanos(raw.stamp_ns),
            sequence: raw.sequence,
            generation: raw.generation,
            dropped: self.dropped,
            message: self.schema.to_json(self.buffer.fixed(), self.buffer.tail()),
        })
    }

    /// Stamp and number of the oldest sample that has not been read yet; its bytes are not looked at.
    pub fn next_stamp(&mut self) -> Option<RawSample> {
        while self.next <= self.ring.head() {
            self.catch_up();
            let sequence = self.next;
            self.next += 1;
            match self.ring.stamp(sequence) {
                Ok(sample) => return Some(sample),
                Err(_) => self.dropped += 1,
            }
        }
        None
    }

    fn next_raw(&mut self) -> Option<RawSample> {
        while self.next <= self.ring.head() {
            self.catch_up();
            let sequence = self.next;
            self.next += 1;
            match self.ring.read(sequence, &mut self.buffer) {
                Ok(sample) => return Some(sample),
                Err(ReadError::Fault) => return None,
                Err(_) => self.dropped += 1,
            }
        }
        None
    }

    /// Counts what the ring has overwritten since the last look.
    fn catch_up(&mut self) {
        let oldest = self.ring.oldest();
        if self.next < oldest {
            self.dropped += oldest - self.next;
            self.next = oldest;
        }
    }

    /// Follows the channel to its successor where this ring has been taken over or removed. Call it now and then, when
    /// everything has been read. `Ok(false)`: the channel is gone.
    pub fn follow(&mut self) -> Result<bool, Failure> {
        if !(self.ring.retired() || self.ring.unlinked()) {
            return Ok(true);
        }
        match Tap::open(&self.tree, &self.path) {
            Ok(fresh) => {
                // A successor carries the numbers on; a ring made anew counts from one.
                let next = if fresh.ring.head() + 1 >= self.next { self.next } else { 1 };
                *self = Tap { next, dropped: self.dropped, ..fresh };
                Ok(true)
            }
            Err(ChannelError::Missing { .. }) => Ok(false),
            Err(e) => Err(Failure::from(e)),
        }
    }
}

/// The schema in a channel's header; a file that anybody may have written says what is wrong with it.
fn schema_of(path: &str, geometry: &Geometry) -> Result<Schema, ChannelError> {
    let damaged = |why: String| ChannelError::NotAChannel { path: path.to_owned(), why };
    let schema = Schema::from_text(&geometry.schema).map_err(|e| damaged(format!("its schema cannot be read: {e}")))?;
    if schema.size != geometry.fixed_bytes {
        let why = format!("its schema is {} bytes long, its samples are {}", schema.size, geometry.fixed_bytes);
        return Err(damaged(why));
    }
    Ok(schema)
}
