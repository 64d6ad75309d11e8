//! Files that are whole, cut off, damaged, foreign, from the future, empty.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use messages::{Message, Odometry, Ranges, bytemuck};
use recorder::info::info;
use recorder::recover::recover;
use recorder::{Facts, Item, RecordError, Recording, RecordingError, RecordingWriter, Taps};
use runtime::channel::{Claim, Geometry, RawSample, Tree};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use support::{record, robot};

fn geometry<M: Message>(depth: usize) -> Geometry {
    let schema = M::schema();
    Geometry {
        type_name: M::NAME.into(),
        layout_hash: schema.hash(),
        schema: schema.to_text(),
        fixed_bytes: size_of::<M>(),
        tail_element_bytes: if M::HAS_TAIL { size_of::<M::Tail>() } else { 0 },
        tail_capacity: if M::HAS_TAIL { 16 } else { 0 },
        depth,
    }
}

fn sample(sequence: u64, stamp_ns: u64) -> RawSample {
    RawSample { sequence, stamp_ns, generation: 1, tail_bytes: 0 }
}

/// Ten samples a second for `seconds`; the file's size after each second.
fn ten_a_second(file: &Path, seconds: u64) -> Vec<u64> {
    let mut out = RecordingWriter::create(file, &Facts::of(&robot(), 1, "live")).unwrap();
    let key = out.channel("/drivers/base/odometry", &geometry::<Odometry>(64)).unwrap();
    let mut sizes = Vec::new();
    for n in 0..seconds * 10 {
        let odometry = Odometry { x_m: n as f64, ..Odometry::default() };
        out.sample(key, &sample(n + 1, n * 100_000_000), bytemuck::bytes_of(&odometry), &[]).unwrap();
        if n % 10 == 9 {
            out.flush().unwrap();
            sizes.push(out.written_bytes());
        }
    }
    out.finish().unwrap();
    sizes
}

fn stamps(file: &Path) -> Vec<u64> {
    let mut stamps = Vec::new();
    Recording::open(file)
        .unwrap()
        .read(&mut |item| {
            if let Item::Sample { sample, .. } = item {
                stamps.push(sample.stamp_ns);
            }
        })
        .unwrap();
    stamps
}

fn copy_of(file: &Path, name: &str, change: impl FnOnce(&mut Vec<u8>)) -> PathBuf {
    let mut bytes = std::fs::read(file).unwrap();
    change(&mut bytes);
    let other = file.with_file_name(name);
    std::fs::write(&other, bytes).unwrap();
    other
}

#[test]
fn a_file_that_is_cut_at_any_byte_keeps_all_but_its_last_second() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let sizes = ten_a_second(&file, 4);
    let whole = std::fs::read(&file).unwrap();
    let (cut, saved) = (folder.path().join("cut.mcap"), folder.path().join("saved.mcap"));
    // Every byte near the ends of chunks and of the file, and every 37th between.
    let near = |at: usize| sizes.iter().any(|size| at.abs_diff(*size as usize) < 12) || whole.len() - at < 64;
    let first_chunk = sizes[0] as usize;
    for at in (0..whole.len()).filter(|at| at % 37 == 0 || near(*at)) {
        std::fs::write(&cut, &whole[..at]).unwrap();
        let _ = std::fs::remove_file(&saved);
        let seconds = sizes.iter().filter(|size| **size <= at as u64).count();
        match recover(&cut, &saved) {
            Ok(recovered) => {
                assert!(recovered.messages >= 20 * seconds as u64, "cut at {at}: {recovered:?}");
                assert!(recovered.damage.is_some(), "cut at {at}: {recovered:?}");
            }
            Err(e) => assert!(at < mcap::MAGIC.len(), "cut at {at}: {e}"),
        }
        if at >= first_chunk {
            let saved = stamps(&saved);
            let expected: Vec<u64> = (0..saved.len() as u64).map(|n| n * 100_000_000).collect();
            assert_eq!(saved, expected, "cut at {at}: a beginning of what was recorded");
            assert!(saved.len() >= 10 * seconds, "cut at {at}");
            let told = info(&cut).unwrap();
            assert!(told.damage.unwrap().contains("sinew recover"));
        }
    }
}

#[test]
fn a_damaged_chunk_is_left_out_and_the_others_are_saved() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let sizes = ten_a_second(&file, 4);
    let middle = ((sizes[1] + sizes[2]) / 2) as usize;
    let damaged = copy_of(&file, "damaged.mcap", |bytes| bytes[middle] ^= 0xff);
    let recovered = recover(&damaged, &folder.path().join("saved.mcap")).unwrap();
    assert_eq!(recovered.damaged_chunks, 1, "{recovered:?}");
    assert_eq!(stamps(&recovered.file).len(), 30);
    assert!(info(&damaged).unwrap().damage.unwrap().contains("damaged at byte"));
}

#[test]
fn what_is_no_recording_is_refused_by_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let open = |file: &Path| Recording::open(file).map(drop).unwrap_err();
    assert!(matches!(open(&at("nowhere")), RecordingError::Io { .. }));
    assert!(matches!(open(folder.path()), RecordingError::Io { .. }));
    std::fs::write(at("empty"), b"").unwrap();
    assert!(matches!(open(&at("empty")), RecordingError::Empty { .. }));
    std::fs::write(at("text"), b"hello, this is no recording").unwrap();
    assert!(matches!(open(&at("text")), RecordingError::NotMcap { .. }));
    std::fs::write(at("short"), &mcap::MAGIC[..5]).unwrap();
    assert!(matches!(open(&at("short")), RecordingError::Truncated { .. }));

    let mut foreign =
        mcap::WriteOptions::new().library("a camera").create(std::fs::File::create(at("foreign")).unwrap()).unwrap();
    let channel = foreign.add_channel(0, "/picture", "json", &BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    foreign.write_to_known_channel(&header, b"{}").unwrap();
    foreign.finish().unwrap();
    let error = open(&at("foreign"));
    assert!(matches!(&error, RecordingError::Foreign { library, .. } if library == "a camera"), "{error}");

    let mut newer = mcap::Writer::new(std::fs::File::create(at("newer")).unwrap()).unwrap();
    let words = BTreeMap::from([("format".to_owned(), "2".to_owned())]);
    newer.write_metadata(&mcap::records::Metadata { name: "sinew".into(), metadata: words }).unwrap();
    newer.finish().unwrap();
    let error = open(&at("newer"));
    assert!(matches!(&error, RecordingError::Newer { format: 2, known: 1, .. }), "{error}");
    assert!(error.to_string().contains("newer sinew"));
}

#[test]
fn a_channel_without_its_schema_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let mut out = mcap::Writer::new(std::fs::File::create(&file).unwrap()).unwrap();
    let words = BTreeMap::from([("format".to_owned(), "1".to_owned())]);
    out.write_metadata(&mcap::records::Metadata { name: "sinew".into(), metadata: words }).unwrap();
    let schema = out.add_schema("sinew_msgs/msg/OdometryStamped", "ros2msg", b"float64 x").unwrap();
    let words = BTreeMap::from([("sinew.type".to_owned(), "Odometry".to_owned())]);
    out.add_channel(schema, "/drivers/base/odometry", "cdr", &words).unwrap();
    out.finish().unwrap();
    let error = Recording::open(&file).unwrap().read(&mut |_| {}).unwrap_err().to_string();
    assert!(error.contains("/drivers/base/odometry") && error.contains("sinew.schema is missing"), "{error}");
}

#[test]
fn foreign_bytes_in_any_place_are_an_error_and_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    ten_a_second(&file, 1);
    let whole = std::fs::read(&file).unwrap();
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    for _ in 0..400 {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        let place = (random % whole.len() as u64) as usize;
        let other = copy_of(&file, "other.mcap", |bytes| bytes[place] ^= (random >> 40) as u8 | 1);
        let _ = info(&other);
        let saved = folder.path().join("saved.mcap");
        let _ = std::fs::remove_file(&saved);
        let _ = recover(&other, &saved);
    }
}

#[test]
fn a_full_disk_ends_the_recording_with_a_word() {
    let mut out = match RecordingWriter::create(Path::new("/dev/full"), &Facts::of(&robot(), 1, "live")) {
        // The facts may be too much already.
        Err(e) => return assert!(matches!(e, RecordError::DiskFull { .. }), "{e}"),
        Ok(out) => out,
    };
    let key = out.channel("/drivers/base/odometry", &geometry::<Odometry>(64)).unwrap();
    let odometry = Odometry::default();
    let full = (1..10_000)
        .find_map(|n| out.sample(key, &sample(n, n * 100_000_000), bytemuck::bytes_of(&odometry), &[]).err());
    let full = full.expect("/dev/full takes nothing");
    assert!(matches!(full, RecordError::DiskFull { .. }), "{full}");
    assert!(full.to_string().contains("the robot goes on"), "{full}");
}

#[test]
fn a_recording_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    std::fs::write(&file, b"precious").unwrap();
    let error = RecordingWriter::create(&file, &Facts::default()).map(drop).unwrap_err();
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    assert_eq!(std::fs::read(&file).unwrap(), b"precious");
}

#[test]
fn samples_that_a_slow_recorder_loses_are_counted_and_missing_in_the_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let tree = Tree::local();
    let mut writer = tree.writer("/drivers/base/odometry", &geometry::<Odometry>(4), Claim::Continue).unwrap();
    let mut publish = |from: u64, to: u64| {
        for n in from..=to {
            writer.publish(n * 1_000_000, bytemuck::bytes_of(&Odometry::default()), &[]);
        }
    };
    let mut out = RecordingWriter::create(&file, &Facts::of(&robot(), 1, "live")).unwrap();
    let mut taps = Taps::new(tree.clone(), Vec::new());
    publish(1, 3);
    taps.look_around(&mut out).unwrap();
    taps.drain(&mut out).unwrap();
    publish(4, 23);
    taps.drain(&mut out).unwrap();
    let losses = taps.losses();
    out.losses(&losses).unwrap();
    out.finish().unwrap();
    let told = info(&file).unwrap();
    let topic = told.topics.iter().find(|topic| topic.topic == "/drivers/base/odometry").unwrap();
    assert_eq!(topic.count + topic.missing, 23, "{topic:?}");
    assert!(topic.missing >= 15, "{topic:?}");
    assert_eq!(
        (told.missing, told.lost, losses["/drivers/base/odometry"]),
        (topic.missing, topic.missing, topic.missing)
    );
}

#[test]
fn a_ring_that_is_made_anew_is_recorded_on() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let tree = Tree::local();
    let path = "/drivers/base/sonar";
    let mut out = RecordingWriter::create(&file, &Facts::of(&robot(), 1, "live")).unwrap();
    let mut taps = Taps::new(tree.clone(), Vec::new());
    for (round, depth) in [(0, 4), (1, 4), (2, 8)] {
        let mut writer = tree.writer(path, &geometry::<Ranges>(depth), Claim::Continue).unwrap();
        for n in 0..3 {
            writer.publish(round * 10 + n, bytemuck::bytes_of(&Ranges::default()), &[0; 48]);
        }
        taps.look_around(&mut out).unwrap();
        taps.drain(&mut out).unwrap();
        drop(writer);
        if round == 0 {
            tree.remove(path).unwrap();
        }
    }
    out.finish().unwrap();
    let told = info(&file).unwrap();
    assert_eq!(told.topics.iter().map(|topic| topic.count).sum::<u64>(), 9, "{told:#?}");
    assert_eq!(told.missing, 0, "{told:#?}");
}

#[test]
fn only_the_paths_that_are_asked_for_are_recorded() {
    let tree = Tree::local();
    let paths =
        ["/actions/forward/proposal", "/actions/goto/proposal", "/actions/goto/state", "/drivers/base/odometry"];
    for path in paths {
        tree.prepare(path, &geometry::<Odometry>(4)).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let recorded = |name: &str, wanted: &[&str]| {
        let file = folder.path().join(name);
        let mut out = RecordingWriter::create(&file, &Facts::default()).unwrap();
        let mut taps = Taps::new(tree.clone(), wanted.iter().map(|path| (*path).to_owned()).collect());
        taps.look_around(&mut out).unwrap();
        taps.channels()
    };
    assert_eq!(recorded("all", &[]), 4);
    assert_eq!(recorded("folder", &["/actions"]), 3);
    assert_eq!(recorded("pattern", &["/actions/*/proposal"]), 2);
    assert_eq!(recorded("one", &["/drivers/base/odometry", "/drivers/base/odo"]), 1);
}

#[test]
fn what_a_recording_says_about_its_run_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    std::fs::write(folder.path().join("world.toml"), b"walls = []").unwrap();
    let mut robot = robot();
    robot.resources = runtime::robot::Resources::Folder(folder.path().to_owned());
    let mut facts = Facts::of(&robot, 42, "live");
    facts.clock_offset_ns = 1_700_000_000_000_000_000;
    RecordingWriter::create(&file, &facts).unwrap().finish().unwrap();
    let recording = Recording::open(&file).unwrap();
    assert_eq!(*recording.facts(), facts);
    let again = recording.facts().robot(support::TYPES).unwrap();
    assert_eq!(again.resources.read("world.toml").unwrap(), b"walls = []");
    assert!(again.resources.read("other.toml").unwrap_err().contains("the recording holds no file"));
    assert_eq!(again.nodes.len(), 4);
}

#[test]
fn a_whole_run_is_told_with_its_counts() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, 1.0, 5, &mut |_, _, _| true);
    let told = info(&file).unwrap();
    assert_eq!((told.robot.as_str(), told.host.as_str(), told.seed, told.missing), ("toy", "simulated", 5, 0));
    assert_eq!(told.replayable, ["/drivers/adder", "/perception/mean", "/simulator/source", "/tasks/boss"]);
    assert_eq!(told.damage, None);
    let mean = told.topics.iter().find(|topic| topic.topic == "/perception/mean/mean").unwrap();
    let copy = told.topics.iter().find(|topic| topic.topic == "/ros/perception/mean/mean").unwrap();
    assert_eq!(
        (mean.ros_type.as_str(), copy.ros_type.as_str()),
        ("sinew_msgs/msg/OdometryStamped", "nav_msgs/msg/Odometry")
    );
    assert!(mean.count == copy.count && (mean.rate_hz - 50.0).abs() < 1.0, "{mean:?}");
}
