//! Recordings as people make and use them: of a channel, of damaged files, played.

use crate::place::{Channel, Place};
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
    let tree = place.tree("rover");
    let mut odometry = Channel::make::<Odometry>(&tree, "/drivers/base/odometry", 1024, 0);
    odometry.write(0, &Odometry::default(), &[]);
    let mut recorder = place.command(&["record", "rover", "-o", &file]);
    let mut recorder = Ends(recorder.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap());
    let mut said = String::new();
    BufReader::new(recorder.0.stderr.take().unwrap()).read_line(&mut said).unwrap();
    assert!(said.contains("recording robot \"rover\""), "{said}");
    for n in 1..count {
        odometry.write(n * 10_000_000, &Odometry { x_m: n as f64, ..Odometry::default() }, &[]);
    }
    recorder.end();
    file
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
