//! A fixed ring of bytes between two threads: one writes, one reads, neither waits.
//!
//! The bytes are relaxed atomics, so the ring needs no `unsafe`; the cursors' release and acquire order them.

use std::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// Bytes on their way from one producer thread to one consumer thread.
#[derive(Debug)]
pub(crate) struct ByteRing {
    bytes: Box<[AtomicU8]>,
    /// Bytes ever written; only the producer changes it.
    written: AtomicUsize,
    /// Bytes ever read; only the consumer changes it.
    read: AtomicUsize,
}

impl ByteRing {
    /// A ring for `capacity` bytes, rounded up to a power of two.
    pub fn new(capacity: usize) -> ByteRing {
        let bytes = (0..capacity.next_power_of_two()).map(|_| AtomicU8::new(0)).collect();
        ByteRing { bytes, written: AtomicUsize::new(0), read: AtomicUsize::new(0) }
    }

    /// Bytes that wait to be read.
    pub fn len(&self) -> usize {
        self.written.load(Ordering::Acquire).wrapping_sub(self.read.load(Ordering::Acquire)).min(self.bytes.len())
    }

    /// Whether no byte waits.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes that can be written now.
    pub fn free(&self) -> usize {
        self.bytes.len() - self.len()
    }

    /// Producer: appends what fits of `bytes` and gives how many that was.
    pub fn push(&self, bytes: &[u8]) -> usize {
        let written = self.written.load(Ordering::Relaxed);
        let count = bytes.len().min(self.free());
        for (offset, byte) in bytes[..count].iter().enumerate() {
            self.place(written.wrapping_add(offset)).store(*byte, Ordering::Relaxed);
        }
        self.written.store(written.wrapping_add(count), Ordering::Release);
        count
    }

    /// Consumer: copies the oldest bytes into `buffer` without removing them, and gives how many.
    pub fn peek(&self, buffer: &mut [u8]) -> usize {
        let read = self.read.load(Ordering::Relaxed);
        let count = buffer.len().min(self.len());
        for (offset, byte) in buffer[..count].iter_mut().enumerate() {
            *byte = self.place(read.wrapping_add(offset)).load(Ordering::Relaxed);
        }
        count
    }

    /// Consumer: removes the oldest `count` bytes, or all when there are fewer.
    pub fn discard(&self, count: usize) {
        let read = self.read.load(Ordering::Relaxed);
        self.read.store(read.wrapping_add(count.min(self.len())), Ordering::Release);
    }

    /// Consumer: moves the oldest bytes into `buffer` and gives how many.
    pub fn pop(&self, buffer: &mut [u8]) -> usize {
        let count = self.peek(buffer);
        self.discard(count);
        count
    }

    fn place(&self, position: usize) -> &AtomicU8 {
        &self.bytes[position & (self.bytes.len() - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    proptest! {
        #[test]
        fn behaves_as_a_bounded_queue(steps in prop::collection::vec((any::<bool>(), 0usize..40), 1..200)) {
            let ring = ByteRing::new(32);
            let mut model = VecDeque::new();
            let mut next = 0u8;
            for (push, count) in steps {
                if push {
                    let bytes: Vec<u8> = (0..count).map(|k| next.wrapping_add(k as u8)).collect();
                    let taken = ring.push(&bytes);
                    prop_assert_eq!(taken, count.min(32 - model.len()));
                    model.extend(&bytes[..taken]);
                    next = next.wrapping_add(taken as u8);
                } else {
                    let mut buffer = vec![0; count];
                    let got = ring.pop(&mut buffer);
                    let expected: Vec<u8> = model.drain(..count.min(model.len())).collect();
                    prop_assert_eq!(&buffer[..got], &expected[..]);
                }
                prop_assert_eq!(ring.len(), model.len());
            }
        }
    }

    #[test]
    fn bytes_cross_threads_in_order_and_whole() {
        let ring = ByteRing::new(64);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut sent = 0u32;
                while sent < 20_000 {
                    if ring.push(&[sent as u8]) == 1 {
                        sent += 1;
                    } else {
                        std::thread::yield_now();
                    }
                }
            });
            let mut buffer = [0; 17];
            let mut received = 0u32;
            while received < 20_000 {
                let count = ring.pop(&mut buffer);
                for byte in &buffer[..count] {
                    assert_eq!(*byte, received as u8);
                    received += 1;
                }
                if count == 0 {
                    std::thread::yield_now();
                }
            }
        });
    }
}
