//! Whole robots on virtual time: a tenth of each experiment's runs, held to the same figures as all of them.
#![allow(clippy::unwrap_used, reason = "tests")]

use messages::{GotoGoal, MoveRequest, SetMode};
use runtime::calls::TicketState;
use sinew::experiments::rig::{OpMode, Rig, service};
use sinew::experiments::{ALL, Extent, Outcome};
use sinew::{messages, runtime};

fn run(name: &str, part: f64) -> Outcome {
    let (_, experiment) = ALL.iter().find(|(known, _)| *known == name).unwrap();
    experiment(&Extent { part, jobs: 2 }).unwrap_or_else(|e| panic!("{name}: {}", e.message))
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
fn orders_that_make_no_sense_are_refused_and_nothing_ever_moves() {
    let robot = service("open").unwrap();
    let mut rig = Rig::new(&robot, 1, OpMode::PositionAvoidance).unwrap();
    let goal = |x_m: f64, y_m: f64| GotoGoal { x_m, y_m, heading_rad: f64::NAN, tolerance_m: 0.0 };
    let nan = rig.order("/actions/goto", "goto", &goal(f64::NAN, 6.0));
    let off = rig.order("/actions/goto", "goto", &goal(-3.0, 6.0));
    let heading = rig.order("/actions/goto", "goto", &GotoGoal { heading_rad: f64::INFINITY, ..goal(7.0, 6.0) });
    let fast = MoveRequest { speed_m_s: 9.0, wheel_difference_m_s: 0.0, duration_s: 1.0 };
    let fast = rig.order("/actions/move", "move", &fast);
    let mode = rig.order("/coordinator/arbiter", "set_mode", &SetMode { mode: 99 });
    rig.watch(2.0);
    let reasons =
        [(nan, "no number"), (off, "off the map"), (heading, "heading"), (fast, "max_speed"), (mode, "no such mode")];
    for (ticket, reason) in reasons {
        match rig.state(ticket) {
            TicketState::Refused(refusal) => assert!(refusal.reason.contains(reason), "{}", refusal.reason),
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
