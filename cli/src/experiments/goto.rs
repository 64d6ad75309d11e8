//! Goto: random targets in an open hall, position control (mode 3), each from a fresh start.
//!
//! Every target is driven to twice: with wheels that do on the ground what they are told, which shows Goto itself, and
//! with imperfect ones (scale, turn, drift and slip drawn from the seed), where the robot has nothing but its encoders and
//! the truth drifts away from what it knows. S2 had position fixes in between.

use super::rig::{End, OpMode, Rig, configure, service};
use super::{Extent, Figure, Outcome, chance, greatest, in_parallel, quantile};
use crate::exit::Failure;
use crate::picture;
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
    picture: Option<String>,
}

/// Runs the experiment.
pub fn run(extent: &Extent) -> Result<Outcome, Failure> {
    let imperfect = service("open")?;
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
        let picture = match run {
            0 => Some(picture::of_track(robot, &rig.track())?),
            _ => None,
        };
        Ok(Ended {
            perfect: is_perfect,
            arrived: matches!(end, End::Done(_)),
            true_error_m: math::hypot(truth.x_m - goal.x_m, truth.y_m - goal.y_m),
            known_error_m: math::hypot(pose.x_m - goal.x_m, pose.y_m - goal.y_m),
            heading_error_rad: (!heading_rad.is_nan()).then(|| math::wrap_angle(pose.heading_rad - heading_rad).abs()),
            took_s,
            contacts: truth.contacts.iter().sum(),
            remark: (!matches!(end, End::Done(_))).then(|| format!("seed {seed} to {goal:?}: {end:?}")),
            picture,
        })
    })?;
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
            Figure::new("median time", quantile(&all(|e| e.took_s), 0.5), "s"),
            Figure::new("contacts", ended.iter().map(|e| e.contacts).sum::<u64>() as f64, "").at_most(0.0),
        ],
        remarks: ended.iter().filter_map(|e| e.remark.clone()).take(5).collect(),
        pictures: ended.into_iter().filter_map(|e| e.picture).map(|svg| ("goto.svg".into(), svg)).collect(),
    })
}
