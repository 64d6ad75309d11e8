//! `sinew shrink`: the few faults that a failing seed needs, as a file, and the command that replays them.

use super::simulate::mission::{MissionArgs, Plan};
use crate::batch::{self, Faults, Mission};
use crate::exit::{CHECK, Failure, USAGE};
use runtime::{NodeType, OpenError};
use std::io::Write;
use std::path::PathBuf;
use supervisor::PlannedFault;

/// Makes the faults of a failing seed as few and as plain as they get
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Seed whose mission fails
    #[arg(long, value_name = "N")]
    seed: u64,
    #[command(flatten)]
    mission: MissionArgs,
    /// File for the faults that are left; without it faults-SEED.toml
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Prints the result as JSON
    #[arg(long)]
    json: bool,
}

/// Shrinks and prints.
pub fn run(args: &Args, types: &[NodeType]) -> Result<(), Failure> {
    let file = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("faults-{}.toml", args.seed)));
    let Some(given) = args.mission.faults() else {
        return Err(Failure::new(
            USAGE,
            "--faults is missing: give those with which the seed fails, as in --faults chaos",
        ));
    };
    let mut plan = args.mission.plan(types)?;
    if file.exists() {
        let text = format!("{} is there already; give another name with --out", file.display());
        return Err(Failure::new(USAGE, text));
    }
    let faults = plan.faults.take().unwrap_or_default();
    let all = faults.of(&plan.robot, args.seed, plan.scenario.timeout_s);
    let mut trials = Trials { args, plan, runs: 0, fewest: all.len() + 1 };
    let (first, _) = trials.mission(&all)?;
    let seed = args.seed;
    if first.succeeded() {
        let text = format!("seed {seed} does not fail with --faults {given}: there is nothing to shrink");
        return Err(Failure::new(CHECK, text));
    }
    let (bare, _) = trials.mission(&[])?;
    if bare.fails_like(&first) {
        let again = args.mission.command(&(seed..seed + 1), Some("supervisor=0"), &[]);
        let text = format!(
            "seed {seed} fails without any fault as well ({}): the failure does not depend on them; again: {again}",
            bare.failure
        );
        return Err(Failure::new(CHECK, text));
    }
    let mut fails = |faults: &[PlannedFault]| {
        let (mission, runs) = trials.mission(faults)?;
        let fails = mission.fails_like(&first);
        if fails && faults.len() < trials.fewest {
            trials.fewest = faults.len();
            eprintln!("faults left after {runs} runs: {} of {}", faults.len(), all.len());
        }
        Ok::<bool, OpenError>(fails)
    };
    let left = batch::shrink(&all, &mut fails)?;
    let (last, runs) = trials.mission(&left)?;
    let text = format!(
        "# Seed {seed} of \"{}\" fails with these faults, and with none of them left out: {}.\n{}",
        trials.plan.robot.name,
        last.failure,
        batch::to_toml(&left)?
    );
    std::fs::write(&file, text).map_err(|e| Failure::from(format!("cannot write {}: {e}", file.display())))?;
    let more = ["--expect", &last.hash].map(str::to_owned);
    let again = args.mission.command(&(seed..seed + 1), Some(&file.display().to_string()), &more);
    let mut out = std::io::stdout().lock();
    if args.json {
        let report = serde_json::json!({"seed": seed, "failure": last.failure, "before": all.len(), "after": left.len(),
            "runs": runs, "faults": left, "file": file.display().to_string(), "hash": last.hash, "again": again});
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        writeln!(
            out,
            "seed {seed}: {}, with {} of {} faults, found in {runs} runs:",
            last.failure,
            left.len(),
            all.len()
        )?;
        for fault in &left {
            writeln!(out, "  {fault}")?;
        }
        writeln!(out, "wrote {}; again: {again}", file.display())?;
    }
    out.flush()?;
    Ok(())
}

/// Missions with other faults.
struct Trials<'a> {
    args: &'a Args,
    plan: Plan,
    runs: u64,
    fewest: usize,
}

impl Trials<'_> {
    /// The mission with these faults, and how many have been simulated by now.
    fn mission(&mut self, faults: &[PlannedFault]) -> Result<(Mission, u64), OpenError> {
        self.runs += 1;
        self.plan.faults = Some(Faults::from(faults.to_vec()));
        let run = self.plan.simulate(self.args.seed)?;
        Ok((Mission::judge(&self.plan.scenario, &run), self.runs))
    }
}
