//! The memory, seen from outside: what it keeps, denies, confirms and forgets.

use super::*;
use proptest::prelude::*;

const RANGES: Ranges = Ranges { min_range_m: 0.1, max_range_m: 5.0, beam_width_rad: 0.52, span_s: 0.3 };
const BODY: Outline = Outline { ahead_m: 0.21, behind_m: 0.3, half_width_m: 0.2 };

fn beam(bearing_rad: f32, range_m: f32, echo: Echo) -> Beam {
    Beam { origin_x_m: 0.0, origin_y_m: 0.0, bearing_rad, range_m, age_s: 0.0, echo: echo as u32 }
}

fn home() -> Place {
    Place::new(0.0, 0.0, 0.0)
}

fn memory() -> EchoMemory {
    EchoMemory::new(MemoryConfig::default())
}

fn beams_at(memory: &EchoMemory, place: &Place) -> Vec<Beam> {
    let mut beams = Vec::new();
    memory.each(Time::ZERO, place, |beam| beams.push(beam));
    beams
}

#[test]
fn an_echo_is_remembered_along_its_arc() {
    let mut memory = memory();
    memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 0.6, Echo::Value));
    let beams = beams_at(&memory, &home());
    assert!(beams.len() >= 5);
    assert!(beams.iter().all(|b| (b.range_m - 0.6).abs() < 1e-6));
    let widest = beams.iter().map(|b| b.bearing_rad.abs()).fold(0.0, f32::max);
    assert!((widest - 0.26).abs() < 1e-6);
}

#[test]
fn what_was_ahead_is_beside_after_a_turn_and_nearer_after_a_way() {
    let mut memory = memory();
    let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
    memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.6, Echo::Value));
    let turned = beams_at(&memory, &Place::new(0.0, 0.0, 1.0));
    assert!((turned[0].bearing_rad + 1.0).abs() < 1e-6);
    let nearer = beams_at(&memory, &Place::new(0.2, 0.0, 0.0));
    assert!((nearer[0].range_m - 0.4).abs() < 1e-6);
}

#[test]
fn a_longer_reading_along_the_same_line_takes_the_spot_away() {
    let mut memory = memory();
    memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 0.6, Echo::Value));
    memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 1.4, Echo::Value));
    let left: Vec<f32> = beams_at(&memory, &home()).iter().filter(|b| b.range_m < 1.0).map(|b| b.bearing_rad).collect();
    assert!(left.iter().all(|bearing| bearing.abs() > 0.7 * 0.26), "only the arc's ends stay: {left:?}");
}

#[test]
fn a_confirmed_spot_needs_to_be_denied_as_often() {
    let mut memory = memory();
    let laser = Ranges { beam_width_rad: 0.02, ..RANGES };
    for k in 0..9_u32 {
        let x_m = 0.04 * f64::from(k);
        let place = Place::new(x_m, 0.0, 0.0);
        memory.hear(Time::from_nanos(u64::from(k)), &place, &laser, &beam(0.0, (0.6 - x_m) as f32, Echo::Value));
    }
    let centre = |memory: &EchoMemory| beams_at(memory, &home()).iter().any(|b| b.bearing_rad.abs() < 1e-3);
    for _ in 0..2 {
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.0, Echo::Clear));
    }
    assert!(centre(&memory));
    memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.0, Echo::Clear));
    assert!(!centre(&memory));
}

#[test]
fn a_body_at_rest_confirms_nothing() {
    let mut memory = memory();
    let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
    for k in 0..9 {
        memory.hear(Time::from_nanos(k), &home(), &laser, &beam(0.0, 0.6, Echo::Value));
    }
    memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 0.0, Echo::Clear));
    assert!(memory.is_empty());
}

#[test]
fn arcs_that_cross_at_a_jamb_leave_the_door_beside_it_open() {
    let mut memory = memory();
    // A jamb at (1, 0.25), heard by a disc that looks 30° to the left while the body moves on.
    let jamb_from = |x_m: f64| math::hypot(1.0 - x_m, 0.25);
    for k in 0..12_u32 {
        let x_m = 0.3 + 0.025 * f64::from(k);
        let place = Place::new(x_m, 0.0, 0.0);
        let heard = beam(0.52, jamb_from(x_m) as f32, Echo::Value);
        memory.hear(Time::from_nanos(u64::from(k)), &place, &RANGES, &heard);
    }
    // The last arc's inner end lies 15° to the left, in the door: it is not among the spots.
    let last = Place::new(0.575, 0.0, 0.0);
    let fresh: Vec<Beam> = beams_at(&memory, &last).into_iter().filter(|b| (b.range_m - 0.493).abs() < 0.01).collect();
    assert!(fresh.iter().any(|b| (b.bearing_rad - 0.532).abs() < 0.06), "the jamb is there");
    assert!(fresh.iter().all(|b| b.bearing_rad > 0.4), "its false images are not: {fresh:?}");
}

#[test]
fn a_wall_that_is_looked_at_askance_is_not_thought_away() {
    let mut memory = memory();
    let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
    memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.6, Echo::Value));
    // The same spot along a line of sight that differs by a right angle.
    let (sin, cos) = math::sin_cos(1.5);
    let elsewhere = Place::new(0.6 - 0.6 * cos, -0.6 * sin, 0.0);
    let wide = Ranges { beam_width_rad: 0.5, ..RANGES };
    memory.hear(Time::ZERO, &elsewhere, &wide, &beam(1.5, 0.0, Echo::Clear));
    assert_eq!(memory.len(), 1);
}

#[test]
fn nothing_stays_where_the_body_stands_nor_for_ever_nor_far_away() {
    let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
    let fill = || {
        let mut memory = memory();
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.6, Echo::Value));
        memory
    };
    let mut kept = fill();
    kept.tidy(Time::from_seconds(4.0), &home(), &BODY);
    assert_eq!(kept.len(), 1);
    for (s, place) in [(0.0, Place::new(0.5, 0.0, 0.0)), (6.0, home()), (0.0, Place::new(-1.0, 0.0, 0.0))] {
        let mut memory = fill();
        memory.tidy(Time::from_seconds(s), &place, &BODY);
        assert!(memory.is_empty());
    }
}

#[test]
fn what_is_nearer_than_can_be_measured_is_taken_to_be_very_near() {
    for too_near in [beam(0.0, 0.0, Echo::TooNear), beam(0.0, 0.1, Echo::Value)] {
        let mut memory = memory();
        memory.hear(Time::ZERO, &home(), &RANGES, &too_near);
        assert!(beams_at(&memory, &home()).iter().any(|b| (b.range_m - 0.05).abs() < 1e-6));
        assert!(beams_at(&memory, &home()).iter().any(|b| (b.range_m - 0.1).abs() < 1e-6));
        assert!(!memory.is_empty());
    }
}

#[test]
fn a_beam_that_tells_nothing_changes_nothing() {
    let mut memory = memory();
    memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 0.6, Echo::Value));
    let before = memory.len();
    for silent in [beam(0.0, 3.0, Echo::LinkLost), beam(0.0, f32::NAN, Echo::Value), beam(f32::NAN, 3.0, Echo::Value)] {
        memory.hear(Time::ZERO, &home(), &RANGES, &silent);
    }
    assert_eq!(memory.len(), before);
}

proptest! {
    #[test]
    fn the_memory_never_grows_beyond_its_room(
        readings in prop::collection::vec((-3.0..3.0f32, 0.0..2.0f32, 0..7u32, -1.0..1.0f64, -3.0..3.0f64), 0..300),
    ) {
        let mut memory = EchoMemory::new(MemoryConfig { capacity: 64, ..MemoryConfig::default() });
        for (bearing_rad, range_m, echo, x, heading) in readings {
            let beam = Beam { echo, ..beam(bearing_rad, range_m, Echo::Value) };
            let place = Place::new(x, 0.0, heading);
            memory.hear(Time::ZERO, &place, &RANGES, &beam);
            memory.tidy(Time::ZERO, &place, &BODY);
            prop_assert!(memory.len() <= 64);
        }
        let ok = beams_at(&memory, &home()).iter().all(|b| b.range_m.is_finite() && b.bearing_rad.is_finite());
        prop_assert!(ok);
    }
}
