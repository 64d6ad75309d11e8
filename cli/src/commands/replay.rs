//! `sinew replay`: nodes do their recorded steps again, and what they write is compared byte for byte.

use crate::exit::{CHECK, Failure, USAGE};
use crate::load;
use crate::output::{Out, Tone, count};
use recorder::replay::{ReplayFailure, replay};
use recorder::{Comparison, FirstDifference, NodeComparison, Recording};
use runtime::NodeType;
use runtime::robot::{NodeSpec, Override, Robot, nearest_advice};
use std::path::PathBuf;

/// Does the recorded steps of nodes again and compares what they write, byte for byte
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    file: PathBuf,
    /// A node, as in steer_clear or /actions/steer_clear; without one every node whose steps were recorded
    #[arg(long = "node", value_name = "NAME")]
    nodes: Vec<String>,
    /// Any value of the robot file, to see what it changes, as in nodes.forward.config.speed_m_s=0.2
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Draws what differs, recorded and replayed over time
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// Replays the nodes and prints the comparison.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let robot = robot(&args, types)?;
    let wanted = wanted(&args.nodes, &robot)?;
    let mut nodes = Vec::new();
    let mut skipped = Vec::new();
    for node in wanted {
        match replay(&args.file, &robot, &node) {
            Ok(comparison) => nodes.push(comparison),
            // Asked for all, those count that can be had.
            Err(ReplayFailure::NoSteps { node, .. }) if args.nodes.is_empty() => skipped.push(node),
            Err(e) => return Err(e.into()),
        }
    }
    if nodes.is_empty() {
        let node = skipped.first().cloned().unwrap_or_default();
        return Err(ReplayFailure::NoSteps { file: args.file, node }.into());
    }
    if let Some(file) = &args.svg {
        match recorder::plot(&nodes) {
            Some(plot) => std::fs::write(file, plot)
                .map_err(|e| Failure::from(format!("cannot write {}: {e}", file.display())))?,
            None => eprintln!("nothing differs: {} was not written", file.display()),
        }
    }
    let comparison = Comparison::of(nodes);
    let mut out = Out::stdout();
    match args.json {
        true => out.json(&serde_json::to_value(&comparison)?)?,
        false => print(&comparison, &skipped, &mut out)?,
    }
    out.flush()?;
    if comparison.identical { Ok(()) } else { Err(Failure::new(CHECK, "")) }
}

/// The robot that ran, with the changes that are asked for.
fn robot(args: &Args, types: &[NodeType]) -> Result<Robot, Failure> {
    let recording = Recording::open(&args.file)?;
    let robot = recording.facts().robot(types).map_err(load::errors)?;
    let mut overrides = Vec::new();
    for set in &args.set {
        let Some((key, value)) = set.split_once('=') else {
            return Err(Failure::new(USAGE, format!("--set {set}: write KEY=VALUE")));
        };
        overrides.push(Override { key: key.trim().into(), value: value.trim().into() });
    }
    let mut changed = robot.with_overrides(&overrides, types).map_err(load::errors)?;
    changed.nodes.retain(|node| robot.nodes.iter().any(|known| known.path() == node.path()));
    Ok(changed)
}

/// The paths of the nodes that are meant, all without a name.
fn wanted(names: &[String], robot: &Robot) -> Result<Vec<String>, Failure> {
    if names.is_empty() {
        return Ok(robot.nodes.iter().map(NodeSpec::path).collect());
    }
    let known: Vec<String> = robot.nodes.iter().map(NodeSpec::path).collect();
    let mut paths = Vec::new();
    for name in names {
        let found = robot.nodes.iter().find(|node| node.path() == *name || node.instance == *name);
        match found {
            Some(node) => paths.push(node.path()),
            None => {
                let text = format!("--node {name}: the recording has no such node; {}", nearest_advice(name, &known));
                return Err(Failure::new(USAGE, text));
            }
        }
    }
    Ok(paths)
}

fn print(comparison: &Comparison, skipped: &[String], out: &mut Out) -> Result<(), Failure> {
    for node in &comparison.nodes {
        print_node(node, out)?;
    }
    if !skipped.is_empty() {
        out.line(out.paint.dim(format!("steps not recorded: {}", skipped.join(" "))))?;
    }
    Ok(())
}

fn print_node(node: &NodeComparison, out: &mut Out) -> Result<(), Failure> {
    let (tone, verdict) = match node.is_identical() {
        true => (Tone::Good, "identical"),
        false if node.different_steps > 0 => (Tone::Bad, "different"),
        false => (Tone::Warn, "nothing proven"),
    };
    let mut words = format!("{} of {} identical", node.identical_steps, count(node.steps as usize, "step"));
    for (number, what) in
        [(node.different_steps, "different"), (node.not_replayable, "not replayable"), (node.unproven, "unproven")]
    {
        if number > 0 {
            words.push_str(&format!(", {number} {what}"));
        }
    }
    if node.lives > 1 {
        words.push_str(&format!(", {} lives", node.lives));
    }
    out.line(format!("{}  {}  {words}", out.paint.strong(&node.node), out.paint.tone(tone, verdict)))?;
    for (reason, number) in &node.reasons {
        out.line(out.paint.dim(format!("  {number} × {reason}")))?;
    }
    for path in &node.paths {
        let samples = path.identical + path.different;
        out.line(format!(
            "  {}: {} compared, {} different{}",
            path.path,
            count(samples as usize, "sample"),
            path.different,
            if path.other_count > 0 {
                format!(", {} wrote another number", count(path.other_count as usize, "step"))
            } else {
                String::new()
            }
        ))?;
        for field in &path.fields {
            out.line(format!(
                "    {}: {} of {} values differ, mean {:+.4e}, rms {:.4e}, greatest {:.4e}",
                field.field, field.different, field.values, field.mean, field.rms, field.max
            ))?;
        }
    }
    if let Some(first) = &node.first_difference {
        print_first(first, out)?;
    }
    Ok(())
}

fn print_first(first: &FirstDifference, out: &mut Out) -> Result<(), Failure> {
    out.line(format!(
        "  first difference: step {} at {:.6} s, {} #{}",
        first.step, first.at_s, first.path, first.sequence
    ))?;
    for field in &first.fields {
        out.line(format!("    {}: recorded {}, replayed {}", field.field, field.recorded, field.replayed))?;
    }
    if first.fields.is_empty() {
        out.line(format!("    recorded {}", first.recorded))?;
        out.line(format!("    replayed {}", first.replayed))?;
    }
    out.line("  from")?;
    for input in &first.inputs {
        out.line(format!("    {} #{} at {:.6} s {}", input.path, input.sequence, input.stamp_s, input.message))?;
    }
    for event in &first.events {
        out.line(format!("    {event}"))?;
    }
    Ok(())
}
