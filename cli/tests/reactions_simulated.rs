//! Reactions in simulation: a path is really waited for, a command ends as the fault list says, and a robot that was reset
//! stands until it is resumed.
#![allow(clippy::unwrap_used, reason = "tests")]

use runtime::Time;
use runtime::robot::{Override, Resources, Robot};
use sinew::built_in::{PIONEER, node_types};
use supervisor::{PlannedFault, SupervisedHost, When};

fn pioneer(changes: &[(&str, &str)]) -> Robot {
    let types = node_types(&[]);
    let text = std::str::from_utf8(PIONEER[0].1).unwrap();
    let robot = Robot::parse(text, "robots/pioneer", Resources::Embedded(PIONEER), &types).unwrap();
    let changes: Vec<Override> =
        changes.iter().map(|(key, value)| Override { key: (*key).into(), value: (*value).into() }).collect();
    robot.with_overrides(&changes, &types).unwrap()
}

fn death(at_s: f64, node: &str) -> PlannedFault {
    PlannedFault::Death { at_s, node: node.into(), when: When::AtOnce, writes: 0 }
}

/// The highest rung on which the robot stood between two moments, looked at every hundredth of a second.
fn limps_between(robot: &Robot, faults: Vec<PlannedFault>, from_s: f64, to_s: f64) -> (bool, [u64; 2]) {
    let mut host = SupervisedHost::new(robot, 1, Time::ZERO, faults, &|_| None).unwrap();
    let mut limped = false;
    for hundredth in (from_s * 100.0) as u64..=(to_s * 100.0) as u64 {
        host.run_until(Time::from_seconds(0.01 * hundredth as f64));
        limped |= host.policy().severity() >= supervisor::Severity::Limp;
    }
    (limped, [host.chronicle().commands, host.chronicle().commands_failed])
}

/// A reaction to the death of `forward` that limps when one of its acts fails.
fn reaction(act: &str) -> Robot {
    let text = format!(
        "[{{ node = \"forward\", when = \"death\", do = [{act}], otherwise = [{{ rung = \"limp\" }}], clear = \"reset\" }}]"
    );
    pioneer(&[("supervision.reactions", &text)])
}

#[test]
fn a_path_that_comes_in_time_is_a_success_and_one_that_does_not_is_a_failure() {
    let waits = |path: &str| reaction(&format!("{{ wait_for = {{ path = \"{path}\", within_ms = 400 }} }}"));
    let dies = || vec![death(5.0, "/actions/forward")];
    assert!(!limps_between(&waits("/actions/forward/proposal"), dies(), 5.0, 8.0).0);
    // Its writer is dead for good.
    let silent = pioneer(&[
        ("nodes.steer_clear.restart", "\"never\""),
        ("nodes.steer_clear.care", "{ loss = \"warn\" }"),
        (
            "supervision.reactions",
            "[{ node = \"forward\", when = \"death\", do = [{ wait_for = { path = \"/actions/steer_clear/proposal\", \
             within_ms = 400 } }], otherwise = [{ rung = \"limp\" }], clear = \"reset\" }]",
        ),
    ]);
    let both = vec![death(4.0, "/actions/steer_clear"), death(5.0, "/actions/forward")];
    assert!(limps_between(&silent, both, 5.0, 8.0).0);
}

#[test]
fn a_command_is_counted_not_run_and_fails_only_where_a_fault_says_so() {
    let mark = std::env::temp_dir().join(format!("sinew-simulated-command-{}", std::process::id()));
    let robot = reaction(&format!("{{ execute = [\"touch\", {:?}] }}", mark.display().to_string()));
    let fails = |at_s| PlannedFault::Command { at_s, program: "touch".into(), for_s: 2.0 };
    let run = |faults| limps_between(&robot, faults, 5.0, 7.0);
    assert_eq!(run(vec![death(5.0, "/actions/forward")]), (false, [1, 0]));
    assert_eq!(run(vec![fails(1.0), death(5.0, "/actions/forward")]), (false, [1, 0]), "it was over by then");
    assert_eq!(run(vec![fails(4.0), death(5.0, "/actions/forward")]), (true, [1, 1]));
    assert!(!mark.exists());
    assert!(fails(1.0).flaw(&robot).is_none());
    assert!(fails(1.0).flaw(&pioneer(&[])).unwrap().contains("no reaction of this robot executes"));
}

#[test]
fn after_a_reset_the_robot_stands_armed_until_it_is_resumed() {
    let robot = pioneer(&[]);
    let stop = PlannedFault::Stop {
        at_s: 5.0,
        node: "/actions/forward".into(),
        gone_after_s: 1.0,
        // Nobody is impatient: the patient person comes 1.5 s after the cause has gone.
        reset_after_s: 2.5,
    };
    let mut host = SupervisedHost::new(&robot, 1, Time::ZERO, vec![stop], &|_| None).unwrap();
    let (mut reset_at, mut free_at) = (None, None);
    for hundredth in 0..1200 {
        let now_s = 0.01 * f64::from(hundredth);
        host.run_until(Time::from_seconds(now_s));
        let after = now_s > 5.1;
        if after && !host.policy().latched() && reset_at.is_none() {
            reset_at = Some(now_s);
            assert!(host.stopped_since().is_some(), "a reset lets nothing go");
        }
        if after && reset_at.is_some() && host.stopped_since().is_none() && free_at.is_none() {
            free_at = Some(now_s);
        }
    }
    let (reset_at, free_at) = (reset_at.unwrap(), free_at.unwrap());
    assert!((7.4..7.7).contains(&reset_at), "{reset_at}");
    assert!((0.15..1.1).contains(&(free_at - reset_at)), "resumed {} s after the reset", free_at - reset_at);
    assert_eq!(host.chronicle().let_go, 0);
}
