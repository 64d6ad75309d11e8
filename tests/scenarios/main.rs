//! Whole robots on virtual time: a tenth of each experiment's runs, held to the same figures as all of them.
#![allow(clippy::unwrap_used, reason = "tests")]

use sinew::experiments::{ALL, Extent, Outcome};

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
