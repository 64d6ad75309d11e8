//! From a name on the command line to a checked robot.

use crate::built_in::{PIONEER, PIONEER_FILE};
use crate::exit::{CHECK, Failure, USAGE};
use runtime::robot::{Override, Resources, Robot, RobotError};
use runtime::{Layer, NodeType};
use std::path::{Path, PathBuf};

/// Changes to the robot file from the command line.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Changes {
    /// World that the simulated twin stands in: a file, relative to the current folder or to the robot's
    #[arg(long, value_name = "FILE")]
    pub world: Option<String>,
    /// Real device of a driver instead of its simulated twin, as in base=/dev/ttyUSB0 or base=tcp:127.0.0.1:8101
    #[arg(long, value_name = "NODE=ADDRESS")]
    pub device: Vec<String>,
    /// Any value of the robot file, as in nodes.forward.config.speed_m_s=0.2
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Name of the robot, to run several of one kind
    #[arg(long)]
    pub name: Option<String>,
}

impl Changes {
    /// The same changes as arguments of another command.
    pub fn arguments(&self) -> Vec<String> {
        let named = |name: &str, value: &String| [format!("--{name}"), value.clone()];
        let world = self.world.iter().flat_map(|value| named("world", value));
        let device = self.device.iter().flat_map(|value| named("device", value));
        let set = self.set.iter().flat_map(|value| named("set", value));
        let name = self.name.iter().flat_map(|value| named("name", value));
        world.chain(device).chain(set).chain(name).collect()
    }
}

/// The robot that `place` names (a folder with robot.toml, or the file itself; the built-in Pioneer for `None`), with
/// the command line's changes.
pub fn robot(place: Option<&Path>, changes: &Changes, types: &[NodeType]) -> Result<Robot, Failure> {
    let robot = written(place, types)?;
    let overrides = overrides(&robot, changes)?;
    let mut robot = robot.with_overrides(&overrides, types).map_err(errors)?;
    drop_unused_twins(&mut robot, changes);
    let contradictions = coordinator::governor::check::contradictions(&robot);
    if !contradictions.is_empty() {
        return Err(Failure::new(CHECK, format!("{}: {}", robot.file, contradictions.join("\n"))));
    }
    let flaws = supervisor::isolation::flaws(&robot);
    if flaws.is_empty() { Ok(robot) } else { Err(errors(flaws)) }
}

fn written(place: Option<&Path>, types: &[NodeType]) -> Result<Robot, Failure> {
    let Some(place) = place else {
        let (_, text) = PIONEER[0];
        let text = std::str::from_utf8(text).map_err(|e| Failure::new(CHECK, e.to_string()))?;
        return Robot::parse(text, PIONEER_FILE, Resources::Embedded(PIONEER), types).map_err(errors);
    };
    let file = if place.is_dir() { place.join("robot.toml") } else { place.to_path_buf() };
    let text = std::fs::read_to_string(&file).map_err(|e| {
        Failure::new(
            USAGE,
            format!("cannot read {}: {e}\nGive a robot's folder (with a robot.toml in it) or its file; without one the built-in Pioneer is used.", file.display()),
        )
    })?;
    let folder = file.parent().map(Path::to_path_buf).unwrap_or_default();
    // Nodes run in processes of their own: relative names must mean the same there.
    let folder = std::path::absolute(&folder).unwrap_or(folder);
    Robot::parse(&text, &file.display().to_string(), Resources::Folder(folder), types).map_err(errors)
}

fn overrides(robot: &Robot, changes: &Changes) -> Result<Vec<Override>, Failure> {
    let mut all = Vec::new();
    let text = |value: &str| toml::Value::String(value.to_owned()).to_string();
    if let Some(world) = &changes.world {
        let Some(node) = robot.nodes.iter().find(|node| node.kind.layer == Layer::Simulator) else {
            return Err(Failure::new(USAGE, format!("--world: robot \"{}\" has no simulator node", robot.name)));
        };
        // A file of the current folder wins over one of the robot's folder.
        let here = PathBuf::from(world);
        let name = if here.exists() { std::path::absolute(&here)?.display().to_string() } else { world.clone() };
        all.push(Override { key: format!("nodes.{}.config.world", node.instance), value: text(&name) });
    }
    for device in &changes.device {
        let Some((node, address)) = device.split_once('=') else {
            return Err(Failure::new(USAGE, format!("--device {device}: write NODE=ADDRESS, as in base=/dev/ttyUSB0")));
        };
        if robot.node(Layer::Drivers, node).is_none() {
            let drivers: Vec<&str> =
                robot.nodes.iter().filter(|n| n.kind.layer == Layer::Drivers).map(|n| n.instance.as_str()).collect();
            return Err(Failure::new(
                USAGE,
                format!("--device {device}: there is no driver \"{node}\"; drivers are {}", drivers.join(", ")),
            ));
        }
        all.push(Override { key: format!("nodes.{node}.config.device"), value: text(address) });
    }
    for set in &changes.set {
        let Some((key, value)) = set.split_once('=') else {
            return Err(Failure::new(USAGE, format!("--set {set}: write KEY=VALUE, as in nodes.forward.period_ms=50")));
        };
        all.push(Override { key: key.trim().into(), value: value.trim().into() });
    }
    if let Some(name) = &changes.name {
        all.push(Override { key: "robot.name".into(), value: text(name) });
    }
    Ok(all)
}

/// A robot whose drivers all have real devices needs no world.
fn drop_unused_twins(robot: &mut Robot, changes: &Changes) {
    let simulated = robot
        .nodes
        .iter()
        .filter(|n| n.kind.layer == Layer::Drivers)
        .any(|node| node.config.get("device").and_then(|d| d.as_str()).is_none_or(|device| device == "simulator"));
    if !changes.device.is_empty() && !simulated {
        robot.nodes.retain(|node| node.kind.layer != Layer::Simulator);
    }
}

/// All errors of a robot file as one failure.
pub fn errors(errors: Vec<RobotError>) -> Failure {
    let count = errors.len();
    let mut text = errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n\n");
    if count > 1 {
        text.push_str(&format!("\n\n{count} errors; nothing was changed."));
    }
    Failure::new(CHECK, text)
}
