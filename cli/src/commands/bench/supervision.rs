//! `sinew bench supervision`: how soon a robot's processes are known to be dead, replaced, taken over and stopped, while
//! it wanders live in its simulated world. Every figure is taken from beside: by the clock of this program before the
//! blow, by the records of the supervisor, the table of heartbeats, and the guard's page.

mod fallback;

use super::machine::Before;
use super::report::{Report, Row, Target, Value};
use super::scratch::Scratch;
use super::timing::Times;
use super::witness::{Testimony, Witnesses};
use crate::commands::chaos::census::{Census, Member};
use crate::commands::run::plan;
use crate::exit::Failure;
use crate::load::{self, Changes};
use guard::LatchPage;
use guard::latch::State;
use runtime::channel::{RawReader, Tree};
use runtime::robot::Robot;
use runtime::{Layer, NodeType, Time, clock};
use rustix::process::{Pid, Signal, kill_process};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Time between two deaths: with seven victims none dies more often than a supervisor forgives [s].
const BETWEEN_S: f64 = 0.95;
/// What has not happened by then will not [s].
pub(super) const PATIENCE_S: f64 = 5.0;
/// Stops per load.
const STOPS: usize = 100;
/// How often this program looks [s].
const LOOK_S: f64 = 0.000_1;

/// The robot, watched from beside.
struct Robotic {
    child: Child,
    census: Census,
    page: LatchPage,
    incidents: PathBuf,
    victims: Vec<Victim>,
}

struct Victim {
    member: Member,
    path: String,
    /// A ring that the node writes.
    ring: RawReader,
    is_driver: bool,
    /// A standby waits for its death.
    is_backed: bool,
}

#[derive(Default)]
struct Found {
    known: Times,
    cold: Times,
    warm: Times,
    driver_sample: Times,
    taken_over: Times,
    will: Times,
    hang: Times,
    hang_will: Times,
    idle: Times,
    loaded: Times,
    lost: u64,
    missing: u64,
    laser: fallback::Found,
}

/// Measures for about `seconds`, and `part` of the stops.
pub fn run(file: Option<&Path>, seconds: f64, part: f64, types: &[NodeType]) -> Result<Report, Failure> {
    let scratch = Scratch::new()?;
    let name = format!("bench_{}", std::process::id());
    let changes = Changes { name: Some(name), ..Changes::default() };
    let robot = load::robot(file, &changes, types)?;
    let (shm, state) = (scratch.folder("shm")?, scratch.folder("state")?);
    let before = Before::now();
    let mut robotic = Robotic::start(file, &robot, &shm, &state)?;
    let witnesses = Witnesses::start()?;
    let mut found = Found::default();
    robotic.kill_nodes(&mut found, clock::now().after_s(0.7 * seconds))?;
    robotic.hang_driver(&mut found, ((seconds / 20.0) as usize).clamp(1, 5))?;
    robotic.kill_supervisor(&mut found, clock::now().after_s(0.3 * seconds))?;
    let stops = ((STOPS as f64 * part) as usize).max(5);
    robotic.stop_and_resume(stops, &mut found.missing, &mut found.idle)?;
    let load = Load::start();
    robotic.stop_and_resume(stops, &mut found.missing, &mut found.loaded)?;
    drop(load);
    drop(robotic);
    found.laser = fallback::run(&scratch, ((seconds / 9.0) as usize).clamp(2, 20))?;
    found.missing += std::mem::take(&mut found.laser.missing);
    let seen = witnesses.stop();
    let machine = before.finish(vec!["robot: as its file asks; root 99, guard 98, supervisor 95".to_owned()], &seen);
    Ok(report(machine, &found, &seen))
}

/// A row, and what its median and its 99 % are meant to be [µs].
type Wanted<'a> = (&'static str, &'a Times, Option<(f64, f64)>);

fn report(machine: super::machine::Machine, found: &Found, seen: &Testimony) -> Report {
    let p99 = |p99_us: f64| Some((f64::INFINITY, p99_us));
    let wanted: [Wanted<'_>; 12] = [
        ("SIGKILL → supervisor knows", &found.known, Some((500.0, 10_000.0))),
        ("SIGKILL → replacement's first sample", &found.cold, p99(100_000.0)),
        ("SIGKILL of the driver → first sample of the device", &found.driver_sample, None),
        ("supervisor killed → the next one beats", &found.taken_over, p99(20_000.0)),
        ("SIGKILL of the driver → stop written by the guard", &found.will, p99(10_000.0)),
        ("SIGSTOP of the driver → hang known", &found.hang, None),
        ("hang known → stop written by the guard", &found.hang_will, None),
        ("estop → stop written by the driver, idle", &found.idle, Some((200.0, 2_000.0))),
        ("estop → stop written by the driver, every core loaded", &found.loaded, Some((200.0, 2_000.0))),
        ("SIGKILL → a standby's first sample", &found.warm, p99(15_000.0)),
        ("SIGKILL of the laser's driver → speed cap lowered", &found.laser.cap, None),
        ("SIGKILL of the laser's driver → sonar in use", &found.laser.sonar, p99(150_000.0)),
    ];
    let (mut rows, mut targets): (Vec<Row>, Vec<Target>) = (Vec::new(), Vec::new());
    for (name, times, aim) in wanted.into_iter().filter(|(_, times, _)| !times.is_empty()) {
        let row = times.row(name, 0, seen);
        if let Some((p50_us, p99_us)) = aim {
            let p50 = if p50_us.is_finite() { format!("p50 ≤ {} ms, ", p50_us / 1e3) } else { String::new() };
            targets.push(Target {
                aim: format!("{name}: {p50}p99 ≤ {} ms", p99_us / 1e3),
                measured: format!("p50 {:.2} ms, p99 {:.2} ms, n {}", row.p50_us / 1e3, row.p99_us / 1e3, row.n),
                reached: row.p50_us <= p50_us && row.p99_us <= p99_us,
            });
        }
        rows.push(row);
    }
    let tries = found.laser.sonar.row("", 0, seen).n;
    targets.push(Target {
        aim: "laser dead: the speed cap is lowered before the sonar is in use".to_owned(),
        measured: format!("{} of {tries} times", tries - found.laser.wrong_order),
        reached: tries > 0 && found.laser.wrong_order == 0,
    });
    let bound = 3.0 / (found.taken_over.row("", 0, seen).n.max(1) as f64);
    let values = vec![
        Value::new("nodes lost at takeovers", found.lost as f64, "nodes"),
        Value::new("… which means below, at 95 %", bound, "takeovers"),
        Value::new("events that did not come", found.missing as f64, "events"),
    ];
    let note = "Measured to write(2): what the line takes afterwards, 1 ms per byte at 9600 baud, is not in it. The world \
                stands behind a pseudo-terminal. A first sample waits for the node's trigger, up to 100 ms of sonar.";
    Report { bench: "supervision", machine, rows, values, targets, notes: vec![note.to_owned()] }
}

impl Robotic {
    fn start(file: Option<&Path>, robot: &Robot, shm: &Path, state: &Path) -> Result<Robotic, Failure> {
        let mut plan = plan(robot)?;
        plan.root = shm.join(&robot.name);
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("run").args(file).args(["--name", &robot.name, "--json", "--svg", "none"]);
        // One node with a standby, the others without.
        let backed = |layer| layer == Layer::Coordinator;
        for node in robot.nodes.iter().filter(|node| backed(node.kind.layer)) {
            command.args(["--set", &format!("nodes.{}.care.standby=true", node.instance)]);
        }
        command.env("SINEW_SHM", shm).env("SINEW_STATE", state);
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn()?;
        let until = clock::now().after_s(30.0);
        let census = loop {
            if let Some(status) = child.try_wait()? {
                return Err(Failure::from(format!("the robot did not start ({status})")));
            }
            if let Some(census) = Census::take(&plan.root, &plan).filter(Census::all_beat) {
                break census;
            }
            if clock::now() > until {
                let _ = child.kill();
                return Err(Failure::from("the robot was not up after 30 s"));
            }
            clock::sleep_s(0.02);
        };
        // The wheels turn before anything is measured.
        clock::sleep_s(3.0);
        let (_, memory) = guard::ask(&plan.root, "look", PATIENCE_S)?;
        let page = LatchPage::map(memory.ok_or_else(|| Failure::from("the guard does not show its latch"))?)?;
        let tree = Tree::shared(&plan.root)?;
        let mut victims = Vec::new();
        for (node, program) in plan.programs.iter().enumerate() {
            let spec = robot.nodes.iter().find(|spec| spec.path() == program.instance);
            let Some(spec) = spec.filter(|spec| spec.kind.layer != Layer::Simulator) else { continue };
            let own = format!("{}/", program.instance);
            let rings =
                tree.list()?.into_iter().filter(|path| path.starts_with(&own) && !path.ends_with("/statistics"));
            // Of a driver, what only its device can have told.
            let ring = rings.max_by_key(|path| (path.ends_with("odometry"), path.ends_with("sonar")));
            let Some(ring) = ring else { continue };
            victims.push(Victim {
                member: Member::Node(node),
                path: program.instance.clone(),
                ring: tree.reader(&ring, None)?,
                is_driver: spec.kind.layer == Layer::Drivers,
                is_backed: backed(spec.kind.layer),
            });
        }
        let incidents = state.join(&robot.name).join("incidents.jsonl");
        Ok(Robotic { child, census, page, incidents, victims })
    }

    /// When the supervisor learned of `event` of `node`, after `since`.
    fn incident(&self, node: &str, event: &str, since: Time) -> Option<Time> {
        let until = clock::now().after_s(PATIENCE_S);
        while clock::now() < until {
            let text = std::fs::read_to_string(&self.incidents).unwrap_or_default();
            let records =
                text.lines().rev().take(8).filter_map(|line| serde_json::from_str::<supervisor::Record>(line).ok());
            let found = records.filter(|r| r.node == node && r.event == event && r.at_s >= since.seconds()).last();
            if let Some(record) = found {
                return Some(Time::from_seconds(record.at_s));
            }
            clock::sleep_s(0.005);
        }
        None
    }

    fn kill_nodes(&mut self, found: &mut Found, end: Time) -> Result<(), Failure> {
        let mut turn = 0;
        while clock::now() < end {
            let next = clock::now().after_s(BETWEEN_S);
            let index = turn % self.victims.len();
            turn += 1;
            let victim = &self.victims[index];
            let Some(pid) = self.census.pid(&victim.member) else { continue };
            let wills = self.page.last_will().0;
            let (generation, head) = (victim.ring.generation(), victim.ring.head());
            let begun = clock::now();
            signal(pid, Signal::KILL)?;
            let sampled = wait(|| victim.ring.generation() > generation && victim.ring.head() > head);
            match sampled {
                Some(at) if victim.is_driver => found.driver_sample.push(begun, at),
                Some(at) if victim.is_backed => found.warm.push(begun, at),
                Some(at) => found.cold.push(begun, at),
                None => found.missing += 1,
            }
            if victim.is_driver {
                match wait(|| self.page.last_will().0 > wills) {
                    Some(_) => found.will.push(begun, Time::from_nanos(self.page.last_will().1)),
                    None => found.missing += 1,
                }
            }
            match self.incident(&victim.path, "died", begun) {
                Some(at) => found.known.push(begun, at),
                None => found.missing += 1,
            }
            clock::sleep_until(next);
        }
        Ok(())
    }

    fn hang_driver(&mut self, found: &mut Found, times: usize) -> Result<(), Failure> {
        let Some(victim) = self.victims.iter().find(|victim| victim.is_driver) else { return Ok(()) };
        for _ in 0..times {
            // Seldom enough for the supervisor's patience with one node.
            clock::sleep_s(6.5);
            let Some(pid) = self.census.pid(&victim.member) else { continue };
            let wills = self.page.last_will().0;
            let begun = clock::now();
            signal(pid, Signal::STOP)?;
            let written = wait(|| self.page.last_will().0 > wills).map(|_| Time::from_nanos(self.page.last_will().1));
            match (self.incident(&victim.path, "hung", begun), written) {
                (Some(known), Some(written)) => {
                    found.hang.push(begun, known);
                    found.hang_will.push(known, written);
                }
                _ => found.missing += 1,
            }
        }
        Ok(())
    }

    fn kill_supervisor(&mut self, found: &mut Found, end: Time) -> Result<(), Failure> {
        while clock::now() < end {
            clock::sleep_s(0.5);
            let Some(pid) = self.census.pid(&Member::Supervisor) else { continue };
            let line = self.census.line(&Member::Supervisor).ok_or_else(|| Failure::from("no supervisor's line"))?;
            let before: Vec<Option<u32>> = self.victims.iter().map(|victim| self.census.pid(&victim.member)).collect();
            let begun = clock::now();
            signal(pid, Signal::KILL)?;
            // It beats when it has taken every node over and looks after them.
            match wait(|| line.writer().0 != pid && line.beat_at_ns() > begun.nanos()) {
                Some(at) => found.taken_over.push(begun, at),
                None => found.missing += 1,
            }
            let after = self.victims.iter().map(|victim| self.census.pid(&victim.member));
            found.lost += before.into_iter().zip(after).filter(|(before, after)| before != after).count() as u64;
        }
        Ok(())
    }

    fn stop_and_resume(&mut self, times: usize, missing: &mut u64, into: &mut Times) -> Result<(), Failure> {
        let driver = self.victims.iter().find(|victim| victim.is_driver);
        let Some(line) = driver.and_then(|driver| self.census.line(&driver.member)) else { return Ok(()) };
        let client = guard::Client::connect(&self.census.folder)?;
        for _ in 0..times {
            let before = self.page.word();
            let begun = clock::now();
            client.say("stop bench\nto be measured")?;
            let obeyed = wait(|| line.last_obeyed().0 > before.0);
            match obeyed {
                Some(_) => into.push(begun, Time::from_nanos(line.last_obeyed().1)),
                None => *missing += 1,
            }
            if wait(|| self.page.word().state() == State::Latched).is_none() {
                *missing += 1;
            }
            while client.hear()?.is_some() {}
            for word in ["reset", "resume"] {
                guard::ask(&self.census.folder, word, PATIENCE_S)?;
            }
            // Long enough for the wheels to turn again, and in no step with any node.
            clock::sleep_s(0.113);
        }
        Ok(())
    }
}

impl Drop for Robotic {
    fn drop(&mut self) {
        let _ = supervisor::down(&self.census.folder, 20.0);
        let _ = self.child.wait();
    }
}

fn signal(pid: u32, signal: Signal) -> Result<(), Failure> {
    let pid = Pid::from_raw(pid as i32).ok_or_else(|| Failure::from("no process"))?;
    Ok(kill_process(pid, signal)?)
}

/// When `happened` was seen; `None` when patience ended.
fn wait(mut happened: impl FnMut() -> bool) -> Option<Time> {
    let until = clock::now().after_s(PATIENCE_S);
    loop {
        let now = clock::now();
        if happened() {
            return Some(now);
        }
        if now > until {
            return None;
        }
        clock::sleep_s(LOOK_S);
    }
}

/// A thread per core that computes for nothing.
pub(super) struct Load(Arc<AtomicBool>, Vec<std::thread::JoinHandle<()>>);

impl Load {
    pub(super) fn start() -> Load {
        let stop: Arc<AtomicBool> = Arc::default();
        let spin = |_| {
            let stop = stop.clone();
            std::thread::spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            })
        };
        let threads = super::machine::processors().into_iter().map(spin).collect();
        Load(stop, threads)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        for thread in self.1.drain(..) {
            let _ = thread.join();
        }
    }
}
