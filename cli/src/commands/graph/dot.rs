//! The graph for Graphviz: a cluster per layer, bold lines for what triggers a step.

use super::released_by;
use runtime::Layer;
use runtime::robot::{Graph, Robot};
use std::fmt::Write;

/// The graph as a Graphviz file.
pub fn graphviz(robot: &Robot, graph: &Graph) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "digraph {} {{", quoted(&robot.name));
    text += "  rankdir=LR;\n  node [shape=box, style=\"rounded,filled\", fillcolor=white, fontname=\"Helvetica\"];\n";
    text += "  edge [fontname=\"Helvetica\", fontsize=10];\n";
    for layer in Layer::ALL {
        let nodes: Vec<_> = graph.nodes.iter().filter(|node| node.spec.kind.layer == layer).collect();
        if nodes.is_empty() {
            continue;
        }
        let _ =
            writeln!(text, "  subgraph cluster_{layer} {{\n    label=\"{layer}\"; style=filled; color=\"#eef2f5\";");
        for node in nodes {
            let spec = &node.spec;
            let label = format!("{}\\n{} · {}", spec.instance, spec.kind.name, released_by(spec));
            let _ = writeln!(text, "    {} [label=\"{label}\"];", quoted(&spec.path()));
        }
        text += "  }\n";
    }
    for edge in &graph.edges {
        let port = edge.path.rsplit('/').next().unwrap_or(&edge.path);
        let label = if port == edge.port { port.to_owned() } else { format!("{port} → {}", edge.port) };
        let style = if edge.triggers { "style=bold" } else { "style=dashed" };
        let (from, to) = (graph.nodes[edge.from].spec.path(), graph.nodes[edge.to].spec.path());
        let _ = writeln!(text, "  {} -> {} [label=\"{label}\", {style}];", quoted(&from), quoted(&to));
    }
    text += "}\n";
    text
}

fn quoted(text: &str) -> String {
    format!("\"{text}\"")
}
