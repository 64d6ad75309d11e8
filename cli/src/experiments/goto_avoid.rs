//! Goto + Avoid: half of the runs through a pocket in which whoever drives straight is caught (mode 3, then 4), half
//! through an office with people (mode 4).

use super::rig::{End, OpMode, Rig};
use super::{Extent, Figure, Outcome, chance, greatest, in_parallel, quantile};
use crate::exit::Failure;
use crate::picture;
use messages::{Detour, GotoGoal};
use runtime::math;

const RUNS: usize = 100;
/// A run is given so long [s].
const LIMIT_S: f64 = 400.0;
/// Behind the pocket [m].
const BEHIND: (f64, f64) = (9.0, 4.0);
/// Free places of the office [m].
const OFFICE: [(f64, f64); 5] = [(12.5, 8.8), (9.3, 1.0), (12.3, 3.2), (1.2, 7.0), (9.0, 5.4)];

struct Ended {
    arrived: bool,
    error_m: f64,
    took_s: f64,
    caused: u64,
    suffered: u64,
    minima: u32,
    least_clearance_m: f64,
    remark: Option<String>,
    picture: Option<(String, String)>,
}

/// With the ring of sonars.
pub fn with_sonar(extent: &Extent) -> Result<Outcome, Failure> {
    run(extent, "robot.toml", "goto_avoid")
}

/// With the laser.
pub fn with_laser(extent: &Extent) -> Result<Outcome, Failure> {
    run(extent, "laser.toml", "goto_avoid_laser")
}

fn run(extent: &Extent, file: &str, experiment: &'static str) -> Result<Outcome, Failure> {
    let (trap, office) = (extent.variant(file, "trap")?, extent.variant(file, "office")?);
    let count = extent.of(RUNS);
    let ended = in_parallel(count, extent.jobs, |index| {
        let seed = (index / 2) as u64;
        let is_trap = index % 2 == 0;
        let robot = if is_trap { &trap } else { &office };
        let place = OFFICE[(chance(seed, 1) * OFFICE.len() as f64) as usize];
        let (x_m, y_m) = if is_trap { BEHIND } else { place };
        let goal = GotoGoal { x_m, y_m, heading_rad: f64::NAN, tolerance_m: 0.05 };
        let mut rig = Rig::new(robot, seed, OpMode::PositionAvoidance)?;
        let begun_s = rig.now_s();
        let ticket = rig.order("/actions/goto", "goto", &goal);
        let end = rig.until_over(ticket, LIMIT_S);
        let took_s = rig.now_s() - begun_s;
        rig.watch(0.5);
        let truth = rig.truth();
        let detour: Detour = rig.latest("/coordinator/arbiter/detour").unwrap_or_default();
        let world = if is_trap { "trap" } else { "office" };
        let picture = match index {
            0 | 1 => {
                let svg = picture::of_crossing(robot, &format!("Goto + Avoid, {world}"), &rig.track())?;
                Some((format!("{experiment}_{world}.svg"), svg))
            }
            _ => None,
        };
        let arrived = matches!(end, End::Done(_));
        let hit = truth.contacts[0] + truth.contacts[1] > 0;
        Ok(Ended {
            arrived,
            error_m: if arrived { math::hypot(truth.x_m - x_m, truth.y_m - y_m) } else { f64::NAN },
            took_s,
            caused: truth.contacts[0] + truth.contacts[1],
            suffered: truth.contacts[2],
            minima: detour.minima,
            least_clearance_m: rig.moments.iter().map(|m| m.truth.clearance_m).fold(f64::INFINITY, f64::min),
            remark: (!arrived || hit).then(|| {
                format!(
                    "{world} seed {seed} to ({x_m}, {y_m}): {end:?}, at ({:.2}, {:.2}), contacts {:?}",
                    truth.x_m, truth.y_m, truth.contacts
                )
            }),
            picture,
        })
    })?;
    let share = |is: fn(&Ended) -> bool| ended.iter().filter(|e| is(e)).count() as f64 / count as f64;
    let times: Vec<f64> = ended.iter().map(|e| e.took_s).collect();
    Ok(Outcome {
        experiment,
        conditions: "mode 4, odometry alone; a pocket before the goal, and an office with three people",
        runs: count,
        figures: vec![
            Figure::new("without collision", share(|e| e.caused == 0), "share").at_least(1.0),
            Figure::new("arrived", share(|e| e.arrived), "share").at_least(1.0),
            Figure::new("contacts suffered", ended.iter().map(|e| e.suffered).sum::<u64>() as f64, ""),
            Figure::new("runs with a local minimum", share(|e| e.minima > 0), "share"),
            Figure::new(
                "least clearance",
                ended.iter().map(|e| e.least_clearance_m).fold(f64::INFINITY, f64::min),
                "m",
            ),
            Figure::new(
                "greatest error by truth of those that arrived",
                greatest(ended.iter().filter(|e| e.arrived).map(|e| e.error_m)),
                "m",
            ),
            Figure::new("median time", quantile(&times, 0.5), "s"),
            Figure::new("longest time", quantile(&times, 1.0), "s"),
        ],
        remarks: ended.iter().filter_map(|e| e.remark.clone()).take(8).collect(),
        pictures: ended.into_iter().filter_map(|e| e.picture).collect(),
    })
}
