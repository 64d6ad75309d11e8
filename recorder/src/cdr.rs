//! CDR as ROS 2 writes it: little-endian, every number aligned to its size, counted from behind the four bytes that
//! say so (OMG Common Data Representation, DDS-RTPS encapsulation `CDR_LE`).

/// Encapsulation: plain CDR, little-endian, no options.
pub(crate) const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// A message in the making.
#[derive(Debug, Default)]
pub(crate) struct Cdr(Vec<u8>);

impl Cdr {
    pub fn new() -> Cdr {
        Cdr(ENCAPSULATION.to_vec())
    }

    /// Begins anew, keeping the memory.
    pub fn clear(&mut self) {
        self.0.clear();
        self.0.extend_from_slice(&ENCAPSULATION);
    }

    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Fills up to a multiple of `size` bytes.
    pub fn align(&mut self, size: usize) -> &mut Cdr {
        let body = self.0.len() - ENCAPSULATION.len();
        self.0.resize(ENCAPSULATION.len() + body.next_multiple_of(size), 0);
        self
    }

    /// Bytes as they are.
    pub fn raw(&mut self, bytes: &[u8]) -> &mut Cdr {
        self.0.extend_from_slice(bytes);
        self
    }

    pub fn u8(&mut self, value: u8) -> &mut Cdr {
        self.raw(&[value])
    }

    pub fn u32(&mut self, value: u32) -> &mut Cdr {
        self.align(4).raw(&value.to_le_bytes())
    }

    pub fn i32(&mut self, value: i32) -> &mut Cdr {
        self.align(4).raw(&value.to_le_bytes())
    }

    pub fn u64(&mut self, value: u64) -> &mut Cdr {
        self.align(8).raw(&value.to_le_bytes())
    }

    pub fn f32(&mut self, value: f32) -> &mut Cdr {
        self.align(4).raw(&value.to_le_bytes())
    }

    pub fn f64(&mut self, value: f64) -> &mut Cdr {
        self.align(8).raw(&value.to_le_bytes())
    }

    /// Length with the closing zero, the bytes, the zero.
    pub fn string(&mut self, text: &str) -> &mut Cdr {
        self.u32(text.len() as u32 + 1).raw(text.as_bytes()).u8(0)
    }

    pub fn f64s(&mut self, values: &[f64]) -> &mut Cdr {
        for value in values {
            self.f64(*value);
        }
        self
    }

    /// builtin_interfaces/Time.
    pub fn time(&mut self, ns: u64) -> &mut Cdr {
        self.i32((ns / 1_000_000_000) as i32).u32((ns % 1_000_000_000) as u32)
    }

    /// std_msgs/Header.
    pub fn header(&mut self, ns: u64, frame: &str) -> &mut Cdr {
        self.time(ns).string(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size_behind_the_encapsulation() {
        let mut cdr = Cdr::new();
        cdr.u8(7).f64(1.0).u8(1).u32(2);
        assert_eq!(cdr.bytes().len(), 4 + 8 + 8 + 4 + 4);
        assert_eq!(cdr.bytes()[4 + 8..][..8], 1.0_f64.to_le_bytes());
    }

    #[test]
    fn a_text_ends_in_a_zero_that_counts() {
        let mut cdr = Cdr::new();
        cdr.string("ab").u32(5);
        assert_eq!(cdr.bytes()[4..], [3, 0, 0, 0, b'a', b'b', 0, 0, 5, 0, 0, 0]);
    }
}
