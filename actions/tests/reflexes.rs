//! The nodes `avoid`, `move` and `emergency_stop` on a bench.
#![allow(clippy::unwrap_used, reason = "tests")]

use actions::avoid::Avoid;
use actions::emergency_stop::EmergencyStop;
use actions::r#move::Move;
use messages::{
    Axis, BaseState, Beam, Detour, Echo, MoveProgress, MoveRequest, Odometry, Proposal, ProtectiveStop, Ranges, Room,
    Side, StopCause, Track, TrackMotion, TrackState, Tracks, Trigger, bytemuck,
};
use runtime::calls::TicketState;
use runtime::{Bench, Body, Time};

const LASER: Ranges = Ranges { min_range_m: 0.05, max_range_m: 8.0, beam_width_rad: 0.0, span_s: 0.0 };

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

/// A 361-beam laser that sees 5 m everywhere, but for a thing of 10° at `bearing_deg`.
fn scan(bearing_deg: f32, range_m: f32) -> Vec<Beam> {
    let beam = |k: u16| {
        let deg = 0.5 * f32::from(k) - 90.0;
        let near = (deg - bearing_deg).abs() <= 5.0;
        Beam {
            bearing_rad: deg.to_radians(),
            range_m: if near { range_m } else { 5.0 },
            echo: Echo::Value as u32,
            ..Beam::default()
        }
    };
    (0..361).map(beam).collect()
}

fn body() -> Body {
    Body { length_ahead_m: 0.25, length_behind_m: 0.25, half_width_m: 0.25, ..Body::default() }
}

#[test]
fn avoid_turns_from_what_is_near_and_abstains_when_it_is_far() {
    let mut bench = Bench::<Avoid>::builder("").body(body()).build().unwrap();
    bench.feed("ranges", at(1.0), &LASER, &scan(-10.0, 0.6));
    bench.step(at(1.0)).unwrap();
    let near = bench.read::<Proposal>("proposal").unwrap().1;
    assert!(near.turn.value > 0.2 && near.forward.value >= 0.0 && near.forward.value < 0.3, "{near:?}");
    let room = bench.read::<Room>("room").unwrap().1;
    assert!((room.nearest_m - 0.6).abs() < 1e-3 && room.side == Side::Left as u32 && room.active == 1);
    bench.feed("ranges", at(1.1), &LASER, &scan(-10.0, 2.0));
    bench.step(at(1.1)).unwrap();
    assert_eq!(bench.read::<Proposal>("proposal").unwrap().1.turn, Axis::NONE);
    bench.step(at(3.0)).unwrap();
    assert_eq!(bench.read::<Proposal>("proposal").unwrap().1.forward, Axis::NONE, "old ranges count for nothing");
}

#[test]
fn avoid_counts_a_walker_where_it_will_be() {
    let mut bench = Bench::<Avoid>::builder("").body(body()).build().unwrap();
    let moving = Track {
        state: TrackState::Confirmed as u32,
        motion: TrackMotion::Moving as u32,
        path_x_m: [0.9, 0.8, 0.7, 0.7],
        path_y_m: [-0.9, -0.4, -0.1, 0.4],
        radius_m: 0.2,
        ..Track::default()
    };
    bench.feed("ranges", at(1.0), &LASER, &scan(-60.0, 1.5));
    bench.step(at(1.0)).unwrap();
    assert_eq!(bench.read::<Room>("room").unwrap().1.active, 0);
    bench.feed("tracks", at(1.0), &Tracks { path_step_s: 0.3, ..Tracks::default() }, &[moving]);
    bench.step(at(1.02)).unwrap();
    let room = bench.read::<Room>("room").unwrap().1;
    assert_eq!((room.active, room.side), (1, Side::Left as u32), "it will be ahead, a little to the right");
    let still = Track { motion: TrackMotion::Still as u32, ..moving };
    bench.feed("tracks", at(1.1), &Tracks { path_step_s: 0.3, ..Tracks::default() }, &[still]);
    bench.step(at(1.1)).unwrap();
    assert_eq!(bench.read::<Room>("room").unwrap().1.active, 0, "what stands is in the ranges already");
}

#[test]
fn avoid_goes_around_on_the_side_that_the_coordinator_says() {
    let mut bench = Bench::<Avoid>::builder("").body(body()).build().unwrap();
    for (side, sign) in [(Side::Left, 1.0), (Side::Right, -1.0)] {
        bench.feed("ranges", at(1.0), &LASER, &scan(0.0, 0.7));
        bench.feed("detour", at(1.0), &Detour { side: side as u32, ..Detour::default() }, &[]);
        bench.step(at(1.0)).unwrap();
        let turn = bench.read::<Proposal>("proposal").unwrap().1.turn.value;
        assert!(turn * sign > 0.1, "{side:?}: {turn}");
    }
}

#[test]
fn move_drives_for_the_time_that_was_ordered_and_tells_how_far_it_came() {
    let mut bench = Bench::<Move>::new().unwrap();
    bench.step(at(1.0)).unwrap();
    let ticket = bench.call("move", &MoveRequest { speed_m_s: 0.3, wheel_difference_m_s: -0.1, duration_s: 5.0 });
    bench.feed("pose", at(1.0), &Odometry::default(), &[]);
    bench.step(at(1.02)).unwrap();
    let proposal = bench.read::<Proposal>("proposal").unwrap().1;
    assert_eq!((proposal.forward, proposal.turn), (Axis::exact(0.3), Axis::exact(-0.25)));
    bench.feed("pose", at(6.0), &Odometry { x_m: 1.4, heading_rad: -1.1, ..Odometry::default() }, &[]);
    bench.step(at(6.02)).unwrap();
    match bench.call_state(ticket) {
        TicketState::Answered(body) => {
            let end: &MoveProgress = bytemuck::from_bytes(&body);
            assert!((end.way_m - 1.4).abs() < 1e-9 && (end.turned_rad + 1.1).abs() < 1e-9, "{end:?}");
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(bench.read::<Proposal>("proposal").unwrap().1.forward, Axis::NONE);
}

#[test]
fn move_refuses_what_is_no_number_and_nothing_moves() {
    let mut bench = Bench::<Move>::new().unwrap();
    bench.step(at(1.0)).unwrap();
    let ticket = bench.call("move", &MoveRequest { speed_m_s: f64::NAN, wheel_difference_m_s: 0.0, duration_s: 5.0 });
    bench.step(at(1.1)).unwrap();
    assert!(matches!(bench.call_state(ticket), TicketState::Refused(r) if r.reason.contains("no number")));
    assert!(bench.read::<Proposal>("proposal").is_none());
}

#[test]
fn a_protective_stop_waits_and_lets_go_by_itself() {
    let mut bench = Bench::<EmergencyStop>::builder("").body(body()).build().unwrap();
    let cause = |bench: &Bench<EmergencyStop>| bench.read::<ProtectiveStop>("state").unwrap().1.cause;
    bench.feed("base", at(1.0), &BaseState { front_bumpers: 2, ..BaseState::default() }, &[]);
    bench.step(at(1.0)).unwrap();
    assert_eq!(cause(&bench), StopCause::Bumper as u32);
    let proposal = bench.read::<Proposal>("proposal").unwrap().1;
    assert_eq!((proposal.forward.cap_positive, proposal.turn), (0.0, Axis::capped(0.0)));
    bench.feed("base", at(1.4), &BaseState::default(), &[]);
    bench.step(at(1.4)).unwrap();
    assert_eq!(cause(&bench), StopCause::Bumper as u32, "it was pressed a moment ago");
    bench.feed("ranges", at(2.1), &LASER, &scan(0.0, 0.3));
    bench.step(at(2.1)).unwrap();
    assert_eq!(cause(&bench), StopCause::Zone as u32);
    bench.feed("ranges", at(3.2), &LASER, &scan(0.0, 3.0));
    bench.step(at(3.2)).unwrap();
    assert_eq!(cause(&bench), StopCause::None as u32);
    assert_eq!(bench.read::<Proposal>("proposal").unwrap().1.forward, Axis::NONE);
}

#[test]
fn a_protective_stop_that_must_be_reset_waits_for_the_call() {
    let config = "release_by_itself = false";
    let mut bench = Bench::<EmergencyStop>::builder(config).body(body()).build().unwrap();
    bench.feed("ranges", at(1.0), &LASER, &scan(0.0, 0.3));
    bench.step(at(1.0)).unwrap();
    bench.feed("ranges", at(5.0), &LASER, &scan(0.0, 3.0));
    bench.step(at(5.0)).unwrap();
    assert_eq!(bench.read::<ProtectiveStop>("state").unwrap().1.cause, StopCause::Held as u32);
    bench.call("reset", &Trigger::default());
    bench.step(at(5.1)).unwrap();
    assert_eq!(bench.read::<ProtectiveStop>("state").unwrap().1.cause, StopCause::None as u32);
}
