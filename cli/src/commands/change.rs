//! `sinew set` and `sinew wire`: another setting or another source for a node of a robot that drives.
//!
//! The change is checked like a robot file, then written where every process of the run reads the robot, and the node is
//! replaced by a new process that has opened with it. A node that does not open with it changes nothing, and one that
//! dies on its trial (`care.trial_s`) neither: what was written is taken back, by the supervisor, also when this program
//! is gone. `--save` writes the change into the robot file too, after the trial, comments and order kept.

use crate::exit::{CHECK, FAILED, Failure, USAGE};
use crate::launch::Launch;
use crate::live::{LiveRobot, Which};
use crate::load;
use crate::output::Out;
use crate::{admission, cycles};
use runtime::robot::{NodeSpec, Override, Robot, nearest_advice};
use runtime::{NodeType, clock};
use serde_json::json;
use std::path::{Path, PathBuf};
use supervisor::NodeStatus;

/// Sets a value of a node's settings while the robot drives
#[derive(Debug, clap::Args)]
pub struct SetArgs {
    /// The node and the key, as in forward.speed_m_s
    #[arg(value_name = "NODE.KEY")]
    key: String,
    /// The value, as in a robot file; what is none is taken as a text
    #[arg(allow_hyphen_values = true)]
    value: String,
    #[command(flatten)]
    more: More,
}

/// Wires a read port of a node to another path, or to several in order of preference
#[derive(Debug, clap::Args)]
pub struct WireArgs {
    /// The node and its port, as in steer_clear.ranges
    #[arg(value_name = "NODE.PORT")]
    port: String,
    /// What it reads from now on
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<String>,
    #[command(flatten)]
    more: More,
}

#[derive(Debug, clap::Args)]
pub(super) struct More {
    /// Writes the change into the robot file, too; comments are kept
    #[arg(long)]
    pub save: bool,
    #[command(flatten)]
    pub which: Which,
    /// Prints one JSON object
    #[arg(long)]
    pub json: bool,
}

/// How long a node may take to open, and its predecessor to stop [s].
pub(super) const PATIENCE_S: f64 = 20.0;
/// How often the supervisor is asked meanwhile [s].
pub(super) const LOOK_S: f64 = 0.02;
/// How long the supervisor may take to answer [s].
pub(super) const ANSWER_WITHIN_S: f64 = 2.0;

/// One change of one node.
struct Change {
    node: String,
    /// Below the node's table.
    keys: Vec<String>,
    value: String,
    /// As it is told and recorded.
    words: String,
}

/// `sinew set`.
pub fn set(args: &SetArgs, types: &[NodeType]) -> Result<(), Failure> {
    let (node, key) = split(&args.key, "NODE.KEY, as in forward.speed_m_s")?;
    let keys = ["config"].into_iter().chain(key.split('.')).map(str::to_owned).collect();
    let words = format!("set {node} {key} = {}", args.value);
    make(&Change { node: node.to_owned(), keys, value: args.value.clone(), words }, &args.more, types)
}

/// `sinew wire`.
pub fn wire(args: &WireArgs, types: &[NodeType]) -> Result<(), Failure> {
    let (node, port) = split(&args.port, "NODE.PORT, as in steer_clear.ranges")?;
    let text = |path: &String| toml::Value::String(path.clone()).to_string();
    let list: Vec<String> = args.paths.iter().map(text).collect();
    let value = if let [one] = &list[..] { one.clone() } else { format!("[{}]", list.join(", ")) };
    let words = format!("wire {node} {port} = {value}");
    make(
        &Change { node: node.to_owned(), keys: vec!["reads".into(), port.to_owned()], value, words },
        &args.more,
        types,
    )
}

fn split<'a>(text: &'a str, form: &str) -> Result<(&'a str, &'a str), Failure> {
    let text = text.trim_start_matches('/');
    // A whole path names the layer, too, which the robot file does not need.
    let text = text.rsplit_once('/').map_or(text, |(_, end)| end);
    let parts = text.split_once('.').filter(|(node, key)| !node.is_empty() && !key.is_empty());
    parts.ok_or_else(|| Failure::new(USAGE, format!("\"{text}\" names no value: write {form}")))
}

fn make(change: &Change, more: &More, types: &[NodeType]) -> Result<(), Failure> {
    let live = more.which.find()?;
    let _one_at_a_time = lock(&live.folder)?;
    let before = Launch::read(&live.folder)?;
    let robot = before.robot(types)?;
    let path = node_of(&robot, &change.node)?.path();
    // One change at a time is on trial, so that taking one back takes back no other.
    await_trials(&live)?;
    let before = Launch::read(&live.folder)?;
    let robot = before.robot(types)?;
    let changed = checked(&robot, change, types)?;
    // A file that cannot be saved is told before anything is changed.
    let saved = more.save.then(|| edited(&before, change)).transpose()?;
    let after = Launch { text: changed.text, ..before.clone() };
    let undo = before.leave_undo(&live.folder, &path)?;
    after.write(&live.folder)?;
    if let Err(failure) = replace(&live, &path, &change.words) {
        before.write(&live.folder)?;
        let _ = std::fs::remove_file(undo);
        return Err(failure);
    }
    await_trials(&live)?;
    if Launch::read(&live.folder)?.text != after.text {
        let text =
            format!("{path} has died on its trial with that, and goes on as before: `sinew incidents` tells how");
        return Err(Failure::new(FAILED, text));
    }
    if let Some((file, text)) = &saved {
        write_beside(file, text)?;
    }
    let mut out = Out::stdout();
    let file = saved.as_ref().map(|(file, _)| file.display().to_string());
    match more.json {
        true => {
            out.json(&json!({"robot": live.name, "node": path, "change": change.words, "saved": file, "ok": true}))?
        }
        false => {
            let kept = file.map_or("until the robot stops".to_owned(), |file| format!("and in {file}"));
            out.line(format!("robot \"{}\": {}: done, {kept}", live.name, change.words))?;
        }
    }
    out.flush()
}

pub(super) fn lock(folder: &Path) -> Result<std::fs::File, Failure> {
    let file = std::fs::File::options().create(true).append(true).open(folder.join(".run/change.lock"))?;
    file.try_lock().map_err(|_| Failure::new(FAILED, "somebody else is changing this robot right now: try again"))?;
    Ok(file)
}

fn node_of<'a>(robot: &'a Robot, name: &str) -> Result<&'a NodeSpec, Failure> {
    let names: Vec<String> = robot.nodes.iter().map(|node| node.instance.clone()).collect();
    robot.nodes.iter().find(|node| node.instance == name).ok_or_else(|| {
        let advice = nearest_advice(name, &names);
        Failure::new(USAGE, format!("robot \"{}\" has no node \"{name}\"; {advice}", robot.name))
    })
}

/// The robot with the change, as sound as a robot file must be.
fn checked(robot: &Robot, change: &Change, types: &[NodeType]) -> Result<Robot, Failure> {
    let key = format!("nodes.{}.{}", change.node, change.keys.join("."));
    let over = Override { key, value: change.value.clone() };
    // Errors name the file as a person did.
    let robot = Robot { file: file_of(&robot.file).to_owned(), ..robot.clone() };
    let changed = robot.with_overrides(&[over], types).map_err(load::errors)?;
    let contradictions = coordinator::governor::check::contradictions(&changed);
    if !contradictions.is_empty() {
        return Err(Failure::new(CHECK, contradictions.join("\n")));
    }
    let flaws = supervisor::isolation::flaws(&changed);
    if !flaws.is_empty() {
        return Err(load::errors(flaws));
    }
    let graph = changed.graph().map_err(load::errors)?;
    if let Some(why) = cycles::refusal(&graph) {
        return Err(Failure::new(CHECK, why));
    }
    let verdict = admission::judge(&graph, &changed.file);
    if !verdict.errors.is_empty() {
        return Err(load::errors(verdict.errors));
    }
    Ok(changed)
}

/// Has the supervisor put a new process in the node's place; says why when the old one goes on.
fn replace(live: &LiveRobot, path: &str, words: &str) -> Result<(), Failure> {
    let old = status(live, path)?;
    let answer = supervisor::ask(&live.folder, words, ANSWER_WITHIN_S).map_err(Failure::from)?;
    let answer: serde_json::Value = serde_json::from_str(&answer)?;
    if let Some(reason) = answer["error"].as_str() {
        return Err(Failure::new(FAILED, format!("robot \"{}\": {reason}", live.name)));
    }
    let until = clock::now().after_s(PATIENCE_S);
    let mut tried = false;
    while clock::now() < until {
        let now = status(live, path)?;
        tried |= now.standby.is_some();
        if now.pid.is_some() && now.pid != old.pid && now.state == "running" {
            return Ok(());
        }
        if tried && now.standby.is_none() && now.pid == old.pid && now.state == "running" {
            let text = format!("{path} does not open with that, and goes on as before: `sinew logs {path}` tells why");
            return Err(Failure::new(FAILED, text));
        }
        clock::sleep_s(LOOK_S);
    }
    Err(Failure::new(FAILED, format!("{path} has not changed within {PATIENCE_S} s: `sinew incidents` tells why")))
}

/// Returns when nothing of the robot is on trial any more.
fn await_trials(live: &LiveRobot) -> Result<(), Failure> {
    while whole_status(live)?.nodes.iter().any(|node| node.on_trial) {
        clock::sleep_s(LOOK_S);
    }
    Ok(())
}

fn whole_status(live: &LiveRobot) -> Result<supervisor::Status, Failure> {
    let status = supervisor::ask(&live.folder, "status", ANSWER_WITHIN_S).map_err(Failure::from)?;
    Ok(serde_json::from_str(&status)?)
}

fn status(live: &LiveRobot, path: &str) -> Result<NodeStatus, Failure> {
    let status = whole_status(live)?;
    let known = |node: &NodeStatus| node.instance == path;
    status.nodes.into_iter().find(known).ok_or_else(|| {
        Failure::new(
            FAILED,
            format!("{path} shares a process with other nodes: change the robot file and start it anew"),
        )
    })
}

/// The file's name without the words that stand behind it when the command line has changed something.
pub(super) fn file_of(name: &str) -> &str {
    name.split(" (with the command line").next().unwrap_or(name)
}

/// The robot file and its text with the change.
fn edited(launch: &Launch, change: &Change) -> Result<(PathBuf, String), Failure> {
    let Some(folder) = &launch.folder else {
        return Err(Failure::new(
            USAGE,
            "--save: this robot is built in and has no file: copy robots/pioneer, run that",
        ));
    };
    let file = folder.join(Path::new(file_of(&launch.file)).file_name().unwrap_or_default());
    let text = std::fs::read_to_string(&file).map_err(|e| Failure::new(FAILED, format!("{}: {e}", file.display())))?;
    let refused = |why: &dyn std::fmt::Display| Failure::new(FAILED, format!("--save: {}: {why}", file.display()));
    let mut document: toml_edit::DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| refused(&e))?;
    let value: toml_edit::Value = change.value.parse().unwrap_or_else(|_| change.value.as_str().into());
    let mut item = document.as_item_mut();
    for key in ["nodes", &change.node].into_iter().chain(change.keys.iter().map(String::as_str)) {
        if !(item.is_none() || item.is_table_like()) {
            return Err(refused(&format!("\"{key}\" lies in something that is no table")));
        }
        item = &mut item[key];
    }
    match item.as_value_mut() {
        // What stands around the old value, a comment perhaps, stays.
        Some(old) => {
            let around = old.decor().clone();
            *old = value;
            *old.decor_mut() = around;
        }
        None => *item = toml_edit::Item::Value(value),
    }
    Ok((file, document.to_string()))
}

/// Writes a file whole or not at all.
pub(super) fn write_beside(file: &Path, text: &str) -> Result<(), Failure> {
    let beside = file.with_extension("toml.new");
    std::fs::write(&beside, text).and_then(|()| std::fs::rename(&beside, file)).map_err(|e| {
        let _ = std::fs::remove_file(&beside);
        Failure::new(FAILED, format!("the robot has changed, but its file has not: {}: {e}", file.display()))
    })
}
