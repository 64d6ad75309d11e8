//! Bytes under way in one direction of a memory link.

use crate::Time;

/// Bytes that may be under way: 17 s at 9600 baud, five scans of a laser.
const CAPACITY: usize = 16 * 1024;
/// Marks the last byte of one `send` in its time of arrival.
const LAST: u64 = 1 << 63;

/// Bytes under way in one direction, each with its time of arrival.
pub(super) struct Lane {
    bytes: Box<[u8]>,
    /// [ns], with [`LAST`].
    arrivals: Box<[u64]>,
    first: usize,
    count: usize,
    /// When the line has sent all that it was given [ns].
    pub idle_ns: u64,
}

impl Default for Lane {
    fn default() -> Lane {
        Lane { bytes: vec![0; CAPACITY].into(), arrivals: vec![0; CAPACITY].into(), first: 0, count: 0, idle_ns: 0 }
    }
}

impl Lane {
    pub fn free(&self) -> usize {
        CAPACITY - self.count
    }

    pub fn clear(&mut self) {
        self.count = 0;
        self.idle_ns = 0;
    }

    pub fn put(&mut self, byte: u8, arrives_ns: u64, last: bool) {
        let place = (self.first + self.count) % CAPACITY;
        self.bytes[place] = byte;
        self.arrivals[place] = arrives_ns | if last { LAST } else { 0 };
        self.count += 1;
    }

    pub fn mark_last(&mut self) {
        if self.count > 0 {
            self.arrivals[(self.first + self.count - 1) % CAPACITY] |= LAST;
        }
    }

    pub fn take(&mut self, now_ns: u64, buffer: &mut [u8], arrived: &mut Time) -> usize {
        let mut taken = 0;
        while taken < buffer.len() && self.count > 0 && self.arrivals[self.first] & !LAST <= now_ns {
            buffer[taken] = self.bytes[self.first];
            *arrived = Time::from_nanos(self.arrivals[self.first] & !LAST);
            self.first = (self.first + 1) % CAPACITY;
            self.count -= 1;
            taken += 1;
        }
        taken
    }

    pub fn next_last(&self, after_ns: u64) -> Option<Time> {
        let arrivals = (0..self.count).map(|offset| self.arrivals[(self.first + offset) % CAPACITY]);
        let mut lasts = arrivals.filter(|arrival| arrival & LAST != 0).map(|arrival| arrival & !LAST);
        lasts.find(|arrival_ns| *arrival_ns > after_ns).map(Time::from_nanos)
    }
}
