//! `sinew bench simulate`: the whole robot on virtual time, protocol bytes included, on one core.

use super::machine::Before;
use super::process::own_thread_ns;
use super::report::{Report, Target, Value};
use super::timing::Times;
use super::witness::Witnesses;
use crate::exit::Failure;
use crate::load::{self, Changes};
use crate::simulation;
use runtime::{NodeType, clock};
use std::path::Path;

/// Simulated time of a run [s].
const RUN_S: f64 = 60.0;
/// Runs, a seed each.
const RUNS: u64 = 20;
/// What is aimed at.
const TARGET: f64 = 1000.0;

/// Simulates the robot in `file`; `part` of the usual number of runs.
pub fn run(file: Option<&Path>, part: f64, types: &[NodeType]) -> Result<Report, Failure> {
    let robot = load::robot(file, &Changes::default(), types)?;
    let before = Before::now();
    let witnesses = Witnesses::start()?;
    let runs = ((RUNS as f64 * part) as u64).max(2);
    let mut times = Times::with_room_for(runs as usize);
    let (mut by_wall, mut by_core) = (Vec::new(), Vec::new());
    // The first run pays for what the others find in the caches: it does not count.
    simulation::run(&robot, 0, 1.0, None)?;
    for seed in 0..runs {
        let (begin, begin_ns) = (clock::now(), own_thread_ns());
        simulation::run(&robot, seed, RUN_S, None)?;
        let (end, end_ns) = (clock::now(), own_thread_ns());
        times.push(begin, end);
        by_wall.push(RUN_S / end.since(begin).max(1e-9));
        by_core.push(RUN_S / ((end_ns - begin_ns) as f64 * 1e-9).max(1e-9));
    }
    let seen = witnesses.stop();
    let machine = before.finish(vec!["one thread, SCHED_OTHER".into()], &seen);
    let (wall, core) = (three(&mut by_wall), three(&mut by_core));
    let mut values = Vec::new();
    for (what, three) in [("core_time", core), ("wall_time", wall)] {
        for (name, factor) in ["least", "median", "greatest"].into_iter().zip(three) {
            values.push(Value::new(format!("realtime_factor_{what}_{name}"), factor, "× real time"));
        }
    }
    let target = Target {
        aim: format!("whole robot: at least {TARGET} × real time on one core"),
        measured: format!(
            "{:.0} × by time on the core, {:.0} × by the clock (medians of {runs} runs)",
            core[1], wall[1]
        ),
        reached: core[1] >= TARGET,
    };
    let rows = vec![times.row("wander_60s", 0, &seen)];
    let note = format!(
        "The row times runs of {RUN_S} simulated seconds of \"{}\", the host's start included, by the clock: other \
         programs that share the core lengthen it. Core time is what the scheduler says that the thread had of a core.",
        robot.name
    );
    Ok(Report { bench: "simulate", machine, rows, values, targets: vec![target], notes: vec![note] })
}

/// Least, median and greatest.
fn three(values: &mut [f64]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [0, values.len() / 2, values.len() - 1].map(|index| values[index])
}
