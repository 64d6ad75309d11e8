//! The rows of the drawing: layers, their nodes, the nodes' ports.

use super::released_by;
use runtime::PortKind;
use runtime::robot::{Graph, GraphNode};

/// What stands on a row, left of the lanes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Row {
    /// Between layers.
    Blank,
    /// A layer.
    Layer(String),
    /// A node: instance, type, what releases it.
    Node(String, String, String),
    /// A read port: its name and type, the paths that it reads, whether they trigger.
    In { port: String, kind: String, paths: Vec<String>, triggers: bool },
    /// A written port: its name and type, its path.
    Out { port: String, kind: String, path: String },
    /// Something else that belongs to a node.
    Note(String),
}

/// What the runtime writes beside a node's own ports; drawn only where somebody reads it.
const OWN_PORTS: [&str; 2] = ["statistics", "inputs"];

/// The rows of `graph`, in flow order.
pub fn rows(graph: &Graph) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut layer = None;
    for (index, node) in graph.nodes.iter().enumerate() {
        let spec = &node.spec;
        if layer != Some(spec.kind.layer) {
            if layer.is_some() {
                rows.push(Row::Blank);
            }
            layer = Some(spec.kind.layer);
            rows.push(Row::Layer(spec.kind.layer.folder().to_owned()));
        }
        rows.push(Row::Node(spec.instance.clone(), spec.kind.name.to_owned(), released_by(spec)));
        rows.extend(inputs(graph, index, node));
        rows.extend(notes(node));
        rows.extend(outputs(graph, node));
    }
    rows
}

fn inputs(graph: &Graph, index: usize, node: &GraphNode) -> Vec<Row> {
    let is_read = |kind: &PortKind| matches!(kind, PortKind::Read | PortKind::OptionalRead | PortKind::Set);
    let wired = node.declared.iter().filter(|d| is_read(&d.kind) && node.spec.reads.contains_key(d.port));
    wired
        .map(|declared| {
            let edges = graph.edges.iter().filter(|edge| edge.to == index && edge.port == declared.port);
            Row::In {
                port: declared.port.to_owned(),
                kind: declared.message.to_owned(),
                paths: edges.map(|edge| edge.path.clone()).collect(),
                triggers: node.spec.triggers.iter().any(|trigger| trigger == declared.port),
            }
        })
        .collect()
}

fn outputs(graph: &Graph, node: &GraphNode) -> Vec<Row> {
    let read = |path: &str| graph.edges.iter().any(|edge| edge.path == path);
    let shown = node.writes.iter().filter_map(|written| {
        let port = written.path.rsplit('/').next().unwrap_or(&written.path);
        let (path, kind) = (written.path.clone(), written.geometry.type_name.clone());
        (!OWN_PORTS.contains(&port) || read(&path)).then(|| Row::Out { port: port.to_owned(), kind, path })
    });
    shown.collect()
}

fn notes(node: &GraphNode) -> Vec<Row> {
    let mut notes = Vec::new();
    for declared in &node.declared {
        if let PortKind::Device(address, serves) = &declared.kind {
            let what = if *serves { "serves" } else { "device" };
            notes.push(Row::Note(format!("{what} {address}")));
        }
    }
    let commands: Vec<&str> =
        node.declared.iter().filter(|d| d.kind == PortKind::Command).map(|declared| declared.port).collect();
    if !commands.is_empty() {
        notes.push(Row::Note(format!("answers {}", commands.join(", "))));
    }
    for (node, command) in node.spec.calls.values() {
        notes.push(Row::Note(format!("calls {node} {command}")));
    }
    notes
}
