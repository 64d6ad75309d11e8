//! `sinew bench reflex`: from a SIP on the wire to the motor command that answers it, through the whole live robot:
//! driver, `steer_clear`, coordinator, motion and the driver again, every node a process of its own under the
//! supervisor. This program is the robot's end of the wire, a pseudo-terminal.

mod pty;
mod robot_end;

pub use pty::Pty;
pub use robot_end::Stimulus;

use super::machine::Before;
use super::process::threads;
use super::report::{Report, Row, Value};
use super::scratch::Scratch;
use super::timing::Times;
use super::witness::Witnesses;
use crate::exit::Failure;
use crate::load::{self, Changes};
use messages::{Message, NodeStatistics, bytemuck};
use robot_end::RobotEnd;
use runtime::channel::{Expect, SampleBuffer, Tree};
use runtime::realtime::{self, Grant};
use runtime::robot::{RealtimeTable, Robot, Scheduler};
use runtime::{Layer, NodeType, clock};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Above the nodes, so that the taker of the time is not late itself; below the witnesses.
const PRIORITY: u8 = 90;
/// Most SIPs in a second.
const MOST_PER_S: f64 = 100.0;
/// The ramp of the turn is taken out of the way: two steps may follow each other within 50 µs [rad/s²].
const TURN_RAMP: &str = "body.turn_acceleration_rad_s2=1000000.0";

/// Upper edges of the histogram [µs].
const EDGES_US: [u64; 9] = [100, 200, 300, 500, 1_000, 2_000, 5_000, 10_000, 50_000];

/// The robot under its supervisor.
struct Running {
    child: Child,
    words: PathBuf,
}

impl Running {
    fn start(
        file: Option<&Path>,
        name: &str,
        devices: &[String],
        shm: &Path,
        state: &Path,
    ) -> Result<Running, Failure> {
        let words = state.join("run.stderr");
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("run").args(file);
        devices.iter().for_each(|device| {
            command.args(["--device", device]);
        });
        command.args(["--name", name, "--set", TURN_RAMP, "--json", "--svg", "none"]);
        command.env("SINEW_SHM", shm).env("SINEW_STATE", state);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::from(File::create(&words)?));
        Ok(Running { child: command.spawn()?, words })
    }

    /// Why the run is over, if it is.
    fn over(&mut self) -> Option<Failure> {
        let status = self.child.try_wait().ok()??;
        let words = std::fs::read_to_string(&self.words).unwrap_or_default();
        Some(Failure::from(format!("the robot stopped ({status}): {}", words.trim())))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(pid) = i32::try_from(self.child.id()).ok().and_then(rustix::process::Pid::from_raw)
            && self.child.try_wait().is_ok_and(|status| status.is_none())
        {
            let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
        }
        let _ = self.child.wait();
    }
}

/// Runs the robot in `file` for `seconds`.
pub fn run(file: Option<&Path>, seconds: f64, types: &[NodeType]) -> Result<Report, Failure> {
    observe("reflex", &Scratch::new()?, file, seconds, types, Stimulus::Sonar)
}

/// Runs the robot in `file` for `seconds` and times how it answers the stimulus.
pub fn observe(
    bench: &'static str,
    scratch: &Scratch,
    file: Option<&Path>,
    seconds: f64,
    types: &[NodeType],
    stimulus: Stimulus,
) -> Result<Report, Failure> {
    let robot = load::robot(file, &Changes::default(), types)?;
    let (shm, state) = (scratch.folder("shm")?, scratch.folder("state")?);
    let driver = robot.nodes.iter().find(|node| node.kind.layer == Layer::Drivers && node.kind.name == "p2os");
    let driver = driver.ok_or("reflex needs a robot with a p2os driver")?.instance.clone();
    let packet = stimulus.packet();
    let mut devices: Vec<String> = stimulus.device().into_iter().collect();
    let mut end = RobotEnd::new(Pty::open()?, stimulus, (seconds * MOST_PER_S) as usize + 1);
    devices.push(format!("{driver}=pty:{}", end.name()));
    let before = Before::now();
    let mut running = Running::start(file, &robot.name, &devices, &shm, &state)?;
    let measured = std::thread::scope(|scope| {
        let work = || measure(&mut end, &mut running, seconds);
        scope.spawn(work).join().unwrap_or_else(|e| std::panic::resume_unwind(e))
    });
    let (own, seen) = measured?;
    let (rows, nodes) = statistics(&robot, &shm.join(&robot.name))?;
    drop(running);
    let scheduling = vec![format!("robot's end: {own}"), nodes];
    let machine = before.finish(scheduling, &seen);
    let mut all = vec![end.times.row(bench, 0, &seen)];
    for (kind, times) in [("direct", &end.direct), ("behind_another", &end.behind)] {
        if !times.is_empty() {
            all.push(times.row(&format!("{bench}_{kind}"), 0, &seen));
        }
    }
    all.extend(rows);
    let [vel, rvel, other] = end.commands;
    let mut values = histogram(&end.times);
    values.extend([
        Value::new("lost", end.lost as f64, "packets or scans without an answer in 0.5 s"),
        Value::new("vel_commands", vel as f64, "packets"),
        Value::new("rvel_commands", rvel as f64, "packets"),
        Value::new("other_commands", other as f64, "packets"),
    ]);
    Ok(Report { bench, machine, rows: all, values, targets: Vec::new(), notes: vec![note(bench, packet, seconds)] })
}

/// What is measured, on a thread of its own: its scheduling and the witnesses of the time end with it.
fn measure(
    end: &mut RobotEnd,
    running: &mut Running,
    seconds: f64,
) -> Result<(String, super::witness::Testimony), Failure> {
    let wishes = RealtimeTable { scheduler: Scheduler::Fifo, lock_memory: false, runaway_ms: 0 };
    let own = match realtime::apply(&wishes, PRIORITY, "robot's end").scheduler {
        Grant::Granted(what) => what,
        _ => "SCHED_OTHER (SCHED_FIFO refused)".into(),
    };
    let running = std::cell::RefCell::new(running);
    end.start(&|| running.borrow_mut().over())?;
    let witnesses = Witnesses::start()?;
    let measured = end.measure(clock::now().after_s(seconds));
    let seen = witnesses.stop();
    measured?;
    match running.borrow_mut().over() {
        Some(failure) => Err(failure),
        None => Ok((own, seen)),
    }
}

/// How every node kept time, by its own statistics, and how its thread is scheduled.
fn statistics(robot: &Robot, root: &Path) -> Result<(Vec<Row>, String), Failure> {
    let tree = Tree::shared(root)?;
    let (mut rows, mut fifo, mut nodes) = (Vec::new(), 0, 0);
    for node in &robot.nodes {
        let expect = Expect { type_name: NodeStatistics::NAME.into(), layout_hash: NodeStatistics::layout_hash() };
        // The simulated twin does not run beside a device of its own.
        let Ok(reader) = tree.reader(&node.port_path("statistics"), Some(expect)) else { continue };
        let mut buffer = SampleBuffer::new(reader.geometry());
        nodes += 1;
        if let Some(pid) = reader.writer_pid() {
            fifo += usize::from(threads(pid).0.contains(&thread_name(&node.instance)));
        }
        if reader.read(reader.head(), &mut buffer).is_err() {
            continue;
        }
        let kept: NodeStatistics = bytemuck::pod_read_unaligned(buffer.fixed());
        for (what, times_s) in [("lateness", kept.lateness_s), ("execution", kept.execution_s)] {
            let [p50, p99, p999, max] = times_s.map(|s| (s * 1e9).round() / 1000.0);
            let mut row = Row::new(&format!("{what} {}", node.path()), 0, [p50, p99, max], kept.steps);
            row.note("p999_us", p999);
            rows.push(row);
        }
    }
    Ok((rows, format!("nodes: {fifo} of {nodes} step under SCHED_FIFO")))
}

/// The name that the kernel keeps of a thread's: its first 15 bytes.
fn thread_name(name: &str) -> String {
    name.chars().take(15).collect()
}

/// How many answers took how long.
fn histogram(times: &Times) -> Vec<Value> {
    let counts = times.counts(&EDGES_US.map(|us| us * 1000));
    let names = EDGES_US.iter().map(|us| format!("up to {us} µs")).chain(["longer".into()]);
    names.zip(counts).map(|(name, count)| Value::new(name, count as f64, "answers")).collect()
}

fn note(bench: &str, packet: &str, seconds: f64) -> String {
    format!(
        "For {seconds} s an obstacle jumped from one side to the other with every {packet}, so that the turn had to change its \
         sign. A {bench} is the time from just before the write of the {packet} to just after the read of the first RVEL of \
         the new sign, two crossings of a pseudo-terminal among it. The base's driver keeps 5 ms between two commands, for the \
         firmware's sake: {bench}_behind_another are the answers that another command came before within that time or after \
         the {packet}, {bench}_direct the others. The next {packet} follows 15 to 35 ms after the answer, at random. The turn's \
         ramp is taken out ({TURN_RAMP}). Lateness is from the stamp of the releasing sample, or from the grid, to the step; \
         execution is the step; both as the nodes counted them since their start, two digits exact."
    )
}
