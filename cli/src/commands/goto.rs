//! `sinew goto`: sends a running robot to a place of its map.

use super::call::failure;
use crate::exit::{Failure, USAGE};
use crate::live::Which;
use crate::output::{Out, Tone, parse_seconds, span};
use messages::{Done, GotoGoal, GotoProgress, GotoResult, Message, bytemuck};
use runtime::calls::client::{Client, Request, Update};
use runtime::clock;
use serde_json::{Value, json};

/// Sends a running robot to a place, in metres and degrees of its map, and waits until it is there
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Where along the map's x axis [m]
    #[arg(value_name = "X", allow_negative_numbers = true)]
    x_m: f64,
    /// Where along the map's y axis [m]
    #[arg(value_name = "Y", allow_negative_numbers = true)]
    y_m: f64,
    /// Heading to end with, counter-clockwise from the x axis; without it any [degrees]
    #[arg(value_name = "THETA", allow_negative_numbers = true)]
    heading_deg: Option<f64>,
    /// How near counts as there; without it as the robot file says
    #[arg(long, value_name = "M")]
    tolerance: Option<f64>,
    /// Returns as soon as the robot has accepted; `sinew call goto cancel` ends it then
    #[arg(long)]
    no_wait: bool,
    /// How long the robot has to accept
    #[arg(long, value_name = "TIME", default_value = "2s")]
    timeout: String,
    /// The node, where another one than /actions/goto is meant
    #[arg(long, value_name = "NODE", default_value = "/actions/goto")]
    node: String,
    /// Prints JSON, an object per line
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// Orders, and waits.
pub fn run(args: Args) -> Result<(), Failure> {
    let goal = goal(&args)?;
    let timeout_s = parse_seconds(&args.timeout).map_err(|reason| Failure::new(USAGE, reason))?;
    let robot = args.which.find()?;
    let node = robot.resolve_node(&args.node)?;
    let mut client = Client::connect(&robot.folder, &node, "sinew goto").map_err(failure)?;
    let mut out = Out::stdout();
    if args.no_wait {
        client.call_message::<GotoGoal, Done>("send", &goal, 128, timeout_s).map_err(failure)?;
        return match args.json {
            true => out.json(&json!({"node": node, "accepted": true})),
            false => out.line(format!(
                "{} {}",
                out.paint.tone(Tone::Good, "under way"),
                out.paint.dim("`sinew call goto cancel` ends it")
            )),
        };
    }
    let begun = clock::now();
    let request = Request {
        command: "goto",
        layout_hash: GotoGoal::layout_hash(),
        body: bytemuck::bytes_of(&goal),
        priority: 128,
        timeout_s,
    };
    let mut broken = None;
    let reply = client.call_with(&request, |update| {
        let said = match update {
            Update::Accepted if args.json => Some(json!({"accepted": true}).to_string()),
            Update::Accepted => Some(out.paint.dim("accepted; Ctrl-C cancels")),
            Update::Progress { layout_hash, body } if layout_hash == GotoProgress::layout_hash() => {
                Some(said(bytemuck::from_bytes(body), args.json))
            }
            Update::Progress { .. } => None,
        };
        if let Some(Err(failure)) = said.map(|said| out.line(said).and_then(|()| out.flush())) {
            broken = Some(failure);
        }
    });
    if let Some(failure) = broken {
        return Err(failure);
    }
    let reply = reply.map_err(failure)?;
    if reply.layout_hash != GotoResult::layout_hash() {
        return Err(Failure::from(format!(
            "{node} answers with another message than GotoResult: use programs of one release"
        )));
    }
    let mut result = <GotoResult as bytemuck::Zeroable>::zeroed();
    bytemuck::bytes_of_mut(&mut result).copy_from_slice(&reply.body);
    let took_s = clock::now().since(begun);
    match args.json {
        true => out.json(&json!({"node": node, "result": messages::to_json_value(&result, &[]), "took_s": took_s})),
        false => out.line(format!(
            "{} at ({:.2}, {:.2}) m, heading {:.0}°, {:.3} m from the goal {}",
            out.paint.tone(Tone::Good, "there"),
            result.x_m,
            result.y_m,
            result.heading_rad.to_degrees(),
            result.distance_m,
            out.paint.dim(format!("after {} and {:.1} m", span(took_s), result.way_m))
        )),
    }
}

fn goal(args: &Args) -> Result<GotoGoal, Failure> {
    let numbers =
        [("X", Some(args.x_m)), ("Y", Some(args.y_m)), ("THETA", args.heading_deg), ("--tolerance", args.tolerance)];
    for (name, value) in numbers {
        if value.is_some_and(|value| !value.is_finite()) {
            return Err(Failure::new(USAGE, format!("{name} must be a number: metres, and degrees for THETA")));
        }
    }
    Ok(GotoGoal {
        x_m: args.x_m,
        y_m: args.y_m,
        heading_rad: args.heading_deg.map_or(f64::NAN, f64::to_radians),
        tolerance_m: args.tolerance.unwrap_or(0.0),
    })
}

fn said(progress: &GotoProgress, as_json: bool) -> String {
    if as_json {
        let progress: Value = messages::to_json_value(progress, &[]);
        return json!({"progress": progress}).to_string();
    }
    let state = match progress.state {
        2 => "turning",
        3 => "lost: no pose",
        _ => "driving",
    };
    format!("{:6.1} s  {:6.2} m to go  {state}", progress.elapsed_s, progress.distance_m)
}
