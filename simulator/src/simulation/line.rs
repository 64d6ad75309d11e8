//! The line between a controller and its client: bytes get lost, corrupted and delayed as the settings say.

use crate::noise::{Chance, Purpose};
use crate::realism::LineFaults;
use runtime::Time;
use std::collections::VecDeque;

/// Bytes that a slow line holds at most; more are lost.
const HELD: usize = 4096;

/// A line with faults.
#[derive(Debug, Clone)]
pub(super) struct Line {
    faults: LineFaults,
    chance: Chance,
    /// Bytes on their way to the controller, with the time at which they arrive.
    held: VecDeque<(Time, u8)>,
}

impl Line {
    pub fn new(faults: LineFaults, seed: u64, body: usize) -> Line {
        let held = VecDeque::with_capacity(if faults.delay_ms > 0.0 { HELD } else { 0 });
        Line { faults, chance: Chance::new(seed, Purpose::Line, body), held }
    }

    /// Whether bytes to the controller take their time.
    pub fn is_slow(&self) -> bool {
        self.faults.delay_ms > 0.0
    }

    /// Keeps bytes that the client sends at `now` until they are due.
    pub fn hold(&mut self, now: Time, bytes: &[u8]) {
        let due = now.after_s(self.faults.delay_ms * 1e-3);
        for byte in bytes.iter().take(HELD - self.held.len().min(HELD)) {
            self.held.push_back((due, *byte));
        }
    }

    /// Moves bytes that are due at `now` into `buffer`, oldest first; answers how many.
    pub fn arrived(&mut self, now: Time, buffer: &mut [u8]) -> usize {
        let mut count = 0;
        while count < buffer.len() && self.held.front().is_some_and(|(due, _)| *due <= now) {
            let Some((_, byte)) = self.held.pop_front() else { break };
            buffer[count] = byte;
            count += 1;
        }
        count
    }

    /// Loses and corrupts bytes in place; answers how many are left.
    pub fn pass(&mut self, bytes: &mut [u8]) -> usize {
        let LineFaults { lose_byte, corrupt_byte, .. } = self.faults;
        if lose_byte == 0.0 && corrupt_byte == 0.0 {
            return bytes.len();
        }
        let mut kept = 0;
        for at in 0..bytes.len() {
            if self.chance.happens(lose_byte) {
                continue;
            }
            bytes[kept] = if self.chance.happens(corrupt_byte) { self.chance.byte() } else { bytes[at] };
            kept += 1;
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sound_line_changes_nothing_and_a_bad_one_about_as_much_as_it_says() {
        let sent = [0x55; 10_000];
        let mut bytes = sent;
        assert_eq!(Line::new(LineFaults::default(), 1, 0).pass(&mut bytes), sent.len());
        assert_eq!(bytes, sent);
        let count = Line::new(LineFaults { lose_byte: 0.1, corrupt_byte: 0.1, delay_ms: 0.0 }, 1, 0).pass(&mut bytes);
        assert!((8800..9200).contains(&count), "{count}");
        let corrupted = bytes[..count].iter().filter(|byte| **byte != 0x55).count();
        assert!((750..1050).contains(&corrupted), "{corrupted}");
    }

    #[test]
    fn a_slow_line_hands_bytes_over_in_order_when_their_time_has_come() {
        let mut line = Line::new(LineFaults { delay_ms: 50.0, ..LineFaults::default() }, 1, 0);
        let at = Time::from_seconds;
        let mut buffer = [0; 8];
        line.hold(at(1.00), &[1, 2]);
        line.hold(at(1.02), &[3]);
        assert_eq!(line.arrived(at(1.04), &mut buffer), 0);
        assert_eq!(line.arrived(at(1.055), &mut buffer), 2);
        assert_eq!(buffer[..2], [1, 2]);
        assert_eq!((line.arrived(at(2.0), &mut buffer), buffer[0]), (1, 3));
    }
}
