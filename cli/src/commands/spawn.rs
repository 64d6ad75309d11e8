//! `sinew spawn TYPE --at NAME`: a node that the robot file does not name, on a robot that drives.
//!
//! All that can be refused is refused before anything is changed: the robot file with the node in it (names, types of
//! all wires, a second writer, a cycle without delay) and its deadlines, by response-time analysis with the measured times
//! of nodes that have no budget. Then its rings are made, it is written where every process reads the robot, and the
//! supervisor starts it. One that does not run is stopped, and keeps its place.

use super::change::{ANSWER_WITHIN_S, LOOK_S, More, PATIENCE_S, file_of, lock, write_beside};
use crate::admission::{self, Verdict};
use crate::cycles;
use crate::exit::{CHECK, FAILED, Failure, USAGE};
use crate::launch::Launch;
use crate::live::LiveRobot;
use crate::load;
use crate::output::Out;
use messages::{NodeStatistics, bytemuck};
use runtime::channel::SampleBuffer;
use runtime::robot::{Graph, NodeSpec, Robot};
use runtime::{Layer, NodeType, clock};
use serde_json::json;
use std::path::{Path, PathBuf};
use supervisor::{Newcomer, Status};

/// Starts a node that the robot file does not name, while the robot drives
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The node's type
    #[arg(value_name = "TYPE")]
    kind: String,
    /// Its name, as in watch or /motion/watch
    #[arg(long, value_name = "NAME")]
    at: String,
    /// Its period, or MIN:MAX for one that the governor may stretch [ms]
    #[arg(long, value_name = "MS")]
    period: Option<String>,
    /// A read port whose samples release its steps
    #[arg(long, value_name = "PORT")]
    trigger: Vec<String>,
    /// What a read port reads
    #[arg(long = "read", value_name = "PORT=PATH")]
    reads: Vec<String>,
    /// A setting
    #[arg(long = "set", value_name = "KEY=VALUE", allow_hyphen_values = true)]
    settings: Vec<String>,
    /// The longest step to be reckoned with [ms]
    #[arg(long, value_name = "MS")]
    budget: f64,
    /// A step must have ended so long after its release; without it: its period [ms]
    #[arg(long, value_name = "MS")]
    deadline: Option<f64>,
    /// Its priority, 1 to 89
    #[arg(long, default_value_t = 50)]
    priority: u8,
    /// How little the robot can do without it, 0 to 100
    #[arg(long, default_value_t = 50)]
    importance: u8,
    #[command(flatten)]
    more: More,
}

/// Spawns.
pub fn run(args: &Args, types: &[NodeType]) -> Result<(), Failure> {
    let name = args.at.rsplit('/').next().unwrap_or(&args.at).to_owned();
    let table = table(args)?;
    let live = args.more.which.find()?;
    let _one_at_a_time = lock(&live.folder)?;
    let before = Launch::read(&live.folder)?;
    let robot = before.robot(types)?;
    if supervisor::isolation::Ownership::of(&robot).is_some() {
        let text = format!(
            "robot \"{}\" is isolated by users, and a spawned node would have another's: name it in the robot file, or take \
             isolate away",
            robot.name
        );
        return Err(Failure::new(FAILED, text));
    }
    let (text, graph) = with_node(&before, &robot, &name, &table, types)?;
    let spec = graph.nodes.iter().find(|node| node.spec.instance == name).map(|node| &node.spec);
    let spec =
        spec.ok_or_else(|| Failure::new(FAILED, format!("\"{name}\" is not in the robot that it was added to")))?;
    let path = spec.path();
    if args.at.contains('/') && args.at != path {
        let text =
            format!("a {} writes below /{}, so it stands at {path}, not at {}", args.kind, spec.kind.layer, args.at);
        return Err(Failure::new(USAGE, text));
    }
    let verdict = admitted(&live, &robot, &graph, file_of(&before.file))?;
    // A file that cannot be saved is told before anything is changed.
    let saved = args.more.save.then(|| edited(&before, &name, &table)).transpose()?;
    let line = robot.nodes.len();
    for written in graph.nodes.iter().filter(|node| node.spec.instance == name).flat_map(|node| &node.writes) {
        live.tree.prepare(&written.path, &written.geometry).map_err(|e| Failure::new(FAILED, e.to_string()))?;
    }
    let mut after = Launch { text, ..before.clone() };
    after.nodes.push(path.clone());
    after.spawned.push(path.clone());
    after.write(&live.folder)?;
    let words = format!("{} at {path}", args.kind);
    if let Err(failure) = start(&live, spec, line, &words) {
        before.write(&live.folder)?;
        return Err(failure);
    }
    runs(&live, &path)?;
    if let Some((file, text)) = &saved {
        write_beside(file, text)?;
    }
    report(args, &live, &path, &words, saved.map(|(file, _)| file), &verdict)
}

fn report(
    args: &Args,
    live: &LiveRobot,
    path: &str,
    words: &str,
    saved: Option<PathBuf>,
    verdict: &Verdict,
) -> Result<(), Failure> {
    let mut out = Out::stdout();
    let file = saved.map(|file| file.display().to_string());
    let (reckoned, utilization) = (verdict.reckoned, verdict.utilization);
    match args.more.json {
        true => out.json(&json!({
            "robot": live.name, "node": path, "change": format!("spawn {words}"), "saved": file,
            "reckoned": reckoned, "utilization": utilization, "ok": true,
        }))?,
        false => {
            let kept = file.map_or("until the robot stops".to_owned(), |file| format!("and in {file}"));
            let load = 100.0 * utilization;
            out.line(format!(
                "robot \"{}\": spawned {words}, {kept}; {reckoned} nodes reckoned with, {load:.0} % of one processor",
                live.name
            ))?;
        }
    }
    out.flush()
}

/// The node's table in a robot file.
fn table(args: &Args) -> Result<toml::Table, Failure> {
    let mut table = toml::Table::new();
    table.insert("type".into(), args.kind.clone().into());
    if let Some(period) = &args.period {
        let number = |text: &str| {
            let told = || Failure::new(USAGE, format!("--period {period}: write MS, or MIN:MAX"));
            text.parse::<f64>().map_err(|_| told())
        };
        let value = match period.split_once(':') {
            Some((min, max)) => {
                let (min, max) = (number(min)?, number(max)?);
                toml::Table::from_iter([("min".to_owned(), min.into()), ("max".to_owned(), max.into())]).into()
            }
            None => toml::Value::from(number(period)?),
        };
        table.insert("period_ms".into(), value);
    }
    if !args.trigger.is_empty() {
        table.insert("trigger".into(), args.trigger.clone().into());
    }
    table.insert("budget_ms".into(), args.budget.into());
    if let Some(ms) = args.deadline {
        table.insert("deadline_ms".into(), ms.into());
    }
    table.insert("priority".into(), i64::from(args.priority).into());
    table.insert("importance".into(), i64::from(args.importance).into());
    for (key, pairs, form) in [("reads", &args.reads, "PORT=PATH"), ("config", &args.settings, "KEY=VALUE")] {
        let mut inner = toml::Table::new();
        for pair in pairs {
            let told = || Failure::new(USAGE, format!("\"{pair}\" is no {form}"));
            let (name, value) = pair.split_once('=').ok_or_else(told)?;
            let parsed = toml::from_str::<toml::Table>(&format!("v = {value}")).ok();
            let value = parsed.and_then(|mut table| table.remove("v")).unwrap_or_else(|| value.into());
            inner.insert(name.to_owned(), value);
        }
        if !inner.is_empty() {
            table.insert(key.into(), inner.into());
        }
    }
    Ok(table)
}

/// The robot file's text with the node, and the graph of the robot with it.
fn with_node(
    launch: &Launch,
    robot: &Robot,
    name: &str,
    table: &toml::Table,
    types: &[NodeType],
) -> Result<(String, Graph), Failure> {
    let mut root: toml::Table = toml::from_str(&launch.text).map_err(|e| Failure::new(FAILED, e.to_string()))?;
    let nodes = root.entry("nodes").or_insert_with(|| toml::Table::new().into());
    let nodes = nodes.as_table_mut().ok_or_else(|| Failure::new(FAILED, "\"nodes\" is no table"))?;
    if nodes.contains_key(name) {
        let text = format!("robot \"{}\" has a node \"{name}\" already, and a path has one writer", robot.name);
        return Err(Failure::new(CHECK, text));
    }
    nodes.insert(name.to_owned(), table.clone().into());
    let text = toml::to_string(&root).map_err(|e| Failure::new(FAILED, e.to_string()))?;
    let mut with = Robot::parse(&text, file_of(&launch.file), robot.resources.clone(), types).map_err(load::errors)?;
    // A robot with real devices runs without its world.
    with.nodes.retain(|node| node.instance == name || launch.nodes.contains(&node.path()));
    let contradictions = coordinator::governor::check::contradictions(&with);
    if !contradictions.is_empty() {
        return Err(Failure::new(CHECK, contradictions.join("\n")));
    }
    let graph = with.graph().map_err(load::errors)?;
    if let Some(why) = cycles::refusal(&graph) {
        return Err(Failure::new(CHECK, why));
    }
    Ok((text, graph))
}

/// Whether nobody misses a deadline who would not without it.
fn admitted(live: &LiveRobot, robot: &Robot, with: &Graph, file: &str) -> Result<Verdict, Failure> {
    let measured = |spec: &NodeSpec| {
        let ring = live.tree.reader(&spec.port_path("statistics"), None).ok()?;
        let mut buffer = SampleBuffer::new(ring.geometry());
        ring.read(ring.head(), &mut buffer).ok()?;
        let statistics = bytemuck::try_from_bytes::<NodeStatistics>(buffer.fixed()).ok()?;
        // 99 %: the greatest of a node that has run for hours is a stall of the machine.
        (statistics.steps > 0).then_some((statistics.execution_s[1] * 1e9) as u64)
    };
    let before = admission::judge_with(&robot.graph().map_err(load::errors)?, file, &measured);
    let mut verdict = admission::judge_with(with, file, &measured);
    let new = verdict.errors.iter().zip(&verdict.missing).filter(|(_, name)| !before.missing.contains(name));
    let new: Vec<_> = new.map(|(error, _)| error.clone()).collect();
    if !new.is_empty() {
        return Err(load::errors(new));
    }
    verdict.errors.clear();
    Ok(verdict)
}

/// Has the supervisor start it.
fn start(live: &LiveRobot, spec: &NodeSpec, line: usize, words: &str) -> Result<(), Failure> {
    let path = spec.path();
    let newcomer = Newcomer {
        path: path.clone(),
        instance: spec.instance.clone(),
        words: words.to_owned(),
        line,
        stop_group: match spec.kind.layer {
            Layer::Simulator => 2,
            Layer::Drivers => 1,
            _ => 0,
        },
        importance: spec.importance,
        shortest_ns: spec.period_ns.unwrap_or(0),
        longest_ns: spec.longest_period_ns.or(spec.period_ns).unwrap_or(0),
    };
    let words = format!("spawn {}", serde_json::to_string(&newcomer)?);
    let answer = supervisor::ask(&live.folder, &words, ANSWER_WITHIN_S).map_err(Failure::from)?;
    let answer: serde_json::Value = serde_json::from_str(&answer)?;
    if let Some(reason) = answer["error"].as_str() {
        return Err(Failure::new(FAILED, format!("robot \"{}\": {reason}", live.name)));
    }
    Ok(())
}

/// Waits until it runs; stops it when it does not.
fn runs(live: &LiveRobot, path: &str) -> Result<(), Failure> {
    let ask = |words: &str| supervisor::ask(&live.folder, words, ANSWER_WITHIN_S).map_err(Failure::from);
    let until = clock::now().after_s(PATIENCE_S);
    let mut restarts = 0;
    while clock::now() < until && restarts == 0 {
        let status: Status = serde_json::from_str(&ask("status")?)?;
        if let Some(node) = status.nodes.iter().find(|node| node.instance == path) {
            if node.state == "running" {
                return Ok(());
            }
            restarts = node.restarts + u32::from(node.last_exit.is_some());
        }
        clock::sleep_s(LOOK_S);
    }
    // It keeps its place in the table of heartbeats.
    let _ = ask(&format!("stop {path}"));
    let text =
        format!("{path} does not run, and was stopped: `sinew logs {path}` tells why, `sinew start` tries again");
    Err(Failure::new(FAILED, text))
}

/// The robot file and its text with the node at its end.
fn edited(launch: &Launch, name: &str, table: &toml::Table) -> Result<(PathBuf, String), Failure> {
    let Some(folder) = &launch.folder else {
        let text = "--save: this robot is built in and has no file: copy robots/pioneer, run that";
        return Err(Failure::new(USAGE, text));
    };
    let file = folder.join(Path::new(file_of(&launch.file)).file_name().unwrap_or_default());
    let text = std::fs::read_to_string(&file).map_err(|e| Failure::new(FAILED, format!("{}: {e}", file.display())))?;
    let refused = |why: &dyn std::fmt::Display| Failure::new(FAILED, format!("--save: {}: {why}", file.display()));
    let mut document: toml_edit::DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| refused(&e))?;
    let written = toml::to_string(table).map_err(|e| refused(&e))?;
    let node: toml_edit::DocumentMut = written.parse().map_err(|e: toml_edit::TomlError| refused(&e))?;
    let nodes = &mut document["nodes"];
    if !nodes.is_table_like() || nodes.get(name).is_some() {
        return Err(refused(&format!("\"nodes.{name}\" cannot be added")));
    }
    nodes[name] = toml_edit::Item::Table(node.as_table().clone());
    Ok((file, document.to_string()))
}
