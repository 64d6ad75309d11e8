//! The nodes `forward` and `steer_clear` on a bench.
#![allow(clippy::unwrap_used, reason = "tests")]

use actions::forward::Forward;
use actions::steer_clear::SteerClear;
use messages::{Axis, Beam, Echo, FreeSectors, Proposal, Ranges};
use runtime::{Bench, OpenError, Time};

const BEARINGS_DEG: [f32; 8] = [90.0, 50.0, 30.0, 10.0, -10.0, -30.0, -50.0, -90.0];
const RANGES: Ranges = Ranges { min_range_m: 0.1, max_range_m: 5.0, beam_width_rad: 0.52, span_s: 0.3 };

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

/// Eight forward sonars that all read 4 m, but for `near`.
fn beams(near: &[(usize, f32)]) -> Vec<Beam> {
    let range = |k: usize| near.iter().find(|(at, _)| *at == k).map_or(4.0, |&(_, range_m)| range_m);
    let beam = |k: usize| Beam {
        origin_x_m: 0.1,
        origin_y_m: 0.0,
        bearing_rad: BEARINGS_DEG[k].to_radians(),
        range_m: range(k),
        age_s: 0.0,
        echo: Echo::Value as u32,
    };
    (0..8).map(beam).collect()
}

#[test]
fn forward_goes_on_and_slows_for_what_is_ahead() {
    let mut bench = Bench::<Forward>::new().unwrap();
    bench.feed("ranges", at(1.0), &RANGES, &beams(&[]));
    bench.step(at(1.0)).unwrap();
    let (_, open, _) = bench.read::<Proposal>("proposal").unwrap();
    bench.feed("ranges", at(1.1), &RANGES, &beams(&[(3, 0.4)]));
    bench.step(at(1.1)).unwrap();
    let (_, near, _) = bench.read::<Proposal>("proposal").unwrap();
    assert!(near.forward.value < open.forward.value && near.forward.value > 0.0);
    assert_eq!((open.turn, near.turn), (Axis::NONE, Axis::NONE));
}

#[test]
fn forward_abstains_without_fresh_ranges_unless_it_is_constant() {
    let mut scaled = Bench::<Forward>::new().unwrap();
    scaled.feed("ranges", at(1.0), &RANGES, &beams(&[]));
    scaled.step(at(2.0)).unwrap();
    assert_eq!(scaled.read::<Proposal>("proposal").unwrap().1.forward, Axis::NONE);
    let mut constant = Bench::<Forward>::builder("scaled = false\nspeed_m_s = 0.2").build().unwrap();
    constant.step(at(2.0)).unwrap();
    assert_eq!(constant.read::<Proposal>("proposal").unwrap().1.forward, Axis::exact(0.2));
}

#[test]
fn steer_clear_answers_each_packet_once() {
    let mut bench = Bench::<SteerClear>::new().unwrap();
    bench.feed("ranges", at(1.0), &RANGES, &beams(&[(2, 0.3)]));
    bench.step(at(1.0)).unwrap();
    let (stamp, proposal, _) = bench.read::<Proposal>("proposal").unwrap();
    assert!(proposal.turn.value < 0.0 && proposal.forward == Axis::NONE);
    bench.step(at(1.2)).unwrap();
    assert_eq!(bench.read::<Proposal>("proposal").unwrap().0, stamp, "the same packet asks for no second turn");
    let (_, free, _) = bench.read::<FreeSectors>("free_sectors").unwrap();
    assert_eq!((free.sectors, free.free), (8, 7));
}

#[test]
fn a_wrong_sector_is_refused_with_its_number() {
    let config = "sectors = [{ from_rad = 0.5, to_rad = -0.5, threshold = 2.0 }]";
    match Bench::<SteerClear>::builder(config).build() {
        Err(OpenError::Config { reason }) => assert!(reason.contains("sectors[0]"), "{reason}"),
        other => panic!("it was accepted: {:?}", other.map(|_| ())),
    }
}
