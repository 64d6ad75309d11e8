//! Whole robots on virtual time: a tenth of each experiment's runs, held to the same figures as all of them.
#![allow(clippy::unwrap_used, reason = "tests")]

mod guard;
mod modes;
mod rangers;

use messages::{GotoGoal, MoveRequest, SetMode};
use runtime::calls::TicketState;
use sinew::experiments::rig::{OpMode, Rig, service};
use sinew::experiments::{ALL, Extent, Outcome};
use sinew::{messages, runtime};

fn run(name: &str, part: f64) -> Outcome {
    let (_, experiment) = ALL.iter().find(|(known, _)| *known == name).unwrap();
    experiment(&Extent { part, jobs: 2, robot: None }).unwrap_or_else(|e| panic!("{name}: {}", e.message))
}

fn holds(name: &str) {
    let outcome = run(name, 0.1);
    assert!(outcome.holds(), "{name}: {:#?}\n{:#?}", outcome.figures, outcome.remarks);
}

#[test]
fn goto_ends_at_every_target() {
    holds("goto");
}

#[test]
fn goto_with_avoid_leaves_a_local_minimum_and_touches_nothing() {
    let outcome = run("goto_avoid", 0.1);
    assert!(outcome.holds(), "{:#?}\n{:#?}", outcome.figures, outcome.remarks);
    assert!(outcome.value("runs with a local minimum") > 0.0, "the pocket catches nobody");
}

#[test]
fn the_same_with_the_laser_which_remembers_what_it_has_passed() {
    holds("goto_avoid_laser");
}

#[test]
fn emergency_stop_stops_before_contact_and_finishes_the_mission() {
    holds("emergency_stop");
}

#[test]
fn move_keeps_its_speed_and_its_wheel_difference() {
    holds("move");
}

#[test]
fn profiles_keep_to_their_accelerations_and_jerks() {
    holds("profiles");
}

#[test]
fn orders_that_make_no_sense_are_refused_with_the_reason_and_nothing_ever_moves() {
    // It stands before a pillar, whose middle is at (6, 3.2).
    let mut robot = service("hallway").unwrap();
    sinew::experiments::rig::configure(&mut robot, runtime::Layer::Simulator, "world", |config| {
        let body = config["bodies"].as_array_mut().unwrap()[0].as_table_mut().unwrap();
        body.insert("start".into(), vec![5.0, 3.2, 0.0].into());
    });
    let mut rig = Rig::new(&robot, 1, OpMode::PositionAvoidance).unwrap();
    let fine = GotoGoal { x_m: 4.0, y_m: 3.0, heading_rad: f64::NAN, tolerance_m: 0.0 };
    let goals = [
        (GotoGoal { x_m: f64::NAN, ..fine }, "no number"),
        (GotoGoal { y_m: f64::INFINITY, ..fine }, "no number"),
        (GotoGoal { x_m: -3.0, ..fine }, "off the map"),
        (GotoGoal { y_m: 1e300, ..fine }, "off the map"),
        (GotoGoal { heading_rad: f64::INFINITY, ..fine }, "heading"),
        (GotoGoal { tolerance_m: -1.0, ..fine }, "tolerance"),
        (GotoGoal { tolerance_m: f64::NAN, ..fine }, "tolerance"),
        (GotoGoal { x_m: 5.72, y_m: 3.2, ..fine }, "something stands at the goal"),
    ];
    let mut asked: Vec<_> =
        goals.map(|(goal, reason)| (rig.order("/actions/goto", "goto", &goal), reason)).into_iter().collect();
    let moves = [(9.0, 0.0, 1.0, "max_speed"), (f64::NAN, 0.0, 1.0, "number"), (0.1, 0.0, f64::NAN, "")];
    for (speed_m_s, wheel_difference_m_s, duration_s, reason) in moves {
        let request = MoveRequest { speed_m_s, wheel_difference_m_s, duration_s };
        asked.push((rig.order("/actions/move", "move", &request), reason));
    }
    for mode in [5, 99, u64::MAX] {
        asked.push((rig.order("/coordinator/arbiter", "set_mode", &SetMode { mode }), "no such mode"));
    }
    rig.watch(3.0);
    for (ticket, reason) in asked {
        match rig.state(ticket) {
            TicketState::Refused(refusal) => assert!(refusal.reason.contains(reason), "{reason}: {}", refusal.reason),
            other => panic!("{reason}: {other:?}"),
        }
    }
    assert!(rig.moments.iter().all(|moment| moment.truth.distance_m == 0.0));
}

#[test]
fn a_robot_without_a_mission_stands_whoever_comes_near() {
    // Somebody walks up and stands within its safe distance.
    let mut robot = service("person").unwrap();
    sinew::experiments::rig::configure(&mut robot, runtime::Layer::Simulator, "world", |config| {
        let bodies = config.get_mut("bodies").and_then(|bodies| bodies.get_mut(0)).and_then(|body| body.as_table_mut());
        bodies.unwrap().insert("start".into(), vec![5.2, 2.0, 0.0].into());
    });
    let mut rig = Rig::new(&robot, 2, OpMode::PositionAvoidance).unwrap();
    rig.watch(12.0);
    assert!(rig.moments.iter().any(|moment| moment.truth.clearance_m < 0.5), "nobody came near");
    assert!(rig.moments.iter().all(|moment| moment.truth.distance_m == 0.0));
}
