//! The nodes `ranges` and `tracks` on a bench.
#![allow(clippy::unwrap_used, reason = "tests")]

use messages::{
    Beam, Echo, LaserScan, Odometry, Ranges, ScanBeam, Segment, Segments, Track, TrackMotion, TrackState, Tracks, Twist,
};
use perception::ranges::BodyRanges;
use runtime::{Bench, OpenError, Time, math};

type Node = perception::tracks::Tracks;

const COUNT: usize = 541;
const FIELD_RAD: f64 = 1.5 * std::f64::consts::PI;

fn at(s: f64) -> Time {
    Time::from_seconds(s)
}

fn pose(x_m: f64, y_m: f64, heading_rad: f64, origin: u64) -> Odometry {
    let velocity = Twist::default();
    Odometry { x_m, y_m, heading_rad, velocity, pose_covariance: [0.0; 9], velocity_covariance: [0.0; 9], origin }
}

/// A laser at (x, y, heading) of the odometry frame that sees discs (x, y, radius) before a wall 8 m around the origin.
fn scan((x, y, heading): (f64, f64, f64), discs: &[(f64, f64, f64)]) -> Vec<Beam> {
    let beam = |k: usize| {
        let bearing = -0.5 * FIELD_RAD + FIELD_RAD * k as f64 / (COUNT - 1) as f64;
        let (u_y, u_x) = math::sin_cos(heading + bearing);
        let towards = x * u_x + y * u_y;
        let mut range = -towards + (towards * towards + 64.0 - x * x - y * y).sqrt();
        for (cx, cy, r) in discs {
            let (along, aside) = ((cx - x) * u_x + (cy - y) * u_y, u_x * (cy - y) - u_y * (cx - x));
            if along > 0.0 && aside.abs() < *r {
                range = range.min(along - (r * r - aside * aside).sqrt());
            }
        }
        Beam { bearing_rad: bearing as f32, range_m: range as f32, echo: Echo::Value as u32, ..Beam::default() }
    };
    (0..COUNT).map(beam).collect()
}

const LASER: Ranges = Ranges { min_range_m: 0.1, max_range_m: 30.0, beam_width_rad: 0.0, span_s: 0.0 };
const PERIOD_S: f64 = 0.05;

/// Runs for `seconds`: where the body is and what is around it, by time.
fn run(
    config: &str,
    seconds: f64,
    body: impl Fn(f64) -> (f64, f64, f64),
    discs: impl Fn(f64) -> Vec<(f64, f64, f64)>,
) -> Vec<(f64, Tracks, Vec<Track>)> {
    let mut bench = Bench::<Node>::builder(config).build().unwrap();
    let mut all = Vec::new();
    for k in 0..=(seconds / PERIOD_S) as u64 {
        let t = k as f64 * PERIOD_S;
        let place = body(t);
        bench.feed("odometry", at(1.0 + t), &pose(place.0, place.1, place.2, 0), &[]);
        bench.feed("ranges", at(1.0 + t), &LASER, &scan(place, &discs(t)));
        bench.step(at(1.0 + t)).unwrap();
        if let Some((stamp, head, tracks)) = bench.read::<Tracks>("tracks") {
            assert_eq!(stamp, at(1.0 + t), "a sample bears its scan's stamp");
            all.push((t, head, tracks));
        }
    }
    all
}

fn confirmed(tracks: &[Track]) -> Vec<Track> {
    tracks.iter().filter(|track| track.state != TrackState::Tentative as u32).copied().collect()
}

const BOTH: [&str; 2] = ["filter = \"polar\"", "filter = \"cartesian\""];

#[test]
fn a_walker_is_followed_with_his_velocity_in_both_frames_and_predicted() {
    for config in BOTH {
        // The body stands at (1, 0) and looks left; the walker passes ahead of it.
        let body = |_| (1.0, 0.0, std::f64::consts::FRAC_PI_2);
        let all = run(config, 3.0, body, |t| vec![(-1.0 + 0.8 * t, 2.0, 0.2)]);
        let (t, head, tracks) = all.last().unwrap();
        let track = confirmed(tracks)[0];
        assert_eq!(confirmed(tracks).len(), 1, "{config}: {tracks:?}");
        assert!(track.moves() && track.state == TrackState::Confirmed as u32, "{config}: {track:?}");
        let x = -1.0 + 0.8 * t;
        assert!((track.odom_x_m - x).abs() < 0.06 && (track.odom_y_m - 2.0).abs() < 0.06, "{config}: {track:?}");
        assert!(
            (track.odom_velocity_x_m_s - 0.8).abs() < 0.1 && track.odom_velocity_y_m_s.abs() < 0.1,
            "{config}: {track:?}"
        );
        // To the right in the odometry frame is to the right of a body that looks left: negative y.
        assert!((track.velocity_y_m_s + 0.8).abs() < 0.1 && track.velocity_x_m_s.abs() < 0.1, "{config}: {track:?}");
        assert!((track.x_m - 2.0).abs() < 0.06 && (track.y_m + (x - 1.0)).abs() < 0.06, "{config}: {track:?}");
        assert!((track.radius_m - 0.2).abs() < 0.05, "{config}: {track:?}");
        let ahead = head.path_step_s * 4.0;
        assert!((track.path_y_m[3] - (track.y_m + ahead * track.velocity_y_m_s)).abs() < 1e-9, "{config}: {track:?}");
    }
}

#[test]
fn what_stands_is_still_however_the_body_drives_and_turns() {
    for config in BOTH {
        let body = |t: f64| (-2.0 + 0.8 * t, 0.3 * math::sin(t), 0.6 * math::sin(1.3 * t));
        let all = run(config, 4.0, body, |_| vec![(3.0, 1.0, 0.3), (2.5, -1.5, 0.15), (3.5, 2.0, 0.2)]);
        for (t, _, tracks) in all.iter().filter(|(t, ..)| *t > 1.0) {
            let tracks = confirmed(tracks);
            assert_eq!(tracks.len(), 3, "{config} {t}: {tracks:?}");
            assert!(tracks.iter().all(|track| track.motion == TrackMotion::Still as u32), "{config} {t}: {tracks:?}");
        }
    }
}

#[test]
fn a_walker_keeps_his_number_behind_a_pillar() {
    for config in BOTH {
        let all = run(config, 5.0, |_| (0.0, 0.0, 0.0), |t| vec![(2.0, 0.0, 0.25), (4.0, -2.0 + 0.9 * t, 0.2)]);
        let walker = |t: f64, tracks: &[Track]| {
            let y = -2.0 + 0.9 * t;
            confirmed(tracks).into_iter().find(|k| math::hypot(k.odom_x_m - 4.0, k.odom_y_m - y) < 0.3)
        };
        let before = all.iter().find(|(t, ..)| *t > 1.2).and_then(|(t, _, k)| walker(*t, k)).unwrap();
        let hidden = all.iter().any(|(t, _, k)| walker(*t, k).is_some_and(|k| k.state == TrackState::Coasting as u32));
        let after = all.last().and_then(|(t, _, k)| walker(*t, k)).unwrap();
        assert!(hidden, "{config}: the pillar never hid him");
        assert_eq!(before.id, after.id, "{config}");
    }
}

#[test]
fn what_is_gone_is_forgotten_and_what_is_hidden_is_remembered_for_a_while() {
    // It vanishes into thin air at 2 s: the laser sees the wall through its place.
    let all = run("", 3.0, |_| (0.0, 0.0, 0.0), |t| if t < 2.0 { vec![(3.0, 0.0, 0.2)] } else { vec![] });
    assert_eq!(confirmed(&all.last().unwrap().2).len(), 0);
    // Something stands before it from 2 s on.
    let discs = |t: f64| if t < 2.0 { vec![(3.0, 0.0, 0.2)] } else { vec![(3.0, 0.0, 0.2), (1.5, 0.0, 0.3)] };
    let all = run("", 3.0, |_| (0.0, 0.0, 0.0), discs);
    assert!(all.last().unwrap().2.iter().any(|track| track.state == TrackState::Coasting as u32));
}

#[test]
fn a_moved_origin_begins_all_tracks_anew_and_an_old_scan_changes_nothing() {
    let mut bench = Bench::<Node>::new().unwrap();
    let beams = scan((0.0, 0.0, 0.0), &[(2.0, 0.0, 0.2)]);
    let mut step = |s: f64, stamp: f64, origin: u64| {
        bench.feed("odometry", at(s), &pose(0.0, 0.0, 0.0, origin), &[]);
        bench.feed("ranges", at(stamp), &LASER, &beams);
        bench.step(at(s)).unwrap();
        let (stamp, head, tracks) = bench.read::<Tracks>("tracks")?;
        tracks.first().map(|track| (stamp, head.origin, track.id, track.age_s))
    };
    // What lies in the ring already is history.
    step(0.9, 0.9, 0);
    step(1.0, 1.0, 0);
    assert_eq!(step(1.1, 1.1, 0).unwrap(), (at(1.1), 0, 1, 0.1));
    assert_eq!(step(1.2, 1.05, 0).unwrap().0, at(1.1), "time went backwards: nothing new is written");
    assert_eq!(step(1.3, 1.3, 1).unwrap(), (at(1.3), 1, 2, 0.0));
}

#[test]
fn without_odometry_and_with_beams_that_say_nothing_it_is_silent_or_empty() {
    let mut bench = Bench::<Node>::new().unwrap();
    bench.feed("ranges", at(1.0), &LASER, &scan((0.0, 0.0, 0.0), &[]));
    bench.step(at(1.0)).unwrap();
    assert!(bench.read::<Tracks>("tracks").is_none());
    let rubbish = [
        Beam { range_m: f32::NAN, echo: Echo::Value as u32, ..Beam::default() },
        Beam { bearing_rad: f32::INFINITY, range_m: 1.0, echo: Echo::Value as u32, ..Beam::default() },
        Beam { echo: 77, ..Beam::default() },
    ];
    for (k, beams) in [&rubbish[..], &[]].into_iter().enumerate() {
        let now = at(1.1 + 0.1 * k as f64);
        bench.feed("odometry", now, &pose(0.0, 0.0, 0.0, 0), &[]);
        bench.feed("ranges", now, &LASER, beams);
        bench.step(now).unwrap();
        let (_, _, tracks) = bench.read::<Tracks>("tracks").unwrap();
        assert!(tracks.is_empty());
    }
}

#[test]
fn the_segments_of_the_scan_are_told_beside_the_tracks() {
    let mut bench = Bench::<Node>::new().unwrap();
    // What lies in the ring at the first step is history.
    for s in [0.9, 1.0] {
        bench.feed("odometry", at(s), &pose(0.0, 0.0, 0.0, 0), &[]);
        bench.feed("ranges", at(s), &LASER, &scan((0.0, 0.0, 0.0), &[(2.0, 0.5, 0.2)]));
        bench.step(at(s)).unwrap();
    }
    let (stamp, head, segments): (_, Segments, Vec<Segment>) = bench.read::<Segments>("segments").unwrap();
    assert_eq!((stamp, head.beams as usize), (at(1.0), COUNT));
    let disc = segments.iter().find(|s| s.radius_sigma_m.is_finite()).unwrap();
    assert!((disc.centre_x_m - 2.0).abs() < 0.03 && (disc.centre_y_m - 0.5).abs() < 0.03, "{disc:?}");
}

#[test]
fn settings_that_make_no_sense_are_refused_with_their_names() {
    for (config, word) in [
        ("gate = 0.0", "gate"),
        ("most_tracks = 0", "most_tracks"),
        ("segments = { noise_m = -1.0 }", "segments.noise_m"),
        ("segments = { most_beams = 3 }", "segments.most_beams"),
    ] {
        match Bench::<Node>::builder(config).build() {
            Err(OpenError::Config { reason }) => assert!(reason.contains(word), "{reason}"),
            other => panic!("{config} was accepted: {:?}", other.map(|_| ())),
        }
    }
}

#[test]
fn a_scan_becomes_ranges_of_the_body_stamped_by_its_newest_beam() {
    let mut bench = Bench::<BodyRanges>::builder("margin_m = 0.02").build().unwrap();
    // What lies in the rings at the first step is history.
    bench.feed("scan", at(0.9), &LaserScan::default(), &[]);
    bench.feed("ranger", at(0.9), &LASER, &[]);
    bench.step(at(0.9)).unwrap();
    let head = LaserScan {
        angle_min_rad: -1.0,
        angle_increment_rad: 1.0,
        time_increment_s: 0.01,
        range_min_m: 0.1,
        range_max_m: 30.0,
        x_m: 0.15,
        ..LaserScan::default()
    };
    let beam = |range_m, echo| ScanBeam { range_m, intensity: 0, echo: echo as u16 };
    bench.feed("scan", at(1.0), &head, &[beam(2.0, Echo::Value), beam(0.05, Echo::Value), beam(0.0, Echo::Clear)]);
    bench.step(at(1.03)).unwrap();
    let (stamp, ranges, beams) = bench.read::<Ranges>("ranges").unwrap();
    assert_eq!((stamp, ranges.max_range_m), (at(1.02), 30.0));
    assert_eq!((beams[0].origin_x_m, beams[0].bearing_rad, beams[0].age_s), (0.15, -1.0, 0.02));
    let echoes: Vec<u32> = beams.iter().map(|beam| beam.echo).collect();
    assert_eq!(
        echoes,
        [Echo::Value, Echo::Off, Echo::Clear].map(|echo| echo as u32),
        "5 cm ahead is the body's own nose"
    );
    bench.feed("ranger", at(2.0), &LASER, &scan((0.0, 0.0, 0.0), &[]));
    bench.step(at(2.0)).unwrap();
    assert_eq!(bench.read::<Ranges>("ranges").unwrap().2.len(), COUNT);
}
