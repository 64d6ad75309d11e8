//! Geometries and layouts: what is refused, and what a change takes over.

use runtime::channel::{ChannelError, Claim, Death, Expect, Geometry, ReadError, SampleBuffer};

use super::{Ground, PATH, check, check_all, die, geometry, publish, publish_many, read};

suite! {
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
