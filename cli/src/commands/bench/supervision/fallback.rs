//! Laser dead for good → sonar in use: how long a Pioneer with both goes without fresh ranges, and whether its speed cap
//! was lowered before it looked for another ranger.
//!
//! The laser's driver gets SIGKILL and is not started again. The cap counts as lowered with motion's first step after the
//! supervisor's word for it; the sonar as in use from the step on in which `steer_clear` says that it changed over, by its
//! log. Then a person starts the laser again, and the next try waits until it is read again.

use super::super::scratch::Scratch;
use super::super::timing::Times;
use super::{PATIENCE_S, signal, wait};
use crate::built_in;
use crate::exit::Failure;
use messages::{SupervisorState, bytemuck};
use runtime::channel::{RawReader, SampleBuffer, Tree};
use runtime::{Time, clock};
use rustix::process::Signal;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

const LASER: &str = "/drivers/laser";
const STEERS: &str = "/actions/steer_clear";

/// What was found.
#[derive(Debug, Default)]
pub struct Found {
    /// From the laser's end to motion under the lower cap.
    pub cap: Times,
    /// From the laser's end to the first step that reads the sonar.
    pub sonar: Times,
    /// Tries in which the sonar was in use before the cap was lowered.
    pub wrong_order: u64,
    /// What did not come.
    pub missing: u64,
}

struct Robot {
    child: Child,
    root: PathBuf,
    log: PathBuf,
    /// What the supervisor lets through, and what motion makes of it.
    rung: RawReader,
    motion: RawReader,
}

/// Takes the laser away `times` times.
pub fn run(scratch: &Scratch, times: usize) -> Result<Found, Failure> {
    let mut robot = Robot::start(scratch)?;
    let mut found = Found::default();
    for _ in 0..times {
        robot.lose_laser(&mut found)?;
        robot.bring_back()?;
    }
    Ok(found)
}

impl Robot {
    fn start(scratch: &Scratch) -> Result<Robot, Failure> {
        let folder = scratch.folder("laser")?;
        for (name, bytes) in built_in::PIONEER {
            let file = folder.join(name);
            std::fs::create_dir_all(file.parent().unwrap_or(&folder))?;
            std::fs::write(file, bytes)?;
        }
        let (shm, state) = (scratch.folder("laser-shm")?, scratch.folder("laser-state")?);
        let name = format!("bench_laser_{}", std::process::id());
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("run").arg(folder.join("laser.toml")).args(["--name", &name, "--json", "--svg", "none"]);
        command.args(["--set", "nodes.laser.care.restarts=0"]).env("SINEW_SHM", &shm).env("SINEW_STATE", &state);
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn()?;
        let root = shm.join(&name);
        let rings = wait_for(30.0, || {
            let tree = Tree::shared(&root).ok()?;
            let ring = |path| tree.reader(path, None).ok().filter(|ring: &RawReader| ring.head() > 0);
            ring("/drivers/laser/ranges")?;
            Some((ring(runtime::SUPERVISOR_STATE)?, ring("/motion/drive/state")?))
        });
        let Some((rung, motion)) = rings else {
            let _ = supervisor::down(&root, 5.0);
            let _ = child.kill();
            let _ = child.wait();
            return Err(Failure::from("the robot with a laser was not up after 30 s"));
        };
        let log = state.join(&name).join("actions.steer_clear.log");
        // The wheels turn before anything is measured.
        clock::sleep_s(3.0);
        Ok(Robot { child, root, log, rung, motion })
    }

    fn lose_laser(&mut self, found: &mut Found) -> Result<(), Failure> {
        let pid = self.pid(LASER)?.ok_or_else(|| Failure::from("the laser's driver does not run"))?;
        let (rungs, motions) = (self.rung.head(), self.motion.head());
        let begun = clock::now();
        signal(pid, Signal::KILL)?;
        let limps = |state: &SupervisorState| state.limp != 0;
        let limp = wait_for(PATIENCE_S, || first_stamp(&self.rung, rungs, |bytes| limps(bytemuck::from_bytes(bytes))));
        let cap = limp.and_then(|limp| {
            let after = |stamp: Time| stamp >= limp;
            wait_for(PATIENCE_S, || stamps(&self.motion, motions).find(|stamp| after(*stamp)))
        });
        let sonar = wait_for(PATIENCE_S, || self.changed_over("/drivers/base/sonar", begun));
        match (cap, sonar) {
            (Some(cap), Some(sonar)) => {
                found.cap.push(begun, cap);
                found.sonar.push(begun, sonar);
                found.wrong_order += u64::from(sonar < cap);
            }
            _ => found.missing += 1,
        }
        Ok(())
    }

    fn bring_back(&mut self) -> Result<(), Failure> {
        let begun = clock::now();
        supervisor::ask(&self.root, &format!("start {LASER}"), PATIENCE_S).map_err(Failure::from)?;
        let back = wait_for(30.0, || self.changed_over("/drivers/laser/ranges", begun));
        back.ok_or_else(|| Failure::from("the laser was not read again within 30 s"))?;
        // Limp mode ends by itself a while after its cause.
        wait(|| newest(&self.rung).is_some_and(|state| state.limp == 0));
        clock::sleep_s(1.0);
        Ok(())
    }

    /// When `steer_clear` began to read `path`, after `since`.
    fn changed_over(&self, path: &str, since: Time) -> Option<Time> {
        let text = std::fs::read_to_string(&self.log).unwrap_or_default();
        let mark = format!("{STEERS}: ranges is read from {path} since ");
        let told = text.lines().rev().filter_map(|line| line.strip_prefix(&mark)?.strip_suffix(" s")?.parse().ok());
        told.map(Time::from_seconds).find(|at| *at >= since)
    }

    fn pid(&self, node: &str) -> Result<Option<u32>, Failure> {
        let status = supervisor::ask(&self.root, "status", PATIENCE_S).map_err(Failure::from)?;
        let status: supervisor::Status = serde_json::from_str(&status)?;
        let known = status.nodes.into_iter().find(|known| known.instance == node);
        Ok(known.and_then(|known| u32::try_from(known.pid?).ok()))
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = supervisor::down(&self.root, 20.0);
        let _ = self.child.wait();
    }
}

/// What `look` finds, unless patience ends.
fn wait_for<T>(patience_s: f64, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let until = clock::now().after_s(patience_s);
    loop {
        if let Some(found) = look() {
            return Some(found);
        }
        if clock::now() > until {
            return None;
        }
        clock::sleep_s(0.001);
    }
}

/// Stamps of the samples after number `after`.
fn stamps(ring: &RawReader, after: u64) -> impl Iterator<Item = Time> {
    (after + 1..=ring.head()).filter_map(move |number| Some(Time::from_nanos(ring.stamp(number).ok()?.stamp_ns)))
}

/// Stamp of the first sample after number `after` that is as wanted.
fn first_stamp(ring: &RawReader, after: u64, wanted: impl Fn(&[u8]) -> bool) -> Option<Time> {
    let mut buffer = SampleBuffer::new(ring.geometry());
    (after + 1..=ring.head()).find_map(|number| {
        let sample = ring.read(number, &mut buffer).ok()?;
        wanted(buffer.fixed()).then(|| Time::from_nanos(sample.stamp_ns))
    })
}

fn newest(ring: &RawReader) -> Option<SupervisorState> {
    let mut buffer = SampleBuffer::new(ring.geometry());
    ring.read(ring.head(), &mut buffer).ok()?;
    Some(*bytemuck::from_bytes(buffer.fixed()))
}
