//! `sinew bench perception`: from a scan to its segments, circles and tracks and to the proposal of `avoid`, on one core.
//!
//! 361 beams: a real SICK in an office (`csail`), or synthetic where the data are absent; 1,081 beams: synthetic, for no
//! recording of that size is at hand. What the nodes `tracks` and
//! `avoid` do with a scan is timed, not reading and writing channels.

use super::machine::Before;
use super::report::{Report, Target};
use super::timing::Times;
use super::tracking::{legs, yard};
use super::witness::Witnesses;
use crate::exit::Failure;
use actions::avoid::{AvoidConfig, Avoidance};
use messages::{Beam, Detour, Echo, Ranges, Side, Twist};
use perception::place::Place;
use perception::tracks::config::{FilterKind, TracksConfig};
use perception::tracks::tracker::Tracker;
use runtime::{Body, Time, clock, math};
use std::path::Path;

/// Times per row.
const SCANS: usize = 20_000;
/// Scans that are not timed: they fill the caches and bring up the first tracks.
const WARM_UP: usize = 200;
/// Predicted paths have a point every so often [s].
const PATH_STEP_S: f64 = 0.5;
/// Aims: beams, median [µs].
const AIMS: [(usize, f64); 2] = [(361, 50.0), (1081, 150.0)];

/// A scan, when, and where the body stood.
struct Frame {
    time_s: f64,
    place: Place,
    beams: Vec<Beam>,
}

/// Times scans of the data in `folder`, where they are there; `part` of the usual number.
pub fn run(folder: Option<&Path>, part: f64) -> Result<Report, Failure> {
    let before = Before::now();
    let (office, of_what) = match folder.map(|folder| folder.join("csail/csail.txt.gz")) {
        Some(file) => (recorded(&legs::unpack(&file)?), "recorded by a SICK at MIT CSAIL"),
        None => (synthetic(361, std::f64::consts::PI), "synthetic: say --data DIR for recorded ones"),
    };
    if office.is_empty() {
        return Err(Failure::from("csail/csail.txt.gz holds no scan".to_owned()));
    }
    let sets = [("361_beams", office), ("1081_beams", synthetic(1081, 1.5 * std::f64::consts::PI))];
    let witnesses = Witnesses::start()?;
    let count = (SCANS as f64 * part) as usize;
    let mut all = Vec::new();
    for (name, frames) in &sets {
        for (kind, filter) in [("polar", FilterKind::Polar), ("cartesian", FilterKind::Cartesian)] {
            all.push((format!("{name}_{kind}"), frames[0].beams.len(), time(frames, filter, count)));
        }
    }
    let seen = witnesses.stop();
    let machine = before.finish(vec!["one thread, SCHED_OTHER".into()], &seen);
    let rows: Vec<_> = all
        .iter()
        .map(|(name, beams, (times, tracks))| {
            let mut row = times.row(name, beams * size_of::<Beam>(), &seen);
            row.note("tracks_mean", *tracks);
            row
        })
        .collect();
    let target = |(beams, aim_us): (usize, f64)| {
        let of_size = rows.iter().filter(|row| row.size_bytes == beams * size_of::<Beam>());
        let worst = of_size.map(|row| row.p50_us).fold(0.0, f64::max);
        Target {
            aim: format!("{beams} beams → segments, circles, tracks, proposal of avoid: p50 at most {aim_us} µs"),
            measured: format!("{worst:.1} µs by the slower filter"),
            reached: worst <= aim_us,
        }
    };
    let notes = vec![format!(
        "361 beams: {of_what}; 1,081 beams: synthetic, a yard of twelve moving cylinders. Every other scan `avoid` is on \
         a detour, which is its dearer case. A test of the crate holds that no scan asks the allocator for anything."
    )];
    Ok(Report { bench: "perception", machine, targets: AIMS.map(target).to_vec(), rows, values: Vec::new(), notes })
}

/// Takes `count` scans, over and over, and the mean number of tracks.
fn time(frames: &[Frame], filter: FilterKind, count: usize) -> (Times, f64) {
    let mut tracker = Tracker::new(TracksConfig { filter, ..TracksConfig::default() });
    let mut times = Times::with_room_for(count);
    let config = AvoidConfig::default();
    let mut avoidance = Avoidance::new(&Body::default(), config);
    let head = Ranges { min_range_m: 0.1, max_range_m: 30.0, beam_width_rad: 0.0, span_s: 0.0 };
    let detour = Detour { side: Side::Left as u32, bearing_rad: 0.5, distance_m: 5.0, ..Detour::default() };
    let mut tracks = 0;
    let length_s = frames.last().map_or(0.0, |frame| frame.time_s) + 0.1;
    for k in 0..WARM_UP + count {
        let (round, frame) = (k / frames.len(), &frames[k % frames.len()]);
        if k % frames.len() == 0 {
            // Back at the first scan nothing is where it was.
            tracker.begin_anew();
        }
        let now = Time::from_seconds(1.0 + round as f64 * length_s + frame.time_s);
        let begin = clock::now();
        tracker.take(now, &frame.beams, &frame.place, &Twist::default());
        avoidance.look(&head, &frame.beams);
        avoidance.expect(tracker.tracks(), PATH_STEP_S);
        std::hint::black_box(avoidance.decide((k % 2 == 1).then_some(&detour)));
        if k >= WARM_UP {
            times.push(begin, clock::now());
            tracks += tracker.tracks().len();
        }
    }
    (times, tracks as f64 / count.max(1) as f64)
}

/// The CSAIL recording: unix time, raw odometry, reference pose, 361 ranges.
fn recorded(text: &str) -> Vec<Frame> {
    let mut first_s = None;
    let frame = |line: &str| {
        let numbers: Vec<f64> = line.split_whitespace().map_while(|n| n.parse().ok()).collect();
        if numbers.len() != 7 + 361 {
            return None;
        }
        let time_s = numbers[0] - *first_s.get_or_insert(numbers[0]);
        let beam = |(k, &range_m): (usize, &f64)| Beam {
            bearing_rad: (math::wrap_angle((0.5 * k as f64 - 90.0).to_radians())) as f32,
            range_m: range_m as f32,
            echo: if range_m > 80.0 { Echo::Clear } else { Echo::Value } as u32,
            ..Beam::default()
        };
        let place = Place::new(numbers[1], numbers[2], numbers[3]);
        Some(Frame { time_s, place, beams: numbers[7..].iter().enumerate().map(beam).collect() })
    };
    text.lines().filter_map(frame).collect()
}

/// A body that drives through a yard of moving cylinders.
fn synthetic(count: usize, field_rad: f64) -> Vec<Frame> {
    let mut laser = yard::Laser::new(count, field_rad, 0.01, 1);
    (0..400)
        .map(|k| {
            let time_s = 0.05 * f64::from(k);
            let mover = |m: u32| {
                let phase = std::f64::consts::FRAC_PI_6 * f64::from(m) + 0.1 * time_s;
                let radius = 3.0 + f64::from(m % 4);
                let (sin, cos) = math::sin_cos(phase);
                yard::Moving { x_m: radius * cos, y_m: radius * sin, velocity_x_m_s: 0.0, velocity_y_m_s: 0.0, lap: 0 }
            };
            let movers: Vec<yard::Moving> = (0..12).map(mover).collect();
            let place = Place::new(0.5 * math::sin(0.3 * time_s), 0.0, 0.2 * math::sin(time_s));
            laser.look(&place, &movers);
            Frame { time_s, place, beams: laser.beams.clone() }
        })
        .collect()
}
