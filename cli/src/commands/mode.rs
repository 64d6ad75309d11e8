//! `sinew mode`: the modes of a running robot's coordinator, and which one counts.

use super::call::failure;
use crate::exit::{Failure, USAGE};
use crate::launch::Launch;
use crate::live::Which;
use crate::output::{Out, Tone};
use messages::{ModeState, SetMode, Trigger};
use runtime::calls::client::Client;
use runtime::robot::{Robot, nearest_advice};
use runtime::{Layer, NodeType};
use serde_json::json;

/// Shows a running robot's modes, or sets one
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The mode, by its name or its number
    mode: Option<String>,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// How long the coordinator has to answer [s].
const TIMEOUT_S: f64 = 2.0;

/// Shows or sets.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let live = args.which.find()?;
    let robot = Launch::read(&live.folder)?.robot(types)?;
    let (node, names) = modes(&robot)?;
    let mut client = Client::connect(&live.folder, &node, "sinew mode").map_err(failure)?;
    let state: ModeState = match &args.mode {
        None => client.call_message("get_mode", &Trigger::default(), 128, TIMEOUT_S),
        Some(wanted) => client.call_message("set_mode", &SetMode { mode: index(wanted, &names)? }, 128, TIMEOUT_S),
    }
    .map_err(failure)?;
    let mut out = Out::stdout();
    if args.json {
        let name = usize::try_from(state.mode).ok().and_then(|mode| names.get(mode));
        return out.json(&json!({"node": node, "mode": state.mode, "name": name, "modes": names}));
    }
    for (number, name) in names.iter().enumerate() {
        let line = format!("{number}  {name}");
        out.line(match number as u64 == state.mode {
            true => format!("{} {}", out.paint.tone(Tone::Good, "→"), out.paint.strong(line)),
            false => format!("  {line}"),
        })?;
    }
    Ok(())
}

/// The coordinator's path, and the names of its modes.
fn modes(robot: &Robot) -> Result<(String, Vec<String>), Failure> {
    let arbiter = robot.nodes.iter().find(|node| node.kind.layer == Layer::Coordinator && node.kind.name == "arbiter");
    let Some(arbiter) = arbiter else {
        return Err(Failure::from(format!("robot \"{}\" has no arbiter: it has no modes", robot.name)));
    };
    let written = arbiter.config.get("modes").and_then(toml::Value::as_array);
    let name = |mode: &toml::Value| mode.get("name").and_then(toml::Value::as_str).unwrap_or("default").to_owned();
    let names = written.map_or_else(|| vec!["default".to_owned()], |modes| modes.iter().map(name).collect());
    Ok((arbiter.path(), names))
}

fn index(wanted: &str, names: &[String]) -> Result<u64, Failure> {
    let by_name = names.iter().position(|name| name == wanted);
    let by_number = wanted.parse::<usize>().ok().filter(|number| *number < names.len());
    match by_name.or(by_number) {
        Some(index) => Ok(index as u64),
        None => {
            let advice = nearest_advice(wanted, names);
            Err(Failure::new(USAGE, format!("there is no mode \"{wanted}\"; {advice}")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mode_goes_by_its_name_or_its_number() {
        let names = ["none".to_owned(), "velocity".to_owned()];
        assert_eq!(index("velocity", &names).ok(), Some(1));
        assert_eq!(index("0", &names).ok(), Some(0));
        assert!(index("2", &names).is_err() && index("velocty", &names).is_err());
    }
}
