//! `sinew bench`: figures of this machine, with the conditions under which they were taken.

mod channel;
mod hangs;
mod idle;
mod laser;
mod machine;
mod markdown;
mod perception;
mod placement;
mod process;
mod record;
mod reflex;
mod report;
mod scratch;
mod simulate;
mod simulator;
mod supervision;
mod timing;
mod tracking;
mod witness;

use crate::exit::{Failure, USAGE};
use crate::output::{Out, parse_seconds};
use report::Report;
use runtime::NodeType;
use std::path::PathBuf;

/// Measures this machine: channels, idle nodes, the reflex path, the speed of simulation, the cost of recording
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: Option<What>,
    /// Prints one JSON object per bench
    #[arg(long, global = true)]
    json: bool,
    /// A tenth of the samples: to see whether it runs, not for figures
    #[arg(long, global = true)]
    quick: bool,
    /// All 10,000 missions of `simulator`, not a sample of them: minutes
    #[arg(long, global = true)]
    long: bool,
    /// Folder or file of the robot; without it the built-in Pioneer
    #[arg(long, global = true, value_name = "ROBOT")]
    robot: Option<PathBuf>,
    /// Replaces the figures of these benches in this document
    #[arg(long, global = true, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Folder of the data that perception and tracking want, with leg-tracker/, csail/, dynabarn/ in it
    #[arg(long, global = true, value_name = "DIR")]
    data: Option<PathBuf>,
    /// How long idle, reflex, laser, record, supervision and hangs measure, as in 20s
    #[arg(long = "for", global = true, value_name = "TIME")]
    length: Option<String>,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Round trips between two processes, beside a bare futex pair, a pipe and iceoryx2 where it is built in
    Channel,
    /// CPU time and memory of node processes to which nothing comes
    Idle,
    /// From a packet of the robot to the motor command that answers it, through the whole live robot
    Reflex,
    /// From a laser's scan to the motor command that answers it, through the whole live robot
    Laser,
    /// The whole robot on virtual time, on one core
    Simulate,
    /// From a scan to segments, circles and tracks
    Perception,
    /// Swarms and whole robots on virtual time: speed, memory and growth, beside IR-SIM where it is installed
    Simulator,
    /// How well moving cylinders and people's legs are tracked, by each way of tracking
    Tracking,
    /// What recording a live robot with 5 MB/s costs, and whether its control becomes later by it
    Record,
    /// From a death, a hang or an emergency stop to what answers it, on the whole live robot
    Supervision,
    /// Hangs told of a live robot in which nobody hangs, while every core is busy: all of them false
    Hangs,
    /// All of them, one after another, as without a word
    All,
    /// The answering process of `channel`
    #[command(hide = true)]
    Partner(channel::partner::Args),
    /// One row of `simulator`
    #[command(hide = true)]
    SimulatorRow(simulator::row::Args),
}

/// Time that idle nodes are watched [s].
const IDLE_S: f64 = 10.0;
/// Time that the reflex is measured [s].
const REFLEX_S: f64 = 20.0;
/// Time that is recorded [s].
const RECORD_S: f64 = 20.0;
/// Time that deaths are measured, without the emergency stops [s].
const SUPERVISION_S: f64 = 90.0;
/// Time that hangs are watched for where nothing is said; the target is about an hour [s].
const HANGS_S: f64 = 60.0;
/// Runs the bench and prints what it found.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let length_s = args.length.as_deref().map(parse_seconds).transpose();
    let length_s = length_s.map_err(|reason| Failure::new(USAGE, format!("--for: {reason}")))?;
    let what = args.what.unwrap_or(What::All);
    let part = if args.quick { 0.1 } else { 1.0 };
    let robot = args.robot.as_deref();
    let channel = || channel::run(part);
    let idle = || idle::run(robot, length_s.unwrap_or(IDLE_S * part), types);
    // A document wants a tail of more than a handful.
    let reflex_s = if matches!(what, What::All) { 2.0 * REFLEX_S } else { REFLEX_S };
    let reflex = || reflex::run(robot, length_s.unwrap_or(reflex_s * part), types);
    let laser = || laser::run(length_s.unwrap_or(reflex_s * part), types);
    let simulate = || simulate::run(robot, part, types);
    let perception = || perception::run(args.data.as_deref(), part);
    let simulator = || simulator::run(part, args.long);
    let tracking = || tracking::run(args.data.as_deref(), part);
    let record = || record::run(robot, length_s.unwrap_or(RECORD_S * part.max(0.2)), types);
    let supervision = || supervision::run(robot, length_s.unwrap_or(SUPERVISION_S * part), part, types);
    let hangs = || hangs::run(robot, length_s.unwrap_or(HANGS_S * part), types);
    let benches: Vec<&dyn Fn() -> Result<Report, Failure>> = match &what {
        What::Channel => vec![&channel],
        What::Idle => vec![&idle],
        What::Reflex => vec![&reflex],
        What::Laser => vec![&laser],
        What::Simulate => vec![&simulate],
        What::Perception => vec![&perception],
        What::Simulator => vec![&simulator],
        What::Tracking => vec![&tracking],
        What::Record => vec![&record],
        What::Supervision => vec![&supervision],
        What::Hangs => vec![&hangs],
        What::All => vec![&channel, &idle, &reflex, &laser, &simulate, &simulator, &record],
        What::Partner(partner) => return channel::partner::run(partner),
        What::SimulatorRow(row) => return simulator::row::run(row, types),
    };
    let mut out = Out::stdout();
    let mut reports = Vec::new();
    for (k, bench) in benches.iter().enumerate() {
        if k > 0 && !args.json {
            out.line("")?;
        }
        let report = bench()?;
        report.print(&mut out, args.json)?;
        reports.push(report);
    }
    if let Some(file) = &args.markdown {
        let old = std::fs::read_to_string(file).unwrap_or_default();
        let text = markdown::document(&old, &reports);
        std::fs::write(file, text).map_err(|e| Failure::from(format!("cannot write {}: {e}", file.display())))?;
    }
    Ok(())
}
