//! What holds for channels in files alone: the file system, other processes, vandals.
#![allow(clippy::unwrap_used, reason = "tests")]

mod full;
mod processes;

use std::fs::{self, File, OpenOptions};
use std::os::unix::fs::{FileExt, MetadataExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};

use runtime::channel::{
    ChannelError, Claim, Geometry, Method, PrivateWord, RawReader, RawSample, RawWriter, ReadError, SampleBuffer, Tree,
    Waiter, Woken,
};

const PATH: &str = "/drivers/base/sonar";

/// A tree of files that vanishes with the test.
struct Ground {
    tree: Tree,
    root: PathBuf,
    _folder: tempfile::TempDir,
}

impl Ground {
    fn new() -> Ground {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        let root = folder.path().join("robot");
        Ground { tree: Tree::shared(&root).unwrap(), root, _folder: folder }
    }

    fn writer(&self) -> RawWriter {
        self.tree.writer(PATH, &geometry(), Claim::Continue).unwrap()
    }

    fn reader(&self) -> RawReader {
        self.tree.reader(PATH, None).unwrap()
    }

    fn file(&self) -> PathBuf {
        self.root.join("drivers/base/sonar")
    }

    fn vandal(&self) -> File {
        OpenOptions::new().read(true).write(true).open(self.file()).unwrap()
    }
}

fn geometry() -> Geometry {
    Geometry {
        type_name: "Ranges".into(),
        layout_hash: 0x0123_4567_89ab_cdef,
        schema: "schema of ranges".into(),
        fixed_bytes: 20,
        tail_element_bytes: 4,
        tail_capacity: 3000,
        depth: 4,
    }
}

fn read(reader: &RawReader, sequence: u64) -> Result<RawSample, ReadError> {
    reader.read(sequence, &mut SampleBuffer::new(reader.geometry()))
}

fn now_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

#[test]
fn a_program_that_knows_the_table_alone_can_read_a_sample() {
    let ground = Ground::new();
    let mut writer = ground.writer();
    writer.publish(1, &[1; 20], &[1; 8]);
    drop(writer);
    let mut writer = ground.writer();
    for n in 2..=7 {
        writer.publish(n * 11, &[n as u8; 20], &[0x40 + n as u8; 8]);
    }
    let bytes = fs::read(ground.file()).unwrap();
    let u64_at = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    assert_eq!(&bytes[..8], b"SINEWCH\0");
    assert_eq!((u64_at(8), u64_at(16), u64_at(24)), (1, 4096, bytes.len() as u64));
    assert_eq!((u64_at(32), u64_at(56), u64_at(64)), (0x0123_4567_89ab_cdef, 4, 20));
    assert_eq!((u64_at(72), u64_at(80), u64_at(88), u64_at(96)), (4, 3000, 6, 16));
    assert_eq!(&bytes[512..512 + 22], b"Rangesschema of ranges");
    assert!(u64_at(104) > 0);
    assert_eq!((u64_at(256), u64_at(264), u64_at(272), u64_at(280)), (7, 2, u64::from(std::process::id()), 0));
    let slot = (u64_at(16) + u64_at(256) % u64_at(48) * u64_at(40)) as usize;
    assert_eq!((u64_at(slot), u64_at(slot + 8), u64_at(slot + 16), u64_at(slot + 24)), (14, 77, 2, 8));
    assert_eq!(bytes[slot + 32..slot + 52], [7; 20]);
    assert_eq!(bytes[slot + 56..slot + 64], [0x47; 8]);
}

#[test]
fn the_ring_is_readable_by_all_the_lock_by_its_owner_and_the_space_is_there() {
    let ground = Ground::new();
    let _writer = ground.writer();
    let ring = fs::metadata(ground.file()).unwrap();
    let lock = fs::metadata(ground.root.join("drivers/base/.sonar.lock")).unwrap();
    assert_eq!(ring.permissions().mode() & 0o022, 0, "nobody else writes");
    assert_eq!(lock.permissions().mode() & 0o777, 0o600);
    assert!(ring.blocks() * 512 >= ring.len(), "the ring has holes");
    assert_eq!(names(&ground.root.join("drivers/base")), [".sonar.lock", "sonar"], "nothing unfinished is left");
}

#[test]
fn readers_map_read_only_and_no_map_passes_to_a_forked_child() {
    let ground = Ground::new();
    ground.tree.prepare(PATH, &geometry()).unwrap();
    let maps = || {
        let smaps = fs::read_to_string("/proc/self/smaps").unwrap();
        let mut found = Vec::new();
        let mut mine = None;
        for line in smaps.lines() {
            if line.split_once(' ').is_some_and(|(range, _)| range.contains('-')) {
                mine =
                    line.ends_with(ground.file().to_str().unwrap()).then(|| line.split(' ').nth(1).unwrap().to_owned());
            }
            if let (Some(mode), Some(flags)) = (&mine, line.strip_prefix("VmFlags:")) {
                found.push((mode.clone(), flags.split(' ').any(|flag| flag == "dc")));
            }
        }
        found
    };
    assert_eq!(maps(), []);
    let reader = ground.reader();
    assert_eq!(maps(), [("r--s".to_owned(), true)]);
    drop(reader);
    let writer = ground.writer();
    assert_eq!(maps(), [("rw-s".to_owned(), true)]);
    drop(writer);
    assert_eq!(maps(), [], "the last user unmaps");
}

#[test]
fn a_foreign_hand_that_removes_the_file_is_noticed() {
    let ground = Ground::new();
    let mut writer = ground.writer();
    let reader = ground.reader();
    assert!(!reader.unlinked());
    fs::remove_file(ground.file()).unwrap();
    assert!(reader.unlinked() && !reader.retired());
    writer.publish(1, &[], &[]);
    assert!(read(&reader, 1).is_ok());
}

#[test]
fn a_file_cut_off_under_its_readers_is_a_fault_and_the_next_writer_mends_it() {
    for bytes in [0, 1, 4095, 4096, 8192, 20_000, 30_000] {
        let ground = Ground::new();
        let mut writer = ground.writer();
        for _ in 0..9 {
            writer.publish(5, &[1; 20], &[7; 12_000]);
        }
        let (reader, other) = (ground.reader(), ground.reader());
        ground.vandal().set_len(bytes).unwrap();

        let mut faults = 0;
        let mut buffer = SampleBuffer::new(reader.geometry());
        for sequence in 0..12 {
            match reader.read(sequence, &mut buffer) {
                Ok(_) => assert!(buffer.fixed() == [1; 20] && buffer.tail() == [7; 12_000], "{bytes}: rubbish"),
                Err(error) => faults += u32::from(error == ReadError::Fault),
            }
        }
        assert!(faults > 0, "{bytes}");
        assert!(reader.retired());
        let _ = (reader.head(), reader.oldest(), reader.generation(), reader.writer_pid());
        let _ = other.at_or_before(5, u64::MAX);

        let lost = (0..6).map(|n| writer.publish(n, &[2; 20], &[7; 12_000]).lost).fold(false, |a, b| a | b);
        assert!(lost, "{bytes}");
        assert!(writer.lost() && writer.publish(9, &[], &[]).lost);
        assert!(matches!(ground.tree.reader(PATH, None), Err(ChannelError::NotAChannel { .. })), "{bytes}");

        drop(writer);
        let mut writer = ground.writer();
        let sequence = writer.publish(10, &[3; 20], &[8; 12_000]).sequence;
        let fresh = ground.reader();
        assert_eq!(read(&fresh, sequence).unwrap().stamp_ns, 10);
    }
}

#[test]
fn a_file_cut_off_and_grown_again_is_a_fault_without_any_signal() {
    let ground = Ground::new();
    let mut writer = ground.writer();
    writer.publish(5, &[1; 20], &[7; 12_000]);
    let reader = ground.reader();
    let vandal = ground.vandal();
    let bytes = vandal.metadata().unwrap().len();
    vandal.set_len(0).unwrap();
    vandal.set_len(bytes).unwrap();
    assert_eq!(read(&reader, 1), Err(ReadError::Fault));
    assert!(reader.retired() && writer.publish(6, &[], &[]).lost);
}

#[test]
fn a_waiter_on_a_file_that_is_cut_off_is_sent_to_look() {
    let ground = Ground::new();
    let _writer = ground.writer();
    let best = Waiter::new(&PrivateWord::new(), Vec::new()).unwrap().method();
    // Often, for there are many moments at which a helper can be.
    for (method, round) in
        [best, Method::Helpers].into_iter().flat_map(|method| (0..50).map(move |round| (method, round)))
    {
        let other = format!("{PATH}_{method:?}_{round}");
        let mut writer = ground.tree.writer(&other, &geometry(), Claim::Continue).unwrap();
        let reader = ground.tree.reader(&other, None).unwrap();
        let words = vec![ground.reader().word(), reader.word()];
        let mut waiter = Waiter::with_method(&PrivateWord::new(), words, method).unwrap();
        waiter.snapshot();
        writer.publish(1, &[], &[]);
        assert_eq!(waiter.wait(Some(now_ns() + 60_000_000_000)), Woken::Word(1));
        waiter.snapshot();
        File::options().write(true).open(ground.root.join(&other[1..])).unwrap().set_len(0).unwrap();
        assert_eq!(waiter.wait(Some(now_ns() + 60_000_000_000)), Woken::Word(1));
        // Having been told, one can wait for the rest.
        let until = now_ns() + 1_000_000;
        let mut again = || {
            waiter.snapshot();
            waiter.wait(Some(until))
        };
        let rest: Vec<Woken> = (0..3).map(|_| again()).collect();
        assert_eq!((rest[2], rest.contains(&Woken::Word(1))), (Woken::Timeout, false), "{rest:?}");
    }
}

#[test]
fn what_is_no_channel_is_refused_to_readers_and_replaced_by_writers() {
    for rubbish in [&b""[..], b"hello", &[0; 4096], &[0xff; 20_000]] {
        let ground = Ground::new();
        ground.tree.prepare(PATH, &geometry()).unwrap();
        fs::write(ground.file(), rubbish).unwrap();
        let error = ground.tree.reader(PATH, None).err().unwrap();
        assert!(matches!(error, ChannelError::NotAChannel { .. }), "{error}");
        assert!(error.to_string().contains(PATH));
        ground.writer().publish(1, &[], &[]);
        assert!(read(&ground.reader(), 1).is_ok());
    }
}

#[test]
fn a_header_whose_sizes_contradict_each_other_is_refused() {
    for field in [16, 24, 40, 48] {
        let ground = Ground::new();
        ground.tree.prepare(PATH, &geometry()).unwrap();
        let mut size = [0; 8];
        ground.vandal().read_exact_at(&mut size, field).unwrap();
        let other = u64::from_le_bytes(size) - if field == 48 { 1 } else { 64 };
        ground.vandal().write_all_at(&other.to_le_bytes(), field).unwrap();
        let error = ground.tree.reader(PATH, None).err().unwrap().to_string();
        assert!(error.contains("contradict"), "{field}: {error}");
    }
}

#[test]
fn a_newer_format_is_refused_by_its_number() {
    let ground = Ground::new();
    ground.tree.prepare(PATH, &geometry()).unwrap();
    ground.vandal().write_all_at(&2u64.to_le_bytes(), 8).unwrap();
    let error = ground.tree.reader(PATH, None).err().unwrap().to_string();
    assert!(error.contains("version 2") && error.contains("knows 1"), "{error}");
}

#[test]
fn symbolic_links_and_pipes_in_the_tree_are_refused() {
    let ground = Ground::new();
    ground.tree.prepare(PATH, &geometry()).unwrap();
    let elsewhere = Ground::new();
    elsewhere.tree.prepare(PATH, &geometry()).unwrap();

    let link = ground.root.join("link");
    symlink(elsewhere.root.join("drivers"), &link).unwrap();
    symlink(elsewhere.file(), ground.root.join("file")).unwrap();
    symlink(elsewhere.file(), ground.root.join(".locked.lock")).unwrap();
    rustix::fs::mknodat(rustix::fs::CWD, ground.root.join("pipe"), rustix::fs::FileType::Fifo, 0o600.into(), 0)
        .unwrap();
    for path in ["/link/base/sonar", "/link/new", "/file", "/pipe"] {
        let error = ground.tree.reader(path, None).err().unwrap();
        assert!(matches!(error, ChannelError::Untrusted { .. } | ChannelError::System { .. }), "{path}: {error}");
    }
    for path in ["/link/base/sonar", "/link/new", "/file", "/pipe", "/locked"] {
        for claim in [Claim::Continue, Claim::Fence] {
            // A fence replaces the link by a lock of its own, which is as good.
            if let Err(error) = ground.tree.writer(path, &geometry(), claim) {
                assert!(
                    matches!(error, ChannelError::Untrusted { .. } | ChannelError::System { .. }),
                    "{path}: {error}"
                );
            } else {
                assert_eq!((path, claim), ("/locked", Claim::Fence));
            }
        }
    }
    assert_eq!(ground.tree.list().unwrap(), [PATH, "/locked"]);
    assert_eq!(elsewhere.tree.list().unwrap(), [PATH], "nothing was written through a link");

    let root_link = ground.root.with_extension("link");
    symlink(&elsewhere.root, &root_link).unwrap();
    assert!(matches!(Tree::shared(&root_link), Err(ChannelError::Untrusted { .. })));
    fs::write(ground.root.with_extension("file"), "").unwrap();
    assert!(matches!(Tree::shared(&ground.root.with_extension("file")), Err(ChannelError::Untrusted { .. })));
}

#[test]
fn a_folder_that_everybody_may_write_is_not_trusted() {
    let ground = Ground::new();
    ground.tree.prepare(PATH, &geometry()).unwrap();
    for folder in [ground.root.clone(), ground.root.join("drivers"), ground.root.join("drivers/base")] {
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o777)).unwrap();
        let error = ground.tree.writer(PATH, &geometry(), Claim::Continue).err().unwrap();
        assert!(matches!(error, ChannelError::Untrusted { .. }), "{error}");
        assert!(ground.tree.reader(PATH, None).is_ok(), "looking is harmless");
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o755)).unwrap();
    }
    ground.writer();
}

#[test]
fn folders_above_the_root_are_made_and_what_was_made_goes_again() {
    let ground = Ground::new();
    let deep = ground.root.join("a/b/c");
    let tree = Tree::shared(&deep).unwrap();
    assert!(!ground.root.exists(), "nothing is made before the first channel");
    tree.prepare(PATH, &geometry()).unwrap();
    tree.prepare("/drivers/base/state", &geometry()).unwrap();
    tree.remove(PATH).unwrap();
    assert_eq!(names(&deep.join("drivers/base")), [".state.lock", "state"]);
    tree.remove("/drivers/base/state").unwrap();
    assert_eq!(names(&deep), [""; 0]);
    tree.prepare(PATH, &geometry()).unwrap();
    tree.clear().unwrap();
    assert!(!deep.exists());
}

#[test]
fn clearing_leaves_what_is_not_ours_and_says_so() {
    let ground = Ground::new();
    let _writer = ground.writer();
    ground.tree.prepare("/drivers/base/damaged", &geometry()).unwrap();
    File::options().write(true).open(ground.root.join("drivers/base/damaged")).unwrap().set_len(3).unwrap();
    fs::write(ground.root.join("drivers/.x.4711.new"), "begun by a process that died").unwrap();
    fs::write(ground.root.join("drivers/.x.4711.newlock"), "").unwrap();
    fs::write(ground.root.join("notes"), "dear diary").unwrap();
    let error = ground.tree.clear().unwrap_err().to_string();
    assert!(error.contains(ground.root.to_str().unwrap()), "{error}");
    assert_eq!(names(&ground.root), ["notes"]);
    fs::remove_file(ground.root.join("notes")).unwrap();
    ground.tree.clear().unwrap();
    assert!(!ground.root.exists());
}

#[test]
fn what_a_maker_left_that_died_is_removed_by_the_next() {
    let ground = Ground::new();
    ground.tree.prepare("/drivers/base/other", &geometry()).unwrap();
    let folder = ground.root.join("drivers/base");
    fs::write(folder.join(".sonar.4711.new"), [0; 9999]).unwrap();
    fs::write(folder.join(".sonar_b.4711.new"), "of another channel").unwrap();
    ground.writer();
    assert_eq!(names(&folder), [".other.lock", ".sonar.lock", ".sonar_b.4711.new", "other", "sonar"]);
}

#[test]
fn what_a_fenced_writer_was_just_about_to_show_does_not_count() {
    let ground = Ground::new();
    let mut hanging = ground.writer();
    (1..=3).for_each(|n| assert!(!hanging.publish(n, &[1; 20], &[]).lost));
    let (old, old_file) = (ground.reader(), ground.vandal());
    let _writer = ground.tree.writer(PATH, &geometry(), Claim::Fence).unwrap();
    // It had looked whether its place was still its own, and then it hung.
    old_file.write_all_at(&4u64.to_le_bytes(), 256).unwrap();
    assert_eq!((old.head(), read(&old, 4)), (3, Err(ReadError::NotYet)));
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
