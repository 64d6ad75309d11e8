//! The show of live changes: a Pioneer with laser and sonars loses its laser for good in mid-run, goes on by sonar and
//! slower, gets it back, and has its `steer_clear` replaced by another build of it, all without a stop.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use messages::{MotionState, Truth, bytemuck};
use runtime::channel::{RawReader, SampleBuffer, Tree};
use runtime::{Time, clock};
use rustix::process::{Pid, Signal, kill_process};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// What has not happened by then counts as never [s].
const PATIENCE_S: f64 = 40.0;
/// A body whose wheels give it less than this has stopped [m/s].
const STOPPED_M_S: f64 = 0.02;
/// The cap of limp mode in the robot file, and what the simulated wheels may add to it [m/s].
const LIMP_M_S: f64 = 0.10 + 0.02;
/// From full speed down to the cap at the body's deceleration, and the world's own delays [s].
const SLOWED_WITHIN_S: f64 = 1.5;

struct Robot {
    name: String,
    base: PathBuf,
    child: Option<Child>,
}

impl Robot {
    /// In a straight corridor that takes it more than a minute.
    fn start() -> Robot {
        let name = format!("laser_lost_{}", std::process::id());
        let base = PathBuf::from(format!("/dev/shm/sinew-test-{name}"));
        let folder = base.join("robot");
        std::fs::create_dir_all(folder.join("worlds")).unwrap();
        let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robots/pioneer");
        std::fs::copy(own.join("laser.toml"), folder.join("robot.toml")).unwrap();
        let corridor = "name = \"straight\"\nbounds_m = [0.0, 0.0, 40.0, 3.0]\n\n\
                        [[start]]\nx_m = 1.5\ny_m = 1.5\nheading_deg = 0.0\n";
        std::fs::write(folder.join("worlds/office.toml"), corridor).unwrap();
        let mut robot = Robot { name, base, child: None };
        let mut command = robot.command(&["run", folder.to_str().unwrap(), "--plain", "--svg", "none", "--name"]);
        // Killed once, it does not come back by itself.
        command.args([&robot.name, "--set", "nodes.laser.care.restarts=0"]).stdout(Stdio::null());
        robot.child = Some(command.spawn().unwrap());
        robot
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sinew"));
        command.args(words).env("SINEW_SHM", self.base.join("shm")).env("SINEW_STATE", self.base.join("state"));
        command.stdin(Stdio::null());
        command
    }

    fn does(&self, words: &[&str]) {
        let output = self.command(words).output().unwrap();
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    }

    fn root(&self) -> PathBuf {
        self.base.join("shm").join(&self.name)
    }

    fn node(&self, instance: &str) -> Option<supervisor::NodeStatus> {
        let status = supervisor::ask(&self.root(), "status", 20.0).ok()?;
        let status: supervisor::Status = serde_json::from_str(&status).ok()?;
        status.nodes.into_iter().find(|node| node.instance == instance)
    }

    /// When steer_clear last began to read `path`, by its log.
    fn reads(&self, path: &str) -> Option<Time> {
        let log = self.base.join("state").join(&self.name).join("actions.steer_clear.log");
        let text = std::fs::read_to_string(log).unwrap_or_default();
        let newest =
            text.lines().rev().find_map(|line| line.strip_prefix("/actions/steer_clear: ranges is read from "))?;
        let (read, at) = newest.strip_suffix(" s")?.split_once(" since ")?;
        (read == path).then(|| at.parse().map(Time::from_seconds).ok())?
    }

    fn until<T>(&self, what: &str, track: &mut Track, mut done: impl FnMut(&Track) -> Option<T>) -> T {
        let end = clock::now().after_s(PATIENCE_S);
        loop {
            track.look();
            if let Some(found) = done(track) {
                return found;
            }
            assert!(clock::now() < end, "never: {what}");
            clock::sleep_s(0.002);
        }
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            if let Some(owner) = supervisor::owner(&self.root()) {
                // Without a root everything stops by itself.
                let _ = kill_process(Pid::from_raw(owner.pid).unwrap(), Signal::KILL);
            }
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = std::fs::remove_dir_all(&self.base);
    }
}

/// Speed by the world's truth, and what motion was allowed, sample by sample.
struct Track {
    truth: RawReader,
    motion: RawReader,
    seen: [u64; 2],
    /// When, and how fast ahead [m/s].
    speeds: Vec<(Time, f64)>,
    /// When motion stepped, and whether the body was held to the pace of limp mode.
    limps: Vec<(Time, bool)>,
    lost: u64,
}

impl Track {
    fn open(root: &Path) -> Option<Track> {
        let tree = Tree::shared(root).ok()?;
        let ring = |path| tree.reader(path, None).ok().filter(|ring: &RawReader| ring.head() > 0);
        let (truth, motion) = (ring("/simulator/world/truth")?, ring("/motion/drive/state")?);
        let seen = [truth.head(), motion.head()];
        Some(Track { truth, motion, seen, speeds: Vec::new(), limps: Vec::new(), lost: 0 })
    }

    fn look(&mut self) {
        let mut buffer = SampleBuffer::new(self.truth.geometry());
        while self.seen[0] < self.truth.head() {
            self.seen[0] += 1;
            match self.truth.read(self.seen[0], &mut buffer) {
                Ok(sample) => {
                    let truth: &Truth = bytemuck::from_bytes(buffer.fixed());
                    self.speeds.push((Time::from_nanos(sample.stamp_ns), truth.velocity.linear_x_m_s));
                }
                Err(_) => self.lost += 1,
            }
        }
        let mut buffer = SampleBuffer::new(self.motion.geometry());
        while self.seen[1] < self.motion.head() {
            self.seen[1] += 1;
            if let Ok(sample) = self.motion.read(self.seen[1], &mut buffer) {
                let state: &MotionState = bytemuck::from_bytes(buffer.fixed());
                // Motion holds back what is faster, or nobody asks for more.
                let limps = state.stop == messages::Stop::Limp as u32 || state.wanted.linear_x_m_s <= LIMP_M_S;
                self.limps.push((Time::from_nanos(sample.stamp_ns), limps));
            }
        }
    }

    fn speed(&self) -> f64 {
        self.speeds.last().map_or(0.0, |(_, speed)| *speed)
    }

    fn between(&self, from: Time, to: Time) -> impl Iterator<Item = f64> {
        self.speeds.iter().filter(move |(at, _)| *at >= from && *at <= to).map(|(_, speed)| *speed)
    }
}

#[test]
fn a_robot_that_loses_its_laser_goes_on_by_sonar_slower_and_never_stops_not_even_for_a_replacement() {
    let mut robot = Robot::start();
    let end = clock::now().after_s(PATIENCE_S);
    let mut track = loop {
        if let Some(track) = Track::open(&robot.root()) {
            break track;
        }
        assert!(clock::now() < end, "never: the robot runs");
        clock::sleep_s(0.02);
    };
    let laser = "/drivers/laser/ranges";
    let scans = Tree::shared(&robot.root()).unwrap().reader(laser, None).unwrap();
    robot.until("it drives at full speed by its laser", &mut track, |track| {
        (track.speed() > 0.25 && scans.head() > 0).then_some(())
    });
    let begun = clock::now();

    // The laser goes, for good.
    let driver = robot.node("/drivers/laser").unwrap().pid.unwrap();
    let killed = clock::now();
    kill_process(Pid::from_raw(driver).unwrap(), Signal::KILL).unwrap();
    let sonar = robot.until("it steers by sonar", &mut track, |_| robot.reads("/drivers/base/sonar"));
    let limps = |track: &Track| track.limps.iter().find(|(at, limps)| *at >= killed && *limps).map(|(at, _)| *at);
    let capped = robot.until("it limps", &mut track, limps);
    assert!(capped < sonar, "the cap is lowered first: {} s against {} s", capped.seconds(), sonar.seconds());
    assert_eq!(robot.node("/drivers/laser").unwrap().state, "given up");
    let far = track.truth.head() + 200;
    robot.until("it goes on for two seconds", &mut track, |track| (track.truth.head() >= far).then_some(()));
    let slow = track.between(killed.after_s(SLOWED_WITHIN_S), clock::now()).fold(0.0, f64::max);
    assert!(slow <= LIMP_M_S, "{slow} m/s without its laser");

    // And comes back.
    robot.does(&["start", "laser"]);
    robot.until("it steers by its laser", &mut track, |_| robot.reads(laser));
    robot.until("it is as fast as before", &mut track, |track| (track.speed() > 0.25).then_some(()));

    // Another build of steer_clear takes over.
    let other = robot.base.join("another build");
    std::fs::copy(env!("CARGO_BIN_EXE_sinew"), &other).unwrap();
    let before = robot.node("/actions/steer_clear").unwrap().pid;
    robot.does(&["replace", "steer_clear", "--program", other.to_str().unwrap()]);
    robot.until("the other build steers", &mut track, |_| {
        let node = robot.node("/actions/steer_clear")?;
        let program = std::fs::read_link(format!("/proc/{}/exe", node.pid?)).unwrap_or_default();
        (node.pid != before && program == other && node.state == "running").then_some(())
    });
    let far = track.truth.head() + 100;
    robot.until("it goes on for a second", &mut track, |track| (track.truth.head() >= far).then_some(()));

    // The track shows no stop.
    let ended = clock::now();
    let slowest = track.between(begun, ended).fold(f64::INFINITY, f64::min);
    let samples = track.between(begun, ended).count();
    assert!(slowest > STOPPED_M_S, "slowest {slowest} m/s of {samples} samples");
    assert_eq!(track.lost, 0, "samples of the truth that nobody looked at");
    robot.does(&["down"]);
    robot.child.take().unwrap().wait().unwrap();
}
