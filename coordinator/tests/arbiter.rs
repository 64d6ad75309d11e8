//! The node `arbiter` on a bench: members of the set come and go, wander emerges.
#![allow(clippy::unwrap_used, reason = "tests")]

use coordinator::arbiter::Arbiter;
use messages::{Axis, CoordinatorState, Proposal, SupervisorState, Twist};
use runtime::robot::{Leave, Limp};
use runtime::{Bench, OpenError, SUPERVISOR_STATE, Time};

fn bench(config: &str) -> Bench<Arbiter> {
    Bench::<Arbiter>::builder(config).set("proposals", "/actions/*/proposal").build().unwrap()
}

fn proposal(forward: Axis, turn: Axis) -> Proposal {
    Proposal { forward, turn, urgency: 0.5, valid_for_s: 0.3, ..Proposal::default() }
}

fn velocity(bench: &Bench<Arbiter>) -> Twist {
    bench.read::<Twist>("velocity").unwrap().1
}

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

#[test]
fn actions_on_different_axes_are_both_obeyed() {
    let mut bench = bench("");
    bench.feed_member("/actions/forward/proposal", at(1.0), &proposal(Axis::exact(0.2), Axis::NONE));
    bench.feed_member("/actions/steer_clear/proposal", at(1.0), &proposal(Axis::NONE, Axis::exact(0.5)));
    bench.step(at(1.1)).unwrap();
    assert_eq!(velocity(&bench), Twist { linear_x_m_s: 0.2, linear_y_m_s: 0.0, angular_z_rad_s: 0.5 });
    assert_eq!(bench.read::<CoordinatorState>("state").unwrap().1.proposals, 2);
}

#[test]
fn without_proposals_and_after_their_end_it_wants_zero() {
    let mut bench = bench("");
    bench.step(at(1.0)).unwrap();
    assert_eq!(velocity(&bench), Twist::default());
    bench.feed_member("/actions/forward/proposal", at(1.0), &proposal(Axis::exact(0.2), Axis::NONE));
    bench.step(at(1.1)).unwrap();
    assert_eq!(velocity(&bench).linear_x_m_s, 0.2);
    bench.step(at(1.4)).unwrap();
    assert_eq!(velocity(&bench), Twist::default());
    assert_eq!(bench.read::<CoordinatorState>("state").unwrap().1.stale, 1);
}

#[test]
fn the_mode_silences_an_action_by_its_weight_and_limits_the_speed() {
    let mut bench = bench("mode = { name = \"slow\", weights = { turner = 0.0 }, max_forward_m_s = 0.1 }");
    bench.feed_member("/actions/forward/proposal", at(1.0), &proposal(Axis::exact(0.2), Axis::NONE));
    bench.feed_member("/actions/turner/proposal", at(1.0), &proposal(Axis::NONE, Axis::exact(0.5)));
    bench.step(at(1.0)).unwrap();
    assert_eq!(velocity(&bench), Twist { linear_x_m_s: 0.1, ..Twist::default() });
}

#[test]
fn a_negative_weight_is_refused_with_its_name() {
    let built = Bench::<Arbiter>::builder("mode = { weights = { forward = -1.0 } }")
        .set("proposals", "/actions/*/proposal")
        .build();
    match built {
        Err(OpenError::Config { reason }) => assert!(reason.contains("mode.weights.forward"), "{reason}"),
        other => panic!("it was accepted: {:?}", other.map(|_| ())),
    }
}

#[test]
fn in_limp_mode_only_what_it_names_is_wished_for_and_everybodys_caps_count() {
    let limp = Limp {
        actions: vec!["steer_clear".into()],
        max_speed_m_s: 0.1,
        max_turn_rad_s: Some(0.3),
        leave: Leave::Recovered,
        after_ms: 0.0,
    };
    let mut bench = Bench::<Arbiter>::builder("").set("proposals", "/actions/*/proposal").limp(limp).build().unwrap();
    let forward = Proposal { turn: Axis::capped(0.2), ..proposal(Axis::exact(0.2), Axis::NONE) };
    bench.feed_member("/actions/forward/proposal", at(1.0), &forward);
    bench.feed_member("/actions/steer_clear/proposal", at(1.0), &proposal(Axis::exact(0.5), Axis::exact(0.5)));
    bench.feed_member(SUPERVISOR_STATE, at(1.0), &SupervisorState { limp: 1, ..SupervisorState::default() });
    bench.step(at(1.1)).unwrap();
    assert_eq!(velocity(&bench), Twist { linear_x_m_s: 0.1, linear_y_m_s: 0.0, angular_z_rad_s: 0.2 });
    bench.feed_member(SUPERVISOR_STATE, at(1.1), &SupervisorState::default());
    bench.step(at(1.2)).unwrap();
    assert_eq!(velocity(&bench).linear_x_m_s, 0.3, "the mean, within the body's limits");
}
