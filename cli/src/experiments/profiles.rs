//! Velocity profiles: a goal straight ahead, with and without a bound on the jerk (mode 3).

use super::chart::{Chart, Series};
use super::rig::{EVERY_S, End, OpMode, Rig, configure};
use super::{Extent, Figure, Outcome, greatest, in_parallel};
use crate::exit::Failure;
use messages::GotoGoal;
use runtime::Layer;

/// As the robot file has it [m/s³]; absent is the trapezoid.
const JERKS: [Option<f64>; 3] = [None, Some(2.0), Some(0.5)];
/// Bounds of the service robot's body [m/s²].
const ACCELERATION_M_S2: f64 = 0.5;
const DECELERATION_M_S2: f64 = 0.8;

/// Runs the experiment.
pub fn run(extent: &Extent) -> Result<Outcome, Failure> {
    let runs = in_parallel(JERKS.len(), extent.jobs, |index| {
        let mut robot = extent.service("open")?;
        configure(&mut robot, Layer::Motion, "drive", |config| match JERKS[index] {
            Some(jerk) => drop(config.insert("max_jerk_m_s3".into(), jerk.into())),
            None => drop(config.remove("max_jerk_m_s3")),
        });
        let mut rig = Rig::new(&robot, 0, OpMode::Position)?;
        let begun_s = rig.now_s();
        let goal = GotoGoal { x_m: 9.0, y_m: 6.0, heading_rad: f64::NAN, tolerance_m: 0.0 };
        let ticket = rig.order("/actions/goto", "goto", &goal);
        let end = rig.until_over(ticket, 60.0);
        let name = JERKS[index].map_or("unbounded".to_owned(), |jerk| format!("{jerk} m/s³"));
        let speeds = rig.moments.iter().filter(|m| m.time_s >= begun_s);
        let points: Vec<(f64, f64)> = speeds.map(|m| (m.time_s - begun_s, m.command.velocity.linear_x_m_s)).collect();
        Ok((Series::line(name, index, points), end))
    })?;
    let gains =
        |series: &Series| -> Vec<f64> { series.points.windows(2).map(|p| (p[1].1 - p[0].1) / EVERY_S).collect() };
    let jerk = |series: &Series| greatest(gains(series).windows(2).map(|a| ((a[1] - a[0]) / EVERY_S).abs()));
    let up = greatest(runs.iter().flat_map(|(series, _)| gains(series)));
    let down = greatest(runs.iter().flat_map(|(series, _)| gains(series)).map(|gain| -gain));
    let arrived = runs.iter().filter(|(_, end)| matches!(end, End::Done(_))).count();
    let figures = vec![
        Figure::new("arrived", arrived as f64 / runs.len() as f64, "share").at_least(1.0),
        Figure::new("greatest acceleration", up, "m/s²").at_most(ACCELERATION_M_S2 + 1e-6),
        Figure::new("greatest deceleration", down, "m/s²").at_most(DECELERATION_M_S2 + 1e-6),
        Figure::new("greatest jerk of the trapezoid", jerk(&runs[0].0), "m/s³"),
        // Arriving at a speed drops less than two steps' worth of acceleration.
        Figure::new("greatest jerk at 2 m/s³", jerk(&runs[1].0), "m/s³").at_most(4.0 + 1e-6),
        Figure::new("greatest jerk at 0.5 m/s³", jerk(&runs[2].0), "m/s³").at_most(1.0 + 1e-6),
    ];
    let count = runs.len();
    let remarks = runs
        .iter()
        .filter(|(_, end)| !matches!(end, End::Done(_)))
        .map(|(s, end)| format!("{}: {end:?}", s.name))
        .collect();
    let series: Vec<Series> = runs.into_iter().map(|(series, _)| series).collect();
    let chart = Chart {
        title: "A goal 3 m straight ahead: speed by bound of the jerk",
        x: "time since the order [s]",
        y: "speed sent to the wheels [m/s]",
        series: &series,
        bounds: &[],
        is_map: false,
    };
    let gained = |series: &Series| Series {
        points: series.points.windows(2).map(|p| (p[1].0, (p[1].1 - p[0].1) / EVERY_S)).collect(),
        ..series.clone()
    };
    let accelerations: Vec<Series> = series.iter().map(gained).collect();
    let second =
        Chart { title: "The same: acceleration", y: "acceleration [m/s²]", series: &accelerations, ..chart.clone() };
    Ok(Outcome {
        experiment: "profiles",
        conditions: "mode 3, 3 m straight ahead, what motion sends every 20 ms",
        runs: count,
        figures,
        remarks,
        pictures: vec![("profiles.svg".into(), chart.svg()), ("profiles_acceleration.svg".into(), second.svg())],
    })
}
