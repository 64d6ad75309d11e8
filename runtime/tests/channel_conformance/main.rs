//! What a channel promises, told once and asked of both memories: files and the heap.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::Path;

use runtime::channel::{Claim, Death, Geometry, RawReader, RawSample, RawWriter, ReadError, SampleBuffer, Tree};

/// A tree that vanishes with the test.
struct Ground {
    tree: Tree,
    _folder: Option<tempfile::TempDir>,
}

impl Ground {
    fn shared() -> Ground {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap();
        Ground { tree: Tree::shared(&folder.path().join("robot")).unwrap(), _folder: Some(folder) }
    }

    fn local() -> Ground {
        Ground { tree: Tree::local(), _folder: None }
    }

    fn writer(&self, geometry: &Geometry) -> RawWriter {
        self.tree.writer(PATH, geometry, Claim::Continue).unwrap()
    }

    fn reader(&self) -> RawReader {
        self.tree.reader(PATH, None).unwrap()
    }
}

/// Asks each check of both memories.
macro_rules! suite {
    ($($name:ident)*) => {
        mod shared { $( #[test] fn $name() { super::$name(&super::Ground::shared()); } )* }
        mod local { $( #[test] fn $name() { super::$name(&super::Ground::local()); } )* }
    };
}

mod layouts;
mod samples;
mod tree;
mod waiting;
mod writers;

const PATH: &str = "/drivers/base/sonar";

fn geometry(depth: usize, tail_capacity: usize) -> Geometry {
    Geometry {
        type_name: "Ranges".into(),
        layout_hash: 0x1234_5678_9abc_def0,
        schema: r#"{"fields":[]}"#.into(),
        fixed_bytes: 20,
        tail_element_bytes: 3,
        tail_capacity,
        depth,
    }
}

fn fixed(seed: u64) -> [u8; 20] {
    std::array::from_fn(|i| (seed as usize * 31 + i) as u8)
}

fn tail(seed: u64, elements: usize) -> Vec<u8> {
    (0..elements * 3).map(|i| (seed as usize * 7 + i) as u8).collect()
}

/// Publishes the sample that [`check`] knows by its number.
fn publish(writer: &mut RawWriter) -> u64 {
    let n = writer.next_sequence();
    let published = writer.publish(n * 100, &fixed(n), &tail(n, n as usize % 4));
    assert_eq!((published.sequence, published.cut, published.lost), (n, false, false));
    n
}

fn publish_many(writer: &mut RawWriter, count: usize) {
    (0..count).for_each(|_| assert_ne!(publish(writer), 0));
}

fn check_all(reader: &RawReader, sequences: std::ops::RangeInclusive<u64>) {
    sequences.for_each(|sequence| assert_eq!(check(reader, sequence).sequence, sequence));
}

fn check(reader: &RawReader, sequence: u64) -> RawSample {
    let mut buffer = SampleBuffer::new(reader.geometry());
    let sample = reader.read(sequence, &mut buffer).unwrap_or_else(|e| panic!("{sequence}: {e}"));
    assert_eq!((sample.sequence, sample.stamp_ns), (sequence, sequence * 100));
    assert_eq!(buffer.fixed(), fixed(sequence));
    assert_eq!(buffer.tail(), tail(sequence, sequence as usize % 4));
    assert_eq!(sample.tail_bytes, buffer.tail().len());
    assert_eq!(reader.stamp(sequence), Ok(sample));
    sample
}

fn read(reader: &RawReader, sequence: u64) -> Result<RawSample, ReadError> {
    reader.read(sequence, &mut SampleBuffer::new(reader.geometry()))
}

fn die(writer: RawWriter, when: Death) {
    let n = writer.next_sequence();
    writer.die_publishing(when, n * 100, &fixed(n), &tail(n, n as usize % 4));
}
