//! `sinew down`: the ordered stop of a running robot.

use crate::exit::{FAILED, Failure, NOT_RUNNING, USAGE};
use crate::live;
use crate::output::{Out, parse_seconds, span};
use runtime::clock;
use serde_json::json;
use supervisor::ControlError;

/// Stops a robot in order; returns when nothing of it is left
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot, where several run
    name: Option<String>,
    /// Gives up waiting after this long
    #[arg(long, value_name = "TIME", default_value = "20s")]
    timeout: String,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// Stops the robot.
pub fn run(args: Args) -> Result<(), Failure> {
    let timeout_s = parse_seconds(&args.timeout).map_err(|reason| Failure::new(USAGE, reason))?;
    let robot = live::find_below(&live::root(), args.name.as_deref())?;
    let begun = clock::now();
    supervisor::down(&robot.folder, timeout_s).map_err(|e| match e {
        ControlError::NotRunning(_) => Failure::new(NOT_RUNNING, left_over(&robot)),
        ControlError::TimedOut(..) => Failure::new(
            FAILED,
            format!(
                "robot \"{}\" is still stopping after {}: `sinew logs` may say what holds it",
                robot.name, args.timeout
            ),
        ),
        e => Failure::from(e),
    })?;
    let took_s = clock::now().since(begun);
    let mut out = Out::stdout();
    match args.json {
        true => out.json(&json!({"robot": robot.name, "stopped": true, "took_s": took_s}))?,
        false => out.line(format!("robot \"{}\" has stopped, after {}", robot.name, span(took_s)))?,
    }
    out.flush()
}

fn left_over(robot: &live::LiveRobot) -> String {
    let folder = robot.folder.display();
    let end = format!("`sinew run` of a robot of this name removes them, or: rm -r {folder}");
    match live::runs(&robot.folder) {
        true => format!(
            "robot \"{}\" runs without a supervisor (a node started by hand?): end its writers, see `sinew ls`",
            robot.name
        ),
        false => format!("robot \"{}\" does not run; {folder} holds its leftovers: {end}", robot.name),
    }
}
