//! The line between a controller and its client: bytes get lost and corrupted as the settings say.

use crate::noise::{Chance, Purpose};
use crate::realism::LineFaults;

/// A line with faults.
#[derive(Debug, Clone)]
pub(super) struct Line {
    faults: LineFaults,
    chance: Chance,
}

impl Line {
    pub fn new(faults: LineFaults, seed: u64, body: usize) -> Line {
        Line { faults, chance: Chance::new(seed, Purpose::Line, body) }
    }

    /// Loses and corrupts bytes in place; answers how many are left.
    pub fn pass(&mut self, bytes: &mut [u8]) -> usize {
        let LineFaults { lose_byte, corrupt_byte } = self.faults;
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
        let count = Line::new(LineFaults { lose_byte: 0.1, corrupt_byte: 0.1 }, 1, 0).pass(&mut bytes);
        assert!((8800..9200).contains(&count), "{count}");
        let corrupted = bytes[..count].iter().filter(|byte| **byte != 0x55).count();
        assert!((750..1050).contains(&corrupted), "{corrupted}");
    }
}
