//! EmergencyStop: somebody steps into the way, stands there, and walks away; position control without avoidance (mode 3).

use super::chart::{Chart, Series};
use super::rig::{End, OpMode, Rig, configure};
use super::{Extent, Figure, Outcome, greatest, in_parallel};
use crate::exit::Failure;
use messages::GotoGoal;
use runtime::Layer;

/// Speeds from 0.1 to 1 m/s, and seeds of each.
const SPEEDS: usize = 10;
const SEEDS: usize = 5;
/// Where the person will stand, and the goal behind [m].
const PERSON_X_M: f64 = 6.0;
const GOAL_X_M: f64 = 8.5;
/// A run is given so long [s].
const LIMIT_S: f64 = 120.0;

struct Ended {
    speed_m_s: f64,
    contacts: u64,
    arrived: bool,
    stopped: bool,
    backwards_m_s: f64,
    least_clearance_m: f64,
    remark: Option<String>,
    series: Option<Series>,
}

/// Runs the experiment.
pub fn run(extent: &Extent) -> Result<Outcome, Failure> {
    let count = SPEEDS * extent.of(SEEDS);
    let ended = in_parallel(count, extent.jobs, |index| {
        let speed_m_s = 0.1 * ((index % SPEEDS) as f64 + 1.0);
        let seed = (index / SPEEDS) as u64;
        let mut robot = extent.service("person")?;
        // It would reach the person some five seconds after the order: when somebody stands there.
        let start_x_m = (PERSON_X_M - 0.5 - 5.0 * speed_m_s).max(0.4);
        configure(&mut robot, Layer::Simulator, "world", |config| {
            if let Some(body) =
                config.get_mut("bodies").and_then(|bodies| bodies.get_mut(0)).and_then(toml::Value::as_table_mut)
            {
                body.insert("start".into(), vec![start_x_m, 2.0, 0.0].into());
            }
        });
        configure(&mut robot, Layer::Actions, "goto", |config| {
            config.insert("max_speed_m_s".into(), speed_m_s.into());
        });
        let mut rig = Rig::new(&robot, seed, OpMode::Position)?;
        let begun_s = rig.now_s();
        let goal = GotoGoal { x_m: GOAL_X_M, y_m: 2.0, heading_rad: f64::NAN, tolerance_m: 0.05 };
        let ticket = rig.order("/actions/goto", "goto", &goal);
        let end = rig.until_over(ticket, LIMIT_S);
        let contacts = rig.truth().contacts.iter().sum();
        // At rest before the person, well before the goal.
        let stopped = rig.moments.iter().any(|m| {
            m.truth.clearance_m < 0.6
                && m.truth.velocity.linear_x_m_s.abs() < 1e-3
                && m.truth.x_m > start_x_m + 0.1
                && m.truth.x_m < PERSON_X_M
        });
        let arrived = matches!(end, End::Done(_));
        // Never backwards: nothing looks there.
        let backwards_m_s = rig.moments.iter().map(|m| -m.command.velocity.linear_x_m_s).fold(0.0, f64::max);
        let series = (seed == 0 && index % 3 == 0).then(|| {
            let shown = rig.moments.iter().filter(|m| m.time_s >= begun_s).step_by(5);
            let points = shown.map(|m| (m.time_s - begun_s, m.command.velocity.linear_x_m_s)).collect();
            Series::line(format!("{speed_m_s:.1} m/s"), index / 3, points)
        });
        Ok(Ended {
            speed_m_s,
            contacts,
            arrived,
            stopped,
            backwards_m_s,
            least_clearance_m: rig.moments.iter().map(|m| m.truth.clearance_m).fold(f64::INFINITY, f64::min),
            remark: (contacts > 0 || !arrived || !stopped)
                .then(|| format!("{speed_m_s:.1} m/s, seed {seed}: {end:?}, contacts {contacts}, stopped {stopped}")),
            series,
        })
    })?;
    let share = |is: fn(&Ended) -> bool| ended.iter().filter(|e| is(e)).count() as f64 / count as f64;
    let fastest = ended.iter().filter(|e| e.contacts == 0 && e.arrived).map(|e| e.speed_m_s).fold(0.0, f64::max);
    let remarks = ended.iter().filter_map(|e| e.remark.clone()).take(8).collect();
    let figures = vec![
        Figure::new("stopped before contact", share(|e| e.contacts == 0), "share").at_least(1.0),
        Figure::new("stopped at all", share(|e| e.stopped), "share").at_least(1.0),
        Figure::new("finished the mission", share(|e| e.arrived), "share").at_least(1.0),
        Figure::new("least clearance", ended.iter().map(|e| e.least_clearance_m).fold(f64::INFINITY, f64::min), "m"),
        Figure::new("fastest backwards", greatest(ended.iter().map(|e| e.backwards_m_s)), "m/s").at_most(0.0),
        Figure::new("fastest without contact", fastest, "m/s").at_least(1.0),
    ];
    let series: Vec<Series> = ended.into_iter().filter_map(|e| e.series).collect();
    let chart = Chart {
        title: "EmergencyStop: somebody steps into the way, stands there, walks away",
        x: "time since the order [s]",
        y: "speed sent to the wheels [m/s]",
        series: &series,
        bounds: &[],
        is_map: false,
    };
    Ok(Outcome {
        experiment: "emergency_stop",
        conditions: "mode 3, goals at 0.1 to 1.0 m/s; a person stands in the way for ten seconds",
        runs: count,
        figures,
        remarks,
        pictures: vec![("emergency_stop.svg".into(), chart.svg())],
    })
}
