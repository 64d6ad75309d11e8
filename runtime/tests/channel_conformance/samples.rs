//! What is written comes out again, whole or not at all.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use runtime::channel::{ChannelError, Death, Geometry, ReadError, SampleBuffer};

use super::{Ground, PATH, check, check_all, die, fixed, geometry, publish, publish_many, read, tail};

suite! {
    a_sample_comes_out_as_it_went_in
    an_empty_channel_has_nothing_to_read
    a_channel_that_nobody_made_is_missing
    history_is_kept_by_count_and_the_lost_samples_are_known
    the_sample_at_or_before_a_time_is_found
    samples_after_the_frozen_head_do_not_exist
    the_newest_sample_can_be_read_while_the_next_is_written_even_with_a_depth_of_one
    a_tail_may_be_empty_or_full_and_is_cut_when_too_long
    a_message_without_a_tail_cuts_any_tail
    a_message_shorter_than_its_channel_is_filled_up_with_zeros
    a_large_tail_is_written_and_read_in_place
    a_panic_while_filling_a_tail_leaves_a_hole
    readers_never_see_a_torn_sample
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
