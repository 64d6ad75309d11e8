//! What a channel promises, told once and asked of both memories: files and the heap.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use runtime::channel::{
    ChannelError, Claim, Death, Expect, Geometry, Method, PrivateWord, RawReader, RawSample, RawWriter, ReadError,
    SampleBuffer, Tree, Waiter, Woken,
};

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

macro_rules! suite {
    ($($name:ident)*) => {
        mod shared { $( #[test] fn $name() { super::$name(&super::Ground::shared()); } )* }
        mod local { $( #[test] fn $name() { super::$name(&super::Ground::local()); } )* }
    };
}

suite! {
    a_sample_comes_out_as_it_went_in
    an_empty_channel_has_nothing_to_read
    a_channel_that_nobody_made_is_missing
    a_path_has_one_writer_and_the_second_is_told_who
    a_place_is_free_again_when_its_writer_leaves
    history_is_kept_by_count_and_the_lost_samples_are_known
    the_sample_at_or_before_a_time_is_found
    samples_after_the_frozen_head_do_not_exist
    a_restarted_writer_goes_on_in_the_same_ring
    a_late_joiner_reads_the_history_of_a_dead_writer
    a_sample_that_its_writer_did_not_live_to_show_is_shown_by_the_next
    a_sample_that_was_never_finished_is_a_hole_and_its_number_is_not_used_again
    writers_that_die_one_after_the_other_in_mid_write_use_up_numbers_only
    the_newest_sample_can_be_read_while_the_next_is_written_even_with_a_depth_of_one
    a_tail_may_be_empty_or_full_and_is_cut_when_too_long
    a_message_without_a_tail_cuts_any_tail
    a_message_shorter_than_its_channel_is_filled_up_with_zeros
    a_large_tail_is_written_and_read_in_place
    a_panic_while_filling_a_tail_leaves_a_hole
    a_reader_that_expects_another_layout_is_told_both
    a_reader_that_expects_this_layout_gets_it
    a_buffer_for_another_geometry_is_refused
    a_deeper_ring_takes_the_history_over_and_the_old_readers_are_told
    a_shallower_ring_keeps_the_newest
    a_ring_with_a_shorter_tail_leaves_out_what_does_not_fit
    another_message_begins_anew_and_the_old_readers_are_told
    preparing_twice_changes_nothing
    preparing_another_geometry_under_a_living_writer_is_refused
    a_geometry_that_cannot_be_is_refused_and_changes_nothing
    a_fence_leaves_a_hanging_writer_writing_to_nobody
    a_fence_does_not_give_the_number_of_a_half_written_sample_again
    a_fenced_writer_that_leaves_does_not_take_its_successors_place_along
    paths_are_listed_and_sets_are_sorted
    a_name_is_a_channel_or_a_folder
    a_path_that_is_none_is_refused_everywhere
    a_removed_channel_tells_its_readers_and_its_writer
    a_cleared_tree_is_empty_and_can_be_used_again
    the_writers_process_is_named_while_it_has_the_place
    a_waiter_returns_for_what_changed_after_its_snapshot
    a_waiter_says_which_of_its_words_changed
    a_waiter_times_out_at_its_time_and_not_before
    two_threads_wake_each_other_a_thousand_times
    a_waiting_reader_is_woken_by_retirement_and_by_a_new_writer
    a_waiter_may_have_more_words_than_one_call_takes
    readers_never_see_a_torn_sample
}

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

fn a_sample_comes_out_as_it_went_in(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    assert_eq!(publish(&mut writer), 1);
    let sample = check(&ground.reader(), 1);
    assert_eq!(sample.generation, 1);
    assert_eq!(ground.reader().geometry(), &geometry(4, 8));
}

fn an_empty_channel_has_nothing_to_read(ground: &Ground) {
    ground.tree.prepare(PATH, &geometry(4, 8)).unwrap();
    let reader = ground.reader();
    assert_eq!((reader.head(), reader.oldest(), reader.generation()), (0, 1, 0));
    assert_eq!(reader.writer_pid(), None);
    assert_eq!(read(&reader, 1), Err(ReadError::NotYet));
    assert_eq!(read(&reader, 0), Err(ReadError::Overrun));
    assert_eq!(reader.at_or_before(u64::MAX, 10), None);
    assert!(!reader.retired() && !reader.unlinked());
}

fn a_channel_that_nobody_made_is_missing(ground: &Ground) {
    for path in [PATH, "/drivers", "/drivers/base"] {
        let error = ground.tree.reader(path, None).err().unwrap();
        assert!(matches!(error, ChannelError::Missing { .. }), "{error}");
        let error = ground.tree.remove(path).unwrap_err();
        assert!(matches!(error, ChannelError::Missing { .. }), "{error}");
        ground.tree.prepare(PATH, &geometry(1, 1)).unwrap();
        ground.tree.remove(PATH).unwrap();
    }
    ground.tree.prepare(PATH, &geometry(1, 1)).unwrap();
    assert!(matches!(ground.tree.reader("/drivers/base", None), Err(ChannelError::Missing { .. })));
    assert!(matches!(ground.tree.reader("/drivers/base/sonar/x", None), Err(ChannelError::Missing { .. })));
}

fn a_path_has_one_writer_and_the_second_is_told_who(ground: &Ground) {
    let mut first = ground.writer(&geometry(4, 8));
    for _ in 0..2 {
        let error = ground.tree.writer(PATH, &geometry(4, 8), Claim::Continue).err().unwrap();
        assert!(matches!(error, ChannelError::Held { holder, .. } if holder == Some(std::process::id())), "{error}");
        let text = error.to_string();
        assert!(text.contains(PATH) && text.contains(&std::process::id().to_string()), "{text}");
    }
    publish(&mut first);
    check(&ground.reader(), 1);
    // Another path is another matter.
    ground.tree.writer("/drivers/base/state", &geometry(4, 8), Claim::Continue).unwrap();
}

fn a_place_is_free_again_when_its_writer_leaves(ground: &Ground) {
    for generation in 1..=3 {
        assert_eq!(ground.writer(&geometry(4, 8)).generation(), generation);
    }
}

fn history_is_kept_by_count_and_the_lost_samples_are_known(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    let reader = ground.reader();
    for n in 1..=20u64 {
        publish(&mut writer);
        assert_eq!((reader.head(), reader.oldest()), (n, n.saturating_sub(3).max(1)));
        (reader.oldest()..=n).for_each(|sequence| assert_eq!(check(&reader, sequence).generation, 1));
        assert_eq!(read(&reader, n + 1), Err(ReadError::NotYet));
    }
    // A reader that had read up to 10 knows that it lost 11 to 16, not how they looked.
    for lost in 1..=15 {
        assert_eq!(read(&reader, lost), Err(ReadError::Overrun), "{lost}");
        assert_eq!(reader.stamp(lost), Err(ReadError::Overrun), "{lost}");
    }
}

fn the_sample_at_or_before_a_time_is_found(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 0));
    let reader = ground.reader();
    for stamp in [10, 20, 20, 30, 50] {
        writer.publish(stamp, &[], &[]);
    }
    let at = |stamp| reader.at_or_before(stamp, u64::MAX);
    assert_eq!(
        (at(60), at(50), at(49), at(30), at(29), at(20)),
        (Some(5), Some(5), Some(4), Some(4), Some(3), Some(3))
    );
    // Sample 1 is beyond the promised history, and there until its slot is needed.
    assert_eq!((at(19), at(10), at(9)), (Some(1), Some(1), None));
    writer.publish(60, &[], &[]);
    assert_eq!(at(19), None);
}

fn samples_after_the_frozen_head_do_not_exist(ground: &Ground) {
    let mut writer = ground.writer(&geometry(8, 0));
    let reader = ground.reader();
    (1..=5).for_each(|n| assert_eq!(writer.publish(n * 10, &[], &[]).sequence, n));
    assert_eq!(reader.at_or_before(100, 3), Some(3));
    assert_eq!(reader.at_or_before(15, 3), Some(1));
    assert_eq!(reader.at_or_before(100, 0), None);
}

fn a_restarted_writer_goes_on_in_the_same_ring(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    let reader = ground.reader();
    publish(&mut writer);
    publish(&mut writer);
    drop(writer);
    let mut writer = ground.writer(&geometry(4, 8));
    assert_eq!((writer.generation(), writer.next_sequence()), (2, 3));
    assert_eq!(reader.generation(), 2, "readers see the restart before its first sample");
    publish(&mut writer);
    let generations: Vec<u64> = (1..=3).map(|sequence| check(&reader, sequence).generation).collect();
    assert_eq!(generations, [1, 1, 2]);
    assert!(!reader.retired());
}

fn a_late_joiner_reads_the_history_of_a_dead_writer(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    publish_many(&mut writer, 9);
    die(writer, Death::BeforeWake);
    let reader = ground.reader();
    assert_eq!((reader.head(), reader.oldest()), (10, 7));
    check_all(&reader, 7..=10);
    assert_eq!(reader.at_or_before(850, u64::MAX), Some(8));
}

fn a_sample_that_its_writer_did_not_live_to_show_is_shown_by_the_next(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    publish(&mut writer);
    die(writer, Death::BeforeHead);
    let reader = ground.reader();
    assert_eq!(reader.head(), 1);
    assert_eq!(read(&reader, 2), Err(ReadError::NotYet));
    let mut writer = ground.writer(&geometry(4, 8));
    assert_eq!((writer.next_sequence(), reader.head()), (3, 2));
    assert_eq!(check(&reader, 2).generation, 1);
    publish(&mut writer);
    assert_eq!(check(&reader, 3).generation, 2);
}

fn a_sample_that_was_never_finished_is_a_hole_and_its_number_is_not_used_again(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    publish(&mut writer);
    die(writer, Death::InMidWrite);
    let reader = ground.reader();
    assert_eq!(reader.head(), 1);
    let mut writer = ground.writer(&geometry(4, 8));
    assert_eq!((writer.next_sequence(), reader.head()), (3, 1));
    publish(&mut writer);
    check(&reader, 1);
    assert_eq!(read(&reader, 2), Err(ReadError::Unfinished));
    check(&reader, 3);
    assert_eq!(reader.at_or_before(299, u64::MAX), Some(1), "a hole has no stamp");
    publish_many(&mut writer, 4);
    assert_eq!(read(&reader, 2), Err(ReadError::Overrun), "its slot is a slot like any other");
}

fn writers_that_die_one_after_the_other_in_mid_write_use_up_numbers_only(ground: &Ground) {
    let mut writer = ground.writer(&geometry(2, 8));
    publish(&mut writer);
    die(writer, Death::InMidWrite);
    for sequence in 3..9 {
        let writer = ground.writer(&geometry(2, 8));
        assert_eq!(writer.next_sequence(), sequence);
        die(writer, Death::InMidWrite);
    }
    let reader = ground.reader();
    let mut writer = ground.writer(&geometry(2, 8));
    assert_eq!(publish(&mut writer), 9);
    assert_eq!((check(&reader, 9).generation, reader.generation()), (8, 8));
}

fn the_newest_sample_can_be_read_while_the_next_is_written_even_with_a_depth_of_one(ground: &Ground) {
    let mut writer = ground.writer(&geometry(1, 8));
    publish_many(&mut writer, 3);
    let reader = ground.reader();
    writer.publish_in_place(400, &fixed(4), 0, |_| check_all(&reader, 3..=3));
    die(writer, Death::InMidWrite);
    assert_eq!(reader.head(), 4);
    assert_eq!(read(&reader, 4).unwrap().stamp_ns, 400);
}

fn a_tail_may_be_empty_or_full_and_is_cut_when_too_long(ground: &Ground) {
    let mut writer = ground.writer(&geometry(16, 7));
    let reader = ground.reader();
    let mut buffer = SampleBuffer::new(reader.geometry());
    for elements in [7, 0, 1, 6, 7, 8, 100] {
        let published = writer.publish(1, &fixed(1), &tail(5, elements));
        assert_eq!(published.cut, elements > 7, "{elements}");
        let sample = reader.read(published.sequence, &mut buffer).unwrap();
        assert_eq!(sample.tail_bytes, elements.min(7) * 3);
        assert_eq!(buffer.tail(), tail(5, elements.min(7)));
        assert_eq!(buffer.fixed(), fixed(1));
        assert_eq!(buffer.tail().as_ptr() as usize % 8, 0);
        assert_eq!(buffer.fixed().as_ptr() as usize % 8, 0);
    }
}

fn a_message_without_a_tail_cuts_any_tail(ground: &Ground) {
    let bare = Geometry { tail_element_bytes: 0, ..geometry(2, 0) };
    let mut writer = ground.writer(&bare);
    assert!(writer.publish(1, &fixed(1), &[1]).cut);
    assert!(!writer.publish(1, &fixed(1), &[]).cut);
    assert_eq!(read(&ground.reader(), 1).unwrap().tail_bytes, 0);
}

fn a_message_shorter_than_its_channel_is_filled_up_with_zeros(ground: &Ground) {
    let mut writer = ground.writer(&geometry(1, 2));
    let reader = ground.reader();
    let mut buffer = SampleBuffer::new(reader.geometry());
    // Each twice, so that every slot has held the other.
    for _ in 0..4 {
        writer.publish(1, &[0xff; 40], &[]);
        reader.read(reader.head(), &mut buffer).unwrap();
        assert_eq!(buffer.fixed(), [0xff; 20]);
    }
    for _ in 0..2 {
        writer.publish(1, &[7; 3], &[]);
        reader.read(reader.head(), &mut buffer).unwrap();
        assert_eq!(buffer.fixed(), [[7; 3].as_slice(), &[0; 17]].concat());
    }
}

fn a_large_tail_is_written_and_read_in_place(ground: &Ground) {
    let image = Geometry { tail_element_bytes: 1, ..geometry(2, 1_000_000) };
    let mut writer = ground.writer(&image);
    let published = writer.publish_in_place(5, &fixed(1), 999_999, |words| {
        assert_eq!(words.len(), 125_000);
        (0..words.len()).for_each(|i| words.set(i, i as u64));
        words.set(125_000, 1);
        words.copy_from(124_999, &[9; 100]);
        words.copy_from(200_000, &[9; 100]);
    });
    assert!(!published.cut && !published.lost);
    let reader = ground.reader();
    let sum = reader.read_in_place(1, |slot| {
        assert_eq!((slot.sample.stamp_ns, slot.sample.tail_bytes), (5, 999_999));
        assert_eq!(slot.tail(124_999), 0x0909_0909_0909_0909);
        assert_eq!((slot.tail(125_000), slot.fixed(3), slot.fixed(usize::MAX)), (0, 0, 0));
        assert_eq!(slot.fixed(0).to_le_bytes(), fixed(1)[..8]);
        (0..124_999).map(|i| slot.tail(i)).sum::<u64>()
    });
    assert_eq!(sum, Ok(124_999 * 124_998 / 2));
    // What a reader saw of a sample that was overtaken meanwhile is not passed on.
    let seen = reader.read_in_place(1, |_| publish_many(&mut writer, 3));
    assert_eq!(seen, Err(ReadError::Overrun));
    assert_eq!(reader.read_in_place(5, |_| ()), Err(ReadError::NotYet));
}

fn a_panic_while_filling_a_tail_leaves_a_hole(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    publish(&mut writer);
    let filled = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        writer.publish_in_place(1, &[], 3, |_| std::panic::resume_unwind(Box::new(())));
    }));
    assert!(filled.is_err());
    assert_eq!(publish(&mut writer), 3);
    let reader = ground.reader();
    assert_eq!(read(&reader, 2), Err(ReadError::Unfinished));
    check(&reader, 3);
}

fn a_reader_that_expects_another_layout_is_told_both(ground: &Ground) {
    ground.tree.prepare(PATH, &geometry(4, 8)).unwrap();
    let expect = Expect { type_name: "Image".into(), layout_hash: 0xfeed_0000_0000_beef };
    let error = ground.tree.reader(PATH, Some(expect)).err().unwrap().to_string();
    for part in [PATH, "Ranges", "123456789abcdef0", "Image", "feed00000000beef"] {
        assert!(error.contains(part), "{part} in {error}");
    }
    let other_version = Expect { type_name: "Ranges".into(), layout_hash: 1 };
    assert!(matches!(ground.tree.reader(PATH, Some(other_version)), Err(ChannelError::Mismatch { .. })));
}

fn a_reader_that_expects_this_layout_gets_it(ground: &Ground) {
    ground.tree.prepare(PATH, &geometry(4, 8)).unwrap();
    let expect = Expect { type_name: "Ranges".into(), layout_hash: geometry(1, 1).layout_hash };
    assert_eq!(ground.tree.reader(PATH, Some(expect)).unwrap().geometry().schema, geometry(1, 1).schema);
}

fn a_buffer_for_another_geometry_is_refused(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    publish(&mut writer);
    let reader = ground.reader();
    let mut small = SampleBuffer::new(&geometry(4, 1));
    assert_eq!(reader.read(1, &mut small), Err(ReadError::Buffer));
    let mut other = SampleBuffer::new(&Geometry { fixed_bytes: 24, ..geometry(4, 8) });
    assert_eq!(reader.read(1, &mut other), Err(ReadError::Buffer));
    let mut large = SampleBuffer::new(&geometry(4, 80));
    assert!(reader.read(1, &mut large).is_ok());
    let impossible = SampleBuffer::new(&geometry(0, 0));
    assert_eq!((impossible.fixed().len(), impossible.tail().len()), (0, 0));
}

fn a_deeper_ring_takes_the_history_over_and_the_old_readers_are_told(ground: &Ground) {
    let mut writer = ground.writer(&geometry(3, 8));
    let old = ground.reader();
    publish_many(&mut writer, 5);
    drop(writer);
    ground.tree.prepare(PATH, &geometry(6, 16)).unwrap();
    assert!(old.retired());
    let new = ground.reader();
    assert!(!new.retired());
    assert_eq!((new.head(), new.generation(), new.geometry().depth), (5, 1, 6));
    check_all(&new, 3..=5);
    let mut writer = ground.writer(&geometry(6, 16));
    assert_eq!((writer.generation(), publish(&mut writer)), (2, 6));
    check_all(&new, 3..=6);
    check(&old, 5);
    assert_eq!(read(&old, 6), Err(ReadError::NotYet));
}

fn a_shallower_ring_keeps_the_newest(ground: &Ground) {
    let mut writer = ground.writer(&geometry(9, 8));
    publish_many(&mut writer, 9);
    die(writer, Death::InMidWrite);
    let mut writer = ground.writer(&geometry(2, 8));
    assert_eq!((writer.next_sequence(), writer.generation()), (11, 2));
    let reader = ground.reader();
    assert_eq!(reader.head(), 9);
    check(&reader, 9);
    publish(&mut writer);
    assert_eq!(read(&reader, 10), Err(ReadError::Unfinished));
    assert_eq!(check(&reader, 11).generation, 2);
}

fn a_ring_with_a_shorter_tail_leaves_out_what_does_not_fit(ground: &Ground) {
    let mut writer = ground.writer(&geometry(8, 8));
    publish_many(&mut writer, 3);
    drop(writer);
    // Samples 1, 2 and 3 have as many elements each.
    let mut writer = ground.writer(&geometry(8, 2));
    let reader = ground.reader();
    assert_eq!((writer.next_sequence(), reader.head()), (4, 2));
    check(&reader, 2);
    publish(&mut writer);
    assert_eq!(read(&reader, 3), Err(ReadError::Unfinished));
    check(&reader, 4);
}

fn another_message_begins_anew_and_the_old_readers_are_told(ground: &Ground) {
    let mut writer = ground.writer(&geometry(3, 8));
    publish(&mut writer);
    drop(writer);
    let old = ground.reader();
    let other = Geometry { type_name: "Image".into(), layout_hash: 7, fixed_bytes: 100, ..geometry(3, 8) };
    let writer = ground.writer(&other);
    assert!(old.retired());
    assert_eq!((writer.next_sequence(), writer.generation()), (1, 2));
    let reader = ground.reader();
    assert_eq!((reader.head(), reader.geometry()), (0, &other));
    check(&old, 1);
}

fn preparing_twice_changes_nothing(ground: &Ground) {
    ground.tree.prepare(PATH, &geometry(3, 8)).unwrap();
    let reader = ground.reader();
    let mut writer = ground.writer(&geometry(3, 8));
    publish(&mut writer);
    ground.tree.prepare(PATH, &geometry(3, 8)).unwrap();
    publish(&mut writer);
    check(&reader, 2);
    assert!(!reader.retired());
}

fn preparing_another_geometry_under_a_living_writer_is_refused(ground: &Ground) {
    let mut writer = ground.writer(&geometry(3, 8));
    let error = ground.tree.prepare(PATH, &geometry(4, 8)).unwrap_err();
    assert!(matches!(error, ChannelError::Held { .. }), "{error}");
    publish(&mut writer);
    check(&ground.reader(), 1);
    assert_eq!(ground.reader().geometry().depth, 3);
}

fn a_geometry_that_cannot_be_is_refused_and_changes_nothing(ground: &Ground) {
    let huge = usize::MAX / 2;
    for bad in [
        geometry(0, 1),
        geometry(huge, 1),
        geometry(usize::MAX, 1),
        geometry(1, huge),
        Geometry { fixed_bytes: huge, ..geometry(1, 1) },
        Geometry { fixed_bytes: usize::MAX, ..geometry(1, 1) },
        Geometry { tail_element_bytes: 0, ..geometry(1, 1) },
    ] {
        for error in [
            ground.tree.prepare(PATH, &bad).unwrap_err(),
            ground.tree.writer(PATH, &bad, Claim::Continue).err().unwrap(),
            ground.tree.writer(PATH, &bad, Claim::Fence).err().unwrap(),
        ] {
            assert!(matches!(error, ChannelError::BadGeometry { .. }), "{error}");
        }
    }
    assert!(ground.tree.list().unwrap().is_empty());
}

fn a_fence_leaves_a_hanging_writer_writing_to_nobody(ground: &Ground) {
    let mut hanging = ground.writer(&geometry(4, 8));
    publish_many(&mut hanging, 6);
    let old = ground.reader();
    let mut writer = ground.tree.writer(PATH, &geometry(4, 8), Claim::Fence).unwrap();
    assert_eq!((writer.generation(), writer.next_sequence()), (2, 7));
    assert!(old.retired());
    let reader = ground.reader();
    (3..=6).for_each(|sequence| assert_eq!(check(&reader, sequence).generation, 1));

    assert!(hanging.lost());
    let published = hanging.publish(700, b"too late", &[]);
    assert!(published.lost);
    (0..9).for_each(|_| assert!(hanging.publish(800, b"too late", &[]).lost));
    check_all(&old, 3..=6);
    assert_eq!((old.head(), reader.head()), (6, 6));
    assert_eq!(publish(&mut writer), 7);
    assert_eq!(check(&reader, 7).generation, 2);
    assert!(!writer.lost());
}

fn a_fence_does_not_give_the_number_of_a_half_written_sample_again(ground: &Ground) {
    let mut hanging = ground.writer(&geometry(4, 8));
    publish(&mut hanging);
    let old = ground.reader();
    let mut writer = None;
    // It hangs in the middle of sample 2, is fenced off, and comes to.
    let published = hanging.publish_in_place(200, &fixed(2), 3, |_| {
        writer = Some(ground.tree.writer(PATH, &geometry(4, 8), Claim::Fence).unwrap());
    });
    assert!(published.lost);
    let mut writer = writer.unwrap();
    assert_eq!(publish(&mut writer), 3);
    let reader = ground.reader();
    assert_eq!(read(&reader, 2), Err(ReadError::Unfinished));
    check(&reader, 1);
    check(&reader, 3);
    // Sample 2 was whole in the end; readers that still look at the old ring may have it.
    assert_eq!((old.head(), read(&old, 3)), (2, Err(ReadError::NotYet)));
}

fn a_fenced_writer_that_leaves_does_not_take_its_successors_place_along(ground: &Ground) {
    let hanging = ground.writer(&geometry(4, 8));
    let mut writer = ground.tree.writer(PATH, &geometry(4, 8), Claim::Fence).unwrap();
    drop(hanging);
    let error = ground.tree.writer(PATH, &geometry(4, 8), Claim::Continue).err().unwrap();
    assert!(matches!(error, ChannelError::Held { .. }), "{error}");
    publish(&mut writer);
    assert!(ground.reader().writer_pid().is_some());
    drop(writer);
    assert_eq!(ground.writer(&geometry(4, 8)).generation(), 3);
}

fn paths_are_listed_and_sets_are_sorted(ground: &Ground) {
    assert!(ground.tree.list().unwrap().is_empty());
    let all =
        ["/actions/avoid/proposal", "/actions/forward/proposal", "/actions/forward/x", "/motion/base/command", "/t"];
    for path in all.iter().rev() {
        ground.tree.prepare(path, &geometry(1, 1)).unwrap();
    }
    assert_eq!(ground.tree.list().unwrap(), all);
    let members = |pattern| ground.tree.members(pattern).unwrap();
    assert_eq!(members("/actions/*/proposal"), all[..2]);
    assert_eq!(members("/*/*/*"), all[..4]);
    assert_eq!(members("/t"), ["/t"]);
    assert!(members("/actions/*").is_empty());
    let writer = ground.tree.writer("/actions/new/proposal", &geometry(1, 1), Claim::Continue).unwrap();
    assert_eq!(members("/actions/*/proposal").len(), 3);
    drop(writer);
    ground.tree.remove("/actions/avoid/proposal").unwrap();
    assert_eq!(members("/actions/*/proposal"), ["/actions/forward/proposal", "/actions/new/proposal"]);
}

fn a_name_is_a_channel_or_a_folder(ground: &Ground) {
    ground.tree.prepare("/a/b", &geometry(1, 1)).unwrap();
    for path in ["/a", "/a/b/c", "/a/b/c/d"] {
        let error = ground.tree.prepare(path, &geometry(1, 1)).unwrap_err();
        assert!(matches!(error, ChannelError::BadPath { .. }), "{path}: {error}");
        let error = ground.tree.writer(path, &geometry(1, 1), Claim::Fence).err().unwrap();
        assert!(matches!(error, ChannelError::BadPath { .. }), "{path}: {error}");
    }
    assert_eq!(ground.tree.list().unwrap(), ["/a/b"]);
}

fn a_path_that_is_none_is_refused_everywhere(ground: &Ground) {
    for path in ["", "a", "/", "/a/", "/../a", "/a/../../b", "/.a", "/a\nb", "/ä", &format!("/{}", "a".repeat(600))] {
        let tree = &ground.tree;
        for error in [
            tree.prepare(path, &geometry(1, 1)).unwrap_err(),
            tree.writer(path, &geometry(1, 1), Claim::Continue).err().unwrap(),
            tree.reader(path, None).err().unwrap(),
            tree.remove(path).unwrap_err(),
            tree.members(path).unwrap_err(),
        ] {
            assert!(matches!(error, ChannelError::BadPath { .. }), "{path:?}: {error}");
        }
    }
}

fn a_removed_channel_tells_its_readers_and_its_writer(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    publish(&mut writer);
    let reader = ground.reader();
    ground.tree.remove(PATH).unwrap();
    assert!(reader.retired());
    assert!(writer.publish(2, &[], &[]).lost);
    check(&reader, 1);
    assert!(ground.tree.list().unwrap().is_empty());
    let fresh = ground.writer(&geometry(4, 8));
    assert_eq!((fresh.generation(), fresh.next_sequence()), (1, 1));
}

fn a_cleared_tree_is_empty_and_can_be_used_again(ground: &Ground) {
    ground.tree.clear().unwrap();
    let mut writer = ground.writer(&geometry(4, 8));
    ground.tree.prepare("/t", &geometry(4, 8)).unwrap();
    let reader = ground.reader();
    ground.tree.clear().unwrap();
    assert!(reader.retired() && writer.publish(2, &[], &[]).lost);
    assert!(ground.tree.list().unwrap().is_empty());
    ground.tree.prepare("/t", &geometry(4, 8)).unwrap();
    assert_eq!(ground.tree.list().unwrap(), ["/t"]);
}

fn the_writers_process_is_named_while_it_has_the_place(ground: &Ground) {
    let writer = ground.writer(&geometry(4, 8));
    let reader = ground.reader();
    assert_eq!(reader.writer_pid(), Some(std::process::id()));
    drop(writer);
    assert_eq!(reader.writer_pid(), None);
    die(ground.writer(&geometry(4, 8)), Death::BeforeWake);
    assert_eq!(reader.writer_pid(), Some(std::process::id()), "a dead process is named until its successor comes");
}

/// Long enough to tell a lost wake-up from a slow machine.
const LONG_NS: u64 = 60_000_000_000;

fn now_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

/// Both ways of waiting, as far as this kernel has them.
fn methods() -> Vec<Method> {
    let best = Waiter::new(&PrivateWord::new(), Vec::new()).unwrap().method();
    if best == Method::Helpers {
        println!("this kernel has no futex_waitv: only the fallback is tested");
        return vec![Method::Helpers];
    }
    vec![Method::Vector, Method::Helpers]
}

fn a_waiter_returns_for_what_changed_after_its_snapshot(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    for method in methods() {
        let private = PrivateWord::new();
        let reader = ground.reader();
        let mut waiter = Waiter::with_method(&private, vec![reader.word()], method).unwrap();
        for _ in 0..100 {
            waiter.snapshot();
            publish(&mut writer);
            assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Word(0), "{method:?}");
            waiter.snapshot();
            private.bump();
            assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Private, "{method:?}");
        }
    }
}

fn a_waiter_says_which_of_its_words_changed(ground: &Ground) {
    let mut writers: Vec<RawWriter> = ["/a", "/b", "/c"]
        .iter()
        .map(|path| ground.tree.writer(path, &geometry(2, 0), Claim::Continue).unwrap())
        .collect();
    let words = || ["/a", "/b", "/c"].iter().map(|path| ground.tree.reader(path, None).unwrap().word()).collect();
    for method in methods() {
        let mut waiter = Waiter::with_method(&PrivateWord::new(), words(), method).unwrap();
        for index in [0, 1, 2, 2, 0, 1] {
            waiter.snapshot();
            writers[index].publish(1, &[], &[]);
            assert_eq!(waiter.wait(None), Woken::Word(index), "{method:?}");
        }
    }
}

fn a_waiter_times_out_at_its_time_and_not_before(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    for method in methods() {
        publish(&mut writer);
        let mut waiter = Waiter::with_method(&PrivateWord::new(), vec![ground.reader().word()], method).unwrap();
        // A helper may still pass on what happened before.
        let mut timed_out = |until| {
            waiter.snapshot();
            while waiter.wait(Some(until)) == Woken::Spurious {
                waiter.snapshot();
            }
            assert_eq!(waiter.wait(Some(until)), Woken::Timeout, "{method:?}");
            assert!(now_ns() >= until);
        };
        timed_out(0);
        timed_out(now_ns());
        timed_out(now_ns() + 3_000_000);
    }
}

fn two_threads_wake_each_other_a_thousand_times(ground: &Ground) {
    let mut ping = ground.tree.writer("/ping", &geometry(2, 0), Claim::Continue).unwrap();
    let mut pong = ground.tree.writer("/pong", &geometry(2, 0), Claim::Continue).unwrap();
    for method in methods() {
        let (pings, pongs) = ["/ping", "/pong"].map(|path| ground.tree.reader(path, None).unwrap()).into();
        let (ping_begin, pong_begin) = (pings.head(), pongs.head());
        let await_head = |waiter: &mut Waiter, reader: &RawReader, head: u64| {
            while reader.head() < head {
                assert_ne!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Timeout, "a wake-up was lost ({method:?})");
                waiter.snapshot();
            }
        };
        std::thread::scope(|scope| {
            let (pong, pings) = (&mut pong, &pings);
            scope.spawn(move || {
                let mut waiter = Waiter::with_method(&PrivateWord::new(), vec![pings.word()], method).unwrap();
                for round in 1..=1000 {
                    await_head(&mut waiter, pings, ping_begin + round);
                    pong.publish(round, &[], &[]);
                }
            });
            let mut waiter = Waiter::with_method(&PrivateWord::new(), vec![pongs.word()], method).unwrap();
            for round in 1..=1000 {
                ping.publish(round, &[], &[]);
                await_head(&mut waiter, &pongs, pong_begin + round);
            }
        });
    }
}

fn a_waiting_reader_is_woken_by_retirement_and_by_a_new_writer(ground: &Ground) {
    for method in methods() {
        let writer = ground.writer(&geometry(4, 8));
        let reader = ground.reader();
        let mut waiter = Waiter::with_method(&PrivateWord::new(), vec![reader.word()], method).unwrap();
        drop(writer);
        waiter.snapshot();
        let writer = ground.writer(&geometry(4, 8));
        assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Word(0), "{method:?}");
        waiter.snapshot();
        let fencing = ground.tree.writer(PATH, &geometry(4, 8), Claim::Fence).unwrap();
        assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Word(0), "{method:?}");
        assert!(reader.retired());
        drop((writer, fencing));
    }
}

fn a_waiter_may_have_more_words_than_one_call_takes(ground: &Ground) {
    let mut writer = ground.writer(&geometry(4, 8));
    for count in [126, 127, 128, 200] {
        let reader = ground.reader();
        let words = (0..count).map(|_| reader.word()).collect();
        let mut waiter = Waiter::new(&PrivateWord::new(), words).unwrap();
        waiter.snapshot();
        publish(&mut writer);
        assert_eq!(waiter.wait(Some(now_ns() + LONG_NS)), Woken::Word(0), "{count}");
    }
}

fn readers_never_see_a_torn_sample(ground: &Ground) {
    let geometry = Geometry { fixed_bytes: 64, tail_element_bytes: 8, ..geometry(2, 200) };
    let mut writer = ground.writer(&geometry);
    let done = AtomicBool::new(false);
    let whole = AtomicU64::new(0);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                let reader = ground.reader();
                let mut buffer = SampleBuffer::new(&geometry);
                let mut newest = 0;
                while !done.load(Ordering::Relaxed) {
                    let wanted = reader.head();
                    assert!(wanted >= newest, "the head went back");
                    match reader.read(wanted, &mut buffer) {
                        Ok(sample) => {
                            assert_eq!(sample.stamp_ns, wanted);
                            let expected = wanted.wrapping_mul(0x9e37_79b9_7f4a_7c15).to_le_bytes();
                            assert!(buffer.fixed().as_chunks::<8>().0.iter().all(|word| *word == expected));
                            assert!(buffer.tail().as_chunks::<8>().0.iter().all(|word| *word == expected));
                            assert_eq!(buffer.tail().len() as u64, wanted % 200 * 8);
                            whole.fetch_add(1, Ordering::Relaxed);
                            newest = wanted;
                        }
                        Err(ReadError::Overrun) => {}
                        Err(ReadError::NotYet) if wanted == 0 => {}
                        Err(error) => panic!("{wanted}: {error}"),
                    }
                }
            });
        }
        while writer.next_sequence() < 200_000 || whole.load(Ordering::Relaxed) < 1000 {
            let n = writer.next_sequence();
            let word = n.wrapping_mul(0x9e37_79b9_7f4a_7c15).to_le_bytes();
            let bytes = word.repeat(200);
            writer.publish(n, &bytes[..64], &bytes[..(n % 200 * 8) as usize]);
        }
        done.store(true, Ordering::Relaxed);
    });
}
