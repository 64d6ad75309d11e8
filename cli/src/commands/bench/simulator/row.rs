//! One row, measured in a process of its own: `sinew bench simulator-row NAME`.

use super::super::process::Activity;
use crate::exit::{Failure, USAGE};
use crate::load::{self, Changes};
use crate::simulation;
use runtime::{NodeType, clock};
use serde::{Deserialize, Serialize};
use simulator::swarm::{Kind, Swarm};
use simulator::world::World;
use std::process::Command;

/// Simulated time of a swarm's step [s].
pub const STEP_S: f64 = 0.1;
/// Simulated time of a run of the whole robot [s].
const RUN_S: f64 = 60.0;
/// Steps before the measured ones: caches fill, robots spread.
const WARM_UP: usize = 10;
/// Steps at least, and at most.
const STEPS: (usize, usize) = (10, 20_000);
/// The hospital-like map.
pub const HOSPITAL: &str = "office:1:140x60";

/// The hall of the peer's task.
const HALL: &str = include_str!("hall.toml");

/// Arguments of the hidden command.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which row
    row: String,
    /// Threads
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Wall time [s]
    #[arg(long, default_value_t = 4.0)]
    seconds: f64,
}

/// What came out.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Measured {
    /// Simulated time over the clock's.
    pub realtime_factor: f64,
    /// Simulated time over the time that all threads together spent on cores: what a single core would reach.
    pub realtime_factor_core: f64,
    /// Greatest resident memory of the process [MiB].
    pub rss_mib: f64,
    /// Threads.
    pub threads: usize,
    /// Median, 99 % and greatest time of a step or run [µs].
    pub step_us: [f64; 3],
    /// Steps or runs.
    pub n: u64,
}

/// Measures a row in a process of its own.
pub fn in_own_process(row: &str, threads: usize, seconds: f64) -> Result<Measured, Failure> {
    let program = std::env::current_exe()?;
    let output = Command::new(program)
        .args(["bench", "simulator-row", row])
        .args(["--threads", &threads.to_string(), "--seconds", &seconds.to_string()])
        .output()?;
    if !output.status.success() {
        return Err(Failure::from(format!("row {row}: {}", String::from_utf8_lossy(&output.stderr).trim())));
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// The hidden command: measures and prints one line of JSON.
pub fn run(args: &Args, types: &[NodeType]) -> Result<(), Failure> {
    let measured = match args.row.split(':').collect::<Vec<_>>()[..] {
        ["hospital"] => swarm(HOSPITAL, Kind::simple(12, 2.0), 1000, args)?,
        ["cave_sonars"] => swarm("cave:1", Kind::pioneer_with_sonars(), 100, args)?,
        ["cave_laser"] => swarm("cave:1", Kind::pioneer_with_laser(180, 8.0), 100, args)?,
        ["simple_10000"] => swarm(HOSPITAL, Kind::simple(12, 2.0), 10_000, args)?,
        ["simple_100000"] => swarm("office:1:440x190", Kind::simple(12, 2.0), 100_000, args)?,
        ["peer_task"] => swarm_steps(peer_task()?, args)?,
        ["wander"] => whole(0, args, types)?,
        ["missions", count] => return super::missions::run(number(count)?, args.threads, types),
        // Rows of the growth table.
        ["robots", count] => {
            // The map grows with them: as many per area as in the hospital with 1,000.
            let count: usize = number(count)?;
            let width_m = 140.0 * (count as f64 / 1000.0).sqrt();
            let world = format!("office:1:{width_m:.1}x{:.1}", width_m * 3.0 / 7.0);
            swarm(&world, Kind::simple(12, 2.0), count, args)?
        }
        ["crowding", count] => swarm(HOSPITAL, Kind::simple(12, 2.0), number(count)?, args)?,
        ["rays", count] => swarm(HOSPITAL, Kind::simple(number(count)?, 2.0), 1000, args)?,
        ["map", width] => {
            let width: usize = number(width)?;
            swarm(&format!("office:1:{width}x{}", width * 3 / 7), Kind::simple(12, 2.0), 1000, args)?
        }
        ["nodes", more] => whole(number(more)?, args, types)?,
        _ => return Err(Failure::new(USAGE, format!("there is no row \"{}\"", args.row))),
    };
    println!("{}", serde_json::to_string(&measured)?);
    Ok(())
}

fn number(text: &str) -> Result<usize, Failure> {
    text.parse().map_err(|_| Failure::new(USAGE, format!("{text} is no number")))
}

fn swarm(world: &str, kind: Kind, count: usize, args: &Args) -> Result<Measured, Failure> {
    let world = World::load(world, &mut |file| std::fs::read(file).map_err(|e| e.to_string()))
        .map_err(|e| Failure::from(e.to_string()))?;
    swarm_steps(Swarm::new(world, kind, count, STEP_S, 1).map_err(|e| Failure::from(e.to_string()))?, args)
}

fn swarm_steps(mut swarm: Swarm, args: &Args) -> Result<Measured, Failure> {
    swarm.use_threads(args.threads).map_err(|e| Failure::from(e.to_string()))?;
    (0..WARM_UP).for_each(|_| swarm.step());
    measure(args, STEP_S, || {
        swarm.step();
        Ok(())
    })
}

/// What the peer is asked to do too: 50 robots with 180 rays in a furnished hall.
pub fn peer_task() -> Result<Swarm, Failure> {
    let world = World::load("hall.toml", &mut |_| Ok(HALL.as_bytes().to_vec()));
    let world = world.map_err(|e| Failure::from(e.to_string()))?;
    Swarm::new(world, Kind::pioneer_with_laser(180, 10.0), 50, STEP_S, 1).map_err(|e| Failure::from(e.to_string()))
}

/// The whole built-in robot; `more` nodes beside its own.
fn whole(more: usize, args: &Args, types: &[NodeType]) -> Result<Measured, Failure> {
    let mut robot = load::robot(None, &Changes::default(), types)?;
    // A listener of the base's odometry, as often as wanted.
    if let Some(spec) = robot.nodes.iter().find(|node| node.instance == "odometry").cloned() {
        for k in 0..more {
            let mut spec = spec.clone();
            spec.instance = format!("odometry_{k}");
            robot.nodes.push(spec);
        }
    }
    simulation::run(&robot, 0, 1.0, None)?;
    let mut seed = 0;
    measure(args, RUN_S, || {
        simulation::run(&robot, seed, RUN_S, None)?;
        seed += 1;
        Ok(())
    })
}

/// Repeats a step of so much simulated time until the wall time is used up.
fn measure(args: &Args, step_s: f64, mut step: impl FnMut() -> Result<(), Failure>) -> Result<Measured, Failure> {
    let own = std::process::id();
    let on_core_ns = || Activity::of(own).unwrap_or_default().on_core_ns;
    let (begin, begin_ns) = (clock::now(), on_core_ns());
    let mut times_us = Vec::new();
    while times_us.len() < STEPS.0 || (times_us.len() < STEPS.1 && clock::now().since(begin) < args.seconds) {
        let before = clock::now();
        step()?;
        times_us.push(clock::now().since(before) * 1e6);
    }
    let wall_s = clock::now().since(begin).max(1e-9);
    let core_s = ((on_core_ns() - begin_ns) as f64 * 1e-9).max(1e-9);
    let [realtime_factor, realtime_factor_core] = factors(step_s * times_us.len() as f64, wall_s, core_s);
    times_us.sort_by(f64::total_cmp);
    let n = times_us.len();
    let at = |share: f64| times_us[((n as f64 * share) as usize).min(n - 1)];
    Ok(Measured {
        realtime_factor,
        realtime_factor_core,
        rss_mib: greatest_rss_mib(),
        threads: args.threads,
        step_us: [at(0.5), at(0.99), at(1.0)],
        n: n as u64,
    })
}

/// Simulated time over the clock's and over that of all threads on cores.
fn factors(simulated_s: f64, wall_s: f64, core_s: f64) -> [f64; 2] {
    [simulated_s / wall_s, simulated_s / core_s]
}

/// Greatest resident memory of this process so far [MiB].
pub fn greatest_rss_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = line.and_then(|rest| rest.split_whitespace().next()).and_then(|text| text.parse::<f64>().ok());
    kib.unwrap_or_default() / 1024.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_per_core_counts_the_time_of_all_threads_and_no_thread_twice() {
        // 60 s were simulated in 6 s by the clock; two threads were busy for 5 s each.
        assert_eq!(factors(60.0, 6.0, 10.0), [10.0, 6.0]);
    }
}
