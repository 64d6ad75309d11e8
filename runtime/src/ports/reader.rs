//! Typed read ports.

use super::input::Input;
use crate::channel::{Geometry, RawSample, SampleBuffer};
use crate::time::Time;
use messages::{Message, bytemuck};
use std::cell::Cell;
use std::marker::PhantomData;
use std::ops::Deref;
use std::rc::Rc;

/// A sample as a step sees it: the message, its tail, and where it comes from.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a, M: Message> {
    /// When the data were taken, on the robot's clock.
    pub stamp: Time,
    /// Number of the sample on its channel, from 1.
    pub sequence: u64,
    /// Counts the writer's restarts.
    pub generation: u64,
    /// The message's fixed part.
    pub message: &'a M,
    /// The message's variable part; empty where the type has none.
    pub tail: &'a [M::Tail],
}

impl<M: Message> Deref for Sample<'_, M> {
    type Target = M;

    fn deref(&self) -> &M {
        self.message
    }
}

/// Reads one path, or the first fresh of several candidates. Inputs freeze at the start of a step: all reads of one
/// step see the same samples.
pub struct Reader<M: Message> {
    input: Rc<Input>,
    buffer: SampleBuffer,
    after: SampleBuffer,
    now: Rc<Cell<Time>>,
    message: PhantomData<M>,
}

impl<M: Message> Reader<M> {
    pub(super) fn new(input: Rc<Input>, now: Rc<Cell<Time>>) -> Reader<M> {
        Reader { input, buffer: no_buffer(), after: no_buffer(), now, message: PhantomData }
    }

    /// Takes over larger buffers that were made when rings were bound.
    fn fit(&mut self) {
        if let Some([buffer, after]) = self.input.take_spare() {
            self.buffer = buffer;
            self.after = after;
        }
    }

    /// The newest sample, however old.
    pub fn latest(&mut self) -> Option<Sample<'_, M>> {
        self.fit();
        let raw = self.input.read_newest(None, &mut self.buffer)?;
        Some(typed(raw, &self.buffer))
    }

    /// The newest sample, unless it is older at `now` than the port's greatest age.
    pub fn fresh(&mut self, now: Time) -> Option<Sample<'_, M>> {
        let max_age_ns = self.input.max_age_ns();
        self.latest().filter(|sample| now.nanos_since(sample.stamp) <= max_age_ns)
    }

    /// The oldest sample that this method has not returned yet; `None` when all have been.
    pub fn next_unread(&mut self) -> Option<Sample<'_, M>> {
        self.fit();
        let raw = self.input.read_next(&mut self.buffer)?;
        Some(typed(raw, &self.buffer))
    }

    /// The newest sample taken at or before `time`.
    pub fn at(&mut self, time: Time) -> Option<Sample<'_, M>> {
        self.fit();
        let raw = self.input.read_at(time, &mut self.buffer)?;
        Some(typed(raw, &self.buffer))
    }

    /// The samples before and after `time`, to interpolate between.
    pub fn around(&mut self, time: Time) -> Option<(Sample<'_, M>, Sample<'_, M>)> {
        self.fit();
        let before = self.input.read_at(time, &mut self.buffer)?;
        let after = self.input.read_sequence(before.sequence + 1, &mut self.after)?;
        Some((typed(before, &self.buffer), typed(after, &self.after)))
    }

    /// Hands the newest `count` samples to `each`, oldest first.
    pub fn newest(&mut self, count: usize, mut each: impl FnMut(Sample<'_, M>)) {
        self.fit();
        let (oldest, newest) = self.input.window();
        let first = newest.saturating_sub(count as u64 - 1).max(oldest).max(1);
        for sequence in first..=newest {
            if let Some(raw) = self.input.read_sequence(sequence, &mut self.buffer) {
                each(typed(raw, &self.buffer));
            }
        }
    }

    /// Samples lost because this reader was slower than the writer.
    pub fn dropped(&self) -> u64 {
        self.input.dropped()
    }

    /// Counts the writer's restarts; 0 before the first writer.
    pub fn generation(&self) -> u64 {
        self.input.generation()
    }

    /// Times that the reader went over to another candidate.
    pub fn switches(&self) -> u64 {
        self.input.switches()
    }

    /// The path in use: the candidate that counts now. Allocates: not for steps.
    pub fn source(&self) -> String {
        self.input.current_path()
    }

    /// Age of the newest sample at the start of this step; +∞ when there is none [s].
    pub fn age_s(&self) -> f64 {
        match self.input.newest_stamp_ns() {
            0 => f64::INFINITY,
            stamp => self.now.get().since(Time::from_nanos(stamp)),
        }
    }
}

/// Reads the newest sample of every member of a pattern such as `/actions/*/proposal`; members come and go between
/// steps.
pub struct Set<M: Message> {
    input: Rc<Input>,
    buffer: SampleBuffer,
    message: PhantomData<M>,
}

impl<M: Message> Set<M> {
    pub(super) fn new(input: Rc<Input>) -> Set<M> {
        Set { input, buffer: no_buffer(), message: PhantomData }
    }

    /// Hands path and newest sample of every member that has one to `each`, sorted by path.
    pub fn each(&mut self, mut each: impl FnMut(&str, Sample<'_, M>)) {
        if let Some([buffer, _]) = self.input.take_spare() {
            self.buffer = buffer;
        }
        for index in 0..self.len() {
            if let Some(raw) = self.input.read_newest(Some(index), &mut self.buffer) {
                let sources = self.input.sources.borrow();
                each(&sources[index].path, typed(raw, &self.buffer));
            }
        }
    }

    /// Greatest age of a sample that counts [s].
    pub fn max_age_s(&self) -> f64 {
        self.input.max_age_ns() as f64 * 1e-9
    }

    /// Number of members, with or without samples.
    pub fn len(&self) -> usize {
        self.input.sources.borrow().len()
    }

    /// Whether there is no member.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The buffer of a port that no ring has been bound to: nothing is read into it.
fn no_buffer() -> SampleBuffer {
    SampleBuffer::new(&Geometry {
        type_name: String::new(),
        layout_hash: 0,
        schema: String::new(),
        fixed_bytes: 0,
        tail_element_bytes: 0,
        tail_capacity: 0,
        depth: 2,
    })
}

/// The bytes of a sample as what they are.
fn typed<M: Message>(raw: RawSample, buffer: &SampleBuffer) -> Sample<'_, M> {
    let tail: &[M::Tail] = if M::HAS_TAIL { bytemuck::cast_slice(buffer.tail()) } else { &[] };
    Sample {
        stamp: Time::from_nanos(raw.stamp_ns),
        sequence: raw.sequence,
        generation: raw.generation,
        message: bytemuck::from_bytes(buffer.fixed()),
        tail,
    }
}
