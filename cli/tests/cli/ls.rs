//! `sinew ls`.

use crate::place::{Channel, Place};
use messages::{Odometry, Ranges, Twist};
use runtime::clock;

#[test]
fn channels_are_listed_in_flow_order_with_rate_and_writer() {
    let place = Place::new("ls-list");
    let tree = place.tree("pioneer");
    let mut odometry = Channel::make::<Odometry>(&tree, "/drivers/base/odometry", 16, 0);
    let _velocity = Channel::make::<Twist>(&tree, "/coordinator/arbiter/velocity", 16, 0);
    let now = clock::now().nanos();
    (0..10).for_each(|k| odometry.write(now - 100_000_000 * (9 - k), &Odometry::default(), &[]));
    let said = place.sinew(&["ls"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let lines: Vec<&str> = said.out.lines().collect();
    assert!(lines[0].starts_with("PATH") && lines.len() == 3, "{said:?}");
    assert!(lines[1].contains("/drivers/base/odometry") && lines[1].contains("10.0 Hz"), "{said:?}");
    assert!(lines[1].contains(&std::process::id().to_string()), "{said:?}");
    assert!(lines[2].contains("/coordinator/arbiter/velocity") && lines[2].contains("no sample"), "{said:?}");
}

#[test]
fn json_tells_what_the_table_tells() {
    let place = Place::new("ls-json");
    let mut sonar = Channel::make::<Ranges>(&place.tree("pioneer"), "/drivers/base/sonar", 8, 4);
    let now = clock::now().nanos();
    (0..20).for_each(|k| sonar.write(now + k * 50_000_000, &Ranges::default(), &[]));
    let said = place.sinew(&["ls", "--json"]);
    let value = &said.json()[0];
    let channel = &value["channels"][0];
    assert_eq!((value["robot"].as_str(), value["running"].as_bool()), (Some("pioneer"), Some(true)), "{said:?}");
    assert_eq!((channel["path"].as_str(), channel["type"].as_str()), (Some("/drivers/base/sonar"), Some("Ranges")));
    assert_eq!(
        (channel["samples"].as_u64(), channel["held"].as_u64(), channel["depth"].as_u64()),
        (Some(20), Some(8), Some(8))
    );
    assert_eq!((channel["rate_hz"].as_f64(), channel["writer_alive"].as_bool()), (Some(20.0), Some(true)), "{channel}");
}

#[test]
fn a_pattern_chooses_and_one_that_fits_nothing_says_so() {
    let place = Place::new("ls-pattern");
    let tree = place.tree("pioneer");
    let _a = Channel::make::<Twist>(&tree, "/actions/forward/proposal", 4, 0);
    let _b = Channel::make::<Twist>(&tree, "/actions/steer/proposal", 4, 0);
    let _c = Channel::make::<Twist>(&tree, "/motion/drive/command", 4, 0);
    assert_eq!(
        place.sinew(&["ls", "/actions/*/proposal", "--json"]).json()[0]["channels"].as_array().unwrap().len(),
        2
    );
    assert_eq!(place.sinew(&["ls", "drive", "--json"]).json()[0]["channels"].as_array().unwrap().len(), 1);
    let said = place.sinew(&["ls", "/tasks"]);
    assert_eq!(said.code, Some(3), "{said:?}");
    assert!(said.err.contains("no channel like /tasks"), "{said:?}");
}

#[test]
fn a_robot_whose_writers_are_gone_does_not_run_but_can_still_be_looked_at() {
    let place = Place::new("ls-dead");
    let mut twist = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 4, 0);
    twist.write(1, &Twist::default(), &[]);
    drop(twist);
    let said = place.sinew(&["ls"]);
    assert_eq!(said.code, Some(3), "{said:?}");
    assert!(said.err.contains("no robot is running: start one with `sinew run`"), "{said:?}");
    assert!(said.err.contains("of pioneer there are leftovers"), "{said:?}");
    let said = place.sinew(&["ls", "--robot", "pioneer"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains("/motion/drive/command"), "{said:?}");
}

#[test]
fn without_a_robot_every_reading_command_says_how_to_start_one() {
    let place = Place::new("ls-none");
    for arguments in
        [&["ls"][..], &["cat", "/drivers/base/sonar"], &["hz", "sonar"], &["call", "base"], &["down"], &["logs"]]
    {
        let said = place.sinew(arguments);
        assert_eq!(said.code, Some(3), "{arguments:?} {said:?}");
        assert_eq!(said.err, "error: no robot is running: start one with `sinew run`\n", "{arguments:?}");
        assert_eq!(said.out, "");
    }
}

#[test]
fn of_several_robots_one_must_be_named() {
    let place = Place::new("ls-several");
    let _a = Channel::make::<Twist>(&place.tree("ann"), "/motion/drive/command", 4, 0);
    let _b = Channel::make::<Twist>(&place.tree("bob"), "/motion/drive/command", 4, 0);
    let said = place.sinew(&["ls"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("several robots are running: ann, bob; say which with --robot NAME"), "{said:?}");
    assert_eq!(place.sinew(&["ls", "--robot", "bob", "--json"]).json()[0]["robot"], "bob");
    let said = place.sinew(&["ls", "--robot", "bobb"]);
    assert_eq!(said.code, Some(3), "{said:?}");
    assert!(said.err.contains("did you mean \"bob\"?"), "{said:?}");
}

#[test]
fn a_file_that_is_no_channel_is_passed_over() {
    let place = Place::new("ls-foreign");
    let _twist = Channel::make::<Twist>(&place.tree("pioneer"), "/motion/drive/command", 4, 0);
    std::fs::write(place.root.join("pioneer/motion/drive/rubbish"), "no channel at all").unwrap();
    let said = place.sinew(&["ls"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains("/motion/drive/command") && !said.out.contains("rubbish"), "{said:?}");
    let said = place.sinew(&["cat", "/motion/drive/rubbish", "--once"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("is no channel that this program can read"), "{said:?}");
}
