//! Goto: random targets in an open hall, position control (mode 3), each from a fresh start.
//!
//! Every target is driven to twice: with wheels that do on the ground what they are told, which shows Goto itself, and
//! with imperfect ones (scale, turn, drift and slip drawn from the seed), where the robot has nothing but its encoders and
//! the truth drifts away from what it knows. S2 had position fixes in between.

use super::chart::{Chart, Mark, Series};
use super::rig::{End, OpMode, Rig, configure};
use super::{Extent, Figure, Outcome, chance, greatest, in_parallel, quantile};
use crate::exit::Failure;
use messages::{GotoGoal, Odometry};
use runtime::{Layer, math};
use std::f64::consts::TAU;

/// Seeds, and targets of each.
const SEEDS: usize = 20;
const TARGETS: usize = 10;
/// Targets lie within this of the start [m].
const WITHIN_M: f64 = 3.0;
/// A run is given so long [s].
const LIMIT_S: f64 = 60.0;

struct Ended {
    perfect: bool,
    arrived: bool,
    /// By the truth, and by the odometry that it goes by [m].
    true_error_m: f64,
    known_error_m: f64,
    heading_error_rad: Option<f64>,
    took_s: f64,
    contacts: u64,
    remark: Option<String>,
    goal: (f64, f64),
    track: Vec<(f64, f64)>,
}

/// What the issue asks for [m], and the tolerance that is asked of Goto.
const PROGRAMMED_M: f64 = 0.10;
const TOLERANCE_M: f64 = 0.02;
/// As many tracks are drawn.
const DRAWN: usize = 40;

/// Runs the experiment.
pub fn run(extent: &Extent) -> Result<Outcome, Failure> {
    let imperfect = extent.service("open")?;
    let mut perfect = imperfect.clone();
    configure(&mut perfect, Layer::Simulator, "world", |config| {
        let none = ["distance_error", "turn_error", "drift_rad_per_m", "slip_m", "encoder_ticks"];
        let wheels: toml::Table = none.iter().map(|key| ((*key).to_owned(), toml::Value::Float(0.0))).collect();
        let realism: toml::Table = [("wheels".to_owned(), toml::Value::Table(wheels))].into_iter().collect();
        config.insert("realism".into(), realism.into());
    });
    let count = extent.of(SEEDS * TARGETS);
    let ended = in_parallel(2 * count, extent.jobs, |run| {
        let (is_perfect, index) = (run >= count, run % count);
        let robot = if is_perfect { &perfect } else { &imperfect };
        let seed = (index / TARGETS) as u64;
        let draw = |k: u64| chance(seed, (index % TARGETS) as u64 * 8 + k);
        let (sin, cos) = math::sin_cos(TAU * draw(0));
        let away_m = 0.5 + (WITHIN_M - 0.5) * draw(1);
        // Every other target has a final heading.
        let heading_rad = if index % 2 == 0 { math::wrap_angle(TAU * draw(2)) } else { f64::NAN };
        let goal = GotoGoal { x_m: 6.0 + away_m * cos, y_m: 6.0 + away_m * sin, heading_rad, tolerance_m: 0.0 };
        let mut rig = Rig::new(robot, seed, OpMode::Position)?;
        let begun_s = rig.now_s();
        let ticket = rig.order("/actions/goto", "goto", &goal);
        let end = rig.until_over(ticket, LIMIT_S);
        let took_s = rig.now_s() - begun_s;
        // The wheels come to rest.
        rig.watch(1.0);
        let truth = rig.truth();
        let pose: Odometry = rig.latest("/perception/odometry/pose").unwrap_or_default();
        let drawn = if is_perfect && index < DRAWN { &rig.moments[..] } else { &[] };
        Ok(Ended {
            perfect: is_perfect,
            arrived: matches!(end, End::Done(_)),
            true_error_m: math::hypot(truth.x_m - goal.x_m, truth.y_m - goal.y_m),
            known_error_m: math::hypot(pose.x_m - goal.x_m, pose.y_m - goal.y_m),
            heading_error_rad: (!heading_rad.is_nan()).then(|| math::wrap_angle(pose.heading_rad - heading_rad).abs()),
            took_s,
            contacts: truth.contacts.iter().sum(),
            remark: (!matches!(end, End::Done(_))).then(|| format!("seed {seed} to {goal:?}: {end:?}")),
            goal: (goal.x_m, goal.y_m),
            track: drawn.iter().step_by(10).map(|m| (m.truth.x_m, m.truth.y_m)).collect(),
        })
    })?;
    let pictures = pictures(&ended);
    let all = |value: fn(&Ended) -> f64| ended.iter().map(value).collect::<Vec<f64>>();
    let errors =
        |perfect: bool| -> Vec<f64> { ended.iter().filter(|e| e.perfect == perfect).map(|e| e.true_error_m).collect() };
    let (perfect, imperfect) = (errors(true), errors(false));
    let share = |is: fn(&Ended) -> bool| ended.iter().filter(|e| is(e)).count() as f64 / ended.len() as f64;
    Ok(Outcome {
        experiment: "goto",
        conditions: "mode 3, targets within 3 m, tolerance 2 cm, encoders alone; half of the runs with perfect wheels",
        runs: ended.len(),
        figures: vec![
            Figure::new("arrived", share(|e| e.arrived), "share").at_least(1.0),
            Figure::new("greatest error by truth, perfect wheels", greatest(perfect.iter().copied()), "m")
                .at_most(0.02),
            Figure::new("median error by truth, perfect wheels", quantile(&perfect, 0.5), "m"),
            Figure::new("greatest error by truth, imperfect wheels", greatest(imperfect.iter().copied()), "m")
                .at_most(0.1),
            Figure::new("p95 error by truth, imperfect wheels", quantile(&imperfect, 0.95), "m"),
            Figure::new("median error by truth, imperfect wheels", quantile(&imperfect, 0.5), "m"),
            Figure::new("greatest error by odometry", greatest(all(|e| e.known_error_m).into_iter()), "m")
                .at_most(0.02),
            Figure::new("greatest heading error", greatest(ended.iter().filter_map(|e| e.heading_error_rad)), "rad")
                .at_most(0.05),
            Figure::new("within 2 cm by truth, perfect wheels", within(&perfect, TOLERANCE_M), "share").at_least(1.0),
            Figure::new("within 2 cm by truth, imperfect wheels", within(&imperfect, TOLERANCE_M), "share"),
            Figure::new("within 10 cm by truth, imperfect wheels", within(&imperfect, PROGRAMMED_M), "share")
                .at_least(1.0),
            Figure::new("median time", quantile(&all(|e| e.took_s), 0.5), "s"),
            Figure::new("contacts", ended.iter().map(|e| e.contacts).sum::<u64>() as f64, "").at_most(0.0),
        ],
        remarks: ended.iter().filter_map(|e| e.remark.clone()).take(5).collect(),
        pictures,
    })
}

fn within(errors: &[f64], most_m: f64) -> f64 {
    errors.iter().filter(|error| **error <= most_m).count() as f64 / errors.len().max(1) as f64
}

/// The tracks, and how far from the target they ended.
fn pictures(ended: &[Ended]) -> Vec<(String, String)> {
    let errors = |perfect: bool| -> Vec<f64> {
        ended.iter().filter(|e| e.perfect == perfect).map(|e| 100.0 * e.true_error_m).collect()
    };
    let bars = [
        Series::histogram("imperfect wheels", 1, &errors(false), 0.5),
        Series::histogram("perfect wheels", 0, &errors(true), 0.5),
    ];
    let histogram = Chart {
        title: "Goto: distance from the target at rest",
        x: "error by truth [cm]",
        y: "runs",
        series: &bars,
        bounds: &[(100.0 * TOLERANCE_M, "tolerance 2 cm"), (100.0 * PROGRAMMED_M, "bound 10 cm")],
        is_map: false,
    };
    let drawn = || ended.iter().filter(|e| !e.track.is_empty());
    let mut series: Vec<Series> = drawn().map(|e| Series::line("", 0, e.track.clone())).collect();
    if let Some(first) = series.first_mut() {
        first.name = "track by truth".into();
    }
    let targets = Series::line("target, 10 cm", 1, drawn().map(|e| e.goal).collect());
    series.push(Series { mark: Mark::Rings(PROGRAMMED_M), ..targets });
    let map = Chart {
        title: "Goto: from the middle of the hall to random targets",
        x: "x [m]",
        y: "y [m]",
        series: &series,
        bounds: &[],
        is_map: true,
    };
    vec![("goto.svg".into(), map.svg()), ("goto_errors.svg".into(), histogram.svg())]
}
