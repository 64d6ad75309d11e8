//! The same policy under faults from seeds, whole robots in simulation.
#![allow(clippy::unwrap_used, reason = "tests")]

use runtime::robot::{Override, Resources, Robot};
use sinew::batch::Faults;
use sinew::built_in::{PIONEER, node_types};
use sinew::simulation::{Run, run, run_all};
use supervisor::{FaultRates, PlannedFault};

fn pioneer(changes: &[(&str, &str)]) -> Robot {
    let types = node_types(&[]);
    let text = std::str::from_utf8(PIONEER[0].1).unwrap();
    let robot = Robot::parse(text, "robots/pioneer", Resources::Embedded(PIONEER), &types).unwrap();
    let changes: Vec<Override> =
        changes.iter().map(|(key, value)| Override { key: (*key).into(), value: (*value).into() }).collect();
    robot.with_overrides(&changes, &types).unwrap()
}

fn chaos() -> Faults {
    FaultRates::CHAOS.into()
}

fn judge(run: &Run) -> bool {
    let faults = run.result.faults.as_ref().unwrap();
    run.result.contacts_caused == 0 && faults.stops_let_go == 0 && faults.moves_while_stopped == 0
}

/// 500 missions of 60 s, about a fault every two seconds each. The nightly 10,000 are `sinew simulate --seeds 0..10000
/// --for 60s --faults chaos`.
#[test]
fn no_fault_makes_the_robot_touch_anything_or_lets_an_emergency_stop_go() {
    let jobs = std::thread::available_parallelism().map_or(1, usize::from);
    let runs = run_all(&pioneer(&[]), 0..500, 60.0, Some(&chaos()), jobs, &|_| None, &|_| {}).unwrap();
    let failing: Vec<u64> = runs.iter().filter(|run| !judge(run)).map(|run| run.result.seed).collect();
    assert_eq!(failing, [] as [u64; 0], "each replays exactly: sinew simulate --seeds N..N+1 --faults chaos");
    let sum = |of: fn(&sinew::simulation::FaultResult) -> u64| {
        runs.iter().filter_map(|run| run.result.faults.as_ref()).map(of).sum::<u64>()
    };
    // The faults were there, and the robots drove all the same.
    assert!(sum(|f| f.injected[0]) > 5000 && sum(|f| f.restarts) > 5000 && sum(|f| f.limps_holds_stops[2]) > 200);
    let distance_m = runs.iter().map(|run| run.result.distance_m).sum::<f64>() / 500.0;
    assert!(distance_m > 6.0, "{distance_m} m a mission");
}

/// The control: with motion's zone out of the way the same missions do touch things, so the zero above is no accident.
#[test]
fn the_same_missions_without_a_stop_zone_do_touch_things() {
    let blind = [
        ("nodes.drive.config.horizon_m", "0.0"),
        ("nodes.steer_clear.period_ms", "1000"),
        ("nodes.steer_clear.trigger", "[]"),
    ];
    let runs = run_all(&pioneer(&blind), 0..10, 60.0, Some(&chaos()), 2, &|_| None, &|_| {}).unwrap();
    assert!(runs.iter().any(|run| run.result.contacts_caused > 0));
}

#[test]
fn a_seed_replays_exactly_and_another_one_differs() {
    let robot = pioneer(&[]);
    let once = |seed| {
        let run = run(&robot, seed, 20.0, Some(&chaos())).unwrap();
        (run.result.hash.clone(), run.result.faults.clone())
    };
    let (first, again, other) = (once(3), once(3), once(4));
    assert_eq!(first, again);
    assert_ne!(first.0, other.0);
}

#[test]
fn without_faults_the_supervised_robot_does_what_the_unsupervised_does() {
    let robot = pioneer(&[]);
    let plain = run(&robot, 5, 30.0, None).unwrap().result;
    let supervised = run(&robot, 5, 30.0, Some(&Faults::default())).unwrap().result;
    assert_eq!(plain.hash, supervised.hash);
    assert_eq!(supervised.faults.unwrap().restarts, 0);
}

#[test]
fn a_driver_that_dies_too_often_is_given_up_and_the_robot_holds() {
    let robot = pioneer(&[("nodes.base.care.restarts", "0")]);
    let rates = FaultRates { deaths: 30.0, ..FaultRates::default() };
    let faults = run(&robot, 1, 60.0, Some(&rates.into())).unwrap().result.faults.unwrap();
    assert!(faults.given_up >= 1 && faults.limps_holds_stops[1] >= 1, "{faults:?}");
}

#[test]
fn the_list_of_a_seeds_faults_does_what_its_rates_do() {
    let robot = pioneer(&[]);
    let list: Vec<PlannedFault> = chaos().of(&robot, 9, 30.0);
    let drawn = run(&robot, 9, 30.0, Some(&chaos())).unwrap().result;
    let listed = run(&robot, 9, 30.0, Some(&list.clone().into())).unwrap().result;
    assert_eq!((drawn.hash.clone(), drawn.faults), (listed.hash, listed.faults));
    // One less leaves everything before it as it was, and what it did is missed.
    let death = list.iter().position(|fault| matches!(fault, PlannedFault::Death { .. })).unwrap();
    let mut fewer = list;
    fewer.remove(death);
    let other = run(&robot, 9, 30.0, Some(&fewer.into())).unwrap().result;
    assert_ne!(other.hash, drawn.hash);
}
