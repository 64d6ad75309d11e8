//! `sinew simulate`: whole robots on virtual time, a run per seed.

mod batch;
mod ledger;
pub mod mission;
mod progress;

use crate::exit::{CHECK, Failure, USAGE};
use crate::simulation::{self, FaultResult, Run, RunResult};
use mission::MissionArgs;
use runtime::NodeType;
use serde::Serialize;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;

/// Runs a robot on virtual time, faster than real time and the same for the same seed
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    mission: MissionArgs,
    /// Seeds A..B (B not included): a run each
    #[arg(long, default_value = "0..1", value_name = "A..B")]
    seeds: String,
    /// Threads; without it all cores. The results do not depend on it
    #[arg(long)]
    jobs: Option<usize>,
    /// Prints results as JSON
    #[arg(long)]
    json: bool,
    /// Draws map, track and contacts of the first run (of all runs with a contact caused, if there are any)
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Draws the same run's speeds and clearance against time
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Records every run for `sinew replay`; where there are several, FILE-SEED.mcap
    #[arg(long, value_name = "FILE", conflicts_with = "faults")]
    record: Option<PathBuf>,
    /// Hash that the run of a single seed must have: whether it is the same byte for byte
    #[arg(long, value_name = "HASH")]
    expect: Option<String>,
    #[command(flatten)]
    batch: batch::Options,
}

#[derive(Serialize)]
struct Report<'a> {
    runs: Vec<&'a RunResult>,
    total: RunResult,
}

/// Runs the simulations and prints the report.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let seeds = parse_seeds(&args.seeds)?;
    if args.expect.is_some() && seeds.end - seeds.start != 1 {
        return Err(Failure::new(USAGE, "--expect: give a single seed, as in --seeds 7..8"));
    }
    let plan = args.mission.plan(types)?;
    crate::picture::notes_of(&plan.robot).iter().for_each(|note| eprintln!("note: {note}"));
    let jobs = args.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    if args.batch.wanted() || args.mission.scenario.is_some() {
        return batch::run(&args, &plan, seeds, jobs);
    }
    let (robot, seconds) = (&plan.robot, plan.scenario.timeout_s);
    let count = seeds.end - seeds.start;
    let progress = std::io::stderr().is_terminal() && count > 1;
    let several = count > 1;
    let record = |seed| args.record.as_deref().map(|file| recording_of(file, seed, several));
    let runs = simulation::run_all(robot, seeds, seconds, plan.faults.as_ref(), jobs, &record, &|done| {
        if progress {
            eprint!("\r{done}/{count} runs");
            let _ = std::io::stderr().flush();
        }
    })?;
    if progress {
        eprint!("\r{:40}\r", "");
    }
    let total = simulation::total(&runs, seconds);
    let safe = total.contacts_caused == 0 && total.failing_seeds.is_empty();
    let drawn = runs.iter().find(|run| run.result.contacts_caused > 0).or(runs.first());
    for (file, is_map) in [(&args.svg, true), (&args.plot, false)] {
        let (Some(file), Some(run)) = (file, drawn) else { continue };
        let picture = if is_map { crate::picture::of_run(robot, run)? } else { crate::picture::of_speeds(robot, run) };
        std::fs::write(file, picture).map_err(|e| Failure::from(format!("cannot write {}: {e}", file.display())))?;
        if !args.json {
            println!("drew seed {} to {}", run.result.seed, file.display());
        }
    }
    let mut out = std::io::stdout().lock();
    if args.json {
        let report = Report { runs: runs.iter().map(|run| &run.result).collect(), total };
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        print_table(&mut out, &runs, &total, seconds)?;
    }
    out.flush()?;
    drop(out);
    if let ([run], Some(hash)) = (runs.as_slice(), &args.expect) {
        compare(hash, &run.result.hash, args.json)?;
    }
    match safe {
        true => Ok(()),
        false => Err(Failure::new(CHECK, "")),
    }
}

fn print_table(out: &mut impl Write, runs: &[Run], total: &RunResult, seconds: f64) -> std::io::Result<()> {
    writeln!(
        out,
        "{:>8} {:>7} {:>9} {:>9} {:>10} {:>11} {:>10} {:>11}  hash",
        "seed", "drove", "reversed", "suffered", "distance", "clearance", "speed", "× real time"
    )?;
    let row = |out: &mut dyn Write, name: String, contacts: [u64; 3], r: &RunResult| {
        writeln!(
            out,
            "{name:>8} {:>7} {:>9} {:>9} {:>8.1} m {:>8.3} m {:>6.3} m/s {:>11.0}  {}",
            contacts[0],
            contacts[1],
            contacts[2],
            r.distance_m,
            r.least_clearance_m,
            r.mean_speed_m_s,
            r.realtime_factor,
            r.hash
        )
    };
    for run in runs {
        row(out, run.result.seed.to_string(), run.contacts, &run.result)?;
    }
    if runs.len() > 1 {
        let sum = |cause: usize| runs.iter().map(|run| run.contacts[cause]).sum();
        row(out, "all".into(), [sum(0), sum(1), sum(2)], total)?;
    }
    if let Some(faults) = &total.faults {
        print_faults(out, faults, runs.len(), total)?;
    }
    writeln!(out, "{} runs of {seconds} s; contacts by cause; speed is the mean while moving (over 1 cm/s)", runs.len())
}

/// The file of one run's recording.
fn recording_of(file: &std::path::Path, seed: u64, several: bool) -> PathBuf {
    if !several {
        return file.to_owned();
    }
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!("{stem}-{seed}.mcap"))
}

fn print_faults(out: &mut impl Write, faults: &FaultResult, runs: usize, total: &RunResult) -> std::io::Result<()> {
    let [deaths, hangs, slowdowns, bursts, stops, supervisor, _] = faults.injected;
    let [limps, holds, latched] = faults.limps_holds_stops;
    let [p50, p99, greatest] = faults.recovery_ms;
    writeln!(
        out,
        "faults: {deaths} deaths, {hangs} hangs, {slowdowns} slow-downs, {bursts} bursts of lost bytes, {stops} \
         emergency stops, {supervisor} deaths of the supervisor"
    )?;
    writeln!(
        out,
        "answers: {} restarts (p50 {p50:.1} ms, p99 {p99:.1} ms, greatest {greatest:.1} ms), {} given up; limp mode \
         {limps} times, held {holds} times, emergency stop {latched} times",
        faults.restarts, faults.given_up
    )?;
    writeln!(
        out,
        "emergency stops let go by themselves: {}; commands to move under one: {}",
        faults.stops_let_go, faults.moves_while_stopped
    )?;
    let [commands, failed] = faults.commands_and_failed;
    if commands > 0 {
        writeln!(out, "commands of reactions: {commands} asked for, none run, {failed} answered as failed")?;
    }
    match total.failing_seeds.as_slice() {
        [] => writeln!(
            out,
            "no contact caused in {runs} runs: with 95 % confidence fewer than {:.2e} runs have one",
            3.0 / runs as f64
        ),
        failing => writeln!(out, "failing seeds, each replays exactly: {failing:?}"),
    }
}

/// Whether a mission ended in the same bytes as the one whose hash was given.
fn compare(expected: &str, hash: &str, json: bool) -> Result<(), Failure> {
    if expected != hash {
        let text = format!(
            "the run's hash is {hash}, not {expected}: it is no replay; program, robot, world, scenario and faults must \
             be those of the run that is replayed"
        );
        return Err(Failure::from(text));
    }
    if !json {
        println!("replayed byte for byte: hash {hash} as expected");
    }
    Ok(())
}

fn parse_seeds(text: &str) -> Result<std::ops::Range<u64>, Failure> {
    let parsed = text.split_once("..").and_then(|(a, b)| Some(a.trim().parse().ok()?..b.trim().parse().ok()?));
    match parsed {
        Some(range) if range.start < range.end && range.end - range.start <= 1_000_000 => Ok(range),
        _ => Err(Failure::new(
            USAGE,
            format!("--seeds {text}: write A..B with A below B and at most a million seeds, as in 0..100"),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_a_half_open_range() {
        assert_eq!(parse_seeds("0..100").ok(), Some(0..100));
        for wrong in ["", "5", "5..5", "7..3", "a..b", "-1..3", "0..99999999"] {
            assert!(parse_seeds(wrong).is_err(), "{wrong}");
        }
    }
}
