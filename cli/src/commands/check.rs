//! `sinew check`: a robot file read, its nodes opened for their declarations, its wires checked; no hardware is touched.

use super::graph::{as_json, released_by};
use crate::admission;
use crate::exit::{CHECK, Failure};
use crate::load::{self, Changes};
use crate::output::{Align, Cell, Out, Table, Tone, count};
use runtime::robot::{Graph, RobotError};
use runtime::{NodeType, PortKind};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Checks a robot file: names, settings, wires, types
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder or file of the robot; without it the built-in Pioneer
    robot: Option<PathBuf>,
    /// Lists the node types that a robot file can name
    #[arg(long)]
    types: bool,
    /// Prints one JSON object, errors included
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    changes: Changes,
}

/// Prints a summary, or all errors.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let mut out = Out::stdout();
    if args.types {
        return list_types(&mut out, types, args.json);
    }
    let checked = load::robot(args.robot.as_deref(), &args.changes, types)
        .map_err(|failure| (json!([{"message": failure.message}]), failure))
        .and_then(|robot| match robot.graph() {
            Ok(graph) => {
                let verdict = admission::judge(&graph, &robot.file);
                match verdict.errors.is_empty() {
                    true => Ok((robot, graph, verdict)),
                    false => {
                        let errors = verdict.errors;
                        Err((Value::Array(errors.iter().map(error_json).collect()), load::errors(errors)))
                    }
                }
            }
            Err(errors) => Err((Value::Array(errors.iter().map(error_json).collect()), load::errors(errors))),
        });
    let (robot, graph, verdict) = match checked {
        Ok(checked) => checked,
        Err((errors, failure)) if args.json && failure.code == CHECK => {
            out.json(&json!({"ok": false, "errors": errors}))?;
            out.flush()?;
            return Err(Failure::new(CHECK, ""));
        }
        Err((_, failure)) => return Err(failure),
    };
    if args.json {
        let mut value = as_json(&robot, &graph);
        value["ok"] = Value::Bool(true);
        value["errors"] = json!([]);
        value["warnings"] = graph.warnings.iter().map(error_json).collect();
        value["world_notes"] = json!(crate::picture::notes_of(&robot));
        value["response_analysis"] = json!({"nodes": verdict.reckoned, "utilization": verdict.utilization});
        out.json(&value)?;
        return out.flush();
    }
    out.table(&table(&graph))?;
    for warning in &graph.warnings {
        out.line(format!("\n{}: {warning}", out.paint.tone(Tone::Warn, "warning")))?;
    }
    for note in crate::picture::notes_of(&robot) {
        out.line(format!("\n{}: {note}", out.paint.tone(Tone::Warn, "note")))?;
    }
    let good = out.paint.tone(Tone::Good, "ok");
    let (nodes, wires) = (count(graph.nodes.len(), "node"), count(graph.edges.len(), "wire"));
    out.line(format!("\n{good}: {} ({}), {nodes}, {wires}", robot.name, robot.file))?;
    if verdict.reckoned > 0 {
        let (load, all) = (verdict.utilization * 100.0, graph.nodes.len());
        out.line(format!(
            "deadlines hold at the budgets of {} of {all} nodes, {load:.0} % of a processor",
            verdict.reckoned
        ))?;
    }
    out.flush()
}

fn error_json(error: &RobotError) -> Value {
    json!({
        "file": error.file,
        "line": error.at.map(|(line, _)| line),
        "column": error.at.map(|(_, column)| column),
        "reason": error.reason,
        "advice": error.advice,
        "message": error.to_string(),
    })
}

fn table(graph: &Graph) -> Table {
    let mut table = Table::new(&[
        ("NODE", Align::Left),
        ("TYPE", Align::Left),
        ("RELEASED BY", Align::Left),
        ("DEADLINE", Align::Right),
        ("PRIORITY", Align::Right),
        ("PORTS", Align::Left),
    ]);
    for node in &graph.nodes {
        let spec = &node.spec;
        let declared = |wanted: &dyn Fn(&PortKind) -> bool| node.declared.iter().filter(|d| wanted(&d.kind)).count();
        let mut ports: Vec<String> = Vec::new();
        let mut add = |count: usize, word: &str| {
            if count > 0 {
                ports.push(format!("{count} {word}"));
            }
        };
        add(declared(&|kind| matches!(kind, PortKind::Read | PortKind::OptionalRead | PortKind::Set)), "read");
        add(declared(&|kind| *kind == PortKind::Write), "written");
        add(declared(&|kind| matches!(kind, PortKind::Device(..))), "device");
        add(declared(&|kind| *kind == PortKind::Command), "calls");
        let deadline = spec.deadline_ns.map_or("-".to_owned(), |ns| format!("{} ms", ns as f64 * 1e-6));
        table.row([
            Cell::toned(Tone::Dim, format!("/{}/", spec.kind.layer)).and(Tone::Name, spec.instance.as_str()),
            spec.kind.name.into(),
            released_by(spec).into(),
            deadline.into(),
            spec.priority.to_string().into(),
            Cell::toned(Tone::Dim, ports.join(", ")),
        ]);
    }
    table
}

fn list_types(out: &mut Out, types: &[NodeType], json: bool) -> Result<(), Failure> {
    if json {
        let all: Vec<Value> =
            types.iter().map(|kind| json!({"type": kind.name, "layer": kind.layer.folder()})).collect();
        out.json(&Value::Array(all))?;
        return out.flush();
    }
    let mut table = Table::new(&[("TYPE", Align::Left), ("WRITES BELOW", Align::Left)]);
    for kind in types {
        table.row([Cell::toned(Tone::Name, kind.name), format!("/{}", kind.layer).into()]);
    }
    out.table(&table)?;
    out.flush()
}
