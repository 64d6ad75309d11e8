//! One sample, copied out of its ring.

use super::layout::{Geometry, Shape};

/// What a read says about the sample whose bytes are in the buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawSample {
    /// Its number in the channel, from 1.
    pub sequence: u64,
    /// When it was taken, on the robot's clock, in nanoseconds.
    pub stamp_ns: u64,
    /// Which writer wrote it: 1 is the channel's first, each restart counts one up.
    pub generation: u64,
    /// Length of its tail, in bytes.
    pub tail_bytes: usize,
}

/// Room for one sample of a channel, allocated once. A failed read leaves rubbish in it.
#[derive(Debug, Clone)]
pub struct SampleBuffer {
    words: Box<[u64]>,
    fixed_bytes: usize,
    tail_bytes: usize,
}

impl SampleBuffer {
    /// Room for a sample of a channel of this geometry. A geometry that no channel can have gets no room, and no
    /// channel reads into it.
    pub fn new(geometry: &Geometry) -> SampleBuffer {
        let room = |shape: Shape| (shape.fixed_words + shape.tail_bytes.div_ceil(8), shape.fixed_bytes);
        let (words, fixed_bytes) = geometry.shape().map_or((0, 0), room);
        SampleBuffer { words: vec![0; words].into(), fixed_bytes, tail_bytes: 0 }
    }

    /// The message without its tail, aligned to 8.
    pub fn fixed(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.fixed_bytes]
    }

    /// The tail of the sample that was read last, aligned to 8.
    pub fn tail(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words[self.fixed_bytes.div_ceil(8)..])[..self.tail_bytes]
    }

    /// Words for the fixed part and for the whole tail, when the buffer fits the channel.
    pub(super) fn parts(&mut self, shape: &Shape) -> Option<(&mut [u64], &mut [u64])> {
        let room = shape.fixed_words + shape.tail_bytes.div_ceil(8);
        if self.fixed_bytes != shape.fixed_bytes || self.words.len() < room {
            return None;
        }
        Some(self.words.split_at_mut(shape.fixed_words))
    }

    pub(super) fn set_tail_bytes(&mut self, bytes: usize) {
        self.tail_bytes = bytes;
    }
}
