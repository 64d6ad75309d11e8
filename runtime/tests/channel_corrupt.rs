//! Files that anybody may have written: whatever is in them, no reader and no writer panics, reads beyond the file,
//! runs for ever or takes one sample for another.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs::{self, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use proptest::prelude::*;
use runtime::channel::{Claim, Expect, Geometry, PrivateWord, RawReader, RawWriter, SampleBuffer, Tree, Waiter};

const PATH: &str = "/a/b";

struct Ground {
    tree: Tree,
    file: PathBuf,
    _folder: tempfile::TempDir,
}

/// A tree with one channel of three slots and a few samples.
fn ground() -> (Ground, RawWriter) {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    let tree = Tree::shared(&folder.path().join("robot")).unwrap();
    let mut writer = tree.writer(PATH, &geometry(), Claim::Continue).unwrap();
    for n in 1..=5 {
        writer.publish(n, &[n as u8; 12], &[n as u8; 10]);
    }
    (Ground { tree, file: folder.path().join("robot/a/b"), _folder: folder }, writer)
}

fn geometry() -> Geometry {
    Geometry {
        type_name: "Corrupt".into(),
        layout_hash: 9,
        schema: "text".into(),
        fixed_bytes: 12,
        tail_element_bytes: 2,
        tail_capacity: 20,
        depth: 2,
    }
}

/// Everything that a reader can do, with numbers good and bad.
fn use_up(reader: &RawReader) {
    let mut buffer = SampleBuffer::new(reader.geometry());
    let (head, oldest) = (reader.head(), reader.oldest());
    let near = (0..6).map(|back| head.wrapping_sub(back));
    for sequence in near.chain([0, 1, oldest, u64::MAX, u64::MAX / 2, 1 << 63]) {
        if let Ok(sample) = reader.read(sequence, &mut buffer) {
            assert_eq!(sample.sequence, sequence);
            let capacity = reader.geometry().tail_element_bytes * reader.geometry().tail_capacity;
            assert!(buffer.tail().len() == sample.tail_bytes && sample.tail_bytes <= capacity);
            assert_eq!(buffer.fixed().len(), reader.geometry().fixed_bytes);
        }
        let _ = reader.stamp(sequence);
        let _ = reader.read_in_place(sequence, |slot| slot.tail(usize::MAX) ^ slot.fixed(0));
        let _ = reader.at_or_before(sequence, u64::MAX);
        let _ = reader.at_or_before(sequence, sequence);
    }
    let _ = (reader.generation(), reader.writer_pid(), reader.retired(), reader.unlinked());
    let mut waiter = Waiter::new(&PrivateWord::new(), vec![reader.word()]).unwrap();
    waiter.snapshot();
    waiter.wait(Some(1));
}

/// The interesting places: every field of the header and of every slot, and any word at all.
fn places() -> impl Strategy<Value = u64> {
    let header = (0u64..14).prop_map(|word| word * 8);
    let state = (32u64..37).prop_map(|word| word * 8);
    let slots = (0u64..3, 0u64..6).prop_map(|(slot, word)| 4096 + slot * 128 + word * 8);
    prop_oneof![3 => header, 3 => state, 3 => slots, 1 => (0u64..560).prop_map(|word| word * 8)]
}

fn values() -> impl Strategy<Value = u64> {
    let near = (0u64..20, any::<bool>()).prop_map(|(n, down)| if down { u64::MAX - n } else { n });
    let powers = (0u32..64, -2i64..3).prop_map(|(bit, off)| (1u64 << bit).wrapping_add_signed(off));
    prop_oneof![near, powers, any::<u64>(), (0u64..5).prop_map(|n| 4096 * n)]
}

fn damage(ground: &Ground, wounds: &[(u64, u64)]) {
    let file = OpenOptions::new().write(true).open(&ground.file).unwrap();
    for (place, value) in wounds {
        file.write_all_at(&value.to_le_bytes(), *place).unwrap();
    }
}

/// After any damage the next writer has a channel that works.
fn mended(ground: &Ground) {
    let mut writer = ground.tree.writer(PATH, &geometry(), Claim::Continue).unwrap();
    let first = writer.next_sequence();
    for n in 0..5 {
        let published = writer.publish(7, &[0xaa; 12], &[0xbb; 9]);
        assert_eq!((published.sequence, published.lost), (first + n, false));
    }
    let expect = Expect { type_name: "Corrupt".into(), layout_hash: 9 };
    let reader = ground.tree.reader(PATH, Some(expect)).unwrap();
    let mut buffer = SampleBuffer::new(reader.geometry());
    assert_eq!(reader.head(), first + 4);
    for sequence in [first + 3, first + 4] {
        assert_eq!(reader.read(sequence, &mut buffer).unwrap().generation, writer.generation());
        assert_eq!((buffer.fixed(), buffer.tail()), (&[0xaa; 12][..], &[0xbb; 9][..]));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_file_is_refused_or_read_within_its_bounds(wounds in prop::collection::vec((places(), values()), 1..6)) {
        let (ground, writer) = ground();
        drop(writer);
        damage(&ground, &wounds);
        if let Ok(reader) = ground.tree.reader(PATH, None) {
            use_up(&reader);
        }
        let _ = ground.tree.prepare(PATH, &geometry());
        mended(&ground);
    }

    #[test]
    fn damage_under_open_readers_and_writers_moves_no_access(wounds in prop::collection::vec((places(), values()), 1..6)) {
        let (ground, mut writer) = ground();
        let reader = ground.tree.reader(PATH, None).unwrap();
        damage(&ground, &wounds);
        use_up(&reader);
        for n in 0..4 {
            writer.publish(n, &[1; 12], &[2; 50]);
            use_up(&reader);
        }
        drop(writer);
        mended(&ground);
    }

    #[test]
    fn a_file_of_any_length_and_content_is_refused_or_read(mut bytes in prop::collection::vec(any::<u8>(), 0..6000), good in 0usize..6000) {
        let (ground, writer) = ground();
        drop(writer);
        // So much of the true file, then noise.
        let truth = fs::read(&ground.file).unwrap();
        let good = good.min(bytes.len()).min(truth.len());
        bytes[..good].copy_from_slice(&truth[..good]);
        fs::write(&ground.file, &bytes).unwrap();
        if let Ok(reader) = ground.tree.reader(PATH, None) {
            use_up(&reader);
        }
        mended(&ground);
    }
}
