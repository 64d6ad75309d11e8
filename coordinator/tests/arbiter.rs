//! The node `arbiter` on a bench: members of the set come and go, wander emerges.
#![allow(clippy::unwrap_used, reason = "tests")]

use coordinator::arbiter::Arbiter;
use messages::{
    Axis, CoordinatorState, Detour, GotoProgress, GotoState, ModeState, Proposal, Room, SetMode, Side, Trigger, Twist,
    bytemuck,
};
use runtime::calls::TicketState;
use runtime::{Bench, OpenError, Time};

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
    let mut bench = bench("modes = [{ name = \"slow\", weights = { turner = 0.0 }, max_forward_m_s = 0.1 }]");
    bench.feed_member("/actions/forward/proposal", at(1.0), &proposal(Axis::exact(0.2), Axis::NONE));
    bench.feed_member("/actions/turner/proposal", at(1.0), &proposal(Axis::NONE, Axis::exact(0.5)));
    bench.step(at(1.0)).unwrap();
    assert_eq!(velocity(&bench), Twist { linear_x_m_s: 0.1, ..Twist::default() });
}

#[test]
fn a_negative_weight_is_refused_with_its_name() {
    let built = Bench::<Arbiter>::builder("modes = [{ weights = { forward = -1.0 } }]")
        .set("proposals", "/actions/*/proposal")
        .build();
    match built {
        Err(OpenError::Config { reason }) => assert!(reason.contains("modes[0].weights.forward"), "{reason}"),
        other => panic!("it was accepted: {:?}", other.map(|_| ())),
    }
}

/// Two of S2's modes: position control, and with avoidance.
const MODES: &str = r#"
modes = [
  { name = "position", weights = { goto = 1.0 }, other_weight = 0.0 },
  { name = "position_avoidance", algorithm = "switch_80cm", weights = { goto = 1.0, avoid = 1.0 }, other_weight = 0.0, leaves_minima = true },
]
"#;

fn feed_goto_and_avoid(bench: &mut Bench<Arbiter>, s: f64) {
    bench.feed_member("/actions/goto/proposal", at(s), &proposal(Axis::exact(0.25), Axis::exact(-0.3)));
    bench.feed_member("/actions/avoid/proposal", at(s), &proposal(Axis::exact(0.1), Axis::exact(0.6)));
}

#[test]
fn the_mode_is_set_by_call_and_counts_at_once() {
    let mut bench = bench(MODES);
    feed_goto_and_avoid(&mut bench, 1.0);
    bench.step(at(1.0)).unwrap();
    assert_eq!(velocity(&bench).angular_z_rad_s, -0.3, "mode 0 knows no avoidance");
    let ticket = bench.call("set_mode", &SetMode { mode: 1 });
    bench.step(at(1.01)).unwrap();
    assert_eq!(velocity(&bench).angular_z_rad_s, 0.6);
    assert_eq!(bench.read::<CoordinatorState>("state").unwrap().1.mode, 1);
    match bench.call_state(ticket) {
        TicketState::Answered(body) => {
            assert_eq!(*bytemuck::from_bytes::<ModeState>(&body), ModeState { mode: 1, modes: 2 });
        }
        other => panic!("{other:?}"),
    }
    let ticket = bench.call("get_mode", &Trigger::default());
    bench.step(at(1.02)).unwrap();
    assert!(matches!(bench.call_state(ticket), TicketState::Answered(_)));
}

#[test]
fn an_unknown_mode_is_refused_and_nothing_changes() {
    let mut bench = bench(MODES);
    feed_goto_and_avoid(&mut bench, 1.0);
    bench.step(at(1.0)).unwrap();
    for mode in [2, 99, u64::MAX] {
        let ticket = bench.call("set_mode", &SetMode { mode });
        bench.step(at(1.01)).unwrap();
        assert!(matches!(bench.call_state(ticket), TicketState::Refused(r) if r.reason.contains("no such mode")));
        assert_eq!(bench.read::<CoordinatorState>("state").unwrap().1.mode, 0);
        assert_eq!(velocity(&bench).angular_z_rad_s, -0.3);
    }
}

#[test]
fn avoid_takes_over_only_within_80_cm() {
    let mut bench = bench(&format!("{MODES}start_mode = \"position_avoidance\""));
    for (nearest_m, turn) in [(0.79, 0.6), (0.81, -0.3)] {
        feed_goto_and_avoid(&mut bench, 1.0);
        bench.feed("room", at(1.0), &Room { nearest_m, ..Room::default() }, &[]);
        bench.step(at(1.0)).unwrap();
        assert_eq!(velocity(&bench).angular_z_rad_s, turn, "at {nearest_m} m");
    }
}

#[test]
fn a_goal_that_comes_no_nearer_begins_a_detour_on_the_roomier_side() {
    let mut bench = bench(&format!("{MODES}start_mode = \"position_avoidance\""));
    let goal =
        GotoProgress { distance_m: 3.0, state: GotoState::Driving as u32, bearing_rad: 0.2, ..GotoProgress::default() };
    let room = Room { nearest_m: 0.6, left_m: 1.0, right_m: 2.0, ..Room::default() };
    let mut sides = Vec::new();
    for second in 0..8 {
        let now = at(f64::from(second));
        bench.feed("goal", now, &goal, &[]);
        bench.feed("room", now, &room, &[]);
        bench.step(now).unwrap();
        let (_, detour, _) = bench.read::<Detour>("detour").unwrap();
        sides.push(detour.side);
        assert!(detour.side == 0 || detour.bearing_rad == 0.2);
    }
    assert_eq!(sides, [0, 0, 0, 0, 0, Side::Right as u32, Side::Right as u32, Side::Right as u32]);
}
