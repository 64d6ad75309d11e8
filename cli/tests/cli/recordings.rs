//! Recordings as people make and use them: of a channel, of damaged files, played.

use crate::place::{Channel, Place, Said};
use messages::Odometry;
use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};

struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Ends {
    /// Asks it to end, and waits until it has.
    fn end(&mut self) {
        let pid = rustix::process::Pid::from_child(&self.0);
        rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
        assert!(self.0.wait().unwrap().success());
    }
}

/// Records a channel on which `count` samples come, 10 ms apart by their stamps.
fn recording(place: &Place, count: u64) -> String {
    let file = place.root.join("run.mcap").display().to_string();
    let mut recorder = begin(place, &file, count);
    recorder.end();
    file
}

/// The recorder that has such samples to write.
fn begin(place: &Place, file: &str, count: u64) -> Ends {
    let tree = place.tree("rover");
    let mut odometry = Channel::make::<Odometry>(&tree, "/drivers/base/odometry", 1024, 0);
    odometry.write(0, &Odometry::default(), &[]);
    let mut recorder = place.command(&["record", "rover", "-o", file]);
    let mut recorder = Ends(recorder.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap());
    let mut said = String::new();
    BufReader::new(recorder.0.stderr.take().unwrap()).read_line(&mut said).unwrap();
    assert!(said.contains("recording robot \"rover\""), "{said}");
    for n in 1..count {
        odometry.write(n * 10_000_000, &Odometry { x_m: n as f64, ..Odometry::default() }, &[]);
    }
    recorder
}

#[test]
fn what_was_recorded_a_moment_ago_outlives_a_recorder_that_is_killed() {
    let place = Place::new("record-kill");
    let file = place.root.join("run.mcap").display().to_string();
    let mut recorder = begin(&place, &file, 300);
    let saved = || {
        let saved = place.root.join("saved.mcap");
        let _ = std::fs::remove_file(&saved);
        let said = place.sinew(&["recover", &file, "-o", saved.to_str().unwrap(), "--json"]);
        said.json()[0]["messages"].as_u64().unwrap()
    };
    // Each sample and its copy for ROS 2: they come to the disk while the recorder lives, within a second.
    while saved() < 600 {
        std::thread::yield_now();
    }
    recorder.0.kill().unwrap();
    recorder.0.wait().unwrap();
    assert_eq!(saved(), 600);
    let told = place.sinew(&["info", &file]);
    assert!(told.code == Some(4) && told.out.contains("300") && told.err.contains("is cut off"), "{told:?}");
}

#[test]
fn a_running_robot_is_recorded_until_somebody_ends_it() {
    let place = Place::new("record");
    let file = recording(&place, 300);
    let told = place.sinew(&["info", &file, "--json"]);
    assert_eq!(told.code, Some(0), "{told:?}");
    let told = &told.json()[0];
    assert_eq!(
        (told["robot"].as_str(), told["missing"].as_u64(), told["lost"].as_u64()),
        (Some("rover"), Some(0), Some(0))
    );
    let topic = &told["topics"][0];
    assert_eq!((topic["topic"].as_str(), topic["count"].as_u64()), (Some("/drivers/base/odometry"), Some(300)));
    let said = place.sinew(&["info", &file]);
    assert!(said.out.contains("/ros/drivers/base/odometry") && said.out.contains("nav_msgs/msg/Odometry"), "{said:?}");
    // A recording replaces nothing.
    let _channel = Channel::make::<Odometry>(&place.tree("rover"), "/drivers/base/other", 4, 0);
    let said = place.sinew(&["record", "rover", "-o", &file, "--for", "1s"]);
    assert!(said.code == Some(2) && said.err.contains("is there already"), "{said:?}");
}

#[test]
fn a_played_recording_is_a_robot_to_all_who_look() {
    let place = Place::new("play");
    let file = recording(&place, 100);
    let mut player = place.command(&["play", &file, "--name", "ghost", "--loop", "--rate", "2"]);
    let mut player = Ends(player.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap());
    let mut said = String::new();
    BufReader::new(player.0.stderr.take().unwrap()).read_line(&mut said).unwrap();
    assert!(said.contains("playing as robot \"ghost\""), "{said}");
    let listed = place.sinew(&["ls", "--robot", "ghost", "--json"]);
    let channels = &listed.json()[0]["channels"];
    assert_eq!(channels[0]["path"].as_str(), Some("/drivers/base/odometry"), "{listed:?}");
    let hz = place.sinew(&["hz", "odometry", "--robot", "ghost", "--window", "0.5", "--json"]);
    // 100 Hz, played twice as fast: how evenly depends on this machine, the number of samples does not.
    assert!(hz.json()[0]["samples"].as_u64().is_some_and(|samples| samples > 20), "{hz:?}");
    let taken = place.sinew(&["play", &file, "--name", "ghost"]);
    assert!(taken.code == Some(1) && taken.err.contains("--name"), "{taken:?}");
    player.end();
    assert!(!place.root.join("ghost").exists(), "nothing is left of it");
}

#[test]
fn playing_begins_and_ends_where_it_is_told_to() {
    let place = Place::new("play-from");
    let file = recording(&place, 200);
    let played = |arguments: &[&str]| {
        let mut all = vec!["play", file.as_str(), "--name", "ghost", "--rate", "1000", "--json"];
        all.extend(arguments);
        place.sinew(&all).json()[0]["samples"].as_u64()
    };
    assert_eq!(played(&[]), Some(200));
    assert_eq!(played(&["--from", "1s"]), Some(100));
    assert_eq!(played(&["--from", "0.5s", "--for", "0.5s"]), Some(51));
    let said = place.sinew(&["play", &file, "--name", "ghost", "--from", "5s"]);
    assert!(said.code == Some(1) && said.err.contains("holds no sample from 5 s on"), "{said:?}");
    let said = place.sinew(&["play", &file, "--rate", "0"]);
    assert_eq!(said.code, Some(2), "{said:?}");
}

#[test]
fn whoever_watches_a_played_recording_can_stop_it_go_elsewhere_and_change_its_rate() {
    let place = Place::new("play-commands");
    let file = recording(&place, 200);
    let mut command = place.command(&["play", &file, "--name", "ghost", "--rate", "0.001", "--commands", "--json"]);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut player = command.spawn().unwrap();
    // So slow that the second sample would come after ten seconds, and the last after half an hour.
    let lines = "pause\nfly\nseek 1s\nskip 0.4s\nrate 1000\ngo\n";
    std::io::Write::write_all(&mut player.stdin.take().unwrap(), lines.as_bytes()).unwrap();
    let said = Said::of(player.wait_with_output().unwrap());
    let samples = said.json()[0]["samples"].as_u64().unwrap();
    // From 1.4 s on; the first sample too, where it came before the first line was read.
    assert!(said.code == Some(0) && (60..=61).contains(&samples), "{said:?}");
    assert!(said.err.contains("fly: write pause, go, rate 2"), "{said:?}");
}

#[test]
fn a_file_that_is_cut_off_is_told_refused_and_recovered() {
    let place = Place::new("recover");
    let file = recording(&place, 500);
    let bytes = std::fs::read(&file).unwrap();
    let cut = place.root.join("cut.mcap").display().to_string();
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let told = place.sinew(&["info", &cut]);
    assert!(told.code == Some(4) && told.err.contains("sinew recover"), "{told:?}");
    let said = place.sinew(&["play", &cut, "--name", "ghost"]);
    assert!(said.code == Some(1) && said.err.contains("is cut off at byte"), "{said:?}");
    let saved = place.root.join("saved.mcap").display().to_string();
    let said = place.sinew(&["recover", &cut, "-o", &saved, "--json"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(place.sinew(&["info", &saved]).code, Some(0));
    let said = place.sinew(&["recover", &cut, "-o", &saved]);
    assert!(said.code == Some(1) && said.err.contains("is there already"), "{said:?}");
}

#[test]
fn what_cannot_be_recorded_or_replayed_has_its_word() {
    let place = Place::new("record-wrong");
    std::fs::create_dir_all(&place.root).unwrap();
    let text = place.root.join("text").display().to_string();
    std::fs::write(&text, "no recording").unwrap();
    let (empty, nowhere) = (place.root.join("empty"), place.root.join("nowhere"));
    std::fs::write(&empty, "").unwrap();
    for (arguments, code, words) in [
        (vec!["record"], 3, "no robot"),
        (vec!["record", "--paths", "drivers"], 2, "begins with a slash"),
        (vec!["record", "--for", "soon"], 2, "soon"),
        (vec!["info", &text], 1, "is no recording"),
        (vec!["info", empty.to_str().unwrap()], 1, "is empty"),
        (vec!["replay", nowhere.to_str().unwrap()], 1, "cannot read"),
        (vec!["play", &text], 1, "is no recording"),
    ] {
        let said = place.sinew(&arguments);
        assert!(said.code == Some(code) && said.err.to_lowercase().contains(words), "{arguments:?}: {said:?}");
        assert_eq!(said.err.matches("error:").count(), 1, "{said:?}");
    }
}

/// What is no recording, or none of ours, or a damaged one, and what each command says of it.
#[test]
fn files_that_are_no_whole_recording_are_told_by_what_they_are() {
    let place = Place::new("record-table");
    std::fs::create_dir_all(&place.root).unwrap();
    let run = place.root.join("run.mcap");
    let said = place.sinew(&["simulate", "--seeds", "7..8", "--for", "3s", "--record", run.to_str().unwrap()]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let whole = std::fs::read(run).unwrap();
    let at = |pattern: &[u8]| whole.windows(pattern.len()).position(|bytes| bytes == pattern).unwrap();
    let changed = |at: usize, to: &[u8]| [&whole[..at], to, &whole[at + to.len()..]].concat();
    let (metadata, format) = (at(b"\x05\0\0\0sinew"), at(b"format\x01\0\0\x001"));
    // Behind the name of its compression, and the length, the first chunk holds channels and samples.
    let chunk = at(b"\x03\0\0\0lz4") + 100;
    // Of each: its name, its bytes, what is said of it, and whether `recover` finds something to save.
    let cases: [(&str, Vec<u8>, &str, bool); 8] = [
        ("empty", Vec::new(), "is empty: nothing was recorded in it", false),
        ("text", b"dear robot".to_vec(), "is no recording: it does not begin as an MCAP file does", false),
        ("stub", whole[..4].to_vec(), "is cut off at byte 0", false),
        ("foreign", changed(metadata + 4, b"other"), "is an MCAP file, but not of Sinew (sinew 0", true),
        (
            "newer",
            changed(format + 10, b"7"),
            "has format 7, this program knows up to 1: read it with a newer sinew",
            true,
        ),
        ("cut", whole[..whole.len() * 2 / 3].to_vec(), "is cut off at byte", true),
        ("damaged", changed(chunk, &[0x55; 64]), "is damaged at byte", true),
        ("footless", whole[..whole.len() - 1].to_vec(), "is cut off at byte", true),
    ];
    for (name, bytes, words, saves) in cases {
        let file = place.root.join(format!("{name}.mcap"));
        std::fs::write(&file, bytes).unwrap();
        let (file, saved) = (file.to_str().unwrap(), place.root.join(format!("{name}-saved.mcap")));
        for command in [&["info", file][..], &["play", file, "--name", "ghost"], &["replay", file]] {
            let said = place.sinew(command);
            // What can be told of a damaged file is told; then comes what is wrong, by another exit code.
            let told = command[0] == "info" && ["cut", "damaged", "footless"].contains(&name);
            assert_eq!(said.code, Some(if told { 4 } else { 1 }), "{command:?}: {said:?}");
            assert!(said.err.contains(words) && said.err.contains(file), "{command:?}: {said:?}");
            assert_eq!(said.err.matches("error:").count(), 1, "{command:?}: {said:?}");
            assert!(!place.root.join("ghost").exists(), "{command:?} left a robot");
        }
        let said = place.sinew(&["recover", file, "-o", saved.to_str().unwrap()]);
        assert_eq!((said.code, saved.exists()), if saves { (Some(0), true) } else { (Some(1), false) }, "{said:?}");
    }
}
