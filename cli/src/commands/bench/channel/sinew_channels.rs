//! Two channels, one each way. Each end waits as a node does: on its trigger's word and on its private one.

use super::line::{End, Line, Proof, proof};
use crate::exit::Failure;
use runtime::channel::{Claim, Geometry, PrivateWord, RawReader, RawWriter, SampleBuffer, Tree, Waiter};
use std::path::Path;

/// Bytes of a payload that are the message itself; the rest is its tail.
const FIXED: usize = 64;
/// Samples of history: eight of small messages; two of scans, images and clouds, as robot files have them.
const DEPTH: [usize; 2] = [8, 2];
/// Payloads from this size on are large [byte].
const LARGE: usize = 64 * 1024;

const THERE: &str = "/bench/there/payload";
const BACK: &str = "/bench/back/payload";

/// One end.
pub struct Channels {
    writer: RawWriter,
    reader: RawReader,
    buffer: SampleBuffer,
    waiter: Waiter,
    sent: u64,
    received: u64,
}

/// What a channel of payloads of `size` bytes holds.
pub fn geometry(size: usize) -> Geometry {
    let tail = size.saturating_sub(FIXED);
    Geometry {
        type_name: "bench::Payload".into(),
        layout_hash: size as u64,
        schema: String::new(),
        fixed_bytes: size.min(FIXED),
        tail_element_bytes: usize::from(tail > 0),
        tail_capacity: tail,
        depth: DEPTH[usize::from(size >= LARGE)],
    }
}

/// Message and tail of `payload`.
pub fn parts(payload: &[u8]) -> (&[u8], &[u8]) {
    payload.split_at(payload.len().min(FIXED))
}

/// Makes both channels.
pub fn prepare(folder: &Path, size: usize) -> Result<(), Failure> {
    let tree = Tree::shared(&folder.join("channels"))?;
    tree.prepare(THERE, &geometry(size))?;
    tree.prepare(BACK, &geometry(size))?;
    Ok(())
}

impl Channels {
    /// Opens one end of the two.
    pub fn open(folder: &Path, size: usize, end: End) -> Result<Channels, Failure> {
        let tree = Tree::shared(&folder.join("channels"))?;
        let (written, read) = match end {
            End::Asking => (THERE, BACK),
            End::Answering => (BACK, THERE),
        };
        let writer = tree.writer(written, &geometry(size), Claim::Continue)?;
        let reader = tree.reader(read, None)?;
        let buffer = SampleBuffer::new(reader.geometry());
        let waiter = Waiter::new(&PrivateWord::new(), vec![reader.word()])?;
        Ok(Channels { writer, reader, buffer, waiter, sent: 0, received: 0 })
    }
}

impl Line for Channels {
    fn send(&mut self, payload: &[u8]) -> Result<(), Failure> {
        let (fixed, tail) = parts(payload);
        self.sent += 1;
        match self.writer.publish(self.sent, fixed, tail).lost {
            false => Ok(()),
            true => Err("the channel was taken away".into()),
        }
    }

    fn receive(&mut self) -> Result<Proof, Failure> {
        loop {
            self.waiter.snapshot();
            let head = self.reader.head();
            if head > self.received {
                self.received = head;
                self.reader.read(head, &mut self.buffer)?;
                let [first, last] = [self.buffer.fixed(), self.buffer.tail()].map(proof);
                return Ok([first[0], if self.buffer.tail().is_empty() { first[1] } else { last[1] }]);
            }
            self.waiter.wait(None);
        }
    }
}
