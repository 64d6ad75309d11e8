//! `sinew bench hangs`: how many hangs the supervisor sees in a live robot in which nobody hangs, while every core is busy.
//!
//! A thread per core computes for nothing, and another takes, fills and gives back memory, while the robot wanders. A hang
//! that is told is a false one, and so is every death and restart. An hour: `sinew bench hangs --for 1h`.

use super::machine::Before;
use super::report::{Report, Target, Value};
use super::scratch::Scratch;
use super::supervision::Load;
use super::witness::Witnesses;
use crate::commands::chaos::census::Census;
use crate::commands::run::plan;
use crate::exit::Failure;
use crate::load::{self, Changes};
use runtime::{NodeType, clock};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};

/// How often the load average is looked at [s].
const LOOK_S: f64 = 5.0;
/// Memory that the load fills at a time [byte].
const FILLED_BYTES: usize = 64 << 20;

/// Watches the robot for `seconds` under load.
pub fn run(file: Option<&Path>, seconds: f64, types: &[NodeType]) -> Result<Report, Failure> {
    let scratch = Scratch::new()?;
    let changes = Changes { name: Some(format!("bench_hangs_{}", std::process::id())), ..Changes::default() };
    let robot = load::robot(file, &changes, types)?;
    let (shm, state) = (scratch.folder("shm")?, scratch.folder("state")?);
    let mut plan = plan(&robot)?;
    plan.root = shm.join(&robot.name);
    let mut command = Command::new(std::env::current_exe()?);
    command.arg("run").args(file).args(["--name", &robot.name, "--json", "--svg", "none"]);
    command.env("SINEW_SHM", &shm).env("SINEW_STATE", &state);
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn()?;
    let until = clock::now().after_s(30.0);
    let census = loop {
        if let Some(census) = Census::take(&plan.root, &plan).filter(Census::all_beat) {
            break census;
        }
        if clock::now() > until || child.try_wait()?.is_some() {
            let _ = child.kill();
            return Err(Failure::from("the robot was not up after 30 s"));
        }
        clock::sleep_s(0.02);
    };
    let before = Before::now();
    let witnesses = Witnesses::start()?;
    let load = Load::start();
    let end = clock::now().after_s(seconds);
    let (mut loads, mut filled) = (Vec::new(), 0_u64);
    while clock::now() < end {
        // Pages that the kernel has to find and clear, beside the cores that are busy.
        let memory = std::hint::black_box(vec![1_u8; FILLED_BYTES]);
        filled += memory.len() as u64;
        drop(memory);
        loads.push(load_average());
        clock::sleep_s(LOOK_S.min(end.since(clock::now()).max(0.0)));
    }
    drop(load);
    let seen = witnesses.stop();
    let alive = child.try_wait()?.is_none();
    let beats = census.total_beats();
    // Records that are still on their way to the disk.
    clock::sleep_s(0.2);
    let text = std::fs::read_to_string(state.join(&robot.name).join("incidents.jsonl")).unwrap_or_default();
    let _ = supervisor::down(&census.folder, 20.0);
    let _ = child.wait();
    let mut events: BTreeMap<String, u64> = BTreeMap::new();
    for record in text.lines().filter_map(|line| serde_json::from_str::<supervisor::Record>(line).ok()) {
        *events.entry(record.event).or_default() += 1;
    }
    let count = |event: &str| events.get(event).copied().unwrap_or(0);
    let hours = seconds / 3600.0;
    let greatest = loads.iter().copied().fold(0.0, f64::max);
    let mean = loads.iter().sum::<f64>() / loads.len().max(1) as f64;
    let mut values = vec![
        Value::new("hangs told, all of them false", count("hung") as f64, "hangs"),
        Value::new("… which means fewer than, at 95 %", 3.0 / hours, "an hour, if there were none"),
        Value::new("watched", hours, "h"),
        Value::new("processes watched", plan.programs.len() as f64, "processes"),
        Value::new("heartbeats of the living", beats as f64, "beats"),
        Value::new("load average: mean", mean, "threads"),
        Value::new("load average: greatest", greatest, "threads"),
        Value::new("memory filled by the load", filled as f64 / f64::from(1 << 20), "MiB"),
        Value::new("longest gap of a witness", seen.longest_ms(), "ms"),
    ];
    values.extend(events.iter().map(|(event, count)| Value::new(format!("incidents: {event}"), *count as f64, "")));
    let target = Target {
        aim: "no false hang in an hour with every core busy".to_owned(),
        measured: format!(
            "{} hangs, {} deaths in {hours:.3} h; load {mean:.1} on {} cores{}",
            count("hung"),
            count("died"),
            super::machine::processors().len(),
            if alive { "" } else { "; the robot ended before its time" }
        ),
        reached: alive && hours >= 1.0 && count("hung") == 0 && count("died") == 0,
    };
    let machine = before.finish(vec!["robot: as its file asks; the load SCHED_OTHER".to_owned()], &seen);
    let note = "A run of less than an hour does not reach the target, whatever it finds: it says how many there were.";
    Ok(Report {
        bench: "hangs",
        machine,
        rows: Vec::new(),
        values,
        targets: vec![target],
        notes: vec![note.to_owned()],
    })
}

fn load_average() -> f64 {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN)
}
