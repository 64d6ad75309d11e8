//! The robot as a graph: every node opened for its declarations alone, every wire checked by type.

use super::error::{RobotError, nearest_advice};
use super::spec::Robot;
use crate::channel::Geometry;
use crate::host::Opened;
use crate::node::OpenError;
use crate::path::{self, Layer};
use crate::ports::{Declaration, Devices, PortKind, Ports};
use crate::robot::NodeSpec;
use messages::{NodeStatistics, StepInputs};

/// A robot whose nodes have been opened and whose wires have been checked.
#[derive(Debug, Clone)]
pub struct Graph {
    /// The nodes, in flow order.
    pub nodes: Vec<GraphNode>,
    /// Every wire from a written path to a read port.
    pub edges: Vec<GraphEdge>,
    /// What is allowed but probably not meant: a pattern that nobody's path matches yet.
    pub warnings: Vec<RobotError>,
}

/// A node and its declarations.
#[derive(Debug, Clone)]
pub struct GraphNode {
    /// The node.
    pub spec: NodeSpec,
    /// Its ports, devices and commands.
    pub declared: Vec<Declaration>,
    /// What it writes: path and geometry, the runtime's own paths included.
    pub writes: Vec<Declared>,
}

/// A written path.
#[derive(Debug, Clone)]
pub struct Declared {
    /// The path.
    pub path: String,
    /// Its ring.
    pub geometry: Geometry,
}

/// One wire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GraphEdge {
    /// Index of the writing node.
    pub from: usize,
    /// Index of the reading node.
    pub to: usize,
    /// The path.
    pub path: String,
    /// The port that reads it.
    pub port: String,
    /// Whether a sample releases the reader's step.
    pub triggers: bool,
}

/// Where the runtime publishes how a node kept time.
pub(crate) const STATISTICS: &str = "statistics";
/// Where the runtime publishes what each step read.
pub(crate) const INPUTS: &str = "inputs";
/// Input sources that a step record can hold.
pub(crate) const INPUTS_CAPACITY: usize = 64;

/// Opens the node's ports with what the runtime adds.
pub(crate) fn open_declared(robot: &Robot, spec: &NodeSpec, seed: u64, place: Devices) -> Result<Opened, OpenError> {
    let (node, mut ports) = Ports::new(robot, spec, seed, place).open_node()?;
    let statistics = ports.own_writer::<NodeStatistics>(STATISTICS, 0);
    let record = spec.record_inputs.then(|| ports.own_writer::<StepInputs>(INPUTS, INPUTS_CAPACITY));
    Ok(Opened { node, ports, statistics, record })
}

impl Robot {
    /// Opens every node for its declarations and checks every wire. All errors found are returned.
    pub fn graph(&self) -> Result<Graph, Vec<RobotError>> {
        let mut errors = Vec::new();
        let mut nodes = Vec::new();
        for spec in &self.nodes {
            match open_declared(self, spec, 0, Devices::Declared) {
                Ok(opened) => {
                    let writes = opened
                        .ports
                        .outputs()
                        .iter()
                        .map(|output| Declared { path: output.path.clone(), geometry: output.geometry.clone() })
                        .collect();
                    nodes.push(GraphNode { spec: spec.clone(), declared: opened.ports.declared().to_vec(), writes });
                }
                Err(e) => {
                    let key = match &e {
                        OpenError::Port { .. } => "reads",
                        _ => "config",
                    };
                    let reason = format!("node \"{}\" ({}): {e}", spec.instance, spec.kind.name);
                    errors.push(self.error_at(&["nodes", &spec.instance, key], reason));
                }
            }
        }
        if !errors.is_empty() {
            return Err(errors);
        }
        let (mut edges, mut warnings) = (Vec::new(), Vec::new());
        for (to, node) in nodes.iter().enumerate() {
            self.check_node(&nodes, to, node, &mut edges, &mut errors);
            self.warn_of_empty_sets(&nodes, &node.spec, &mut warnings);
        }
        if errors.is_empty() { Ok(Graph { nodes, edges, warnings }) } else { Err(errors) }
    }

    /// Names the patterns that match no path of this robot: members may come later, a slip of the pen never brings any.
    fn warn_of_empty_sets(&self, nodes: &[GraphNode], spec: &NodeSpec, warnings: &mut Vec<RobotError>) {
        let paths: Vec<&str> = nodes.iter().flat_map(|n| n.writes.iter().map(|w| w.path.as_str())).collect();
        for (port, wire) in &spec.reads {
            for pattern in wire.from.iter().filter(|source| path::is_pattern(source)) {
                if !paths.iter().any(|written| path::covers(pattern, written)) {
                    let reason = format!("no node of this robot writes a path that {pattern} matches, so far");
                    let error = self.error_at(&["nodes", &spec.instance, "reads", port], reason);
                    warnings.push(error.advise(nearest_advice(pattern, &paths)));
                }
            }
        }
    }

    fn check_node(
        &self,
        nodes: &[GraphNode],
        to: usize,
        node: &GraphNode,
        edges: &mut Vec<GraphEdge>,
        errors: &mut Vec<RobotError>,
    ) {
        let spec = &node.spec;
        let keys = |rest: &[&'static str]| -> Vec<String> {
            ["nodes", spec.instance.as_str()].iter().chain(rest).map(|k| (*k).to_owned()).collect()
        };
        let mut complain = |keys: Vec<String>, reason: String, advice: Option<String>| {
            let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
            let error = self.error_at(&keys, reason);
            errors.push(match advice {
                Some(advice) => error.advise(advice),
                None => error,
            });
        };
        let reads: Vec<&str> = node
            .declared
            .iter()
            .filter(|d| matches!(d.kind, PortKind::Read | PortKind::OptionalRead | PortKind::Set))
            .map(|d| d.port)
            .collect();
        let has_device = node.declared.iter().any(|d| matches!(d.kind, PortKind::Device(..)));
        for trigger in &spec.triggers {
            if !(reads.contains(&trigger.as_str()) || trigger == "device" && has_device) {
                let mut valid = reads.clone();
                if has_device {
                    valid.push("device");
                }
                let reason =
                    format!("node type \"{}\" has no read port \"{trigger}\" to be triggered by", spec.kind.name);
                complain(keys(&["trigger"]), reason, Some(nearest_advice(trigger, &valid)));
            }
        }
        for port in spec.reads.keys().filter(|port| !reads.contains(&port.as_str())) {
            let reason = format!("node type \"{}\" reads no port \"{port}\"", spec.kind.name);
            let mut at = keys(&["reads"]);
            at.push(port.clone());
            complain(at, reason, Some(nearest_advice(port, &reads)));
        }
        let written: Vec<String> =
            node.writes.iter().filter_map(|w| w.path.rsplit('/').next().map(str::to_owned)).collect();
        for port in spec.depth.keys().filter(|port| !written.contains(port)) {
            let reason = format!("node type \"{}\" writes no port \"{port}\"", spec.kind.name);
            let mut at = keys(&["depth"]);
            at.push(port.clone());
            complain(at, reason, Some(nearest_advice(port, &written)));
        }
        for port in spec.care.fresh_ms.keys().filter(|port| !written.contains(port)) {
            let reason = format!("node type \"{}\" writes no port \"{port}\" that could be fresh", spec.kind.name);
            complain(keys(&["care", "fresh_ms"]), reason, Some(nearest_advice(port, &written)));
        }
        for declared in &node.declared {
            let Some(wire) = spec.reads.get(declared.port) else { continue };
            for source in &wire.from {
                let mut at = keys(&["reads"]);
                at.push(declared.port.to_owned());
                let mut found = false;
                for (from, writer) in nodes.iter().enumerate() {
                    for output in writer.writes.iter().filter(|output| path::covers(source, &output.path)) {
                        found = true;
                        if output.geometry.layout_hash != declared.layout_hash {
                            let reason = format!(
                                "port \"{}\" reads {} ({:016x}), but {} carries {} ({:016x})",
                                declared.port,
                                declared.message,
                                declared.layout_hash,
                                output.path,
                                output.geometry.type_name,
                                output.geometry.layout_hash
                            );
                            complain(at.clone(), reason, None);
                            continue;
                        }
                        edges.push(GraphEdge {
                            from,
                            to,
                            path: output.path.clone(),
                            port: declared.port.to_owned(),
                            triggers: spec.triggers.iter().any(|t| t == declared.port),
                        });
                    }
                }
                let elsewhere = path::split_path(source).is_ok_and(|(layer, ..)| layer == Layer::Link);
                if !(found || elsewhere || path::is_pattern(source)) {
                    let all: Vec<&str> = nodes.iter().flat_map(|n| n.writes.iter().map(|w| w.path.as_str())).collect();
                    let reason = format!("no node of this robot writes {source}");
                    complain(at, reason, Some(nearest_advice(source, &all)));
                }
            }
        }
        if spec.record_inputs {
            let sources: usize = spec.reads.values().map(|wire| wire.from.len()).sum();
            if sources > INPUTS_CAPACITY {
                let reason = format!("{sources} sources are more than the {INPUTS_CAPACITY} that a step record holds");
                complain(keys(&["record_inputs"]), reason, None);
            }
        }
    }
}
