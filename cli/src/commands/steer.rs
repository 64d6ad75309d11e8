//! `sinew start`, `sinew stop`, `sinew restart`, `sinew replace`: one node of a running robot; `sinew clear`: what holds
//! all of it back.

use crate::exit::{FAILED, Failure, USAGE};
use crate::live::Which;
use crate::output::Out;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Starts, stops or restarts one node of a running robot
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The node, as in base or /drivers/base
    node: String,
    #[command(flatten)]
    which: Which,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// Puts another build of a node's program in its place while the robot drives
#[derive(Debug, clap::Args)]
pub struct ReplaceArgs {
    #[command(flatten)]
    steer: Args,
    /// The other program; without it the node's own file, as it is now
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
}

/// Asks the supervisor to replace a node.
pub fn replace(args: &ReplaceArgs) -> Result<(), Failure> {
    let Some(program) = &args.program else { return run(&args.steer, "replace") };
    // The supervisor stands in another folder, and a name without a slash would be looked for in its PATH.
    let program = std::path::absolute(program)?;
    let Some(program) = program.to_str().filter(|_| program.is_file()) else {
        let reason = format!("--program: there is no file {}; build it first", program.display());
        return Err(Failure::new(USAGE, reason));
    };
    ask(&args.steer, "replace", &format!(" {program}"))
}

/// Ends what holds a robot back once its cause is gone: limp mode and hold that wait for a person
#[derive(Debug, clap::Args)]
pub struct ClearArgs {
    #[command(flatten)]
    which: Which,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// A person says that all is well again.
pub fn clear(args: &ClearArgs) -> Result<(), Failure> {
    let robot = args.which.find()?;
    let answer = supervisor::ask(&robot.folder, "clear", ANSWER_WITHIN_S).map_err(Failure::from)?;
    let answer: Value = serde_json::from_str(&answer)?;
    if let Some(reason) = answer["error"].as_str() {
        return Err(Failure::new(FAILED, format!("robot \"{}\": {reason}", robot.name)));
    }
    let ended = answer["ended"].as_u64().unwrap_or(0);
    let stays: Vec<&str> = answer["stays"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let mut out = Out::stdout();
    match args.json {
        true => out.json(&json!({"robot": robot.name, "ended": ended, "stays": stays, "ok": true}))?,
        false => {
            out.line(format!("robot \"{}\": {ended} causes ended, {} stay", robot.name, stays.len()))?;
            for cause in stays {
                out.line(format!("  {cause}"))?;
            }
        }
    }
    out.flush()
}

/// How long the supervisor may take to answer [s].
const ANSWER_WITHIN_S: f64 = 2.0;

/// Asks the supervisor to `verb` the node.
pub fn run(args: &Args, verb: &str) -> Result<(), Failure> {
    ask(args, verb, "")
}

fn ask(args: &Args, verb: &str, more: &str) -> Result<(), Failure> {
    let robot = args.which.find()?;
    let request = format!("{verb} {}{more}", args.node);
    let answer = supervisor::ask(&robot.folder, &request, ANSWER_WITHIN_S).map_err(Failure::from)?;
    let answer: Value = serde_json::from_str(&answer)?;
    if let Some(reason) = answer["error"].as_str() {
        return Err(Failure::new(FAILED, format!("robot \"{}\": {reason}", robot.name)));
    }
    let mut out = Out::stdout();
    match args.json {
        true => out.json(&json!({"robot": robot.name, "node": args.node, "request": verb, "ok": true}))?,
        false => {
            out.line(format!("robot \"{}\": {request}: done as asked; `sinew top --once` shows it", robot.name))?
        }
    }
    out.flush()
}
