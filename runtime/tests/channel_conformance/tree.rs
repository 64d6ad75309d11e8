//! Paths and folders.

use runtime::channel::{ChannelError, Claim};

use super::{Ground, PATH, check, geometry, publish};

suite! {
    paths_are_listed_and_sets_are_sorted
    a_name_is_a_channel_or_a_folder
    a_path_that_is_none_is_refused_everywhere
    a_removed_channel_tells_its_readers_and_its_writer
    a_cleared_tree_is_empty_and_can_be_used_again
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
