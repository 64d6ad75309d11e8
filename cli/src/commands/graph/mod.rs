//! `sinew graph`: who writes what for whom, as a drawing, for Graphviz, or as JSON.

mod dot;
mod lanes;
mod rows;

use crate::exit::Failure;
use crate::load::{self, Changes};
use crate::output::Out;
use runtime::NodeType;
use runtime::robot::{Graph, NodeSpec, Robot};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Draws the flow of a robot: nodes by layer, what they write, who reads it, what triggers whom
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder or file of the robot; without it the built-in Pioneer
    robot: Option<PathBuf>,
    /// Prints a Graphviz file
    #[arg(long, conflicts_with = "json")]
    dot: bool,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    changes: Changes,
}

/// Prints the graph.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let robot = load::robot(args.robot.as_deref(), &args.changes, types)?;
    let graph = robot.graph().map_err(load::errors)?;
    let mut out = Out::stdout();
    match (args.dot, args.json) {
        (true, _) => out.raw(&dot::graphviz(&robot, &graph))?,
        (_, true) => out.json(&as_json(&robot, &graph))?,
        _ => lanes::draw(&robot, &graph, out.paint).iter().try_for_each(|line| out.line(line))?,
    }
    out.flush()
}

/// What releases a node's steps, in words: `50 ms, device, command`.
pub fn released_by(spec: &NodeSpec) -> String {
    let period = spec.period_ns.map(|ns| format!("{} ms", ns as f64 * 1e-6));
    period.into_iter().chain(spec.triggers.iter().cloned()).collect::<Vec<_>>().join(", ")
}

/// The graph for programs.
pub fn as_json(robot: &Robot, graph: &Graph) -> Value {
    let nodes = graph.nodes.iter().map(|node| {
        let spec = &node.spec;
        let writes = node.writes.iter().map(|written| {
            json!({
                "path": written.path,
                "type": written.geometry.type_name,
                "layout_hash": format!("{:016x}", written.geometry.layout_hash),
                "depth": written.geometry.depth,
            })
        });
        let reads = spec
            .reads
            .iter()
            .map(|(port, wire)| json!({"port": port, "from": wire.from, "max_age_ms": wire.max_age_ns as f64 * 1e-6}));
        json!({
            "path": spec.path(),
            "type": spec.kind.name,
            "layer": spec.kind.layer.folder(),
            "period_ms": spec.period_ns.map(|ns| ns as f64 * 1e-6),
            "deadline_ms": spec.deadline_ns.map(|ns| ns as f64 * 1e-6),
            "triggers": spec.triggers,
            "priority": spec.priority,
            "process": spec.process,
            "reads": reads.collect::<Vec<_>>(),
            "writes": writes.collect::<Vec<_>>(),
        })
    });
    let edges = graph.edges.iter().map(|edge| {
        json!({
            "from": graph.nodes[edge.from].spec.path(),
            "to": graph.nodes[edge.to].spec.path(),
            "path": edge.path,
            "port": edge.port,
            "triggers": edge.triggers,
        })
    });
    json!({
        "robot": robot.name,
        "file": robot.file,
        "nodes": nodes.collect::<Vec<_>>(),
        "edges": edges.collect::<Vec<_>>(),
    })
}
