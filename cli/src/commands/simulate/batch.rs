//! `sinew simulate` with a scenario, a table or a report: a batch of missions.

use super::Args;
use crate::batch::{self, Failed, Frame, Mission, Scenario};
use crate::exit::{CHECK, Failure, USAGE};
use crate::picture;
use crate::simulation::{Fingerprint, Run};
use runtime::robot::Robot;
use runtime::{OpenError, clock};
use std::fs::OpenOptions;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Failures that the report draws.
const DRAWN: usize = 12;
/// Width of the progress bar.
const BAR: usize = 30;

/// What makes a batch of it.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Options {
    /// Missions: goals, timeouts, success conditions (TOML); judges every seed
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
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
        self.scenario.is_some() || self.csv.is_some() || self.report.is_some()
    }
}

/// Runs the batch. `simulate` is a run of so many seconds from a seed.
pub fn run(
    args: &Args,
    robot: &Robot,
    seeds: std::ops::Range<u64>,
    seconds: f64,
    jobs: usize,
    simulate: &(dyn Fn(u64, f64) -> Result<Run, OpenError> + Sync),
) -> Result<(), Failure> {
    let options = &args.batch;
    let scenario = scenario(options, robot, seconds)?;
    let setup = setup(robot, &scenario, args);
    let (mut missions, mut csv) = open(options, &setup)?;
    missions.retain(|mission| seeds.contains(&mission.seed));
    let known: std::collections::BTreeSet<u64> = missions.iter().map(|mission| mission.seed).collect();
    let left: Vec<u64> = seeds.clone().filter(|seed| !known.contains(seed)).collect();
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // The second one ends the program where it stands.
        signal_hook::flag::register_conditional_shutdown(signal, 130, interrupted.clone())?;
        signal_hook::flag::register(signal, interrupted.clone())?;
    }
    let mut written: Result<(), std::io::Error> = Ok(());
    let mut progress = Progress::new(left.len());
    let mut done = |mission: &Mission| {
        if let Some(csv) = &mut csv {
            written = csv.write_all(batch::line(mission, &setup).as_bytes());
        }
        progress.step();
        written.is_ok() && !interrupted.load(Ordering::Relaxed)
    };
    let judge = |seed: u64| Ok(Mission::judge(&scenario, &simulate(seed, scenario.timeout_s)?));
    let (fresh, error) = batch::work::<OpenError>(&left, jobs, &judge, &mut done);
    progress.end();
    missions.extend(fresh);
    missions.sort_by_key(|mission| mission.seed);
    if let Some(file) = &options.report {
        let failed = draw(args, robot, &missions, &|seed| simulate(seed, scenario.timeout_s))?;
        let frame = frame(args, robot, &scenario, &seeds);
        write(file, batch::html(&frame, &missions, &failed).as_bytes())?;
    }
    written.map_err(|e| Failure::from(format!("cannot write the table: {e}; results so far are in it")))?;
    if let Some(e) = error {
        return Err(e.into());
    }
    summarise(args, &missions, &seeds)
}

fn scenario(options: &Options, robot: &Robot, seconds: f64) -> Result<Scenario, Failure> {
    let Some(file) = &options.scenario else { return Ok(Scenario::of_length(seconds)) };
    let failed = |reason: String| Failure::new(CHECK, format!("{}: {reason}", file.display()));
    let text = std::fs::read_to_string(file).map_err(|e| failed(format!("cannot be read: {e}")))?;
    let world = picture::world_of(robot);
    Scenario::parse(&text, world.as_ref(), robot.body.max_forward_m_s).map_err(|e| failed(e.to_string()))
}

/// Tells robot, world, scenario and changes apart.
fn setup(robot: &Robot, scenario: &Scenario, args: &Args) -> String {
    let mut hash = Fingerprint::default();
    for node in &robot.nodes {
        hash.add(format!("{} {} {:?} {:?}", node.path(), node.kind.name, node.config, node.period_ns).as_bytes());
    }
    hash.add(format!("{:?} {scenario:?} {:?}", robot.body, args.changes).as_bytes());
    hash.text()
}

/// Missions that are there already, and the file for the new ones.
fn open(options: &Options, setup: &str) -> Result<(Vec<Mission>, Option<std::fs::File>), Failure> {
    let Some(file) = &options.csv else { return Ok((Vec::new(), None)) };
    let failed = |reason: String| Failure::new(USAGE, format!("{}: {reason}", file.display()));
    let there = match std::fs::read_to_string(file) {
        Ok(text) => Some(text),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => None,
        Err(e) => return Err(failed(e.to_string())),
    };
    let mut missions = Vec::new();
    let mut out = OpenOptions::new().create(true).append(true).open(file).map_err(|e| failed(e.to_string()))?;
    match there {
        Some(text) if options.resume && !text.is_empty() => {
            let table = batch::parse(&text).map_err(|e| failed(e.to_string()))?;
            if !table.missions.is_empty() && table.setup != setup {
                let reason =
                    "it comes from another robot, scenario or other changes; give this batch a file of its own";
                return Err(failed(reason.into()));
            }
            out.set_len(table.whole as u64)?;
            if table.whole == 0 {
                out.write_all(batch::heading().as_bytes())?;
            }
            missions = table.missions;
        }
        Some(text) if !text.is_empty() => {
            return Err(failed("it is there already; --resume goes on with it, or give another name".into()));
        }
        _ => out.write_all(batch::heading().as_bytes())?,
    }
    Ok((missions, Some(out)))
}

fn draw(
    args: &Args,
    robot: &Robot,
    missions: &[Mission],
    simulate: &dyn Fn(u64) -> Result<Run, OpenError>,
) -> Result<Vec<Failed>, Failure> {
    let bad = missions.iter().filter(|mission| !mission.succeeded()).take(DRAWN);
    bad.map(|mission| {
        let run = simulate(mission.seed)?;
        let seed = mission.seed;
        Ok(Failed { seed, picture: picture::of_run(robot, &run)?, command: command(args, &(seed..seed + 1), true) })
    })
    .collect()
}

/// The command line of these seeds again.
fn command(args: &Args, seeds: &std::ops::Range<u64>, draw: bool) -> String {
    let mut words = vec!["sinew simulate".to_owned()];
    words.extend(args.robot.iter().map(|robot| quoted(&robot.display().to_string())));
    words.push(format!("--seeds {}..{}", seeds.start, seeds.end));
    match &args.batch.scenario {
        Some(file) => words.push(format!("--scenario {}", quoted(&file.display().to_string()))),
        None => words.push(format!("--for {}", args.length)),
    }
    let changes = &args.changes;
    words.extend(changes.world.iter().map(|world| format!("--world {}", quoted(world))));
    words.extend(changes.device.iter().map(|device| format!("--device {}", quoted(device))));
    words.extend(changes.set.iter().map(|set| format!("--set {}", quoted(set))));
    if draw {
        words.push(format!("--report seed-{}.html", seeds.start));
    }
    words.join(" ")
}

/// As a shell takes it.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-:=,@".contains(c);
    if !text.is_empty() && text.chars().all(plain) { text.into() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

fn frame(args: &Args, robot: &Robot, scenario: &Scenario, seeds: &std::ops::Range<u64>) -> Frame {
    let world = picture::world_of(robot).map(|world| world.name).unwrap_or_default();
    let facts = [
        ("robot", robot.name.clone()),
        ("world", world),
        ("seeds", format!("{}..{}", seeds.start, seeds.end)),
        ("goals", scenario.goals.len().to_string()),
        ("timeout", format!("{} s", scenario.timeout_s)),
        ("program", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let facts = facts.map(|(name, value)| (name.to_owned(), value)).to_vec();
    Frame { robot: robot.name.clone(), facts, command: command(args, seeds, false) }
}

fn summarise(args: &Args, missions: &[Mission], seeds: &std::ops::Range<u64>) -> Result<(), Failure> {
    let bad: Vec<&Mission> = missions.iter().filter(|mission| !mission.succeeded()).collect();
    let wanted = seeds.end - seeds.start;
    let good = missions.len() - bad.len();
    let mut out = std::io::stdout().lock();
    if args.json {
        let list = |mission: &Mission| {
            serde_json::json!({"seed": mission.seed, "success": mission.succeeded(), "failure": mission.failure,
                "time_s": mission.time_s, "goals": mission.goals, "contacts_caused": mission.contacts[0],
                "contacts_suffered": mission.contacts[1], "distance_m": mission.distance_m,
                "least_clearance_m": mission.clearance_m[0], "mean_speed_m_s": mission.speed_m_s[0],
                "jerk_rms_m_s3": mission.jerk_m_s3, "energy_j": mission.energy_j,
                "missed_deadlines": mission.missed_deadlines, "realtime_factor": mission.realtime_factor,
                "hash": mission.hash})
        };
        let report = serde_json::json!({
            "missions": missions.iter().map(list).collect::<Vec<_>>(),
            "wanted": wanted, "finished": missions.len(), "succeeded": good,
            "figures": batch::Figures::of(missions),
        });
        serde_json::to_writer_pretty(&mut out, &report)?;
        writeln!(out)?;
    } else {
        for mission in bad.iter().take(DRAWN) {
            let again = command(args, &(mission.seed..mission.seed + 1), true);
            writeln!(out, "seed {}: {}; again: {again}", mission.seed, mission.failure)?;
        }
        writeln!(out, "{good} of {} missions succeeded", missions.len())?;
    }
    out.flush()?;
    if (missions.len() as u64) < wanted {
        let text = format!("interrupted: {} of {wanted} missions are finished; --resume goes on", missions.len());
        return Err(Failure::new(130, text));
    }
    match bad.is_empty() {
        true => Ok(()),
        false => Err(Failure::new(CHECK, "")),
    }
}

fn write(file: &std::path::Path, bytes: &[u8]) -> Result<(), Failure> {
    std::fs::write(file, bytes).map_err(|e| Failure::from(format!("cannot write {}: {e}", file.display())))
}

/// A bar with the time left, on a terminal.
struct Progress {
    all: usize,
    done: usize,
    begin: runtime::Time,
    shown: bool,
}

impl Progress {
    fn new(all: usize) -> Progress {
        Progress { all, done: 0, begin: clock::now(), shown: std::io::stderr().is_terminal() && all > 1 }
    }

    fn step(&mut self) {
        self.done += 1;
        if self.shown {
            let left_s = clock::now().since(self.begin) / self.done as f64 * (self.all - self.done) as f64;
            let full = BAR * self.done / self.all.max(1);
            let (bar, rest) = ("#".repeat(full), " ".repeat(BAR - full));
            eprint!("\r[{bar}{rest}] {}/{}, {} left   ", self.done, self.all, left(left_s));
            let _ = std::io::stderr().flush();
        }
    }

    fn end(&self) {
        if self.shown {
            eprint!("\r{:70}\r", "");
        }
    }
}

/// A time left in one or two words.
fn left(seconds: f64) -> String {
    match seconds.ceil() as u64 {
        s if s < 100 => format!("{s} s"),
        s if s < 6000 => format!("{} min", s.div_ceil(60)),
        s => format!("{:.1} h", s as f64 / 3600.0),
    }
}
