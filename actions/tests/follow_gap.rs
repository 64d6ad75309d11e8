//! The node `follow_gap` on a bench, and its planner through some of BARN's worlds on a planar robot.
#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "planar/mod.rs"]
mod planar;

use actions::follow_gap::{FollowGap, FollowGapConfig};
use messages::{
    Axis, Beam, Done, Echo, GotoGoal, GotoProgress, GotoResult, Message, Odometry, Proposal, Ranges, Track,
    TrackMotion, TrackState, Tracks, Trigger, Twist, bytemuck,
};
use runtime::calls::{Ticket, TicketState};
use runtime::{Bench, Body, OpenError, Time};
use std::path::PathBuf;

const RANGES: Ranges = Ranges { min_range_m: 0.1, max_range_m: 30.0, beam_width_rad: 0.0, span_s: 0.0 };

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

fn jackal() -> Body {
    Body {
        length_ahead_m: 0.254,
        length_behind_m: 0.254,
        half_width_m: 0.215,
        max_forward_m_s: 2.0,
        max_backward_m_s: 0.2,
        max_turn_rad_s: 2.5,
        acceleration_m_s2: 3.0,
        deceleration_m_s2: 4.0,
        turn_acceleration_rad_s2: 10.0,
        ..Body::default()
    }
}

fn bench(config: &str) -> Bench<FollowGap> {
    Bench::<FollowGap>::builder(config).body(jackal()).build().unwrap()
}

/// Beams that see a wall across the way at `wall_m` ahead of the sensor, from `left_m` to `right_m` of the middle line.
fn beams(wall_m: f64, right_m: f64, left_m: f64) -> Vec<Beam> {
    (0..720)
        .map(|k| {
            let bearing = (-135.0 + 270.0 * f64::from(k) / 719.0).to_radians();
            let (sin, cos) = runtime::math::sin_cos(bearing);
            let range = wall_m / cos;
            let hits = cos > 0.1 && (right_m..=left_m).contains(&(range * sin));
            Beam {
                origin_x_m: 0.12,
                bearing_rad: bearing as f32,
                range_m: if hits { range as f32 } else { 30.0 },
                echo: if hits { Echo::Value } else { Echo::Clear } as u32,
                ..Beam::default()
            }
        })
        .collect()
}

fn see(bench: &mut Bench<FollowGap>, s: f64, odometry: Odometry, beams: &[Beam]) {
    bench.feed("pose", at(s), &odometry, &[]);
    bench.feed("ranges", at(s), &RANGES, beams);
    bench.step(at(s)).unwrap();
}

fn order<M: Message>(bench: &mut Bench<FollowGap>, s: f64, command: &str, message: &M) -> Ticket {
    let ticket = bench.call(command, message);
    bench.step(at(s)).unwrap();
    ticket
}

fn goal(x_m: f64, y_m: f64) -> GotoGoal {
    GotoGoal { x_m, y_m, heading_rad: f64::NAN, tolerance_m: 0.0 }
}

fn proposal(bench: &Bench<FollowGap>) -> Proposal {
    bench.read::<Proposal>("proposal").unwrap().1
}

fn reason(state: TicketState) -> String {
    match state {
        TicketState::Refused(refusal) | TicketState::Failed(refusal) => refusal.reason,
        other => panic!("neither refused nor failed: {other:?}"),
    }
}

#[test]
fn in_the_open_it_goes_straight_and_ends_at_the_goal() {
    let mut bench = bench("");
    let open = beams(50.0, 0.0, 0.0);
    see(&mut bench, 1.0, Odometry::default(), &open);
    assert!(bench.read::<Proposal>("proposal").is_none(), "without an order it proposes nothing");
    let ticket = order(&mut bench, 1.01, "goto", &goal(5.0, 0.0));
    for k in 0..20 {
        see(&mut bench, 1.02 + 0.02 * f64::from(k), Odometry::default(), &open);
    }
    let ahead = proposal(&bench);
    assert!(ahead.forward.value > 0.2 && ahead.turn.value.abs() < 0.2, "{ahead:?}");
    match bench.call_state(ticket) {
        TicketState::Running(Some(body)) => {
            let progress: &GotoProgress = bytemuck::from_bytes(&body);
            assert_eq!((progress.distance_m, progress.orders), (5.0, 1));
        }
        other => panic!("{other:?}"),
    }
    see(&mut bench, 6.0, Odometry { x_m: 4.9, ..Odometry::default() }, &open);
    match bench.call_state(ticket) {
        TicketState::Answered(body) => {
            let result: &GotoResult = bytemuck::from_bytes(&body);
            assert!((result.distance_m - 0.1).abs() < 1e-9 && result.way_m > 4.8, "{result:?}");
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(proposal(&bench).forward, Axis::NONE, "the last proposal is taken back");
}

#[test]
fn before_a_wall_it_turns_to_the_side_that_is_open() {
    for (right, left, sign) in [(-6.0, 0.4, 1.0), (-0.4, 6.0, -1.0)] {
        let mut bench = bench("");
        see(&mut bench, 1.0, Odometry::default(), &beams(1.2, right, left));
        order(&mut bench, 1.01, "goto", &goal(4.0, 0.0));
        for k in 0..10 {
            see(&mut bench, 1.02 + 0.02 * f64::from(k), Odometry::default(), &beams(1.2, right, left));
        }
        let away = proposal(&bench);
        assert!(away.turn.value * sign > 0.1, "{right} {left}: {away:?}");
    }
}

#[test]
fn at_speed_it_wants_no_more_than_can_still_stop() {
    let mut bench = bench("");
    let velocity = Twist { linear_x_m_s: 2.0, ..Twist::default() };
    let wall = beams(0.9, -9.0, 9.0);
    let fast = Odometry { velocity, ..Odometry::default() };
    see(&mut bench, 1.0, fast, &wall);
    order(&mut bench, 1.01, "goto", &goal(6.0, 0.0));
    see(&mut bench, 1.02, fast, &wall);
    assert!(proposal(&bench).forward.value < 1.9, "{:?}", proposal(&bench));
}

#[test]
fn a_cylinder_that_crosses_is_waited_for_only_when_it_is_tracked() {
    let run = |config: &str| {
        let mut bench = bench(config);
        // Out of the laser's sight for now: what is known of it is its track.
        let open = beams(50.0, 0.0, 0.0);
        let track = Track {
            id: 1,
            state: TrackState::Confirmed as u32,
            motion: TrackMotion::Moving as u32,
            odom_x_m: 1.6,
            odom_y_m: -1.2,
            odom_velocity_y_m_s: 1.0,
            radius_m: 0.5,
            age_s: 2.0,
            ..Track::default()
        };
        let velocity = Twist { linear_x_m_s: 1.5, ..Twist::default() };
        let driving = Odometry { velocity, ..Odometry::default() };
        see(&mut bench, 1.0, driving, &open);
        order(&mut bench, 1.01, "goto", &goal(8.0, 0.0));
        bench.feed("tracks", at(1.02), &Tracks::default(), &[track]);
        see(&mut bench, 1.02, driving, &open);
        proposal(&bench)
    };
    let (told, not_told) = (run("watch_s = 0.0"), run("tracking = false"));
    assert!(not_told.forward.value > 1.5 && not_told.turn.value.abs() < 0.3, "{not_told:?}");
    assert!(told.forward.value < 1.4 || told.turn.value.abs() > 0.5, "{told:?}");
}

#[test]
fn from_rest_it_first_watches_what_moves_and_at_speed_it_does_not_stop_for_that() {
    let open = beams(50.0, 0.0, 0.0);
    let run = |config: &str, speed_m_s: f64, seconds: f64, tracks: bool| {
        let mut bench = bench(config);
        let velocity = Twist { linear_x_m_s: speed_m_s, ..Twist::default() };
        let here = Odometry { velocity, ..Odometry::default() };
        see(&mut bench, 1.0, here, &open);
        order(&mut bench, 1.01, "goto", &goal(8.0, 0.0));
        for k in 1..=(seconds / 0.02) as usize {
            let s = 1.0 + 0.02 * k as f64;
            if tracks {
                bench.feed("tracks", at(s), &Tracks::default(), &[]);
            }
            see(&mut bench, s, here, &open);
        }
        proposal(&bench).forward.value
    };
    assert_eq!(run("", 0.0, 0.5, true), 0.0, "it watches");
    assert!(run("", 0.0, 1.5, true) > 0.1, "it has watched");
    assert!(run("", 0.0, 0.5, false) > 0.1, "nobody tells what moves");
    assert!(run("tracking = false", 0.0, 0.5, true) > 0.1, "it does not ask what moves");
    assert!(run("", 1.5, 0.5, true) > 1.0, "it drives already");
}

#[test]
fn without_fresh_scans_it_proposes_to_stand() {
    let mut bench = bench("");
    let open = beams(50.0, 0.0, 0.0);
    see(&mut bench, 1.0, Odometry::default(), &open);
    order(&mut bench, 1.01, "goto", &goal(5.0, 0.0));
    see(&mut bench, 1.02, Odometry::default(), &open);
    assert!(proposal(&bench).forward.value > 0.0);
    bench.feed("pose", at(3.0), &Odometry::default(), &[]);
    bench.step(at(3.0)).unwrap();
    assert_eq!((proposal(&bench).forward, proposal(&bench).turn), (Axis::exact(0.0), Axis::exact(0.0)));
    see(&mut bench, 3.02, Odometry::default(), &open);
    assert!(proposal(&bench).forward.value > 0.0, "and goes on when they are back");
}

#[test]
fn goals_that_cannot_be_are_refused_and_a_newer_one_takes_over() {
    let mut bench = bench("");
    let ticket = order(&mut bench, 0.5, "goto", &goal(1.0, 0.0));
    assert!(reason(bench.call_state(ticket)).contains("no pose"));
    see(&mut bench, 1.0, Odometry::default(), &beams(50.0, 0.0, 0.0));
    for (x, says) in [(f64::NAN, "not a number"), (f64::INFINITY, "not a number"), (1e6, "10 km")] {
        let ticket = order(&mut bench, 1.01, "goto", &goal(x, 0.0));
        assert!(reason(bench.call_state(ticket)).contains(says));
    }
    let first = order(&mut bench, 1.02, "goto", &goal(4.0, 0.0));
    let second = order(&mut bench, 1.03, "goto", &goal(3.0, 0.0));
    assert!(reason(bench.call_state(first)).contains("newer order"));
    let cancelled = order(&mut bench, 1.04, "cancel", &Trigger::default());
    assert!(matches!(bench.call_state(cancelled), TicketState::Answered(body) if body.len() == size_of::<Done>()));
    assert_eq!(bench.call_state(second), TicketState::Cancelled);
    assert_eq!(proposal(&bench).forward, Axis::NONE);
}

#[test]
fn wild_beams_poses_and_tracks_make_no_number_that_is_none() {
    let mut bench = bench("");
    see(&mut bench, 1.0, Odometry::default(), &beams(50.0, 0.0, 0.0));
    order(&mut bench, 1.01, "goto", &goal(5.0, 0.0));
    let wild = [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e30];
    for (k, value) in wild.into_iter().enumerate() {
        let beam = Beam { range_m: value, bearing_rad: value, origin_x_m: value, echo: 1, ..Beam::default() };
        let mut all = beams(2.0, -1.0, 1.0);
        all[k * 100] = beam;
        let track = Track { state: 1, motion: 2, odom_x_m: f64::from(value), radius_m: 0.5, ..Track::default() };
        let s = 1.02 + 0.02 * k as f64;
        bench.feed("tracks", at(s), &Tracks::default(), &[track]);
        see(&mut bench, s, Odometry::default(), &all);
        let proposal = proposal(&bench);
        assert!(proposal.forward.value.is_finite() && proposal.turn.value.is_finite());
    }
    see(&mut bench, 1.5, Odometry { x_m: f64::NAN, ..Odometry::default() }, &beams(2.0, -1.0, 1.0));
    assert_eq!(proposal(&bench).forward, Axis::exact(0.0), "nobody knows where the body is");
}

#[test]
fn settings_out_of_bounds_are_refused_by_name() {
    for (config, says) in [("steps = 1", "steps"), ("memory_s = -1.0", "memory_s"), ("free_m = 0.1", "free_m")] {
        match Bench::<FollowGap>::builder(config).build() {
            Err(OpenError::Config { reason }) => assert!(reason.contains(says), "{reason}"),
            other => panic!("{:?}", other.err()),
        }
    }
}

/// A folder of the shared data, or `None` with a word about it.
fn data(name: &str) -> Option<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(name);
    if folder.exists() {
        return Some(folder);
    }
    println!("skipped: {} is not there", folder.display());
    None
}

fn trial() -> planar::Trial {
    planar::Trial { seed: 0, latency_s: 0.04, scale: 1.0, tracking: true, keep_track: true }
}

#[test]
fn barn_worlds_are_crossed_with_and_without_memory_and_with_a_bad_line_and_odometry() {
    let Some(folder) = data("barn") else { return };
    for course in planar::barn(&folder).unwrap().iter().skip(7).step_by(125) {
        for (memory_s, latency_s, scale) in [(20.0, 0.04, 1.0), (0.0, 0.04, 1.0), (20.0, 0.09, 1.01)] {
            let setup = FollowGapConfig { memory_s, ..FollowGapConfig::default() }.setup(&jackal());
            let result = planar::run(course, &setup, &planar::Trial { latency_s, scale, ..trial() });
            assert!(result.success, "world {} with memory {memory_s}: {:.1} s", course.index, result.time_s);
        }
    }
}

#[test]
fn the_same_seed_makes_the_same_way_to_the_last_bit() {
    let Some(folder) = data("barn") else { return };
    let course = &planar::barn(&folder).unwrap()[100];
    let setup = FollowGapConfig::default().setup(&jackal());
    let (first, second) = (planar::run(course, &setup, &trial()), planar::run(course, &setup, &trial()));
    assert_eq!(first.track, second.track);
    let other = FollowGapConfig { seed: 2, ..FollowGapConfig::default() }.setup(&jackal());
    assert_ne!(planar::run(course, &other, &trial()).track, first.track);
}

#[test]
fn moving_cylinders_are_crossed_when_their_motion_is_known() {
    let Some(folder) = data("dynabarn") else { return };
    let setup = FollowGapConfig::default().setup(&jackal());
    let courses = planar::dynabarn(&folder).unwrap();
    let won = courses.iter().skip(3).step_by(10).filter(|course| planar::run(course, &setup, &trial()).success).count();
    assert!(won >= 4, "{won} of 5");
}
