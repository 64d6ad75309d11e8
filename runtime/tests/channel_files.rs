//! What holds for channels in files alone: the file system, other processes, vandals.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{FileExt, MetadataExt, PermissionsExt, symlink};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};

use runtime::channel::{
    ChannelError, Claim, Death, Geometry, Method, PrivateWord, RawReader, RawSample, RawWriter, ReadError,
    SampleBuffer, Tree, Waiter, Woken,
};

const PATH: &str = "/drivers/base/sonar";
const ROLE: &str = "SINEW_FILES_ROLE";
const ROOT: &str = "SINEW_FILES_ROOT";

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
fn a_writer_in_another_process_is_named_and_its_death_frees_the_place() {
    let ground = Ground::new();
    let (mut child, mut told) = start("holding_process", &ground.root);
    assert_eq!(line(&mut told), "holding");
    let error = ground.tree.writer(PATH, &geometry(), Claim::Continue).err().unwrap();
    assert!(matches!(error, ChannelError::Held { holder, .. } if holder == Some(child.id())), "{error}");
    assert!(error.to_string().contains(&format!("process {}", child.id())), "{error}");
    assert!(matches!(ground.tree.prepare(PATH, &geometry()), Ok(())));
    assert_eq!(ground.reader().writer_pid(), Some(child.id()));
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(ground.writer().generation(), 2);
}

#[test]
fn a_stopped_writer_that_was_fenced_off_finds_out_when_it_goes_on() {
    let ground = Ground::new();
    let (mut child, mut told) = start("publishing_process", &ground.root);
    assert_eq!(line(&mut told), "publishing");
    let pid = rustix::process::Pid::from_raw(child.id() as i32).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::STOP).unwrap();
    rustix::process::waitpid(Some(pid), rustix::process::WaitOptions::UNTRACED).unwrap();

    let mut writer = ground.tree.writer(PATH, &geometry(), Claim::Fence).unwrap();
    let reader = ground.reader();
    let (head, next) = (reader.head(), writer.next_sequence());
    assert!(head > 0 && next > head && read(&reader, head).is_ok());
    rustix::process::kill_process(pid, rustix::process::Signal::CONT).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(17), "it learned that it had lost its place");

    assert_eq!(reader.head(), head);
    writer.publish(1, &[9; 20], &[]);
    assert_eq!((read(&reader, next).unwrap().generation, reader.writer_pid()), (2, Some(std::process::id())));
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

#[test]
fn a_bus_error_elsewhere_still_ends_the_process() {
    let ground = Ground::new();
    ground.tree.prepare(PATH, &geometry()).unwrap();
    let (mut child, mut told) = start("faulting_process", &ground.root);
    assert_eq!(line(&mut told), "faulting");
    assert_eq!(child.wait().unwrap().signal(), Some(libc::SIGBUS));
}

#[test]
fn a_bus_error_elsewhere_goes_to_the_handler_that_was_there_before() {
    let ground = Ground::new();
    ground.tree.prepare(PATH, &geometry()).unwrap();
    let (mut child, mut told) = start("handling_process", &ground.root);
    assert_eq!(line(&mut told), "faulting");
    assert_eq!(child.wait().unwrap().code(), Some(42));
}

/// In a process of its own: becomes the writer and waits to be killed.
#[test]
fn holding_process() {
    if let Some(tree) = role("holding_process") {
        let _writer = tree.writer(PATH, &geometry(), Claim::Continue).unwrap();
        eprintln!("holding");
        Waiter::new(&PrivateWord::new(), Vec::new()).unwrap().wait(Some(now_ns() + 60_000_000_000));
    }
}

/// In a process of its own: publishes until it learns that it lost its place.
#[test]
fn publishing_process() {
    if let Some(tree) = role("publishing_process") {
        let mut writer = tree.writer(PATH, &geometry(), Claim::Continue).unwrap();
        writer.publish(1, &[1; 20], &[2; 12_000]);
        eprintln!("publishing");
        let end = now_ns() + 60_000_000_000;
        while now_ns() < end {
            if writer.publish(1, &[1; 20], &[2; 12_000]).lost {
                std::process::exit(17);
            }
        }
    }
}

/// In a process of its own: has rings mapped, and runs into a bus error of its own.
#[test]
fn faulting_process() {
    if let Some(tree) = role("faulting_process") {
        let _reader = tree.reader(PATH, None).unwrap();
        touch_a_page_that_is_gone();
    }
}

/// The same in a program with a handler of its own.
#[test]
fn handling_process() {
    extern "C" fn leave(_: libc::c_int) {
        // SAFETY: _exit is async-signal-safe.
        unsafe { libc::_exit(42) }
    }
    if let Some(tree) = role("handling_process") {
        let handler = leave as extern "C" fn(libc::c_int);
        // SAFETY: a handler of the right signature, which only calls what a handler may.
        unsafe { libc::signal(libc::SIGBUS, handler as *const () as libc::sighandler_t) };
        let _reader = tree.reader(PATH, None).unwrap();
        touch_a_page_that_is_gone();
    }
}

fn touch_a_page_that_is_gone() {
    let file = tempfile::tempfile().unwrap();
    file.set_len(4096).unwrap();
    // SAFETY: a fresh mapping that nothing else uses; reading it ends the process, which is what is wanted.
    unsafe {
        use rustix::mm::{MapFlags, ProtFlags};
        let map = rustix::mm::mmap(std::ptr::null_mut(), 4096, ProtFlags::READ, MapFlags::SHARED, &file, 0).unwrap();
        file.set_len(0).unwrap();
        eprintln!("faulting");
        std::ptr::read_volatile(map.cast::<u8>());
    }
}

#[test]
fn a_full_file_system_is_an_error_with_numbers_and_never_a_signal() {
    let Some(report) = in_a_file_system_of_its_own("full_process") else { return };
    assert_eq!(report, "done");
}

/// In a process and mount namespace of its own: a /dev/shm of 64 MB as containers have it, and a tiny one.
#[test]
fn full_process() {
    if role("full_process").is_none() {
        return;
    }
    let folder = PathBuf::from(std::env::var_os(ROOT).unwrap());
    for (size, image_bytes) in [("64m", 1 << 20), ("64k", 1 << 11), ("8k", 1 << 10), ("4k", 0)] {
        let place = folder.join(size);
        fs::create_dir_all(&place).unwrap();
        if !mount_tmpfs(&place, size) {
            eprintln!("skipped: mount refused ({})", std::io::Error::last_os_error());
            return;
        }
        let tree = Tree::shared(&place.join("robot")).unwrap();
        let image = Geometry { tail_element_bytes: 1, tail_capacity: image_bytes, ..geometry() };
        let mut writers = Vec::new();
        let error = loop {
            let path = format!("/camera/image_{}", writers.len());
            match tree.writer(&path, &image, Claim::Continue) {
                Ok(writer) => writers.push(writer),
                Err(error) => break error,
            }
            assert!(writers.len() < 1000, "a file system of {size} holds whatever one likes");
        };
        let text = error.to_string();
        let ChannelError::NoSpace { path, wanted_bytes, free_bytes } = error else { panic!("{text}") };
        assert!(wanted_bytes > free_bytes, "{text}");
        assert!(text.contains(&path) && text.contains(&wanted_bytes.to_string()) && text.contains("depth"), "{text}");
        assert_eq!(writers.is_empty(), size == "8k" || size == "4k", "{size}");

        // What there is works to the last byte.
        let tail = vec![0x5a; image_bytes];
        for writer in &mut writers {
            (0..10).for_each(|n| assert!(!writer.publish(n, &[1; 20], &tail).lost));
        }
        for index in 0..writers.len() {
            let reader = tree.reader(&format!("/camera/image_{index}"), None).unwrap();
            let mut buffer = SampleBuffer::new(reader.geometry());
            (7..=10).for_each(|sequence| assert!(reader.read(sequence, &mut buffer).is_ok()));
            assert_eq!(buffer.tail(), tail);
        }
        // The refused one has left nothing, neither has a refused growth.
        assert_eq!(tree.list().unwrap().len(), writers.len());
        if let Ok(folder) = fs::read_dir(place.join("robot/camera")) {
            let mut names = folder.map(|entry| entry.unwrap().file_name().into_string().unwrap());
            assert!(!names.any(|name| name.ends_with(".new")), "the unfinished ring is still there");
        }
        if let Some(writer) = writers.pop() {
            writer.die_publishing(Death::BeforeWake, 11, &[2; 20], &tail);
            let path = format!("/camera/image_{}", writers.len());
            let deeper = Geometry { depth: 400, ..image.clone() };
            assert!(matches!(tree.writer(&path, &deeper, Claim::Continue), Err(ChannelError::NoSpace { .. })));
            let fenced = tree.writer("/camera/image_0", &deeper, Claim::Fence);
            assert!(matches!(fenced, Err(ChannelError::NoSpace { .. })));
            assert!(writers.iter().all(|writer| !writer.lost()), "a fence that failed takes nothing away");
            let reader = tree.reader(&path, None).unwrap();
            assert!(!reader.retired());
            assert_eq!((reader.head(), read(&reader, 11).unwrap().stamp_ns), (11, 11));
            let mut writer = tree.writer(&path, &image, Claim::Continue).unwrap();
            assert_eq!(writer.publish(12, &[], &[]).sequence, 12);
            assert!(read(&reader, 12).is_ok());
            if !writers.is_empty() {
                let held = tree.writer("/camera/image_0", &image, Claim::Continue);
                assert!(matches!(held, Err(ChannelError::Held { .. })));
            }
        }
    }
    eprintln!("done");
}

fn mount_tmpfs(at: &Path, size: &str) -> bool {
    let c = |text: &str| std::ffi::CString::new(text).unwrap();
    let (none, target, kind, options) = (c("none"), c(at.to_str().unwrap()), c("tmpfs"), c(&format!("size={size}")));
    // SAFETY: all pointers are to live C strings; the namespace is this process's own.
    unsafe {
        libc::mount(none.as_ptr(), c"/".as_ptr(), std::ptr::null(), libc::MS_REC | libc::MS_PRIVATE, std::ptr::null());
        libc::mount(none.as_ptr(), target.as_ptr(), kind.as_ptr(), 0, options.as_ptr().cast()) == 0
    }
}

/// Runs `role` in a mount namespace of its own, made as root or in a user namespace; `None`, with the reason printed,
/// where neither is permitted.
fn in_a_file_system_of_its_own(role: &str) -> Option<String> {
    use std::os::unix::process::CommandExt;
    let folder = tempfile::tempdir().unwrap();
    let mut command = command(role, folder.path());
    let users = format!("0 {} 1", rustix::process::geteuid().as_raw());
    let groups = format!("0 {} 1", rustix::process::getegid().as_raw());
    // SAFETY: between fork and exec only system calls run.
    unsafe {
        command.pre_exec(move || {
            if libc::unshare(libc::CLONE_NEWNS) == 0 {
                return Ok(());
            }
            if libc::unshare(libc::CLONE_NEWUSER | libc::CLONE_NEWNS) != 0 {
                return Err(std::io::Error::last_os_error());
            }
            fs::write("/proc/self/uid_map", &users)?;
            fs::write("/proc/self/setgroups", "deny")?;
            fs::write("/proc/self/gid_map", &groups)
        });
    }
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(refusal) => {
            println!("skipped: no mount namespace can be made here ({refusal})");
            return None;
        }
    };
    let lines: Vec<String> = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok).collect();
    let status = child.wait().unwrap();
    let last = lines.iter().find(|line| *line == "done" || line.starts_with("skipped")).cloned();
    assert!(status.success(), "{status}: {}", lines.join("\n"));
    let last = last.expect("the process says how it went");
    if last.starts_with("skipped") {
        println!("{last}");
        return None;
    }
    Some(last)
}

fn command(role: &str, root: &Path) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", role, "--nocapture", "--test-threads=1"]).env(ROLE, role).env(ROOT, root);
    command.env("RUST_BACKTRACE", "0").stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn start(role: &str, root: &Path) -> (Child, BufReader<ChildStderr>) {
    let mut child = command(role, root).spawn().unwrap();
    let told = BufReader::new(child.stderr.take().unwrap());
    (child, told)
}

fn line(from: &mut BufReader<ChildStderr>) -> String {
    let mut line = String::new();
    from.read_line(&mut line).unwrap();
    line.trim_end().to_owned()
}

fn role(mine: &str) -> Option<Tree> {
    let playing = std::env::var(ROLE).is_ok_and(|role| role == mine);
    playing.then(|| Tree::shared(Path::new(&std::env::var_os(ROOT).unwrap())).unwrap())
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
