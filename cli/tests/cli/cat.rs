//! `sinew cat`.

use crate::place::{Channel, Place};
use messages::{Beam, MotionState, Odometry, Ranges, Twist};
use runtime::clock;
use std::io::{BufRead, BufReader};
use std::process::Stdio;

fn twist(x: f64) -> Twist {
    Twist { linear_x_m_s: x, ..Twist::default() }
}

#[test]
fn one_sample_is_shown_with_names_values_and_units() {
    let place = Place::new("cat-once");
    let mut sonar = Channel::make::<Ranges>(&place.tree("pioneer"), "/drivers/base/sonar", 8, 4);
    let beams = [Beam { range_m: 1.25, echo: 1, ..Beam::default() }, Beam { echo: 2, ..Beam::default() }];
    sonar.write(clock::now().nanos(), &Ranges { max_range_m: 5.0, ..Ranges::default() }, &beams);
    let said = place.sinew(&["cat", "/drivers/base/sonar", "--once"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let lines: Vec<&str> = said.out.lines().collect();
    assert!(lines[0].starts_with("/drivers/base/sonar Ranges  #1  "), "{said:?}");
    assert!(lines.iter().any(|line| line.trim_start().starts_with("max_range_m") && line.ends_with("m")), "{said:?}");
    assert!(lines.iter().any(|line| line.contains("1.2500") && line.ends_with("value")), "{said:?}");
    assert!(lines.last().unwrap().ends_with("clear"), "{said:?}");
}

#[test]
fn the_end_of_a_path_will_do_and_an_ambiguous_one_will_not() {
    let place = Place::new("cat-end");
    let tree = place.tree("pioneer");
    let mut pose = Channel::make::<Odometry>(&tree, "/perception/odometry/pose", 8, 0);
    let _a = Channel::make::<Twist>(&tree, "/drivers/base/state", 8, 0);
    let _b = Channel::make::<Twist>(&tree, "/motion/drive/state", 8, 0);
    pose.write(1, &Odometry { x_m: 2.5, ..Odometry::default() }, &[]);
    let said = place.sinew(&["cat", "pose", "--once", "--json"]);
    assert_eq!(said.json()[0]["path"], "/perception/odometry/pose", "{said:?}");
    let said = place.sinew(&["cat", "state", "--once"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("any of /drivers/base/state, /motion/drive/state"), "{said:?}");
    let said = place.sinew(&["cat", "/perception/odometry/pos", "--once"]);
    assert_eq!(said.code, Some(3), "{said:?}");
    assert!(said.err.contains("did you mean /perception/odometry/pose?"), "{said:?}");
}

#[test]
fn history_gives_the_newest_samples_oldest_first_and_ends() {
    let place = Place::new("cat-history");
    let mut channel = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 8, 0);
    (1..=20).for_each(|k| channel.write(k, &twist(k as f64), &[]));
    let said = place.sinew(&["cat", "command", "--history", "3", "--json"]);
    let numbers: Vec<_> = said.json().iter().map(|line| line["sequence"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [18, 19, 20], "{said:?}");
    // The ring holds eight: more cannot be had, and nothing was lost by this reader.
    let lines = place.sinew(&["cat", "command", "--history", "99", "--json"]).json();
    assert_eq!((lines.len(), lines[0]["sequence"].as_u64(), lines[0]["dropped"].as_u64()), (8, Some(13), Some(0)));
}

#[test]
fn fields_print_alone_for_shells() {
    let place = Place::new("cat-field");
    let mut channel = Channel::make::<MotionState>(&place.tree("pioneer"), "/motion/drive/state", 8, 0);
    channel.write(1, &MotionState { wanted: twist(0.25), stop: 3, ..MotionState::default() }, &[]);
    let said = place.sinew(&["cat", "state", "--once", "--field", "wanted.linear_x_m_s", "--field", "stop"]);
    assert_eq!(said.out, "0.25\tzone\n", "{said:?}");
    let said = place.sinew(&["cat", "state", "--once", "--field", "wanted.linear_x"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("did you mean \"linear_x_m_s\"?"), "{said:?}");
}

#[test]
fn a_stream_gives_every_sample_and_ends_when_the_channel_goes() {
    let place = Place::new("cat-stream");
    let tree = place.tree("pioneer");
    let mut channel = Channel::make::<Twist>(&tree, "/motion/drive/command", 64, 0);
    channel.write(1, &twist(1.0), &[]);
    let mut child =
        place.command(&["cat", "command", "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut next = || -> u64 {
        let line: serde_json::Value = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
        line["sequence"].as_u64().unwrap()
    };
    assert_eq!(next(), 1);
    (2..=5).for_each(|k| channel.write(k, &twist(k as f64), &[]));
    assert_eq!([next(), next(), next(), next()], [2, 3, 4, 5]);
    drop(channel);
    tree.remove("/motion/drive/command").unwrap();
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&ended.stderr).contains("is gone: the robot was stopped"), "{ended:?}");
}

#[test]
fn a_slow_reader_is_told_how_many_it_lost() {
    let place = Place::new("cat-dropped");
    let mut channel = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 4, 0);
    channel.write(1, &twist(1.0), &[]);
    let mut child = place.command(&["cat", "command", "--json"]).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut next = || -> serde_json::Value { serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap() };
    assert_eq!(next()["sequence"], 1);
    // Faster than anybody can look: the ring holds four.
    (2..=2000).for_each(|k| channel.write(k, &twist(k as f64), &[]));
    let mut last = next();
    while last["sequence"] != 2000 {
        last = next();
    }
    assert!(last["dropped"].as_u64().unwrap() > 1000, "{last}");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_reader_that_has_seen_enough_ends_the_stream_silently() {
    let place = Place::new("cat-pipe");
    let mut channel = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 64, 0);
    channel.write(1, &twist(1.0), &[]);
    let mut child =
        place.command(&["cat", "command", "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.contains("\"sequence\":1"), "{line}");
    // The pipe is closed now; samples go on until the command notices.
    while child.try_wait().unwrap().is_none() {
        channel.write(2, &twist(2.0), &[]);
        clock::sleep_s(0.005);
    }
    let ended = child.wait_with_output().unwrap();
    assert_eq!((ended.status.code(), String::from_utf8_lossy(&ended.stderr).as_ref()), (Some(0), ""));
}

#[test]
fn a_silent_channel_is_not_waited_for_without_end() {
    let place = Place::new("cat-silent");
    let _channel = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 4, 0);
    let said = place.sinew(&["cat", "command", "--once", "--timeout", "100ms"]);
    assert_eq!(said.code, Some(3), "{said:?}");
    assert!(said.err.contains("no sample on /motion/drive/command"), "{said:?}");
    assert!(said.err.contains("lives but writes nothing"), "{said:?}");
}

#[test]
fn what_is_no_path_is_refused() {
    let place = Place::new("cat-path");
    let _channel = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 4, 0);
    for wrong in ["", "a b", "/mot*/x", "../../etc/passwd\u{7}"] {
        let said = place.sinew(&["cat", wrong, "--once"]);
        assert_eq!(said.code, Some(2), "{wrong:?} {said:?}");
        assert!(said.err.contains("is no path"), "{wrong:?} {said:?}");
    }
}
