//! A sample as a CDR message, and back, bit for bit.
//!
//! A message of ours has no padding and every field of it lies at a multiple of its size. So has CDR's. Behind the 24
//! bytes of stamp, sequence number and generation the fixed part is therefore copied as it lies in memory; the tail's
//! length is placed so that its elements begin at a multiple of eight (where that needs four bytes more, the
//! definition has a field `reserved`), and the tail is copied too. Nothing is converted, so nothing can be lost.
//!
//! ```text
//! 00 01 00 00 | stamp_ns u64 | sequence u64 | generation u64 | fixed part | [reserved u32] | count u32 | tail
//! ```

use crate::cdr::{Cdr, ENCAPSULATION};
use runtime::channel::{Geometry, RawSample};

/// Bytes of stamp, sequence number and generation.
const INFO_BYTES: usize = 24;

/// How a channel's samples lie in CDR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    fixed_bytes: usize,
    /// Elements that CDR counts per element of the tail: an array counts as its parts.
    tail_element_bytes: usize,
    parts_per_element: usize,
}

impl Layout {
    /// The layout of a channel; `parts_per_element` is the length of each tail element that is an array, else 1.
    pub fn new(geometry: &Geometry, parts_per_element: usize) -> Layout {
        Layout {
            fixed_bytes: geometry.fixed_bytes,
            tail_element_bytes: geometry.tail_element_bytes,
            parts_per_element: parts_per_element.max(1),
        }
    }

    /// Whether four bytes stand before the tail's length.
    pub fn has_reserved(&self) -> bool {
        self.tail_element_bytes > 0 && (INFO_BYTES + self.fixed_bytes).next_multiple_of(4).is_multiple_of(8)
    }

    fn count_offset(&self) -> usize {
        (INFO_BYTES + self.fixed_bytes).next_multiple_of(4) + if self.has_reserved() { 4 } else { 0 }
    }

    /// Writes the sample into `into`.
    pub(crate) fn encode(&self, sample: &RawSample, fixed: &[u8], tail: &[u8], into: &mut Cdr) {
        into.clear();
        into.u64(sample.stamp_ns).u64(sample.sequence).u64(sample.generation).raw(fixed);
        if let Some(elements) = tail.len().checked_div(self.tail_element_bytes) {
            if self.has_reserved() {
                into.u32(0);
            }
            into.u32((elements * self.parts_per_element) as u32).raw(tail);
        }
    }

    /// The sample in a message: what it is, its fixed part, its tail. `None` when these are not the bytes of one.
    pub fn decode<'a>(&self, message: &'a [u8]) -> Option<(RawSample, &'a [u8], &'a [u8])> {
        let body = message.strip_prefix(&ENCAPSULATION)?;
        let word = |at: usize| body.get(at..at + 8).and_then(|b| b.first_chunk()).map(|b| u64::from_le_bytes(*b));
        let (stamp_ns, sequence, generation) = (word(0)?, word(8)?, word(16)?);
        let fixed = body.get(INFO_BYTES..INFO_BYTES + self.fixed_bytes)?;
        let tail = match self.tail_element_bytes {
            0 => &[][..],
            element_bytes => {
                let at = self.count_offset();
                let count = u32::from_le_bytes(*body.get(at..at + 4)?.first_chunk()?) as usize;
                let tail = body.get(at + 4..)?;
                let bytes = (count / self.parts_per_element).checked_mul(element_bytes)?;
                tail.get(..bytes)?
            }
        };
        Some((RawSample { sequence, stamp_ns, generation, tail_bytes: tail.len() }, fixed, tail))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn geometry(fixed_bytes: usize, tail_element_bytes: usize) -> Geometry {
        Geometry {
            type_name: "Any".into(),
            layout_hash: 0,
            schema: String::new(),
            fixed_bytes,
            tail_element_bytes,
            tail_capacity: 64,
            depth: 4,
        }
    }

    proptest! {
        #[test]
        fn a_sample_comes_back_bit_for_bit(
            fixed in prop::collection::vec(any::<u8>(), 0..60), element in 0_usize..20, elements in 0_usize..20,
            stamp_ns in any::<u64>(), sequence in any::<u64>(), generation in any::<u64>(), seed in any::<u8>(),
        ) {
            let tail: Vec<u8> = (0..element * elements).map(|n| (n as u8).wrapping_mul(31) ^ seed).collect();
            let sample = RawSample { sequence, stamp_ns, generation, tail_bytes: tail.len() };
            let layout = Layout::new(&geometry(fixed.len(), element), 1);
            let mut cdr = Cdr::new();
            layout.encode(&sample, &fixed, &tail, &mut cdr);
            prop_assert_eq!(layout.decode(cdr.bytes()), Some((sample, &fixed[..], &tail[..])));
            if element > 0 && elements > 0 {
                prop_assert_eq!((cdr.bytes().len() - 4 - tail.len()) % 8, 0);
            }
        }

        #[test]
        fn foreign_bytes_are_refused_and_never_read_beyond(
            bytes in prop::collection::vec(any::<u8>(), 0..80), fixed in 0_usize..40, element in 0_usize..9,
        ) {
            let _ = Layout::new(&geometry(fixed, element), 3).decode(&bytes);
        }
    }
}
