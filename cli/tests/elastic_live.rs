//! A live robot with a governor: periods that it announces are kept, the load is told, and a node that the robot file does
//! not name is spawned, outlives its supervisor, and is refused where it does not fit.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use messages::{Load, NodeLoad, NodeStatistics, bytemuck, path_number};
use runtime::channel::{SampleBuffer, Tree};
use runtime::clock;
use rustix::process::{Pid, Signal, kill_process};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

/// What has not happened by then counts as never [s].
const PATIENCE_S: f64 = 60.0;

/// A robot of its own, in folders of its own.
struct Robot {
    name: String,
    base: PathBuf,
    child: Child,
}

impl Robot {
    /// The Pioneer with a governor whose one rule asks for another period of `forward`, from a file of its own.
    fn run() -> Robot {
        let name = format!("elastic_{}", std::process::id());
        let base = PathBuf::from(format!("/dev/shm/sinew-test-{name}"));
        let folder = base.join("robot");
        std::fs::create_dir_all(folder.join("worlds")).unwrap();
        let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robots/pioneer");
        std::fs::copy(own.join("worlds/office.toml"), folder.join("worlds/office.toml")).unwrap();
        let text = std::fs::read_to_string(own.join("robot.toml")).unwrap();
        let text = text.replace("[nodes.forward]\n", "[nodes.forward]\nperiod_ms = { min = 100, max = 800 }\n");
        let arbiter = "[nodes.arbiter]\nreads.governor = \"/coordinator/governor/state\"\n";
        let text = text.replace("[nodes.arbiter]\n", arbiter);
        let rules = "[{ when = \"always\", mode = \"default\", periods_ms = { forward = 700 } }]";
        let governor = format!("\n[nodes.governor]\ntype = \"governor\"\nperiod_ms = 50\nconfig.rules = {rules}\n");
        std::fs::write(folder.join("robot.toml"), text + &governor).unwrap();
        let mut command = command(&base);
        command.args(["run", "--plain", "--svg", "none", "--seed", "3", "--name", &name]).arg(&folder);
        let child = command.stdout(Stdio::null()).spawn().unwrap();
        let robot = Robot { name, base, child };
        robot.until("every node runs", || {
            robot.status().is_some_and(|status| status.nodes.iter().all(|node| node.state == "running"))
        });
        robot
    }

    fn root(&self) -> PathBuf {
        self.base.join("shm").join(&self.name)
    }

    fn status(&self) -> Option<supervisor::Status> {
        serde_json::from_str(&supervisor::ask(&self.root(), "status", 20.0).ok()?).ok()
    }

    fn pid(&self, node: &str) -> Option<i32> {
        self.status()?.nodes.into_iter().find(|found| found.instance == node && found.state == "running")?.pid
    }

    fn sinew(&self, words: &[&str]) -> Output {
        command(&self.base).args(words).output().unwrap()
    }

    fn newest(&self, path: &str) -> Option<SampleBuffer> {
        let ring = Tree::shared(&self.root()).ok()?.reader(path, None).ok()?;
        let mut buffer = SampleBuffer::new(ring.geometry());
        ring.read(ring.head(), &mut buffer).ok()?;
        Some(buffer)
    }

    fn period_ms(&self, node: &str) -> f64 {
        let statistics = self.newest(&format!("{node}/statistics"));
        statistics.map_or(0.0, |told| bytemuck::from_bytes::<NodeStatistics>(told.fixed()).period_s * 1e3)
    }

    fn load_of(&self, node: &str) -> Option<(Load, NodeLoad)> {
        let told = self.newest("/supervisor/robot/load")?;
        let nodes: &[NodeLoad] = bytemuck::cast_slice(told.tail());
        let own = *nodes.iter().find(|entry| entry.node == path_number(node))?;
        Some((*bytemuck::from_bytes(told.fixed()), own))
    }

    fn until(&self, what: &str, mut done: impl FnMut() -> bool) {
        let end = clock::now().after_s(PATIENCE_S);
        while !done() {
            assert!(clock::now() < end, "never: {what}");
            clock::sleep_s(0.005);
        }
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        if let Some(owner) = supervisor::owner(&self.root()) {
            // Without a root everything stops by itself.
            kill(owner.pid);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_dir_all(&self.base);
    }
}

fn command(base: &std::path::Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sinew"));
    command.env("SINEW_SHM", base.join("shm")).env("SINEW_STATE", base.join("state")).stdin(Stdio::null());
    command
}

fn kill(pid: i32) {
    let _ = kill_process(Pid::from_raw(pid).unwrap(), Signal::KILL);
}

#[test]
fn periods_are_kept_the_load_is_told_and_a_spawned_node_is_one_like_any_other() {
    let robot = Robot::run();
    robot.until("the rule's period is kept", || (robot.period_ms("/actions/forward") - 700.0).abs() < 1e-6);
    robot.until("its load is told", || {
        robot.load_of("/actions/forward").is_some_and(|(load, node)| {
            load.processors >= 1.0 && node.steps > 0 && node.busy_ns > 0 && node.resident_bytes > 0.0
        })
    });

    let refused = |words: &[&str], why: &str| {
        let launch = std::fs::read(robot.root().join(".run/launch.json")).unwrap();
        let output = robot.sinew(words);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(why), "{words:?}: {said}");
        assert_eq!(std::fs::read(robot.root().join(".run/launch.json")).unwrap(), launch, "{words:?}");
    };
    let ranges = "ranges=/drivers/base/sonar";
    refused(
        &["spawn", "forward", "--at", "forward", "--budget", "1", "--trigger", "ranges", "--read", ranges],
        "one writer",
    );
    refused(
        &["spawn", "forwrd", "--at", "creep", "--budget", "1", "--period", "100"],
        "there is no node type \"forwrd\"",
    );
    let other = "ranges=/perception/odometry/pose";
    refused(
        &["spawn", "forward", "--at", "creep", "--budget", "1", "--period", "100", "--read", other],
        "carries Odometry",
    );
    refused(
        &["spawn", "forward", "--at", "creep", "--budget", "90", "--period", "60", "--read", ranges],
        "node \"creep\" can miss its deadline of 60 ms by 30 ms or more",
    );

    let spawn = ["spawn", "forward", "--at", "creep", "--period", "400", "--budget", "0.01", "--priority", "1"];
    let output = robot.sinew(&[&spawn[..], &["--read", ranges, "--set", "speed_m_s=0.05", "--save"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let saved = std::fs::read_to_string(robot.base.join("robot/robot.toml")).unwrap();
    assert!(saved.contains("[nodes.creep]") && saved.contains("# What the echoes explain"), "{saved}");
    robot.until("it steps", || robot.load_of("/actions/creep").is_some_and(|(_, node)| node.steps > 0));

    let (creep, status) = (robot.pid("/actions/creep").unwrap(), robot.status().unwrap());
    kill(status.pid);
    robot.until("another supervisor is there", || robot.status().is_some_and(|now| now.pid != status.pid));
    assert_eq!(robot.pid("/actions/creep"), Some(creep), "it outlives its supervisor");
    kill(creep);
    robot.until("it is started again", || robot.pid("/actions/creep").is_some_and(|pid| pid != creep));
    robot.until("and steps", || robot.load_of("/actions/creep").is_some_and(|(_, node)| node.steps > 0));
    assert!(robot.sinew(&["down"]).status.success());
}
