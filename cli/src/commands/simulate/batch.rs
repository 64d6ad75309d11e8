//! `sinew simulate` with a scenario, a table or a report: a batch of missions.

use super::Args;
use super::ledger::Ledger;
use super::mission::Plan;
use super::progress::Progress;
use crate::batch::{self, Failed, Frame, Mission};
use crate::exit::{CHECK, Failure};
use crate::picture;
use runtime::OpenError;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Failures that the report draws.
const DRAWN: usize = 12;

/// What makes a batch of it, beside a scenario.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Options {
    /// A line per mission, written as soon as it is finished
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Goes on with the seeds that the CSV file does not have yet
    #[arg(long, requires = "csv")]
    resume: bool,
    /// A report of tables, histograms and failures with their tracks (HTML, needs nothing else)
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

impl Options {
    /// Whether any of them was given.
    pub fn wanted(&self) -> bool {
        self.csv.is_some() || self.report.is_some()
    }
}

/// Runs the batch.
pub fn run(args: &Args, plan: &Plan, seeds: Range<u64>, jobs: usize) -> Result<(), Failure> {
    let options = &args.batch;
    if let Some(file) = &options.report {
        writable(file)?;
    }
    let setup = plan.setup();
    let (mut missions, mut ledger) = Ledger::open(options.csv.as_deref(), options.resume, setup, seeds.clone())?;
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // The second one ends the program where it stands.
        signal_hook::flag::register_conditional_shutdown(signal, 130, interrupted.clone())?;
        signal_hook::flag::register(signal, interrupted.clone())?;
    }
    let mut written: Result<(), std::io::Error> = Ok(());
    let left = ledger.left().to_vec();
    let mut progress = Progress::new(left.len());
    let mut done = |mission: &Mission| {
        if written.is_ok() {
            written = ledger.take(mission);
        }
        progress.step();
        written.is_ok() && !interrupted.load(Ordering::Relaxed)
    };
    let judge = |seed: u64| Ok(Mission::judge(&plan.scenario, &plan.simulate(seed)?));
    let (fresh, error) = batch::work::<OpenError>(&left, jobs, &judge, &mut done);
    progress.end();
    let (simulated, wall_s) = progress.so_far();
    let written = written.and_then(|()| ledger.close());
    missions.extend(fresh);
    missions.sort_by_key(|mission| mission.seed);
    if let Some(file) = &options.report {
        let failed = failures(args, plan, &missions)?;
        write(file, batch::html(&frame(args, plan, &seeds), &missions, &failed).as_bytes())?;
    }
    written.map_err(|e| Failure::from(format!("cannot write the table: {e}; results so far are in it")))?;
    if let Some(e) = error {
        return Err(e.into());
    }
    let speed = simulated as f64 * plan.scenario.timeout_s / wall_s.max(1e-9);
    summarise(args, &missions, &seeds, speed)
}

/// Every failure with its command, the first of them with their tracks.
fn failures(args: &Args, plan: &Plan, missions: &[Mission]) -> Result<Vec<Failed>, Failure> {
    let bad = missions.iter().filter(|mission| !mission.succeeded());
    bad.enumerate()
        .map(|(place, mission)| {
            let picture = match place < DRAWN {
                true => Some(picture::of_run(&plan.robot, &plan.simulate(mission.seed)?)?),
                false => None,
            };
            Ok(Failed { seed: mission.seed, picture, command: again(args, mission) })
        })
        .collect()
}

/// The command that simulates a mission again, and compares.
fn again(args: &Args, mission: &Mission) -> String {
    let more = ["--expect", &mission.hash].map(str::to_owned);
    args.mission.command(&(mission.seed..mission.seed + 1), None, &more)
}

fn frame(args: &Args, plan: &Plan, seeds: &Range<u64>) -> Frame {
    let world = picture::world_of(&plan.robot).map(|world| world.name).unwrap_or_default();
    let folder = std::env::current_dir().map(|folder| folder.display().to_string()).unwrap_or_default();
    let facts = [
        ("robot", plan.robot.name.clone()),
        ("world", world),
        ("seeds", format!("{}..{}", seeds.start, seeds.end)),
        ("goals", plan.scenario.goals.len().to_string()),
        ("timeout", format!("{} s", plan.scenario.timeout_s)),
        ("faults", args.mission.faults().unwrap_or("none").to_owned()),
        ("program", recorder::facts::build_id()),
        ("commands run in", folder),
    ];
    let facts = facts.map(|(name, value)| (name.to_owned(), value)).to_vec();
    Frame { robot: plan.robot.name.clone(), facts, command: args.mission.command(seeds, None, &[]) }
}

fn summarise(args: &Args, missions: &[Mission], seeds: &Range<u64>, speed: f64) -> Result<(), Failure> {
    let bad: Vec<&Mission> = missions.iter().filter(|mission| !mission.succeeded()).collect();
    let wanted = seeds.end - seeds.start;
    let good = missions.len() - bad.len();
    let mut out = std::io::stdout().lock();
    if args.json {
        let report = serde_json::json!({
            "missions": missions.iter().map(to_json).collect::<Vec<_>>(),
            "wanted": wanted, "finished": missions.len(), "succeeded": good, "realtime_factor": speed,
            "figures": batch::Figures::of(missions),
        });
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        for mission in bad.iter().take(DRAWN) {
            writeln!(out, "seed {}: {}; again: {}", mission.seed, mission.failure, again(args, mission))?;
        }
        if bad.len() > DRAWN {
            writeln!(out, "and {} other seeds failed", bad.len() - DRAWN)?;
        }
        writeln!(out, "{good} of {} missions succeeded, {speed:.0} × real time", missions.len())?;
    }
    out.flush()?;
    if (missions.len() as u64) < wanted {
        let on = if args.batch.csv.is_some() { "--resume goes on" } else { "with --csv the next one could be resumed" };
        return Err(Failure::new(
            130,
            format!("interrupted: {} of {wanted} missions are finished; {on}", missions.len()),
        ));
    }
    if let ([mission], Some(hash)) = (missions, &args.expect) {
        super::compare(hash, &mission.hash, args.json)?;
    }
    match bad.is_empty() {
        true => Ok(()),
        false => Err(Failure::new(CHECK, "")),
    }
}

fn to_json(mission: &Mission) -> serde_json::Value {
    let node = |node: &batch::NodeCost| serde_json::json!({"path": node.path, "cpu_share": node.cpu, "missed_deadlines": node.missed_deadlines});
    serde_json::json!({"seed": mission.seed, "success": mission.succeeded(), "failure": mission.failure,
        "time_s": mission.time_s, "goals": mission.goals, "contacts_caused": mission.contacts[0],
        "contacts_suffered": mission.contacts[1], "distance_m": mission.distance_m,
        "mean_speed_m_s": mission.speed_m_s[0], "max_speed_m_s": mission.speed_m_s[1],
        "jerk_rms_m_s3": mission.jerk_m_s3, "least_clearance_m": mission.clearance_m[0],
        "mean_clearance_m": mission.clearance_m[1], "energy_j": mission.energy_j,
        "missed_deadlines": mission.missed_deadlines(), "cpu_share": mission.cpu(),
        "faults": mission.faults[0], "restarts": mission.faults[1],
        "nodes": mission.nodes.iter().map(node).collect::<Vec<_>>(), "hash": mission.hash})
}

/// Whether the file can be written is known before hours of missions, not after.
fn writable(file: &Path) -> Result<(), Failure> {
    let open = std::fs::OpenOptions::new().create(true).truncate(false).write(true).open(file);
    open.map(|_| ()).map_err(|e| Failure::from(format!("cannot write {}: {e}", file.display())))
}

fn write(file: &Path, bytes: &[u8]) -> Result<(), Failure> {
    std::fs::write(file, bytes).map_err(|e| Failure::from(format!("cannot write {}: {e}", file.display())))
}
