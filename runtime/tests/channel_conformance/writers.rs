//! One writer at a time: those who come, die, restart and are fenced off.

use runtime::channel::{ChannelError, Claim, Death, ReadError};

use super::{Ground, PATH, check, check_all, die, fixed, geometry, publish, publish_many, read};

suite! {
    a_path_has_one_writer_and_the_second_is_told_who
    a_place_is_free_again_when_its_writer_leaves
    a_restarted_writer_goes_on_in_the_same_ring
    a_late_joiner_reads_the_history_of_a_dead_writer
    a_sample_that_its_writer_did_not_live_to_show_is_shown_by_the_next
    a_sample_that_was_never_finished_is_a_hole_and_its_number_is_not_used_again
    writers_that_die_one_after_the_other_in_mid_write_use_up_numbers_only
    a_fence_leaves_a_hanging_writer_writing_to_nobody
    a_fence_does_not_give_the_number_of_a_half_written_sample_again
    a_fenced_writer_that_leaves_does_not_take_its_successors_place_along
    the_writers_process_is_named_while_it_has_the_place
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

fn the_writers_process_is_named_while_it_has_the_place(ground: &Ground) {
    let writer = ground.writer(&geometry(4, 8));
    let reader = ground.reader();
    assert_eq!(reader.writer_pid(), Some(std::process::id()));
    drop(writer);
    assert_eq!(reader.writer_pid(), None);
    die(ground.writer(&geometry(4, 8)), Death::BeforeWake);
    assert_eq!(reader.writer_pid(), Some(std::process::id()), "a dead process is named until its successor comes");
}
