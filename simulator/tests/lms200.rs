//! The simulated LMS as the driver's own session sees it.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, also in its helpers")]

mod support;

use drivers::laser::Session as _;
use drivers::lms200::model::{Reach, Variant};
use drivers::lms200::session::{Session, SessionConfig};
use messages::{Echo, Link};
use runtime::Time;
use simulator::Realism;
use simulator::world::World;
use support::lasers::{Rig, room, true_m};

fn rig(realism: Realism, config: SessionConfig) -> Rig<Session> {
    Rig::new("lms200", room(), realism, Session::new(config))
}

fn half_degrees() -> SessionConfig {
    SessionConfig { variant: Variant::of(180, 50), ..SessionConfig::default() }
}

#[test]
fn every_variant_and_unit_is_read_beam_by_beam_as_the_map_lies() {
    let variants = [(180, 100, 75.0), (180, 50, 37.5), (100, 100, 75.0), (100, 50, 37.5), (100, 25, 18.75)];
    for (k, (angle, resolution, scans_per_s)) in variants.into_iter().enumerate() {
        let reach = [Reach::Keep, Reach::Eight, Reach::Sixteen, Reach::ThirtyTwo, Reach::Eighty][k];
        let variant = Variant::of(angle, resolution);
        let mut rig = rig(Realism::none(), SessionConfig { variant, reach, ..SessionConfig::default() });
        rig.run(3.0);
        assert_eq!(rig.session.link(), Link::Up, "{variant:?}");
        assert!(rig.scans.len() as f64 > 2.0 * scans_per_s, "{variant:?}: {} scans", rig.scans.len());
        let world = room();
        assert_eq!(rig.newest().len(), variant.unwrap().count());
        let worst_m = if reach == Reach::Eighty { 0.0051 } else { 0.0006 };
        for (beam, read) in rig.newest().iter().enumerate() {
            let degrees = -0.5 * f64::from(angle) + beam as f64 * f64::from(resolution) * 0.01;
            let true_m = true_m(&world, degrees.to_radians());
            assert_eq!(read.echo, Echo::Value as u16, "{variant:?} beam {beam} {true_m}");
            assert!((f64::from(read.range_m) - true_m).abs() < worst_m, "{variant:?} {beam}: {read:?} {true_m}");
        }
        assert_eq!(rig.session.state().damaged, 0, "no damaged telegram");
    }
}

#[test]
fn stamps_are_as_even_as_the_mirror_whatever_the_line_does() {
    let mut rig = rig(Realism::none(), half_degrees());
    rig.run(20.0);
    // Scans arrive on the simulation's grid of 10 ms; a scan begins every 26.7 ms.
    let settled = &rig.scans[200..];
    let late = settled.iter().map(|scan| scan.came.since(scan.first)).fold(0.0, f64::max);
    assert!(late < 0.045, "{late} s");
    for pair in settled.windows(2) {
        let gap = pair[1].first.since(pair[0].first);
        assert!((gap - 2.0 / 75.0).abs() < 0.001, "{gap} s between two scans");
    }
}

#[test]
fn a_slow_rate_costs_scans_as_on_a_real_line() {
    let mut rig = rig(Realism::none(), half_degrees());
    // 20 40: 38,400 baud, as any client may ask; 732 bytes take 191 ms.
    rig.simulation.laser_receive(0, Time::from_seconds(100.0), &[2, 0, 2, 0, 0x20, 0x40, 0x50, 0x08]);
    assert_eq!(rig.simulation.laser_baud(0), Some(38_400));
    rig.run(5.0);
    assert!((18..=26).contains(&rig.scans.len()), "{} scans in 5 s", rig.scans.len());
}

#[test]
fn lost_and_corrupt_bytes_cost_scans_but_never_give_wrong_ones() {
    let mut realism = Realism::none();
    (realism.line.lose_byte, realism.line.corrupt_byte) = (2e-5, 2e-5);
    let mut broken = rig(realism, half_degrees());
    broken.run(20.0);
    let mut right = rig(Realism::none(), half_degrees());
    right.run(2.0);
    assert!(broken.scans.len() > 200, "{}", broken.scans.len());
    assert!(broken.session.state().damaged > 5, "{:?}", broken.session.state());
    assert!(
        broken.scans.iter().all(|scan| scan.beams == right.newest()),
        "a sum of 16 bits misses one damage in 65,536"
    );
}

#[test]
fn noise_is_as_large_as_the_data_sheet_says() {
    let mut rig = rig(Realism::default(), half_degrees());
    rig.run(10.0);
    assert!((0.003..0.008).contains(&rig.sigma_m(10)), "{} m", rig.sigma_m(10));
}

/// Somebody comes straight towards the laser at 1.5 m/s.
const WALKER: &str = r#"
name = "walker"
bounds_m = [-3.0, -4.0, 9.0, 4.0]
[[person]]
path_m = [[8.0, 1.62], [0.6, 0.12]]
speed_m_s = 1.5
phase = 0.0
"#;

#[test]
fn somebody_who_comes_nearer_is_nearer_in_the_second_turn_of_an_interlaced_scan() {
    let second_turn_nearer_m = |mirror: bool| {
        let mut realism = Realism::none();
        realism.laser.mirror = mirror;
        let world = World::load("walker.toml", &mut |_| Ok(WALKER.as_bytes().to_vec())).unwrap();
        let mut rig = Rig::new("lms200", world, realism, Session::new(half_degrees()));
        rig.run(3.0);
        // The walls ahead are 8.9 m away: what is nearer is the walker.
        let beams = rig.newest();
        let walker: Vec<usize> = (1..360)
            .filter(|&k| beams[k - 1..=k + 1].iter().all(|beam| beam.range_m < 5.0) && (170..190).contains(&k))
            .collect();
        assert!(walker.len() >= 4, "{} beams meet the walker", walker.len());
        let odd = walker.iter().filter(|k| *k % 2 == 1);
        let nearer: Vec<f64> = odd
            .map(|&k| 0.5 * f64::from(beams[k - 1].range_m + beams[k + 1].range_m) - f64::from(beams[k].range_m))
            .collect();
        nearer.iter().sum::<f64>() / nearer.len() as f64
    };
    // A turn takes 13.3 ms: 20 mm at 1.5 m/s. All at one instant, what is left is that the walker is round.
    let (turning, frozen) = (second_turn_nearer_m(true), second_turn_nearer_m(false));
    assert!((0.016..0.024).contains(&(turning - frozen)), "{turning} m, {frozen} m");
    assert!((0.0..0.01).contains(&frozen), "{frozen} m");
}
