//! `sinew chaos`: a robot that drives while its processes are killed, stopped, hung, spun and fed with memory.
//!
//! Every process may be hit, the supervisor and the guard included; not the root, which is the one thing that is never
//! replaced, and not the simulated world, which is the reality that the others live in.

pub mod census;
mod fault;

use super::run::plan;
use crate::exit::{CHECK, Failure, USAGE};
use crate::load::{self, Changes};
use crate::output::{Out, parse_seconds, span};
use census::{Census, Member, descriptors};
use fault::{Fault, Wound};
use runtime::robot::Robot;
use runtime::{Layer, NodeType, clock};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Hurts a driving robot about every two seconds, and says what came of it
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder or file of the robot; without it the built-in Pioneer in its office
    robot: Option<PathBuf>,
    /// How long, as in 60s or 10m
    #[arg(long = "for", value_name = "TIME", default_value = "60s")]
    length: String,
    /// Mean time between two faults
    #[arg(long, value_name = "TIME", default_value = "2s")]
    every: String,
    /// Seed of the world and of the faults
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    changes: Changes,
}

/// Time for the robot to come up [s].
const UP_WITHIN_S: f64 = 30.0;
/// A process that is not back by then will not be [s].
const BACK_WITHIN_S: f64 = 10.0;
/// Time for an ordered end [s].
const DOWN_WITHIN_S: f64 = 20.0;

/// What a run of chaos has shown.
#[derive(Debug, Default)]
struct Toll {
    faults: u64,
    by_kind: BTreeMap<&'static str, u64>,
    by_member: BTreeMap<String, u64>,
    recovery_s: Vec<f64>,
    not_recovered: Vec<String>,
    leaks: Vec<String>,
}

/// Runs the robot and hurts it.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let seconds = |text: &str| parse_seconds(text).map_err(|reason| Failure::new(USAGE, reason));
    let (length_s, every_s) = (seconds(&args.length)?, seconds(&args.every)?.max(0.1));
    let robot = load::robot(args.robot.as_deref(), &args.changes, types)?;
    let plan = plan(&robot)?;
    let members = members(&robot, &plan);
    let lines = std::env::temp_dir().join(format!("sinew-chaos-{}.jsonl", std::process::id()));
    let mut running = Running::start(&args, &lines)?;
    let census = running.up(&plan)?;
    let before = held_descriptors(&census, &robot, &plan)?;
    let mut toll = Toll::default();
    let mut random = Random(args.seed.wrapping_mul(2).wrapping_add(0x9e37_79b9_7f4a_7c15));
    let mut deck: Vec<Member> = Vec::new();
    let end = clock::now().after_s(length_s);
    let mut next = clock::now().after_s(every_s);
    while next < end {
        clock::sleep_until(next);
        if let Some(status) = running.child.try_wait()? {
            toll.not_recovered.push(format!("the robot as a whole ({status})"));
            break;
        }
        // A shuffled deck: everybody is hit equally often, nobody so often that the supervisor gives him up for it.
        if deck.is_empty() {
            deck = members.clone();
            random.shuffle(&mut deck);
        }
        let member = deck.pop().unwrap_or(Member::Supervisor);
        let fault = Fault::ALL[random.below(Fault::ALL.len() as u64) as usize].for_member(&member);
        if let Some(wound) = Wound::inflict(&census, &member, fault)? {
            let name = census.name(&member).to_owned();
            toll.faults += 1;
            *toll.by_kind.entry(fault.word()).or_default() += 1;
            *toll.by_member.entry(name.clone()).or_default() += 1;
            match wound.healed(&census, BACK_WITHIN_S) {
                Some(took_s) => toll.recovery_s.push(took_s),
                None => toll.not_recovered.push(format!("{name} after {}", fault.word())),
            }
        }
        // Spread about the mean, and never in step with the nodes' own periods.
        let pause_s = every_s * (0.5 + random.share());
        next = next.after_s(pause_s).max(clock::now().after_s(0.05 * every_s));
    }
    clock::sleep_s(0.5);
    let after = held_descriptors(&census, &robot, &plan).unwrap_or_default();
    for ((who, before), (_, after)) in before.iter().zip(&after) {
        if after > before {
            toll.leaks.push(format!("{who}: {} descriptors more", after - before));
        }
    }
    running.stop()?;
    toll.leaks.extend(census.processes().into_iter().map(|pid| format!("process {pid}")));
    if census.folder.exists() {
        toll.leaks.push(format!("files in {}", census.folder.display()));
    }
    let last = last_picture(&lines);
    let _ = std::fs::remove_file(&lines);
    tell(&args, &toll, &last, length_s)
}

/// Everybody who may be hit.
fn members(robot: &Robot, plan: &supervisor::Plan) -> Vec<Member> {
    let is_world = |instance: &str| {
        robot.nodes.iter().any(|node| {
            node.kind.layer == Layer::Simulator
                && (node.path() == instance || node.process.as_deref() == Some(instance))
        })
    };
    let nodes = plan.programs.iter().enumerate().filter(|(_, program)| !is_world(&program.instance));
    nodes.map(|(node, _)| Member::Node(node)).chain([Member::Supervisor, Member::Guard]).collect()
}

/// Descriptors of those who outlive every fault: what they hold must not grow.
fn held_descriptors(census: &Census, robot: &Robot, plan: &supervisor::Plan) -> Result<Vec<(String, usize)>, Failure> {
    let mut held = vec![("root".to_owned(), descriptors(census.root)?)];
    let victims = members(robot, plan);
    for node in (0..plan.programs.len()).map(Member::Node).filter(|node| !victims.contains(node)) {
        if let Some(pid) = census.pid(&node) {
            held.push((census.name(&node).to_owned(), descriptors(pid)?));
        }
    }
    Ok(held)
}

/// The robot as a child of this program.
struct Running {
    child: Child,
    folder: PathBuf,
}

impl Running {
    fn start(args: &Args, lines: &Path) -> Result<Running, Failure> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("run").args(args.robot.as_ref()).args(args.changes.arguments());
        command.args(["--json", "--svg", "none", "--seed", &args.seed.to_string()]);
        command.env("SINEW_FAULTS", "allowed").stdin(Stdio::null()).stdout(Stdio::from(File::create(lines)?));
        Ok(Running { child: command.spawn()?, folder: PathBuf::new() })
    }

    /// Waits until every node beats.
    fn up(&mut self, plan: &supervisor::Plan) -> Result<Census, Failure> {
        self.folder = plan.root.clone();
        let until = clock::now().after_s(UP_WITHIN_S);
        while clock::now() < until {
            if let Some(status) = self.child.try_wait()? {
                return Err(Failure::from(format!("the robot did not start ({status})")));
            }
            if let Some(census) = Census::take(&plan.root, plan).filter(Census::all_beat) {
                return Ok(census);
            }
            clock::sleep_s(0.02);
        }
        Err(Failure::from(format!("the robot was not up after {}", span(UP_WITHIN_S))))
    }

    fn stop(&mut self) -> Result<(), Failure> {
        // A robot that has stopped by itself has been told of already.
        if self.child.try_wait()?.is_none() {
            let _ = supervisor::down(&self.folder, DOWN_WITHIN_S);
            self.child.wait()?;
        }
        Ok(())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.stop();
    }
}

/// What the robot said last: contacts and distance.
fn last_picture(lines: &Path) -> Value {
    let text = std::fs::read_to_string(lines).unwrap_or_default();
    let objects = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    objects.rev().find(|value| value.get("contacts_caused").is_some()).unwrap_or_default()
}

fn tell(args: &Args, toll: &Toll, last: &Value, length_s: f64) -> Result<(), Failure> {
    let mut sorted = toll.recovery_s.clone();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get(((sorted.len() as f64 * share).ceil() as usize).saturating_sub(1)).copied();
    let ms = |share: f64| at(share).map(|s| (s * 1e6).round() / 1e3);
    let contacts = last.get("contacts_caused").and_then(Value::as_u64);
    let bound = (toll.faults > 0).then(|| 3.0 / toll.faults as f64);
    let mut out = Out::stdout();
    if args.json {
        out.json(&json!({
            "faults": toll.faults,
            "contacts_caused": contacts,
            "leaks": toll.leaks.len(),
            "recovery_ms": { "p50": ms(0.5), "p99": ms(0.99), "max": ms(1.0) },
            "recovered": sorted.len(),
            "not_recovered": toll.not_recovered,
            "leaked": toll.leaks,
            "contacts_per_fault_below": bound,
            "faults_by_kind": toll.by_kind,
            "faults_by_process": toll.by_member,
            "distance_m": last.get("distance_m"),
            "lasted_s": length_s,
            "seed": args.seed,
        }))?;
    } else {
        let kinds: Vec<String> = toll.by_kind.iter().map(|(kind, count)| format!("{count} {kind}")).collect();
        out.line(format!("{} faults in {} ({})", toll.faults, span(length_s), kinds.join(", ")))?;
        let contacts = contacts.map_or("an unknown number of".to_owned(), |count| count.to_string());
        let bound = bound.map(|bound| format!(" (none seen means below {bound:.3} per fault, at 95 %)"));
        out.line(format!("{contacts} contacts caused{}", bound.unwrap_or_default()))?;
        let time = |share| at(share).map_or("none".to_owned(), span);
        out.line(format!("back after p50 {}, p99 {}, max {}, n {}", time(0.5), time(0.99), time(1.0), sorted.len()))?;
        out.line(format!("{} leaks {}", toll.leaks.len(), toll.leaks.join(", ")))?;
    }
    out.flush()?;
    let fine = contacts == Some(0) && toll.leaks.is_empty() && toll.not_recovered.is_empty();
    match fine {
        true => Ok(()),
        false if toll.not_recovered.is_empty() => {
            Err(Failure::new(CHECK, "the robot touched something or left something"))
        }
        false => Err(Failure::new(CHECK, format!("not back: {}", toll.not_recovered.join("; ")))),
    }
}

/// xorshift64*: enough for choosing victims, and the same from the same seed.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, bound: u64) -> u64 {
        (self.next() >> 33) % bound.max(1)
    }

    /// 0…1.
    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn shuffle<T>(&mut self, all: &mut [T]) {
        for index in (1..all.len()).rev() {
            all.swap(index, self.below(index as u64 + 1) as usize);
        }
    }
}
