//! `sinew bench tracking`: how well the tracks are, on data that nobody here made.
//!
//! DynaBARN's key-framed cylinders (r = 0.5 m) give exact truth: position, velocity, who is who behind whom. Every way
//! of tracking sees the same scans. The labelled legs give recall on a real laser; everything else in those scans is
//! unlabelled, so there is no precision to be had from them.

mod baseline;
pub mod legs;
mod runs;
mod score;
pub mod yard;

use super::machine::Before;
use super::report::{Report, Target, Value};
use super::witness::Testimony;
use crate::exit::{Failure, USAGE};
use perception::scan::segments::Fit;
use perception::tracks::config::FilterKind;
use runs::{Contestant, Way};
use std::path::Path;

/// All ways of tracking that are compared.
const WAYS: [(&str, Way); 6] = [
    ("nearest_neighbour", Way::Nearest(Fit::ThreePoint)),
    ("nearest_neighbour_edges", Way::Nearest(Fit::Edges)),
    ("polar_three_point", Way::Filtered(FilterKind::Polar, Fit::ThreePoint)),
    ("polar_edges", Way::Filtered(FilterKind::Polar, Fit::Edges)),
    ("cartesian_least_squares", Way::Filtered(FilterKind::Cartesian, Fit::LeastSquares)),
    ("cartesian_edges", Way::Filtered(FilterKind::Cartesian, Fit::Edges)),
];
/// Noise of the simulated laser [m].
const SIGMA_M: f64 = 0.01;
/// Labels and what is found for them are at most so far apart [m].
const NEAR_M: [f64; 2] = [0.1, 0.2];

/// Runs all ways over the data in `folder` (laid out as `shared/data`); `part` of the worlds.
pub fn run(folder: Option<&Path>, part: f64) -> Result<Report, Failure> {
    let Some(folder) = folder else {
        return Err(Failure::new(USAGE, "say where the data lie: --data DIR, with dynabarn/ and leg-tracker/ in it"));
    };
    let before = Before::now();
    let yards = yard::read(&folder.join("dynabarn/worlds.txt"))?;
    let scans = legs::read(&folder.join("leg-tracker/labelled.txt.gz"))?;
    let used = ((yards.len() as f64 * part).ceil() as usize).max(1);
    let (mut values, mut notes) = (Vec::new(), Vec::new());
    let mut scores = Vec::new();
    for (name, way) in WAYS {
        let mut score = score::Score::default();
        for (index, yard) in yards[..used].iter().enumerate() {
            runs::drive(yard, index as u64, SIGMA_M, &mut Contestant::new(way, SIGMA_M), &mut score);
        }
        score.values(name, &mut values);
        scores.push(score);
    }
    for near_m in NEAR_M {
        for (name, way) in WAYS {
            let found = legs::recall(&scans, way, near_m);
            let mut add = |what: &str, share: f64| {
                let name = format!("legs_{what}_{:.0}_cm_{name}", near_m * 100.0);
                values.push(Value::new(name, share, "of labels"));
            };
            add("in_segments", found.in_segments());
            add("in_tracks", found.in_tracks());
        }
    }
    let labels = legs::labels(&scans);
    notes.push(format!(
        "{used} DynaBARN worlds, 20 s each at 50 Hz: 720 beams over 270°, σ = {SIGMA_M} m, the body driving 1 m/s through \
         the yard on a weaving line with exact odometry; {} scans with {labels} labelled legs, of a real laser that is \
         taken to stand still.",
        scans.len()
    ));
    let kept = [0, WAYS.len() - 1].map(|k| scores[k].kept_share());
    let target = Target {
        aim: "identity kept through occlusions at least as often as by the baseline".into(),
        measured: format!("{:.3} of occlusions, baseline {:.3}", kept[1], kept[0]),
        reached: kept[1] >= kept[0],
    };
    let machine = before.finish(vec!["one thread; no times are measured".into()], &Testimony::default());
    Ok(Report { bench: "tracking", machine, rows: Vec::new(), values, targets: vec![target], notes })
}
