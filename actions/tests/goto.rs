//! The node `goto` on a bench: orders by call, and what it proposes.
#![allow(clippy::unwrap_used, reason = "tests")]

use actions::goto::Goto;
use messages::{
    Axis, Beam, Done, Echo, GotoGoal, GotoPath, GotoProgress, GotoResult, Message, Odometry, Proposal, Ranges, Trigger,
    VIA_POINTS, bytemuck,
};
use runtime::calls::{Ticket, TicketState};
use runtime::{Bench, OpenError, Time};

const RANGES: Ranges = Ranges { min_range_m: 0.02, max_range_m: 8.0, beam_width_rad: 0.0, span_s: 0.0 };

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

fn goal(x_m: f64, y_m: f64) -> GotoGoal {
    GotoGoal { x_m, y_m, heading_rad: f64::NAN, tolerance_m: 0.0 }
}

fn pose(x_m: f64, y_m: f64, heading_rad: f64) -> Odometry {
    Odometry { x_m, y_m, heading_rad, ..Odometry::default() }
}

/// A bench that knows where the body is.
fn bench(config: &str) -> Bench<Goto> {
    let mut bench = Bench::<Goto>::builder(config).build().unwrap();
    bench.feed("pose", at(1.0), &pose(0.0, 0.0, 0.0), &[]);
    bench.step(at(1.0)).unwrap();
    bench
}

/// Gives an order and lets it be seen.
fn order<M: Message>(bench: &mut Bench<Goto>, command: &str, message: &M) -> Ticket {
    let ticket = bench.call(command, message);
    bench.step(at(1.02)).unwrap();
    ticket
}

fn proposal(bench: &Bench<Goto>) -> Option<(Time, Proposal)> {
    bench.read::<Proposal>("proposal").map(|(stamp, proposal, _)| (stamp, proposal))
}

fn reason(state: TicketState) -> String {
    match state {
        TicketState::Refused(refusal) | TicketState::Failed(refusal) => refusal.reason,
        other => panic!("neither refused nor failed: {other:?}"),
    }
}

#[test]
fn it_drives_to_the_goal_tells_how_far_it_is_and_ends_with_the_result() {
    let mut bench = bench("");
    let ticket = order(&mut bench, "goto", &goal(2.0, 0.0));
    let (_, proposal_far) = proposal(&bench).unwrap();
    assert_eq!(proposal_far.forward, Axis::exact(0.5));
    assert_eq!(proposal_far.turn, Axis::exact(0.0));
    match bench.call_state(ticket) {
        TicketState::Running(Some(body)) => {
            let progress: &GotoProgress = bytemuck::from_bytes(&body);
            assert_eq!((progress.goal_x_m, progress.distance_m, progress.orders), (2.0, 2.0, 1));
        }
        other => panic!("{other:?}"),
    }
    bench.feed("pose", at(6.0), &pose(1.99, 0.0, 0.3), &[]);
    bench.step(at(6.0)).unwrap();
    match bench.call_state(ticket) {
        TicketState::Answered(body) => {
            let result: &GotoResult = bytemuck::from_bytes(&body);
            assert!((result.distance_m - 0.01).abs() < 1e-9 && (result.way_m - 1.99).abs() < 1e-9, "{result:?}");
        }
        other => panic!("{other:?}"),
    }
    let (stamp, rest) = proposal(&bench).unwrap();
    assert_eq!((stamp, rest.forward, rest.turn), (at(6.0), Axis::NONE, Axis::NONE), "the last proposal is taken back");
    bench.step(at(6.1)).unwrap();
    assert_eq!(proposal(&bench).unwrap().0, at(6.0), "an idle goto writes nothing");
}

#[test]
fn without_an_order_it_proposes_nothing() {
    let bench = bench("");
    assert!(proposal(&bench).is_none());
}

#[test]
fn goals_that_cannot_be_are_refused_and_nothing_moves() {
    let mut bench = bench("bounds_m = [-1.0, -1.0, 5.0, 5.0]");
    let mut refusal = |goal: GotoGoal| {
        let ticket = order(&mut bench, "goto", &goal);
        reason(bench.call_state(ticket))
    };
    assert!(refusal(goal(f64::NAN, 0.0)).contains("no number"));
    assert!(refusal(goal(9.0, 0.0)).contains("off the map"));
    let path = GotoPath { points_m: [[0.0; 2]; VIA_POINTS], count: 0, heading_rad: f64::NAN, tolerance_m: 0.0 };
    let ticket = order(&mut bench, "follow", &path);
    assert!(reason(bench.call_state(ticket)).contains("no points"));
    assert!(proposal(&bench).is_none());
}

#[test]
fn a_goal_on_which_something_stands_is_refused() {
    let mut bench = bench("");
    let beam = Beam { range_m: 2.1, echo: Echo::Value as u32, ..Beam::default() };
    bench.feed("ranges", at(1.0), &RANGES, &[beam]);
    let ticket = order(&mut bench, "goto", &goal(2.0, 0.0));
    assert!(reason(bench.call_state(ticket)).contains("something stands at the goal"));
    let ticket = order(&mut bench, "goto", &goal(1.7, 0.0));
    assert!(matches!(bench.call_state(ticket), TicketState::Running(_)), "0.4 m before it there is room");
}

#[test]
fn an_order_without_a_pose_is_refused() {
    let mut bench = Bench::<Goto>::new().unwrap();
    bench.step(at(1.0)).unwrap();
    let ticket = order(&mut bench, "goto", &goal(2.0, 0.0));
    assert!(reason(bench.call_state(ticket)).contains("no pose"));
}

#[test]
fn a_newer_order_takes_the_place_of_an_older_one() {
    let mut bench = bench("");
    let first = order(&mut bench, "goto", &goal(2.0, 0.0));
    let second = order(&mut bench, "goto", &goal(0.0, 2.0));
    assert!(reason(bench.call_state(first)).contains("newer order"));
    assert!(matches!(bench.call_state(second), TicketState::Running(_)));
    assert!(proposal(&bench).unwrap().1.turn.value > 0.0);
}

#[test]
fn a_goal_that_was_sent_is_pursued_until_somebody_cancels() {
    let mut bench = bench("");
    let sent = order(&mut bench, "send", &goal(2.0, 0.0));
    assert!(matches!(bench.call_state(sent), TicketState::Answered(body) if body.len() == size_of::<Done>()));
    bench.step(at(1.1)).unwrap();
    assert_eq!(proposal(&bench).unwrap().1.forward, Axis::exact(0.5));
    order(&mut bench, "cancel", &Trigger::default());
    assert_eq!(proposal(&bench).unwrap().1.forward, Axis::NONE);
}

#[test]
fn an_order_ends_when_the_map_frame_is_moved_under_it() {
    let mut bench = bench("");
    let ticket = order(&mut bench, "goto", &goal(2.0, 0.0));
    bench.feed("pose", at(1.1), &Odometry { origin: 1, ..pose(0.1, 0.0, 0.0) }, &[]);
    bench.step(at(1.1)).unwrap();
    assert!(reason(bench.call_state(ticket)).contains("map frame was moved"));
    assert_eq!(proposal(&bench).unwrap().1.forward, Axis::NONE);
}

#[test]
fn wrong_gains_are_refused_when_the_node_is_opened() {
    match Bench::<Goto>::builder("gains = { k_per_s = 9.0 }").build() {
        Err(OpenError::Config { reason }) => assert!(reason.contains("gains.k_per_s = 9"), "{reason}"),
        other => panic!("it was accepted: {:?}", other.map(|_| ())),
    }
}
