//! Move: 10, 20, 30 cm/s for 5 s, and 30 cm/s with wheel differences of −15 to +15 cm/s; by encoders every 0.1 s (mode 1).

use super::chart::{Chart, Series};
use super::rig::{End, OpMode, Rig};
use super::{Extent, Figure, Outcome, greatest, in_parallel};
use crate::exit::Failure;
use messages::{MoveRequest, Odometry};

/// Speed and wheel difference [m/s].
const ORDERS: [(f64, f64); 9] =
    [(0.1, 0.0), (0.2, 0.0), (0.3, 0.0), (0.3, -0.15), (0.3, -0.1), (0.3, -0.05), (0.3, 0.05), (0.3, 0.1), (0.3, 0.15)];
const SEEDS: usize = 5;
const DURATION_S: f64 = 5.0;
/// Ramps last a second at either end: the cruise is judged.
const CRUISE_S: std::ops::Range<f64> = 1.5..4.5;
/// As the robot file has it [m].
const WHEEL_DISTANCE_M: f64 = 2.0 / 5.6;

struct Ended {
    /// Mean over the cruise less what was ordered, over the ordered speed.
    speed_error: f64,
    difference_error: f64,
    /// Greatest single sample's error.
    worst: f64,
    remark: Option<String>,
    series: Series,
}

/// Runs the experiment.
pub fn run(extent: &Extent) -> Result<Outcome, Failure> {
    let robot = extent.service("open")?;
    let count = ORDERS.len() * extent.of(SEEDS);
    let ended = in_parallel(count, extent.jobs, |index| {
        let (speed_m_s, wheel_difference_m_s) = ORDERS[index % ORDERS.len()];
        let seed = (index / ORDERS.len()) as u64;
        let mut rig = Rig::new(&robot, seed, OpMode::Velocity)?;
        let begun_s = rig.now_s();
        let ticket = rig.order(
            "/actions/move",
            "move",
            &MoveRequest { speed_m_s, wheel_difference_m_s, duration_s: DURATION_S },
        );
        let (mut samples, mut cruise) = (Vec::new(), Vec::new());
        for _ in 0..((DURATION_S + 1.5) / 0.1) as usize {
            rig.watch(0.1);
            let odometry: Odometry = rig.latest("/drivers/base/odometry").unwrap_or_default();
            let time_s = rig.now_s() - begun_s;
            let measured = (odometry.velocity.linear_x_m_s, odometry.velocity.angular_z_rad_s * WHEEL_DISTANCE_M);
            samples.push((time_s, if wheel_difference_m_s == 0.0 { measured.0 } else { measured.1 }));
            if CRUISE_S.contains(&time_s) {
                cruise.push(measured);
            }
        }
        let end = rig.until_over(ticket, 1.0);
        let mean = |value: fn(&(f64, f64)) -> f64| cruise.iter().map(value).sum::<f64>() / cruise.len() as f64;
        let off = |is: f64, ordered: f64| (is - ordered).abs() / speed_m_s;
        let name = match wheel_difference_m_s {
            0.0 => format!("{:.0} cm/s", speed_m_s * 100.0),
            difference => format!("{:+.0} cm/s", difference * 100.0).replace('-', "−"),
        };
        Ok(Ended {
            speed_error: off(mean(|m| m.0), speed_m_s),
            difference_error: off(mean(|m| m.1), wheel_difference_m_s),
            worst: greatest(cruise.iter().map(|m| off(m.0, speed_m_s).max(off(m.1, wheel_difference_m_s)))),
            remark: (!matches!(end, End::Done(_))).then(|| format!("{name}, seed {seed}: {end:?}")),
            series: Series::line(name, index % ORDERS.len() % 6, samples),
        })
    })?;
    let mean = |value: fn(&Ended) -> f64| ended.iter().map(value).sum::<f64>() / count as f64;
    let figures = vec![
        Figure::new("mean error of the speed", mean(|e| e.speed_error), "share").at_most(0.01),
        Figure::new("greatest run's error of the speed", greatest(ended.iter().map(|e| e.speed_error)), "share")
            .at_most(0.01),
        Figure::new("mean error of the wheel difference", mean(|e| e.difference_error), "share of the speed")
            .at_most(0.01),
        Figure::new(
            "greatest run's error of the difference",
            greatest(ended.iter().map(|e| e.difference_error)),
            "share of the speed",
        )
        .at_most(0.01),
        Figure::new("greatest error of a sample", greatest(ended.iter().map(|e| e.worst)), "share"),
        Figure::new("orders done", ended.iter().filter(|e| e.remark.is_none()).count() as f64 / count as f64, "share")
            .at_least(1.0),
    ];
    let remarks = ended.iter().filter_map(|e| e.remark.clone()).take(5).collect();
    let mut series: Vec<Series> = ended.into_iter().take(ORDERS.len()).map(|e| e.series).collect();
    let differences = series.split_off(3);
    let base = Chart { title: "", x: "time since the order [s]", y: "", series: &[], bounds: &[], is_map: false };
    let straight =
        Chart { title: "Move: 10, 20, 30 cm/s for 5 s", y: "speed by encoders [m/s]", series: &series, ..base };
    let turning = Chart {
        title: "Move: 30 cm/s with a difference between the wheels",
        y: "right less left, by encoders [m/s]",
        series: &differences,
        ..base
    };
    Ok(Outcome {
        experiment: "move",
        conditions: "mode 1, 5 s each, by encoders every 0.1 s, cruise from 1.5 to 4.5 s",
        runs: count,
        figures,
        remarks,
        pictures: vec![("move.svg".into(), straight.svg()), ("move_turning.svg".into(), turning.svg())],
    })
}
