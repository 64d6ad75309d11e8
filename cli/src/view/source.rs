//! One channel read as its type, by looking at the ring; the writer never notices.

use messages::{Message, bytemuck};
use runtime::Time;
use runtime::channel::{Expect, RawReader, SampleBuffer, Tree};

/// A channel of `M`, whether it is there yet or not.
pub struct Source<M: Message> {
    path: String,
    open: Option<Open>,
    /// Sequence number of the newest sample that has been read.
    read_to: u64,
    message: std::marker::PhantomData<M>,
}

struct Open {
    ring: RawReader,
    buffer: SampleBuffer,
}

impl<M: Message> Source<M> {
    /// The channel at `path`, to be opened when it is there.
    pub fn new(path: &str) -> Source<M> {
        Source { path: path.to_owned(), open: None, read_to: 0, message: std::marker::PhantomData }
    }

    /// Opens the channel if it is there and not open; leaves one that was taken over. Costs system calls: now and then.
    pub fn look(&mut self, tree: &Tree) {
        if self.open.as_ref().is_some_and(|open| open.ring.retired() || open.ring.unlinked()) {
            self.open = None;
        }
        if self.open.is_none() {
            let expect = Expect { type_name: M::NAME.into(), layout_hash: M::layout_hash() };
            if let Ok(ring) = tree.reader(&self.path, Some(expect)) {
                self.read_to = self.read_to.min(ring.head());
                let buffer = SampleBuffer::new(ring.geometry());
                self.open = Some(Open { ring, buffer });
            }
        }
    }

    /// Hands every sample that has not been read to `each`, oldest first.
    pub fn drain(&mut self, mut each: impl FnMut(Time, &M, &[M::Tail])) {
        let Some(Open { ring, buffer }) = &mut self.open else { return };
        let head = ring.head();
        self.read_to = self.read_to.max(ring.oldest().saturating_sub(1));
        while self.read_to < head {
            self.read_to += 1;
            if let Ok(raw) = ring.read(self.read_to, buffer) {
                let message = bytemuck::from_bytes(buffer.fixed());
                each(Time::from_nanos(raw.stamp_ns), message, bytemuck::cast_slice(buffer.tail()));
            }
        }
    }

    /// Hands the newest sample to `each` if it has not been read before.
    pub fn newest(&mut self, each: impl FnOnce(Time, &M, &[M::Tail])) {
        let Some(Open { ring, buffer }) = &mut self.open else { return };
        let head = ring.head();
        if head > self.read_to
            && let Ok(raw) = ring.read(head, buffer)
        {
            self.read_to = head;
            let message = bytemuck::from_bytes(buffer.fixed());
            each(Time::from_nanos(raw.stamp_ns), message, bytemuck::cast_slice(buffer.tail()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Twist;
    use runtime::channel::{Claim, Geometry};

    fn geometry() -> Geometry {
        Geometry {
            type_name: Twist::NAME.into(),
            layout_hash: Twist::layout_hash(),
            schema: Twist::schema().to_text(),
            fixed_bytes: size_of::<Twist>(),
            tail_element_bytes: 0,
            tail_capacity: 0,
            depth: 4,
        }
    }

    fn write(writer: &mut runtime::channel::RawWriter, x: f64) {
        let twist = Twist { linear_x_m_s: x, ..Twist::default() };
        writer.publish(1, bytemuck::bytes_of(&twist), &[]);
    }

    fn drained(source: &mut Source<Twist>) -> Vec<f64> {
        let mut all = Vec::new();
        source.drain(|_, twist, _| all.push(twist.linear_x_m_s));
        all
    }

    #[test]
    fn every_sample_comes_once_and_a_channel_may_come_late() {
        let tree = Tree::local();
        let mut source = Source::<Twist>::new("/motion/drive/command");
        source.look(&tree);
        assert!(drained(&mut source).is_empty());
        let mut writer = tree.writer("/motion/drive/command", &geometry(), Claim::Continue).unwrap();
        (1..=3).for_each(|x| write(&mut writer, f64::from(x)));
        source.look(&tree);
        assert_eq!(drained(&mut source), [1.0, 2.0, 3.0]);
        write(&mut writer, 4.0);
        assert_eq!(drained(&mut source), [4.0]);
        assert!(drained(&mut source).is_empty());
    }

    #[test]
    fn the_newest_sample_is_given_once() {
        let tree = Tree::local();
        let mut writer = tree.writer("/motion/drive/command", &geometry(), Claim::Continue).unwrap();
        let mut source = Source::<Twist>::new("/motion/drive/command");
        source.look(&tree);
        (1..=9).for_each(|x| write(&mut writer, f64::from(x)));
        let mut seen = Vec::new();
        for _ in 0..2 {
            source.newest(|_, twist, _| seen.push(twist.linear_x_m_s));
        }
        assert_eq!(seen, [9.0]);
    }
}
