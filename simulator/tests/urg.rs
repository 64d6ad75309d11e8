//! The simulated SCIP scanners as the driver's own session sees them.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::laser::Session as _;
use drivers::urg::session::{Session, SessionConfig};
use messages::{Echo, Link};
use simulator::Realism;
use support::lasers::{Rig, room, true_m};

fn rig(model: &str, realism: Realism, config: SessionConfig) -> Rig<Session> {
    Rig::new(model, room(), realism, Session::new(config))
}

#[test]
fn every_model_is_read_beam_by_beam_as_the_map_lies() {
    for (model, beams, scans_per_s, worst_m) in
        [("sinew-720", 720, 50, 0.0006), ("utm-30lx", 1081, 40, 0.0006), ("urg-04lx", 682, 10, 0.0006)]
    {
        let mut rig = rig(model, Realism::none(), SessionConfig::default());
        rig.run(2.0);
        assert_eq!(rig.session.link(), Link::Up, "{model}");
        assert!(rig.scans.len() >= scans_per_s, "{model}: {} scans", rig.scans.len());
        let sensor = *rig.session.sensor().unwrap();
        let sweep = sensor.sweep(&sensor.whole(1));
        let world = room();
        assert_eq!(rig.newest().len(), beams);
        for (beam, read) in rig.newest().iter().enumerate() {
            let true_m = true_m(&world, sweep.angle_min_rad + beam as f64 * sweep.angle_increment_rad);
            if true_m > sweep.range_max_m {
                assert_eq!(read.echo, Echo::Clear as u16);
            } else {
                assert_eq!(read.echo, Echo::Value as u16, "{model} beam {beam} {true_m}");
                assert!((f64::from(read.range_m) - true_m).abs() < worst_m, "{model} {beam}: {read:?} {true_m}");
            }
        }
        assert_eq!(rig.session.state().damaged, 0, "no damaged message");
    }
}

#[test]
fn scans_come_evenly_and_are_stamped_when_their_turn_began() {
    let mut rig = rig("utm-30lx", Realism::none(), SessionConfig::default());
    rig.run(3.0);
    for gap in rig.scans.windows(2).map(|pair| pair[1].first.since(pair[0].first)) {
        assert!((gap - 0.025).abs() < 0.0011, "{gap} s between two stamps of whole milliseconds");
    }
}

#[test]
fn the_same_seed_gives_the_same_scans_and_noise_is_as_large_as_the_model_says() {
    let noisy = |seconds: f64| {
        let mut rig = rig("utm-30lx", Realism::default(), SessionConfig::default());
        rig.run(seconds);
        rig
    };
    let (long, short) = (noisy(2.0), noisy(1.0));
    assert!(short.scans.iter().zip(&long.scans).all(|(a, b)| a == b));
    // Beam 0 looks at a wall: its readings spread by σ = 1 cm.
    assert!((0.006..0.014).contains(&long.sigma_m(0)), "{} m", long.sigma_m(0));
    let dropped = long.scans.iter().flat_map(|scan| &scan.beams).filter(|beam| beam.echo == Echo::Clear as u16).count();
    assert!(dropped > 0, "some echoes are lost");
}

#[test]
fn a_part_of_the_field_clusters_and_intensities_can_be_asked_for() {
    let config =
        SessionConfig { between_rad: (-0.5, 0.5), cluster: 3, skip: 1, intensities: true, ..SessionConfig::default() };
    let mut rig = rig("utm-30lx", Realism::none(), config);
    rig.run(2.0);
    assert_eq!(rig.newest().len(), 77);
    assert!(rig.newest().iter().all(|beam| beam.intensity > 100));
    assert!((rig.scans[1].first.since(rig.scans[0].first) - 0.05).abs() < 0.0011);
}

#[test]
fn another_model_than_wanted_is_foreign_and_says_so() {
    let config = SessionConfig { model: "ust-10lx".into(), ..SessionConfig::default() };
    let mut rig = rig("utm-30lx", Realism::none(), config);
    rig.run(2.0);
    assert_eq!(rig.session.link(), Link::Foreign);
    assert!(rig.scans.is_empty());
}

#[test]
fn lost_and_corrupt_bytes_cost_scans_but_hardly_ever_give_wrong_ones() {
    let mut realism = Realism::none();
    (realism.line.lose_byte, realism.line.corrupt_byte) = (2e-5, 2e-5);
    let mut broken = rig("sinew-720", realism, SessionConfig::default());
    broken.run(20.0);
    let mut right = rig("sinew-720", Realism::none(), SessionConfig::default());
    right.run(1.0);
    assert!(broken.scans.len() > 300, "{}", broken.scans.len());
    assert!(broken.session.state().damaged > 10, "{:?}", broken.session.state());
    // A sum of six bits misses one damage in 64: so few scans may differ, in few beams.
    let wrong = broken.scans.iter().filter(|scan| scan.beams != right.newest()).count();
    assert!(wrong < broken.scans.len() / 50, "{wrong} of {}", broken.scans.len());
}

/// Beams of a scan that lie between two surfaces: neither as near as the post nor as far as the wall behind it.
fn between(mixed: f64) -> (usize, usize) {
    let mut realism = Realism::none();
    (realism.laser.mixed, realism.laser.mixed_within_m) = (mixed, 5.0);
    let mut rig = rig("utm-30lx", realism, SessionConfig::default());
    rig.run(4.0);
    let sensor = *rig.session.sensor().unwrap();
    let sweep = sensor.sweep(&sensor.whole(1));
    let world = room();
    let truth: Vec<f64> =
        (0..sweep.beams).map(|k| true_m(&world, sweep.angle_min_rad + k as f64 * sweep.angle_increment_rad)).collect();
    let (mut edges, mut inside) = (0, 0);
    for scan in &rig.scans {
        for (k, beam) in scan.beams.iter().enumerate() {
            let read_m = f64::from(beam.range_m);
            let is_edge = truth.get(k + 1).is_some_and(|next_m| (next_m - truth[k]).abs() > 0.5);
            let next_m = if is_edge { truth[k + 1] } else { truth[k] };
            edges += usize::from(is_edge);
            // Wherever it lies, it lies between the two.
            assert!(read_m > truth[k].min(next_m) - 1e-3 && read_m < truth[k].max(next_m) + 1e-3, "beam {k}: {read_m}");
            inside += usize::from(is_edge && (read_m - truth[k]).abs() > 1e-3);
        }
    }
    (edges, inside)
}

#[test]
fn a_beam_that_grazes_an_edge_reads_something_between_near_and_far_as_often_as_the_world_says() {
    let (edges, inside) = between(0.3);
    assert!(edges > 200, "{edges} edges");
    let share = inside as f64 / edges as f64;
    assert!((0.2..0.4).contains(&share), "{inside} of {edges}");
    assert_eq!(between(0.0).1, 0);
}
