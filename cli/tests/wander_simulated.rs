//! The wander on virtual time: no contact, no standing still, through the narrow opening, the same bytes each time.
#![allow(clippy::unwrap_used, reason = "tests")]

use runtime::robot::{Override, Resources, Robot};
use sinew::simulation::{Run, run_all, total};

fn pioneer(world: &str) -> Robot {
    let types = sinew::built_in::node_types(&[]);
    let (_, text) = sinew::built_in::PIONEER[0];
    let resources = Resources::Embedded(sinew::built_in::PIONEER);
    let robot = Robot::parse(std::str::from_utf8(text).unwrap(), "robot.toml", resources, &types).unwrap();
    let world = Override { key: "nodes.world.config.world".into(), value: format!("\"worlds/{world}.toml\"") };
    robot.with_overrides(&[world], &types).unwrap()
}

fn runs(world: &str, seeds: std::ops::Range<u64>, seconds: f64, jobs: usize) -> Vec<Run> {
    run_all(&pioneer(world), seeds, seconds, jobs, &|_| None, &|_| {}).unwrap()
}

#[test]
fn twenty_robots_wander_through_the_office_without_causing_a_contact() {
    let runs = runs("office", 0..20, 120.0, 2);
    let all = total(&runs, 120.0);
    assert_eq!(all.contacts_caused, 0, "{runs:#?}");
    assert!(all.mean_speed_m_s >= 0.15, "{} m/s", all.mean_speed_m_s);
    assert!(all.distance_m > 20.0 * 5.0, "{} m", all.distance_m);
}

#[test]
fn the_robot_passes_an_opening_of_half_a_metre() {
    let runs = runs("opening", 0..10, 120.0, 2);
    assert_eq!(total(&runs, 120.0).contacts_caused, 0);
    // The wall with the opening stands at x = 4 m; the robot starts at 1.2 m.
    let passed = runs.iter().filter(|run| run.track.iter().any(|point| point.truth.x_m > 4.6)).count();
    assert!(passed >= 8, "{passed} of 10 passed");
}

#[test]
fn the_same_seed_gives_the_same_bytes_twice_and_on_any_number_of_threads() {
    let hashes = |jobs: usize| -> Vec<String> {
        runs("office", 3..7, 30.0, jobs).into_iter().map(|run| run.result.hash).collect()
    };
    let once = hashes(1);
    assert_eq!(once, hashes(1));
    assert_eq!(once, hashes(2));
    let mut different = once.clone();
    different.dedup();
    assert_eq!(different.len(), 4, "every seed is a run of its own");
}
