//! `sinew bench idle`: what node processes cost while nothing comes. The nodes of a robot that are released by samples
//! alone, each a process of its own on channels that nobody writes: CPU time, wake-ups, and memory by what it is for.

use super::machine::Before;
use super::process::{Activity, Memory, threads};
use super::report::{Report, Target, Value};
use super::scratch::Scratch;
use super::witness::Testimony;
use crate::exit::Failure;
use crate::launch::Launch;
use crate::load::{self, Changes};
use runtime::channel::Tree;
use runtime::robot::Robot;
use runtime::{Layer, NodeType, clock};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Memory that a node process may have, channels not counted [byte].
const MOST_BYTES: u64 = 8 << 20;
/// Time for everything that follows a start to be over [s].
const SETTLE_S: f64 = 0.5;

/// A running node process.
struct Process {
    path: String,
    /// Whether samples alone release it.
    waits: bool,
    child: Child,
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Starts the nodes of the robot in `file` and watches them for `seconds`.
pub fn run(file: Option<&Path>, seconds: f64, types: &[NodeType]) -> Result<Report, Failure> {
    let robot = load::robot(file, &Changes::default(), types)?;
    let scratch = Scratch::new()?;
    let root = scratch.folder(&robot.name)?;
    prepare(&robot, &root)?;
    let before = Before::now();
    let processes = start(&robot, &root)?;
    clock::sleep_s(SETTLE_S);
    let look = |process: &Process| {
        Activity::of(process.child.id()).ok_or_else(|| Failure::from(format!("node {} ended", process.path)))
    };
    let first: Vec<Activity> = processes.iter().map(look).collect::<Result<_, _>>()?;
    clock::sleep_s(seconds);
    let last: Vec<Activity> = processes.iter().map(look).collect::<Result<_, _>>()?;
    let (mut values, mut targets) = (Vec::new(), Vec::new());
    for ((process, first), last) in processes.iter().zip(first).zip(last) {
        if process.waits {
            judge_idle(&process.path, last.since(first), seconds, &mut values, &mut targets);
        }
    }
    let mut scheduling = Vec::new();
    for process in &processes {
        let pid = process.child.id();
        let memory = Memory::of(pid, &root).ok_or("a node process ended while its memory was read")?;
        judge_memory(&process.path, memory, &mut values, &mut targets);
        let (fifo, other) = threads(pid);
        values.push(Value::new(format!("threads {}", process.path), (fifo.len() + other.len()) as f64, "threads"));
        scheduling.push(format!("{}: SCHED_FIFO {}; SCHED_OTHER {}", process.path, names(&fifo), names(&other)));
    }
    drop(processes);
    // No witness: what is measured is time on a core and memory, which no stall changes.
    let machine = before.finish(scheduling, &Testimony::default());
    let note = format!(
        "CPU time and wake-ups are those of all threads of a process over {seconds} s during which no sample came. rss_private \
         is heap, stacks and statics; rss_program the touched pages of the program's file, one copy for all processes; \
         rss_rings the robot's channels, also one copy for all, counted apart. Locked is what mlockall holds of them."
    );
    Ok(Report { bench: "idle", machine, rows: Vec::new(), values, targets, notes: vec![note] })
}

/// Leaves below `root` what the nodes look for there.
fn prepare(robot: &Robot, root: &Path) -> Result<(), Failure> {
    let graph = robot.graph().map_err(load::errors)?;
    Launch::new(robot, 1).write(root)?;
    let tree = Tree::shared(root)?;
    for written in graph.nodes.iter().flat_map(|node| &node.writes) {
        tree.prepare(&written.path, &written.geometry)?;
    }
    Ok(())
}

/// Every node between the devices: drivers and simulated devices always have something to do.
fn start(robot: &Robot, root: &Path) -> Result<Vec<Process>, Failure> {
    let between = robot.nodes.iter().filter(|node| !matches!(node.kind.layer, Layer::Drivers | Layer::Simulator));
    let mut processes = Vec::new();
    for node in between {
        let words = root.join(format!("{}.stderr", node.instance));
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("node").arg("--root").arg(root).arg(node.path());
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::from(std::fs::File::create(&words)?));
        let waits = node.period_ns.is_none();
        let process = Process { path: node.path(), waits, child: command.spawn()? };
        processes.push(process);
        let process = processes.last_mut().ok_or("no process")?;
        await_first_words(process, &words)?;
    }
    Ok(processes)
}

/// A node says what it was granted when all of it has started.
fn await_first_words(process: &mut Process, words: &PathBuf) -> Result<(), Failure> {
    let until = clock::now().after_s(10.0);
    while clock::now() < until {
        let text = std::fs::read_to_string(words).unwrap_or_default();
        if text.contains("scheduler ") {
            return Ok(());
        }
        if let Some(status) = process.child.try_wait()? {
            return Err(Failure::from(format!("node {} ended ({status}): {}", process.path, text.trim())));
        }
        clock::sleep_s(0.02);
    }
    Err(Failure::from(format!("node {} did not start within 10 s", process.path)))
}

fn judge_idle(path: &str, done: Activity, seconds: f64, values: &mut Vec<Value>, targets: &mut Vec<Target>) {
    let percent = done.on_core_ns as f64 * 1e-9 / seconds * 100.0;
    values.push(Value::new(format!("idle_cpu {path}"), done.on_core_ns as f64 * 1e-6, "ms on a core"));
    values.push(Value::new(format!("idle_ticks {path}"), done.ticks as f64, "ticks of 10 ms"));
    values.push(Value::new(format!("idle_switches {path}"), done.voluntary_switches as f64, "voluntary switches"));
    targets.push(Target {
        aim: format!("{path}: 0 % CPU while idle"),
        measured: format!("{percent:.3} % over {seconds} s, {} wake-ups", done.voluntary_switches),
        reached: done.ticks == 0 && percent < 0.05,
    });
}

fn judge_memory(path: &str, memory: Memory, values: &mut Vec<Value>, targets: &mut Vec<Target>) {
    let kib = |bytes: u64| bytes as f64 / 1024.0;
    for (name, bytes) in [
        ("rss_private", memory.private),
        ("rss_program", memory.program),
        ("rss_rings", memory.rings),
        ("locked", memory.locked),
    ] {
        values.push(Value::new(format!("{name} {path}"), kib(bytes), "KiB"));
    }
    targets.push(Target {
        aim: format!("{path}: at most 8 MiB resident, channels apart"),
        measured: format!(
            "{:.2} MiB, {:.2} MiB of it private",
            kib(memory.without_rings()) / 1024.0,
            kib(memory.private) / 1024.0
        ),
        reached: memory.without_rings() <= MOST_BYTES,
    });
}

fn names(threads: &[String]) -> String {
    if threads.is_empty() { "none".into() } else { threads.join(" ") }
}
