//! Commands that wait for their turn: a bounded first-in-first-out list without allocation.

use super::protocol::{Argument, MAX_PACKET, encode_command};

/// Commands that can wait at once.
const CAPACITY: usize = 24;
/// Greatest packet that can wait: SAY with 20 pairs fits [byte].
const MAX_QUEUED: usize = 64;

/// Encoded commands in their order.
#[derive(Debug, Clone)]
pub struct Queue {
    packets: [[u8; MAX_QUEUED]; CAPACITY],
    lengths: [u8; CAPACITY],
    first: usize,
    count: usize,
}

impl Queue {
    /// Empty.
    pub const fn new() -> Queue {
        Queue { packets: [[0; MAX_QUEUED]; CAPACITY], lengths: [0; CAPACITY], first: 0, count: 0 }
    }

    /// Appends a command; `false` when the queue is full or the command cannot be encoded in 64 bytes.
    pub fn push(&mut self, number: u8, argument: Argument) -> bool {
        if self.count == CAPACITY {
            return false;
        }
        let at = (self.first + self.count) % CAPACITY;
        match encode_command(&mut self.packets[at], number, argument) {
            Ok(length) => {
                self.lengths[at] = length as u8;
                self.count += 1;
                true
            }
            Err(_) => false,
        }
    }

    /// Takes the oldest packet out; returns its length.
    pub fn pop(&mut self, out: &mut [u8; MAX_PACKET]) -> Option<usize> {
        if self.count == 0 {
            return None;
        }
        let length = usize::from(self.lengths[self.first]);
        out[..length].copy_from_slice(&self.packets[self.first][..length]);
        self.first = (self.first + 1) % CAPACITY;
        self.count -= 1;
        Some(length)
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.count = 0;
    }
}
