//! `sinew start`, `sinew stop`, `sinew restart`: one node of a running robot.

use crate::exit::{FAILED, Failure};
use crate::live::Which;
use crate::output::Out;
use serde_json::{Value, json};

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

/// How long the supervisor may take to answer [s].
const ANSWER_WITHIN_S: f64 = 2.0;

/// Asks the supervisor to `verb` the node.
pub fn run(args: &Args, verb: &str) -> Result<(), Failure> {
    let robot = args.which.find()?;
    let request = format!("{verb} {}", args.node);
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
