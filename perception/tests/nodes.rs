//! The nodes `odometry` and `echoes` on a bench.
#![allow(clippy::unwrap_used, reason = "tests")]

use messages::{Beam, Echo, Odometry, Ranges, SetPose, Twist};
use perception::echoes::Echoes;
use runtime::calls::TicketState;
use runtime::{Bench, OpenError, Time};

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

fn pose(x_m: f64, heading_rad: f64, speed_m_s: f64, origin: u64) -> Odometry {
    Odometry {
        x_m,
        y_m: 0.0,
        heading_rad,
        velocity: Twist { linear_x_m_s: speed_m_s, ..Twist::default() },
        pose_covariance: [0.0; 9],
        velocity_covariance: [0.0; 9],
        origin,
    }
}

#[test]
fn odometry_takes_every_sample_and_keeps_its_stamp() {
    let mut bench = Bench::<perception::odometry::Odometry>::new().unwrap();
    // What lies in the ring already is history.
    bench.feed("odometry", at(0.9), &pose(9.0, 0.0, 0.0, 0), &[]);
    bench.step(at(0.9)).unwrap();
    bench.feed("odometry", at(1.0), &pose(5.0, 0.0, 0.0, 0), &[]);
    bench.feed("odometry", at(1.1), &pose(5.5, 0.0, 0.0, 0), &[]);
    bench.feed("odometry", at(1.2), &pose(0.0, 0.0, 0.0, 1), &[]);
    bench.feed("odometry", at(1.3), &pose(0.5, 0.0, 0.3, 1), &[]);
    bench.step(at(1.35)).unwrap();
    let (stamp, out, _) = bench.read::<Odometry>("pose").unwrap();
    assert_eq!(stamp, at(1.3));
    assert!((out.x_m - 1.0).abs() < 1e-9, "{out:?}");
    assert_eq!(out.velocity.linear_x_m_s, 0.3);
}

const LASER: Ranges = Ranges { min_range_m: 0.1, max_range_m: 5.0, beam_width_rad: 0.0, span_s: 0.0 };

fn beam(bearing_rad: f32, range_m: f32, age_s: f32) -> Beam {
    let echo = if range_m < 5.0 { Echo::Value } else { Echo::Clear } as u32;
    Beam { origin_x_m: 0.0, origin_y_m: 0.0, bearing_rad, range_m, age_s, echo }
}

fn remembered(bench: &Bench<Echoes>) -> Vec<Beam> {
    let (_, _, beams) = bench.read::<Ranges>("ranges").unwrap();
    beams.into_iter().filter(|beam| beam.echo == Echo::Value as u32).collect()
}

const SHARP: &str = "heard_before_s = 0.0";

#[test]
fn what_has_left_the_beam_is_still_there_after_a_turn() {
    let mut bench = Bench::<Echoes>::builder(SHARP).build().unwrap();
    bench.feed("odometry", at(1.0), &pose(0.0, 0.0, 0.0, 0), &[]);
    bench.feed("sonar", at(1.0), &LASER, &[beam(0.0, 0.8, 0.0)]);
    bench.step(at(1.0)).unwrap();
    bench.feed("odometry", at(2.0), &pose(0.0, 1.0, 0.0, 0), &[]);
    bench.feed("sonar", at(2.0), &LASER, &[beam(0.0, 5.0, 0.0)]);
    bench.step(at(2.0)).unwrap();
    let beams = remembered(&bench);
    assert_eq!(beams.len(), 1);
    assert!((beams[0].bearing_rad + 1.0).abs() < 1e-5 && (beams[0].age_s - 1.0).abs() < 1e-5);
    let (_, head, all) = bench.read::<Ranges>("ranges").unwrap();
    assert_eq!(head.beam_width_rad, 0.0);
    assert!(all.iter().any(|beam| beam.echo == Echo::Clear as u32), "where somebody looks stays known");
}

#[test]
fn an_old_beam_is_placed_where_the_body_was_when_it_was_fired() {
    let mut bench = Bench::<Echoes>::builder(SHARP).build().unwrap();
    bench.feed("odometry", at(1.0), &pose(0.0, 0.0, 0.0, 0), &[]);
    bench.feed("odometry", at(1.2), &pose(0.1, 0.0, 0.0, 0), &[]);
    bench.feed("sonar", at(1.2), &LASER, &[beam(0.0, 0.8, 0.1)]);
    bench.step(at(1.2)).unwrap();
    // Fired at 1.1 s from x = 0.05 m, so the spot is at 0.85 m, 0.75 m ahead of where the body is now.
    assert!((remembered(&bench)[0].range_m - 0.75).abs() < 1e-5);
}

#[test]
fn a_reading_that_is_only_repeated_is_not_heard_twice() {
    let mut bench = Bench::<Echoes>::builder(SHARP).build().unwrap();
    for k in 0..3 {
        let s = 1.0 + 0.1 * f64::from(k);
        bench.feed("odometry", at(s), &pose(0.2 * f64::from(k), 0.0, 0.0, 0), &[]);
        bench.feed("sonar", at(s), &LASER, &[beam(0.0, 1.2, 0.1 * k as f32)]);
        bench.step(at(s)).unwrap();
    }
    let beams = remembered(&bench);
    assert_eq!(beams.len(), 1);
    assert!((beams[0].range_m - 0.8).abs() < 1e-5);
}

#[test]
fn a_restarted_node_reads_the_history_first() {
    let mut bench = Bench::<Echoes>::builder(SHARP).build().unwrap();
    for k in 0..5 {
        let s = 1.0 + 0.1 * f64::from(k);
        bench.feed("odometry", at(s), &pose(0.0, 0.3 * f64::from(k), 0.0, 0), &[]);
        bench.feed("sonar", at(s), &LASER, &[beam(0.0, 0.8, 0.0)]);
    }
    bench.step(at(1.45)).unwrap();
    assert_eq!(remembered(&bench).len(), 5);
}

#[test]
fn a_new_odometry_frame_ends_the_memory_and_without_odometry_it_is_silent() {
    let mut bench = Bench::<Echoes>::builder(SHARP).build().unwrap();
    bench.feed("sonar", at(1.0), &LASER, &[beam(0.0, 0.8, 0.0)]);
    bench.step(at(1.0)).unwrap();
    assert!(bench.read::<Ranges>("ranges").is_none());
    bench.feed("odometry", at(1.1), &pose(0.0, 0.0, 0.0, 0), &[]);
    bench.feed("sonar", at(1.1), &LASER, &[beam(0.0, 0.8, 0.0)]);
    bench.step(at(1.1)).unwrap();
    assert_eq!(remembered(&bench).len(), 1);
    bench.feed("odometry", at(1.2), &pose(0.0, 0.0, 0.0, 1), &[]);
    bench.feed("sonar", at(1.2), &LASER, &[beam(1.0, 0.7, 0.0)]);
    bench.step(at(1.2)).unwrap();
    assert_eq!(remembered(&bench).len(), 1);
}

#[test]
fn a_setting_that_makes_no_sense_is_refused_with_its_name() {
    match Bench::<Echoes>::builder("capacity = 1").build() {
        Err(OpenError::Config { reason }) => assert!(reason.contains("capacity"), "{reason}"),
        other => panic!("it was accepted: {:?}", other.map(|_| ())),
    }
}

#[test]
fn the_map_frame_begins_at_the_start_pose_and_is_moved_by_call_alone() {
    let mut bench =
        Bench::<perception::odometry::Odometry>::builder("start = { x_m = 2.0, y_m = 1.0, heading_deg = 90.0 }")
            .build()
            .unwrap();
    bench.feed("odometry", at(0.9), &pose(9.0, 0.0, 0.0, 0), &[]);
    bench.step(at(0.9)).unwrap();
    bench.feed("odometry", at(1.0), &pose(5.0, 0.0, 0.0, 0), &[]);
    bench.feed("odometry", at(1.1), &pose(5.5, 0.0, 0.0, 0), &[]);
    bench.step(at(1.1)).unwrap();
    let (_, out, _) = bench.read::<Odometry>("pose").unwrap();
    assert!((out.x_m - 2.0).abs() < 1e-9 && (out.y_m - 1.5).abs() < 1e-9 && out.origin == 0, "{out:?}");
    bench.call("set_pose", &SetPose { x_m: 7.0, y_m: -1.0, heading_rad: 0.0 });
    bench.feed("odometry", at(1.2), &pose(6.0, 0.0, 0.0, 0), &[]);
    bench.step(at(1.2)).unwrap();
    let (_, out, _) = bench.read::<Odometry>("pose").unwrap();
    assert!((out.x_m - 7.5).abs() < 1e-9 && (out.y_m + 1.0).abs() < 1e-9 && out.origin == 1, "{out:?}");
    let ticket = bench.call("set_pose", &SetPose { x_m: f64::NAN, ..SetPose::default() });
    bench.step(at(1.3)).unwrap();
    assert!(matches!(bench.call_state(ticket), TicketState::Refused(r) if r.reason.contains("no number")));
}
