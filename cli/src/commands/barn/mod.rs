//! `sinew barn`: a whole robot through the BARN or DynaBARN worlds, on virtual time.

mod pace;
mod peer;
mod report;
mod suite;
mod trial;

use crate::built_in::{JACKAL, JACKAL_FILE};
use crate::exit::{CHECK, Failure, USAGE};
use crate::load::{self, Changes};
use crate::picture;
use report::Report;
use runtime::robot::{Override, Resources, Robot};
use runtime::{Layer, NodeType};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use suite::{Course, Suite};
use trial::{End, PLANNER, Trial};

/// Runs a robot through the BARN or DynaBARN worlds and scores it by their rules
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder or file of the robot; without it the built-in Jackal
    robot: Option<PathBuf>,
    /// Folder of the worlds: grids.txt and worlds.csv, or with --dynamic worlds.txt
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// The folder holds DynaBARN worlds: cylinders that move
    #[arg(long)]
    dynamic: bool,
    /// Runs in each world, from seeds 0, 1, …
    #[arg(long, default_value_t = 1, value_name = "N")]
    seeds: u64,
    /// Worlds A..B (B not included) of those in the folder
    #[arg(long, value_name = "A..B")]
    worlds: Option<String>,
    /// Only every so manieth of these worlds
    #[arg(long, default_value_t = 1, value_name = "N")]
    every: usize,
    /// Threads; without it all cores. The results do not depend on it
    #[arg(long)]
    jobs: Option<usize>,
    /// Purely reactive: every step is decided by the newest scan alone, nothing is remembered
    #[arg(long)]
    reactive: bool,
    /// Whether the planner is told what moves
    #[arg(long, default_value = "on", value_name = "on|off", value_parser = ["on", "off"])]
    tracking: String,
    /// Commands reach the wheels so much later [ms]
    #[arg(long, default_value_t = 0.0, value_name = "MS", allow_negative_numbers = true)]
    latency_ms: f64,
    /// The odometry reads this many times the true way
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR", allow_negative_numbers = true)]
    odometry_scale: f64,
    /// Prints results as JSON
    #[arg(long)]
    json: bool,
    /// Draws map and track of the first run that failed, or of the first one
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Program of the MRPT peer (cargo xtask mrpt): runs it through the same worlds, and reports it beside ours
    #[arg(long, value_name = "FILE")]
    peer: Option<PathBuf>,
    /// Also tells what CPU time the planner's steps took; these figures differ from run to run
    #[arg(long)]
    step_times: bool,
    /// Any value of the robot file, as in nodes.follow_gap.config.memory_s=5
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Runs the suite and prints the report.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    check(&args)?;
    let clocked = args.step_times.then(|| pace::clocked(types));
    let types = clocked.as_deref().unwrap_or(types);
    let suite = Suite::read(&args.data, args.dynamic)?;
    let courses = chosen(&suite, args.worlds.as_deref(), args.every)?;
    let robot = robot(&args, types)?;
    let robots: Vec<(Course, Robot)> = courses
        .iter()
        .map(|course| Ok((*course, trial::robot_in(&robot, &suite, course, types)?)))
        .collect::<Result<_, Failure>>()?;
    if let Some((_, first)) = robots.first() {
        first.graph().map_err(load::errors)?;
    }
    let trials = run_all(&args, &suite, &robots)?;
    let mut report = Report::of(&suite, &trials);
    if let Some(program) = &args.peer {
        report.peers = peer::run(program, &args)?;
    }
    let mut out = std::io::stdout().lock();
    if let Some(file) = &args.svg {
        draw(file, &robots, &trials)?;
    }
    if args.json {
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        report.print(&mut out)?;
    }
    Ok(())
}

/// Refuses numbers that mean nothing, before anything has been run.
fn check(args: &Args) -> Result<(), Failure> {
    let refuse = |text: String| Err(Failure::new(USAGE, text));
    for (flag, count) in
        [("--seeds", args.seeds), ("--every", args.every as u64), ("--jobs", args.jobs.unwrap_or(1) as u64)]
    {
        if count == 0 {
            return refuse(format!("{flag} 0 would run nothing: write 1 or more"));
        }
    }
    if !(0.0..=1000.0).contains(&args.latency_ms) {
        return refuse(format!("--latency-ms {}: write 0 to 1000 milliseconds", args.latency_ms));
    }
    if !(0.5..=2.0).contains(&args.odometry_scale) {
        return refuse(format!(
            "--odometry-scale {}: write 0.5 to 2, as in 1.01 for one per cent too far",
            args.odometry_scale
        ));
    }
    if let Some(peer) = args.peer.as_ref().filter(|peer| !peer.is_file()) {
        return refuse(format!(
            "--peer {}: there is no such program; build it with `cargo xtask mrpt`",
            peer.display()
        ));
    }
    Ok(())
}

/// All runs, by world and seed, on as many threads as are wanted.
fn run_all(args: &Args, suite: &Suite, robots: &[(Course, Robot)]) -> Result<Vec<Trial>, Failure> {
    let seeds = args.seeds as usize;
    let count = robots.len() * seeds;
    let jobs = args.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let progress = std::io::stderr().is_terminal();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || {
        let mut runs = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return runs;
            }
            let (course, robot) = &robots[index / seeds];
            runs.push((index, trial::run(robot, suite, course, (index % seeds) as u64)));
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            if progress {
                eprint!("\r{done}/{count} runs");
                let _ = std::io::stderr().flush();
            }
        }
    };
    let mut all: Vec<(usize, Result<Trial, Failure>)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..jobs.clamp(1, count.max(1))).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(|e| std::panic::resume_unwind(e))).collect()
    });
    if progress {
        eprint!("\r{:40}\r", "");
    }
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, trial)| trial).collect()
}

/// The robot with what the arguments change in it.
fn robot(args: &Args, types: &[NodeType]) -> Result<Robot, Failure> {
    let robot = match &args.robot {
        Some(place) => load::robot(Some(place), &Changes::default(), types)?,
        None => {
            let text = std::str::from_utf8(JACKAL[0].1).map_err(|e| Failure::new(CHECK, e.to_string()))?;
            Robot::parse(text, JACKAL_FILE, Resources::Embedded(JACKAL), types).map_err(load::errors)?
        }
    };
    let instance = |layer: Layer, kind: Option<&str>| {
        let of = robot.nodes.iter().find(|node| node.kind.layer == layer && kind.is_none_or(|k| node.kind.name == k));
        of.map(|node| node.instance.clone())
    };
    let world = instance(Layer::Simulator, None);
    let Some(world) = world else {
        let text = format!("robot \"{}\" has no simulator node: there is nothing to run it in", robot.name);
        return Err(Failure::new(CHECK, text));
    };
    let Some(planner) = instance(Layer::Actions, Some(PLANNER)) else {
        return Err(Failure::new(
            CHECK,
            format!("robot \"{}\" has no node of type {PLANNER} to give the goal to", robot.name),
        ));
    };
    let mut all = Vec::new();
    let mut set = |key: String, value: String| all.push(Override { key, value });
    if args.reactive {
        set(format!("nodes.{planner}.config.memory_s"), "0.0".into());
    }
    if args.tracking == "off" {
        set(format!("nodes.{planner}.config.tracking"), "false".into());
    }
    if args.latency_ms != 0.0 {
        set(format!("nodes.{world}.config.realism.line.delay_ms"), format!("{:?}", args.latency_ms));
    }
    if args.odometry_scale != 1.0 {
        set(format!("nodes.{world}.config.realism.wheels.odometry_scale"), format!("{:?}", args.odometry_scale));
    }
    for change in &args.set {
        let Some((key, value)) = change.split_once('=') else {
            let text = format!("--set {change}: write KEY=VALUE, as in nodes.{planner}.config.memory_s=5");
            return Err(Failure::new(USAGE, text));
        };
        set(key.trim().into(), value.trim().into());
    }
    robot.with_overrides(&all, types).map_err(load::errors)
}

/// The worlds that were asked for.
fn chosen(suite: &Suite, range: Option<&str>, every: usize) -> Result<Vec<Course>, Failure> {
    let (from, to) = match range {
        None => (0, u32::MAX),
        Some(text) => text
            .split_once("..")
            .and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)))
            .filter(|(a, b)| a < b)
            .ok_or_else(|| Failure::new(USAGE, format!("--worlds {text}: write A..B with A below B, as in 0..60")))?,
    };
    let within = suite.courses.iter().filter(|course| (from..to).contains(&course.index));
    let courses: Vec<Course> = within.step_by(every.max(1)).copied().collect();
    if courses.is_empty() {
        let known = (suite.courses[0].index, suite.courses[suite.courses.len() - 1].index);
        let text = format!(
            "no world between {from} and {to}; the folder has {} from {} to {}",
            suite.courses.len(),
            known.0,
            known.1
        );
        return Err(Failure::new(USAGE, text));
    }
    Ok(courses)
}

fn draw(file: &std::path::Path, robots: &[(Course, Robot)], trials: &[Trial]) -> Result<(), Failure> {
    let drawn = trials.iter().find(|trial| trial.end != End::Success).or(trials.first());
    let Some(trial) = drawn else { return Ok(()) };
    let Some((_, robot)) = robots.iter().find(|(course, _)| course.index == trial.world) else { return Ok(()) };
    let svg = picture::of_crossing(robot, &format!("world {}, seed {}", trial.world, trial.seed), &trial.track)?;
    std::fs::write(file, svg).map_err(|e| Failure::from(format!("cannot write {}: {e}", file.display())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use suite::Kind;

    fn suite() -> Suite {
        let courses = (0..10).map(|k| Course { index: 3 * k, path_m: 11.0 }).collect();
        Suite { kind: Kind::Barn, file: PathBuf::new(), courses }
    }

    #[test]
    fn worlds_are_chosen_by_number_not_by_place() {
        let numbers = |range, every| {
            chosen(&suite(), range, every).unwrap().iter().map(|course| course.index).collect::<Vec<u32>>()
        };
        assert_eq!(numbers(Some("3..10"), 1), [3, 6, 9]);
        assert_eq!(numbers(None, 4), [0, 12, 24]);
        for wrong in ["9..3", "x", "1..2", "100..200"] {
            assert!(chosen(&suite(), Some(wrong), 1).is_err(), "{wrong}");
        }
    }
}
