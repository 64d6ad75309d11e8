//! `sinew top`: every node's state, timing, processor, memory and scheduling.
//!
//! Timing comes from the nodes' own `statistics` channels, processor and memory from /proc, state and restarts from the
//! supervisor, the rung from `/supervisor/robot/state`. Nothing of it slows a node down.

use crate::exit::Failure;
use crate::live::{LiveRobot, Which};
use crate::output::{Align, Cell, Out, Table, Tone, bytes, rate};
use messages::{Message, NodeStatistics, SupervisorState, bytemuck};
use runtime::channel::{Expect, SampleBuffer};
use runtime::{SUPERVISOR_STATE, clock};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use supervisor::{NodeStatus, Severity, Status};

/// Shows every node's state, timing, processor, memory and scheduling
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    which: Which,
    /// Looks once: for half a second, then ends
    #[arg(long)]
    once: bool,
    /// Prints a JSON object per look
    #[arg(long)]
    json: bool,
}

/// How long a look lasts [s].
const LOOK_S: f64 = 1.0;
/// The same with `--once` [s].
const ONCE_S: f64 = 0.5;
/// How long the supervisor may take to answer [s].
const ANSWER_WITHIN_S: f64 = 2.0;

/// Shows the nodes, once or until Ctrl-C or the robot's end.
pub fn run(args: &Args) -> Result<(), Failure> {
    let robot = args.which.find()?;
    let mut out = Out::stdout();
    let mut before = look(&robot)?;
    loop {
        clock::sleep_s(if args.once { ONCE_S } else { LOOK_S });
        let now = match look(&robot) {
            Ok(now) => now,
            // It has been stopped while we looked on.
            Err(_) if !args.once => return Ok(()),
            Err(e) => return Err(e),
        };
        let rows = rows(&before, &now);
        if args.json {
            out.json(&json(&now, &rows))?;
        } else {
            if !args.once && out.is_terminal() {
                // Home, and clear to the end: no flicker, and the shell's scrollback stays.
                out.raw("\x1b[H\x1b[J")?;
            }
            print(&mut out, &now, &rows)?;
        }
        out.flush()?;
        if args.once {
            return Ok(());
        }
        before = now;
    }
}

/// What was found at one moment.
struct Look {
    at_s: f64,
    status: Status,
    state: Option<SupervisorState>,
    /// By node path.
    statistics: BTreeMap<String, NodeStatistics>,
    /// By process: processor time [s], resident memory [byte], scheduling.
    processes: BTreeMap<i32, (f64, u64, String)>,
}

fn look(robot: &LiveRobot) -> Result<Look, Failure> {
    let answer = supervisor::ask(&robot.folder, "status", ANSWER_WITHIN_S).map_err(Failure::from)?;
    let status: Status = serde_json::from_str(&answer)?;
    let mut statistics = BTreeMap::new();
    for path in robot.paths()?.iter().filter(|path| path.ends_with("/statistics")) {
        if let (Some(sample), Some(node)) = (newest::<NodeStatistics>(robot, path), path.strip_suffix("/statistics")) {
            statistics.insert(node.to_owned(), sample);
        }
    }
    let pids = status.nodes.iter().filter_map(|node| node.pid);
    let processes = pids.filter_map(|pid| Some((pid, process(pid)?))).collect();
    let state = newest::<SupervisorState>(robot, SUPERVISOR_STATE);
    Ok(Look { at_s: clock::now().seconds(), status, state, statistics, processes })
}

fn newest<M: Message>(robot: &LiveRobot, path: &str) -> Option<M> {
    let expect = Expect { type_name: M::NAME.into(), layout_hash: M::layout_hash() };
    let ring = robot.tree.reader(path, Some(expect)).ok()?;
    let mut buffer = SampleBuffer::new(ring.geometry());
    ring.read(ring.head(), &mut buffer).ok()?;
    Some(*bytemuck::from_bytes(buffer.fixed()))
}

/// Processor time, resident memory and scheduling of a process, from /proc (proc_pid_stat(5)).
fn process(pid: i32) -> Option<(f64, u64, String)> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name may hold anything, also blanks and brackets: the fields begin after the last bracket.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let field = |number: usize| fields.get(number - 3).and_then(|text| text.parse::<i64>().ok());
    let ticks_per_s = rustix::param::clock_ticks_per_second() as f64;
    let cpu_s = (field(14)? + field(15)?) as f64 / ticks_per_s;
    let rss_bytes = field(24)?.max(0) as u64 * rustix::param::page_size() as u64;
    Some((cpu_s, rss_bytes, scheduling(pid)))
}

/// The best scheduling among the process' threads: its node steps there.
fn scheduling(pid: i32) -> String {
    let tasks = std::fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
    let policy_of = |entry: std::fs::DirEntry| {
        let stat = std::fs::read_to_string(entry.path().join("stat")).ok()?;
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        let (priority, policy): (u32, u32) = (fields.get(37)?.parse().ok()?, fields.get(38)?.parse().ok()?);
        Some((priority, policy))
    };
    match tasks.filter_map(policy_of).max() {
        Some((priority, 1)) => format!("FIFO {priority}"),
        Some((priority, 2)) => format!("RR {priority}"),
        Some(_) => "OTHER".to_owned(),
        None => "–".to_owned(),
    }
}

/// One node as it is shown.
struct Row<'a> {
    node: &'a NodeStatus,
    statistics: Option<NodeStatistics>,
    rate_hz: Option<f64>,
    cpu_percent: Option<f64>,
    rss_bytes: Option<u64>,
    scheduling: String,
}

fn rows<'a>(before: &Look, now: &'a Look) -> Vec<Row<'a>> {
    let spent_s = (now.at_s - before.at_s).max(1e-3);
    let row = |node: &'a NodeStatus| {
        let statistics = now.statistics.get(&node.instance).copied();
        // Published once a second: over the whole life where two looks see the same counters.
        let rate_hz = statistics.map(|s| match node.lived_s {
            Some(lived_s) if lived_s > 0.0 => s.steps as f64 / lived_s,
            _ => 0.0,
        });
        let process = node.pid.and_then(|pid| now.processes.get(&pid));
        let earlier = node.pid.and_then(|pid| before.processes.get(&pid));
        Row {
            node,
            statistics,
            rate_hz,
            cpu_percent: process.zip(earlier).map(|(now, before)| (now.0 - before.0) / spent_s * 100.0),
            rss_bytes: process.map(|process| process.1),
            scheduling: process.map_or_else(|| "–".to_owned(), |process| process.2.clone()),
        }
    };
    now.status.nodes.iter().map(row).collect()
}

/// Median, 99 % and greatest of the four that a node publishes [ms].
fn three_ms(four: [f64; 4]) -> [f64; 3] {
    [four[0] * 1e3, four[1] * 1e3, four[3] * 1e3]
}

fn severity(state: Option<SupervisorState>) -> &'static str {
    let rung = state.and_then(|state| Severity::ALL.get(state.severity as usize).copied());
    rung.unwrap_or_default().word()
}

fn json(look: &Look, rows: &[Row<'_>]) -> Value {
    let nodes = rows.iter().map(|row| {
        let s = row.statistics;
        json!({
            "node": row.node.instance,
            "state": row.node.state,
            "pid": row.node.pid,
            "restarts": row.node.restarts,
            "rate_hz": row.rate_hz,
            "lateness_ms": s.map(|s| three_ms(s.lateness_s)),
            "execution_ms": s.map(|s| three_ms(s.execution_s)),
            "steps": s.map(|s| s.steps),
            "skipped": s.map(|s| s.skipped),
            "missed": s.map(|s| s.missed_deadlines),
            "faults": s.map(|s| s.faults),
            "dropped": s.map(|s| s.dropped),
            "cpu_percent": row.cpu_percent,
            "rss_bytes": row.rss_bytes,
            "scheduling": row.scheduling,
        })
    });
    json!({
        "robot": look.status.robot,
        "state": look.status.state,
        "severity": severity(look.state),
        "running_s": look.status.running_s,
        "nodes": nodes.collect::<Vec<_>>(),
    })
}

fn print(out: &mut Out, look: &Look, rows: &[Row<'_>]) -> Result<(), Failure> {
    let status = &look.status;
    let rung = match severity(look.state) {
        "none" => String::new(),
        word => format!(", {word}"),
    };
    out.line(format!("robot \"{}\": {}{rung}, for {:.0} s", status.robot, status.state, status.running_s))?;
    let right = Align::Right;
    let mut table = Table::new(&[
        ("node", Align::Left),
        ("state", Align::Left),
        ("rate", right),
        ("late p50/p99/max ms", right),
        ("step p50/p99/max ms", right),
        ("missed", right),
        ("skipped", right),
        ("dropped", right),
        ("restarts", right),
        ("cpu %", right),
        ("memory", right),
        ("granted", Align::Left),
    ]);
    let dash = || "–".to_owned();
    for row in rows {
        let three = |of: fn(NodeStatistics) -> [f64; 4]| {
            row.statistics.map_or_else(dash, |s| {
                let [p50, p99, max] = three_ms(of(s));
                format!("{p50:.2}/{p99:.2}/{max:.2}")
            })
        };
        let count = |of: fn(NodeStatistics) -> u64| row.statistics.map_or_else(dash, |s| of(s).to_string());
        let tone = if row.node.state == "running" { Tone::Plain } else { Tone::Bad };
        table.row([
            Cell::toned(Tone::Name, row.node.instance.as_str()),
            Cell::toned(tone, row.node.state.as_str()),
            Cell::from(row.rate_hz.map_or_else(dash, rate)),
            Cell::from(three(|s| s.lateness_s)),
            Cell::from(three(|s| s.execution_s)),
            Cell::from(count(|s| s.missed_deadlines)),
            Cell::from(count(|s| s.skipped)),
            Cell::from(count(|s| s.dropped)),
            Cell::from(row.node.restarts.to_string()),
            Cell::from(row.cpu_percent.map_or_else(dash, |cpu| format!("{cpu:.1}"))),
            Cell::from(row.rss_bytes.map_or_else(dash, bytes)),
            Cell::from(row.scheduling.as_str()),
        ]);
    }
    out.table(&table)
}
