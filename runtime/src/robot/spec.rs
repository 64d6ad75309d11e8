//! A robot file after reading: names checked, node types looked up, times in nanoseconds, nodes in flow order.

use super::care::{self, CareTable, Limp, Period, SupervisionTable};
use super::error::{RobotError, nearest_advice};
use super::file::{Body, Isolate, Missed, NodeTable, RealtimeTable, RecordTable, Restart, RobotFile};
use super::locate::{locate, value_at};
use super::resources::Resources;
use crate::node::NodeType;
use crate::path::{self, Layer};
use std::collections::BTreeMap;

/// A robot, ready to be checked and run.
#[derive(Debug, Clone)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// One line about it.
    pub description: String,
    /// The file as the user named it.
    pub file: String,
    /// The file's text.
    pub text: String,
    /// Where its worlds and maps are.
    pub resources: Resources,
    /// Its body.
    pub body: Body,
    /// What to ask of the kernel.
    pub realtime: RealtimeTable,
    /// Whether its runs are recorded, and how.
    pub record: Option<RecordTable>,
    /// What remains when a node that matters cannot be had.
    pub limp: Option<Limp>,
    /// Nodes that share a fate, and what follows conditions.
    pub supervision: SupervisionTable,
    /// Its nodes in flow order: by layer, then by name.
    pub nodes: Vec<NodeSpec>,
}

/// One node of a robot.
#[derive(Debug, Clone)]
pub struct NodeSpec {
    /// Instance name.
    pub instance: String,
    /// Its type.
    pub kind: NodeType,
    /// Read ports whose samples release a step; "device" for the device's bytes.
    pub triggers: Vec<String>,
    /// Grid of releases [ns].
    pub period_ns: Option<u64>,
    /// The longest period that the governor may stretch it to [ns]; `period_ns` where it may not.
    pub longest_period_ns: Option<u64>,
    /// Deadline after the release [ns].
    pub deadline_ns: Option<u64>,
    /// What to do about missed periods.
    pub missed: Missed,
    /// SCHED_FIFO priority.
    pub priority: u8,
    /// Nodes of one word share a process.
    pub process: Option<String>,
    /// How its process is kept apart.
    pub isolate: Isolate,
    /// The user that it runs as under root.
    pub user: Option<String>,
    /// What follows when it ends.
    pub restart: Restart,
    /// Hangs, silence, standbys, and what its loss means for the robot.
    pub care: CareTable,
    /// How little the robot can do without it, 0 to 100.
    pub importance: u8,
    /// Longest execution of a step that is reckoned with before any was measured [ns].
    pub budget_ns: Option<u64>,
    /// Sources of the read ports.
    pub reads: BTreeMap<String, ReadWire>,
    /// Targets of callers: path of the node, command.
    pub calls: BTreeMap<String, (String, String)>,
    /// Ring depths of written ports.
    pub depth: BTreeMap<String, usize>,
    /// Publish what each step read.
    pub record_inputs: bool,
    /// The type's own settings.
    pub config: toml::Table,
}

/// Sources of a read port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReadWire {
    /// One path, one pattern, or candidates in order of preference.
    pub from: Vec<String>,
    /// A sample older than this counts as absent [ns].
    pub max_age_ns: u64,
    /// A better candidate must have been fresh for this long before it is used again [ns].
    pub return_after_ns: u64,
}

/// Replaces the value under `key` (dotted, as in "nodes.base.config.device") by `value` (TOML).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    /// Dotted key.
    pub key: String,
    /// A TOML value; what is none is taken as a text.
    pub value: String,
}

impl NodeSpec {
    /// `/<layer>/<instance>`.
    pub fn path(&self) -> String {
        format!("/{}/{}", self.kind.layer, self.instance)
    }

    /// The path of its port `port`.
    pub fn port_path(&self, port: &str) -> String {
        format!("/{}/{}/{port}", self.kind.layer, self.instance)
    }
}

/// A sample is fresh for half a second where the robot file says nothing.
const MAX_AGE_MS: f64 = 500.0;
/// A better candidate is used again after a second of health where the robot file says nothing.
const RETURN_AFTER_MS: f64 = 1000.0;

impl Robot {
    /// Reads the robot file `text`; `file` is its name in messages. All errors found are returned.
    pub fn parse(text: &str, file: &str, resources: Resources, types: &[NodeType]) -> Result<Robot, Vec<RobotError>> {
        let written: RobotFile = toml::from_str(text).map_err(|e| vec![RobotError::from_toml(file, text, &e)])?;
        let place = |keys: &[&str], reason: String| RobotError::at(file, text, locate(text, keys), reason);
        let mut errors = Vec::new();
        if !path::is_name(&written.robot.name) {
            let reason = format!(
                "\"{}\" is no name: use 1 to 32 of a-z, 0-9 and _, beginning with a letter",
                written.robot.name
            );
            errors.push(place(&["robot", "name"], reason));
        }
        check_body(&written.body, &mut |key, reason| errors.push(place(&["body", key], reason)));
        care::check(&written, &mut |keys, reason, advice| errors.push(place(keys, reason).advise(advice)));
        let mut nodes = Vec::new();
        for (instance, table) in &written.nodes {
            match node_spec(instance, table, types, text, file) {
                Ok(spec) => nodes.push(spec),
                Err(mut found) => errors.append(&mut found),
            }
        }
        nodes.sort_by(|a, b| (a.kind.layer, &a.instance).cmp(&(b.kind.layer, &b.instance)));
        if !errors.is_empty() {
            return Err(errors);
        }
        let RobotFile { robot, body, realtime, record, limp, supervision, .. } = written;
        if record.as_ref().is_some_and(|record| record.inputs) {
            nodes.iter_mut().for_each(|node| node.record_inputs = true);
        }
        Ok(Robot {
            name: robot.name,
            description: robot.description,
            file: file.into(),
            text: text.into(),
            resources,
            body,
            realtime,
            record,
            limp,
            supervision,
            nodes,
        })
    }

    /// The same robot with some values replaced, checked anew.
    pub fn with_overrides(&self, overrides: &[Override], types: &[NodeType]) -> Result<Robot, Vec<RobotError>> {
        if overrides.is_empty() {
            return Ok(self.clone());
        }
        let mut root: toml::Table =
            toml::from_str(&self.text).map_err(|e| vec![RobotError::from_toml(&self.file, &self.text, &e)])?;
        for over in overrides {
            over.apply(&mut root).map_err(|reason| vec![RobotError::plain(&self.file, reason)])?;
        }
        let text = toml::to_string(&root).map_err(|e| vec![RobotError::plain(&self.file, e.to_string())])?;
        let file = format!("{} (with the command line's changes)", self.file);
        Robot::parse(&text, &file, self.resources.clone(), types)
    }

    /// The node `instance` of `layer`.
    pub fn node(&self, layer: Layer, instance: &str) -> Option<&NodeSpec> {
        self.nodes.iter().find(|node| node.kind.layer == layer && node.instance == instance)
    }

    /// An error at the value under `keys`.
    pub fn error_at(&self, keys: &[&str], reason: impl Into<String>) -> RobotError {
        RobotError::at(&self.file, &self.text, locate(&self.text, keys), reason)
    }
}

impl Override {
    fn apply(&self, root: &mut toml::Table) -> Result<(), String> {
        let mut keys: Vec<&str> = self.key.split('.').collect();
        let Some(last) = keys.pop().filter(|last| !last.is_empty()) else {
            return Err(format!("\"{}\" is no key: write nodes.NAME.config.KEY=VALUE", self.key));
        };
        let mut table = root;
        for key in keys {
            let entry = table.entry(key).or_insert_with(|| toml::Value::Table(toml::Table::new()));
            table = entry.as_table_mut().ok_or_else(|| format!("\"{key}\" in \"{}\" is no table", self.key))?;
        }
        let value = toml::from_str::<toml::Table>(&format!("v = {}", self.value))
            .ok()
            .and_then(|mut parsed| parsed.remove("v"))
            .unwrap_or_else(|| toml::Value::String(self.value.clone()));
        table.insert(last.to_owned(), value);
        Ok(())
    }
}

fn check_body(body: &Body, error: &mut dyn FnMut(&str, String)) {
    let positive = [
        ("length_ahead_m", body.length_ahead_m),
        ("length_behind_m", body.length_behind_m),
        ("half_width_m", body.half_width_m),
        ("acceleration_m_s2", body.acceleration_m_s2),
        ("deceleration_m_s2", body.deceleration_m_s2),
        ("turn_acceleration_rad_s2", body.turn_acceleration_rad_s2),
    ];
    let limits = [
        ("max_forward_m_s", body.max_forward_m_s),
        ("max_backward_m_s", body.max_backward_m_s),
        ("max_turn_rad_s", body.max_turn_rad_s),
        ("blind_cap_m_s", body.blind_cap_m_s),
    ];
    for (key, value) in positive {
        if !(value.is_finite() && value > 0.0) {
            error(key, format!("{key} is {value}: it must be a number above 0"));
        }
    }
    for (key, value) in limits {
        if !(value.is_finite() && value >= 0.0) {
            error(key, format!("{key} is {value}: it must be 0 or a number above 0"));
        }
    }
}

/// One node's table, looked up and checked on its own.
fn node_spec(
    instance: &str,
    table: &NodeTable,
    types: &[NodeType],
    text: &str,
    file: &str,
) -> Result<NodeSpec, Vec<RobotError>> {
    let place = |keys: &[&str], reason: String| {
        let all: Vec<&str> = ["nodes", instance].iter().chain(keys).copied().collect();
        RobotError::at(file, text, locate(text, &all), reason)
    };
    let mut errors = Vec::new();
    if !path::is_name(instance) {
        errors.push(place(&[], format!("\"{instance}\" is no name: use 1 to 32 of a-z, 0-9 and _")));
    }
    let Some(kind) = types.iter().find(|kind| kind.name == table.kind).copied() else {
        let names: Vec<&str> = types.iter().map(|kind| kind.name).collect();
        let reason = format!("there is no node type \"{}\"", table.kind);
        errors.push(place(&["type"], reason).advise(nearest_advice(&table.kind, &names)));
        return Err(errors);
    };
    let mut nanos = |key: &str, value: Option<f64>, least: f64| -> Option<u64> {
        let ms = value?;
        if !(least..=3_600_000.0).contains(&ms) {
            errors.push(place(&[key], format!("{key} is {ms}: it must lie between {least} and 3600000")));
            return None;
        }
        Some((ms * 1e6).round() as u64)
    };
    let period_ns = nanos("period_ms", table.period_ms.map(Period::wanted_ms), 0.05);
    let longest_period_ns = nanos("period_ms", table.period_ms.map(Period::longest_ms), 0.05);
    let budget_ns = nanos("budget_ms", table.budget_ms, 0.0);
    let deadline_ns = nanos("deadline_ms", table.deadline_ms, 0.0);
    if table.period_ms.is_none() && table.trigger.0.is_empty() {
        let reason = format!("node \"{instance}\" would never step: it has neither period_ms nor trigger");
        errors.push(place(&[], reason));
    }
    if longest_period_ns < period_ns {
        errors.push(place(&["period_ms"], "the longest period is shorter than the shortest: swap min and max".into()));
    }
    let importance = table.importance.unwrap_or(50);
    if importance > 100 {
        errors.push(place(&["importance"], format!("importance is {importance}: it must lie between 0 and 100")));
    }
    let priority = table.priority.unwrap_or(50);
    if !(1..=89).contains(&priority) {
        errors.push(place(&["priority"], format!("priority is {priority}: it must lie between 1 and 89")));
    }
    let mut reads = BTreeMap::new();
    for (port, read) in &table.reads {
        let keys = ["reads", port.as_str()];
        if read.from.is_empty() {
            errors.push(place(&keys, format!("port \"{port}\" has no source: write `from = \"/layer/node/port\"`")));
        }
        for source in &read.from {
            if let Err(e) = path::split_path(source) {
                errors.push(place(&keys, e.to_string()));
            }
        }
        let (age, back) = (read.max_age_ms.unwrap_or(MAX_AGE_MS), read.return_after_ms.unwrap_or(RETURN_AFTER_MS));
        if !(age > 0.0 && age.is_finite() && back >= 0.0 && back.is_finite()) {
            errors.push(place(&keys, format!("port \"{port}\": ages must be positive numbers of milliseconds")));
        }
        let wire =
            ReadWire { from: read.from.clone(), max_age_ns: (age * 1e6) as u64, return_after_ns: (back * 1e6) as u64 };
        reads.insert(port.clone(), wire);
    }
    let mut calls = BTreeMap::new();
    for (port, target) in &table.calls {
        match target.split_once(' ') {
            Some((path, command)) if path.starts_with('/') && path::is_name(command) => {
                calls.insert(port.clone(), (path.to_owned(), command.to_owned()));
            }
            _ => {
                errors.push(place(&["calls", port], format!("\"{target}\" is no call: write \"/layer/node command\"")))
            }
        }
    }
    let mut depth = BTreeMap::new();
    for (port, samples) in &table.depth {
        if !(2..=1_048_576).contains(samples) {
            errors.push(place(&["depth", port], format!("depth is {samples}: it must lie between 2 and 1048576")));
        }
        depth.insert(port.clone(), *samples as usize);
    }
    let config_keys = ["nodes", instance, "config"];
    let checked = match value_at(text, &config_keys) {
        Some(value) => (kind.check_config)(value),
        None => match toml::de::ValueDeserializer::parse("{}") {
            Ok(empty) => (kind.check_config)(empty),
            Err(e) => Err(e),
        },
    };
    if let Err(e) = checked {
        let mut error = RobotError::from_toml(file, text, &e);
        if error.at.is_none() || table.config.is_none() {
            error = place(&["config"], format!("config of \"{instance}\": {}", error.reason));
        }
        errors.push(error);
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    Ok(NodeSpec {
        instance: instance.into(),
        kind,
        triggers: table.trigger.0.clone(),
        period_ns,
        longest_period_ns,
        deadline_ns,
        missed: table.missed,
        priority,
        process: table.process.clone(),
        isolate: table.isolate,
        user: table.user.clone(),
        restart: table.restart,
        care: table.care.clone().unwrap_or_default(),
        importance,
        budget_ns,
        reads,
        calls,
        depth,
        record_inputs: table.record_inputs,
        config: table.config.clone().unwrap_or_default(),
    })
}
