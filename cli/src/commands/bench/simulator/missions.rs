//! The row of the batch runner: missions of 60 s of the whole built-in robot, with about a fault every two seconds each.
//!
//! A sample of the seeds is simulated, judged and counted as `sinew simulate --faults chaos` does, in a process of its own,
//! and its time is scaled up to 10,000; `--long` simulates them all. A tenth of the seeds is simulated once more without
//! faults and without the supervisor's policy, on one thread: what faults cost is the ratio of the core times.

use super::super::process::own_thread_ns;
use super::super::report::{Row, Target, Value};
use super::row::greatest_rss_mib;
use crate::batch::{self, Faults, Mission, Scenario};
use crate::exit::Failure;
use crate::load::{self, Changes};
use crate::simulation;
use runtime::{NodeType, OpenError, clock};
use serde::{Deserialize, Serialize};
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};
use supervisor::FaultRates;

/// Missions of the row, and of a sample of them.
const ALL: u64 = 10_000;
const SAMPLE: u64 = 400;
/// Simulated time of a mission [s].
const MISSION_S: f64 = 60.0;
/// What is aimed at, on two cores [min].
const AIM_MIN: f64 = 5.0;
const THREADS: usize = 2;

/// What came out.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Missions {
    n: u64,
    threads: usize,
    wall_s: f64,
    core_s: f64,
    contacts_caused: u64,
    failed: u64,
    faults: u64,
    restarts: u64,
    /// Core time of a mission with faults over that of one without.
    cost_of_faults: f64,
    rss_mib: f64,
}

/// Measures in a process of its own.
pub fn measure(part: f64, long: bool) -> Result<Missions, Failure> {
    let count = if long { ALL } else { ((SAMPLE as f64 * part) as u64).max(20) };
    let program = std::env::current_exe()?;
    let row = format!("missions:{count}");
    let output =
        Command::new(program).args(["bench", "simulator-row", &row, "--threads", &THREADS.to_string()]).output()?;
    if !output.status.success() {
        return Err(Failure::from(format!("row {row}: {}", String::from_utf8_lossy(&output.stderr).trim())));
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// The hidden command's part.
pub fn run(count: usize, threads: usize, types: &[NodeType]) -> Result<(), Failure> {
    let robot = load::robot(None, &Changes::default(), types)?;
    let (scenario, faults) = (Scenario::of_length(MISSION_S), Faults::from(FaultRates::CHAOS));
    // The first run pays for what the others find in the caches.
    simulation::run(&robot, 0, 1.0, Some(&faults))?;
    let work = |seeds: usize, faults: Option<&Faults>, threads: usize| {
        let seeds: Vec<u64> = (0..seeds as u64).collect();
        // Each thread's own: those that have ended are no longer in the process's sum.
        let on_core_ns = AtomicU64::new(0);
        let begin = clock::now();
        let judge = |seed: u64| {
            let begin_ns = own_thread_ns();
            let mission = Mission::judge(&scenario, &simulation::run(&robot, seed, MISSION_S, faults)?);
            on_core_ns.fetch_add(own_thread_ns().saturating_sub(begin_ns), Ordering::Relaxed);
            Ok(mission)
        };
        let (missions, error) = batch::work::<OpenError>(&seeds, threads, &judge, &mut |_| true);
        let (wall_s, core_s) = (clock::now().since(begin), on_core_ns.into_inner() as f64 * 1e-9);
        error.map_or(Ok((missions, wall_s, core_s)), Err)
    };
    let (missions, wall_s, core_s) = work(count, Some(&faults), threads)?;
    let some = (count / 10).clamp(1, 100);
    let ratio = work(some, Some(&faults), 1)?.2 / work(some, None, 1)?.2;
    let sum = |of: fn(&Mission) -> u64| missions.iter().map(of).sum::<u64>();
    let measured = Missions {
        n: missions.len() as u64,
        threads,
        wall_s,
        core_s,
        contacts_caused: sum(|mission| mission.contacts[0]),
        failed: sum(|mission| u64::from(!mission.succeeded())),
        faults: sum(|mission| mission.faults[0]),
        restarts: sum(|mission| mission.faults[1]),
        cost_of_faults: ratio,
        rss_mib: greatest_rss_mib(),
    };
    println!("{}", serde_json::to_string(&measured)?);
    Ok(())
}

impl Missions {
    /// Adds row, values and target.
    pub fn add_to(&self, rows: &mut Vec<Row>, values: &mut Vec<Value>, targets: &mut Vec<Target>) {
        let scale = ALL as f64 / self.n as f64 / 60.0;
        let (minutes, core_minutes) = (self.wall_s * scale, self.core_s * scale);
        let simulated_s = MISSION_S * self.n as f64;
        let name = "10,000 missions of 60 s, whole stack, faults on";
        // The mean stands for all three: missions overlap.
        let mean_us = self.core_s / self.n as f64 * 1e6;
        let mut row = Row::new(name, 0, [mean_us; 3], self.n);
        row.note("realtime_factor", simulated_s / self.wall_s);
        row.note("realtime_factor_core", simulated_s / self.core_s);
        row.note("rss_mib", self.rss_mib);
        row.note("threads", self.threads);
        row.note("minutes", minutes);
        row.note("core_minutes", core_minutes);
        row.note("contacts_caused", self.contacts_caused);
        row.note("failed_missions", self.failed);
        rows.push(row);
        values.push(Value::new("faults a mission", self.faults as f64 / self.n as f64, "faults"));
        values.push(Value::new("core time of a mission with faults over one without", self.cost_of_faults, "×"));
        let how = match self.n == ALL {
            true => "all of them simulated".to_owned(),
            false => format!("scaled up from a sample of {} missions; --long simulates all", self.n),
        };
        targets.push(Target {
            aim: format!("{name}: at most {AIM_MIN} minutes on {THREADS} cores, no contact caused"),
            measured: format!(
                "{minutes:.1} minutes by the clock on {} threads, {core_minutes:.1} core minutes ({how}); {} contacts \
                 caused, {} missions failed, {} faults, {} restarts in {}",
                self.threads, self.contacts_caused, self.failed, self.faults, self.restarts, self.n
            ),
            reached: minutes <= AIM_MIN && self.contacts_caused == 0 && self.failed == 0,
        });
    }
}
