//! The process tree of a live robot: whoever dies is replaced, a stop is never forgotten, and nothing is left behind.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use guard::latch::State;
use guard::{LatchPage, Phase, SUPERVISOR_LINE, Table, fds};
use messages::{Truth, bytemuck};
use runtime::channel::{RawReader, SampleBuffer, Tree};
use runtime::clock;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

/// What has not happened by then counts as never [s].
const PATIENCE_S: f64 = 40.0;

/// A robot of its own, in folders of its own.
struct Robot {
    name: String,
    base: PathBuf,
    child: Option<Child>,
}

impl Robot {
    fn new() -> Robot {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("tree_{}_{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        Robot { base: PathBuf::from(format!("/dev/shm/sinew-test-{name}")), name, child: None }
    }

    /// Started, every node beating, the wheels turning unless it stands.
    fn run(mut self, more: &[&str]) -> Robot {
        self.start(more);
        self
    }

    fn start(&mut self, more: &[&str]) {
        let mut command = self.command(&["run", "--plain", "--svg", "none", "--seed", "3", "--name"]);
        self.child = Some(command.arg(&self.name).args(more).stdout(Stdio::null()).spawn().unwrap());
        self.until("every node beats", || self.try_table().is_some_and(|table| beat(&table)));
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sinew"));
        command.args(words).env("SINEW_SHM", self.base.join("shm")).env("SINEW_STATE", self.base.join("state"));
        command.stdin(Stdio::null());
        command
    }

    fn sinew(&self, words: &[&str]) -> Output {
        self.command(words).output().unwrap()
    }

    fn says(&self, words: &[&str]) -> Value {
        let output = self.sinew(words);
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    fn root(&self) -> PathBuf {
        self.base.join("shm").join(&self.name)
    }

    fn root_pid(&self) -> i32 {
        supervisor::owner(&self.root()).unwrap().pid
    }

    fn try_table(&self) -> Option<Table> {
        let pid = supervisor::owner(&self.root())?.pid;
        let path = format!("/proc/{pid}/fd/{}", fds::TABLE);
        Table::map(std::fs::File::options().read(true).write(true).open(path).ok()?).ok()
    }

    fn table(&self) -> Table {
        self.try_table().unwrap()
    }

    fn page(&self) -> LatchPage {
        let (_, memory) = guard::ask(&self.root(), "look", 10.0).unwrap();
        LatchPage::map(memory.unwrap()).unwrap()
    }

    fn supervisor(&self) -> i32 {
        self.table().line(SUPERVISOR_LINE).unwrap().writer().0 as i32
    }

    fn guard(&self) -> Option<i32> {
        let root = self.root_pid();
        let children = std::fs::read_to_string(format!("/proc/{root}/task/{root}/children")).unwrap_or_default();
        let pids = children.split_ascii_whitespace().filter_map(|word| word.parse::<i32>().ok());
        pids.into_iter().find(|pid| {
            let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            line.split(|byte| *byte == 0).any(|word| word == guard::GUARD_WORD.as_bytes())
        })
    }

    /// Processes of all nodes, by the table.
    fn nodes(&self) -> Vec<u32> {
        let table = self.table();
        (0..8).map(|index| table.line(index).unwrap().writer().0).collect()
    }

    fn status(&self) -> supervisor::Status {
        serde_json::from_str(&supervisor::ask(&self.root(), "status", 20.0).unwrap()).unwrap()
    }

    fn node(&self, instance: &str) -> i32 {
        self.status().nodes.into_iter().find(|node| node.instance == instance).unwrap().pid.unwrap()
    }

    fn truth(&self) -> RawReader {
        Tree::shared(&self.root()).unwrap().reader("/simulator/world/truth", None).unwrap()
    }

    fn speed(&self) -> f64 {
        let ring = self.truth();
        let mut buffer = SampleBuffer::new(ring.geometry());
        if ring.read(ring.head(), &mut buffer).is_err() {
            return f64::NAN;
        }
        let truth: &Truth = bytemuck::from_bytes(buffer.fixed());
        truth.velocity.linear_x_m_s.abs() + truth.velocity.angular_z_rad_s.abs()
    }

    fn moves(&self) {
        self.until("the wheels turn", || self.speed() > 0.05);
    }

    /// The wheels come to rest, and stay so while `samples` samples of the world pass.
    fn stands(&self, samples: u64) {
        self.until("the wheels rest", || self.speed() < 1e-3);
        let ring = self.truth();
        let end = ring.head() + samples;
        self.until("the world goes on", || {
            assert!(self.speed() < 1e-2 || self.speed().is_nan(), "it moves again: {}", self.speed());
            ring.head() >= end
        });
    }

    fn until(&self, what: &str, mut done: impl FnMut() -> bool) {
        let end = clock::now().after_s(PATIENCE_S);
        while !done() {
            assert!(clock::now() < end, "never: {what}");
            clock::sleep_s(0.002);
        }
    }

    fn incidents(&self) -> Vec<supervisor::Record> {
        let text = std::fs::read_to_string(self.base.join("state").join(&self.name).join("incidents.jsonl"));
        text.unwrap_or_default().lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    }

    /// Ends in order; nothing is left.
    fn end(&mut self) {
        let root = self.root_pid();
        let guard = self.guard();
        assert!(self.sinew(&["down"]).status.success());
        assert!(self.child.take().unwrap().wait().unwrap().success());
        assert!(!self.root().exists(), "files are left");
        for pid in [Some(root), guard].into_iter().flatten() {
            assert!(!PathBuf::from(format!("/proc/{pid}")).exists(), "process {pid} is left");
        }
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            if let Some(owner) = supervisor::owner(&self.root()) {
                // Without a root everything stops by itself.
                kill(owner.pid, Signal::KILL);
            }
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = std::fs::remove_dir_all(&self.base);
    }
}

fn beat(table: &Table) -> bool {
    (0..8).all(|index| table.line(index).is_some_and(|line| line.phase() != Phase::Absent && line.beats() > 0))
}

fn kill(pid: i32, signal: Signal) {
    let _ = kill_process(Pid::from_raw(pid).unwrap(), signal);
}

#[test]
fn no_node_notices_that_the_supervisor_died_and_the_next_one_looks_after_them() {
    let mut robot = Robot::new().run(&[]);
    robot.moves();
    let before = robot.nodes();
    for signal in [Signal::KILL, Signal::STOP] {
        let old = robot.supervisor();
        kill(old, signal);
        robot.until("another supervisor beats", || robot.supervisor() != old);
        assert_eq!(robot.status().state, "running");
        assert_eq!(robot.nodes(), before, "a node was lost");
    }
    // The new one is not their parent, and learns of a death all the same, and how it came.
    kill(robot.node("/actions/forward"), Signal::KILL);
    robot.until("the node is back", || robot.nodes() != before);
    robot.until("the death is on record", || {
        robot.incidents().iter().any(|r| r.node == "/actions/forward" && r.event == "died" && r.signal == Some(9))
    });
    // A killed supervisor may take its last records with it; the living one has told of both.
    assert!(robot.incidents().iter().any(|r| r.event == "takeover" && r.message.starts_with("supervisor 2 ")));
    robot.moves();
    robot.end();
}

/// Processes that wait beside a node's living one.
fn others(robot: &Robot, instance: &str) -> Vec<i32> {
    let root = robot.root().display().to_string();
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let numbers = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
    let living = robot.node(instance);
    let runs = |pid: &i32| {
        let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let words: Vec<&[u8]> = line.split(|byte| *byte == 0).collect();
        words.contains(&root.as_bytes()) && words.contains(&instance.as_bytes())
    };
    numbers.filter(|pid| *pid != living).filter(runs).collect()
}

#[test]
fn a_standby_takes_over_from_the_dead_and_another_waits_for_the_next_death() {
    let mut robot = Robot::new().run(&["--set", "nodes.arbiter.care.standby=true"]);
    robot.moves();
    for _ in 0..2 {
        robot.until("a standby waits", || {
            let nodes = robot.status().nodes;
            nodes
                .iter()
                .any(|node| node.instance == "/coordinator/arbiter" && node.standby.as_deref() == Some("waiting"))
        });
        let waiting = others(&robot, "/coordinator/arbiter")[0];
        kill(robot.node("/coordinator/arbiter"), Signal::KILL);
        robot.until("it is the node", || robot.node("/coordinator/arbiter") == waiting);
    }
    robot.until("both are on record", || {
        robot.incidents().iter().filter(|record| record.event == "took_over").count() == 2
    });
    robot.moves();
    // A killed supervisor's standby ends, and the next supervisor has one of its own.
    robot.until("a standby waits", || others(&robot, "/coordinator/arbiter").len() == 1);
    let (old, waiting) = (robot.supervisor(), others(&robot, "/coordinator/arbiter")[0]);
    kill(old, Signal::KILL);
    robot.until("another supervisor beats", || robot.supervisor() != old);
    robot.until("another standby", || {
        let others = others(&robot, "/coordinator/arbiter");
        others.len() == 1 && others[0] != waiting
    });
    robot.end();
}

#[test]
fn another_program_replaces_a_node_in_mid_drive_and_one_that_fails_changes_nothing() {
    let mut robot = Robot::new().run(&[]);
    robot.moves();
    let other = robot.base.join("another build");
    std::fs::copy(env!("CARGO_BIN_EXE_sinew"), &other).unwrap();
    let before = robot.node("/actions/steer_clear");
    let word = other.display().to_string();
    assert!(robot.sinew(&["replace", "steer_clear", "--program", &word]).status.success());
    robot.until("the other program runs", || {
        let pid = robot.node("/actions/steer_clear");
        pid != before && std::fs::read_link(format!("/proc/{pid}/exe")).is_ok_and(|program| program == other)
    });
    robot.until("it is on record", || robot.incidents().iter().any(|record| record.event == "replaced"));
    robot.until("it is ready", || {
        robot.status().nodes.iter().any(|node| node.instance == "/actions/steer_clear" && node.state == "running")
    });
    let replaced = robot.node("/actions/steer_clear");
    // One that cannot even open: the living one is not touched.
    assert!(robot.sinew(&["replace", "steer_clear", "--program", "/bin/false"]).status.success());
    robot.until("it is given up", || robot.incidents().iter().any(|record| record.event == "reverted"));
    assert_eq!(robot.node("/actions/steer_clear"), replaced);
    let refused = robot.sinew(&["replace", "steer_clear", "--program", "/nowhere"]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("there is no file /nowhere"), "{refused:?}");
    // The other program dies on its trial: the first one is back.
    kill(replaced, Signal::KILL);
    robot.until("the first program is back", || {
        let pid = robot.node("/actions/steer_clear");
        let program = std::fs::read_link(format!("/proc/{pid}/exe")).unwrap_or_default();
        pid != replaced && program.as_os_str() == env!("CARGO_BIN_EXE_sinew")
    });
    robot.moves();
    robot.end();
}

#[test]
fn a_reaction_executes_a_command_and_waits_for_a_path_and_tells_when_either_fails() {
    let mut robot = Robot::new();
    let mark = robot.base.join("mark");
    let script = format!("echo $SINEW_ROBOT > {}; echo said", mark.display());
    let reaction = |acts: &str| format!("{{ node = \"forward\", when = \"death\", do = [{acts}] }}");
    let reactions = [
        reaction(&format!(
            "{{ execute = [\"sh\", \"-c\", {script:?}] }}, \
             {{ wait_for = {{ path = \"/actions/forward/proposal\", within_ms = 20000 }} }}, \"notify\""
        )),
        reaction("{ execute = [\"false\"] }, \"notify\""),
        reaction("{ wait_for = { path = \"/actions/nobody/proposal\", within_ms = 50 } }, \"notify\""),
    ];
    robot.start(&["--set", &format!("supervision.reactions=[{}]", reactions.join(","))]);
    robot.moves();
    kill(robot.node("/actions/forward"), Signal::KILL);
    robot.until("the command has run", || std::fs::read_to_string(&mark).is_ok_and(|name| name.trim() == robot.name));
    let told = || robot.incidents().into_iter().filter(|record| record.event.contains("reaction")).collect::<Vec<_>>();
    robot.until("all three are on record", || told().len() == 3);
    let failed = told().into_iter().filter(|record| record.message.contains("failed")).count();
    assert_eq!(failed, 2, "{:?}", told());
    let log = robot.base.join("state").join(&robot.name).join("reactions.log");
    assert_eq!(std::fs::read_to_string(log).unwrap(), "said\n");
    robot.end();
}

#[test]
fn settings_and_wires_change_while_it_drives_and_what_is_refused_changes_nothing() {
    let mut robot = Robot::new();
    let folder = robot.base.join("robot");
    std::fs::create_dir_all(folder.join("worlds")).unwrap();
    let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robots/pioneer");
    for file in ["robot.toml", "worlds/office.toml"] {
        std::fs::copy(own.join(file), folder.join(file)).unwrap();
    }
    let file = folder.join("robot.toml");
    let before = std::fs::read_to_string(&file).unwrap();
    robot.start(&[&folder.display().to_string()]);
    robot.moves();
    let refused = |words: &[&str], why: &str| {
        let nodes = robot.nodes();
        let output = robot.sinew(words);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(why), "{words:?}: {said}");
        assert_eq!(robot.nodes(), nodes, "{words:?}");
    };
    refused(&["set", "forward.sped_m_s", "0.1", "--save"], "did you mean \"speed_m_s\"?");
    refused(&["set", "forward.speed_m_s", "-1"], "speed_m_s");
    refused(&["set", "forwrd.speed_m_s", "0.1"], "has no node \"forwrd\"");
    refused(&["wire", "steer_clear.ranges", "/perception/odometry/pose"], "carries Odometry");
    refused(&["wire", "steer_clear.ranges", "/perception/nobody/pose"], "no node of this robot writes");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), before);
    assert!(robot.sinew(&["set", "forward.speed_m_s", "0.11", "--save"]).status.success());
    assert!(robot.sinew(&["wire", "/actions/steer_clear.ranges", "/perception/echoes/ranges"]).status.success());
    let saved = std::fs::read_to_string(&file).unwrap();
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<std::collections::BTreeSet<_>>();
    let new: Vec<String> = lines(&saved).difference(&lines(&before)).cloned().collect();
    assert_eq!(new, ["config = { speed_m_s = 0.11 }"], "comments and all else stay");
    // A new process of the same node, much later, has both.
    robot.until("both are ready", || robot.status().nodes.iter().all(|node| node.state == "running"));
    let launch = std::fs::read_to_string(robot.root().join(".run/launch.json")).unwrap();
    assert!(
        launch.contains("speed_m_s = 0.11") && launch.contains("ranges = \\\"/perception/echoes/ranges\\\""),
        "{launch}"
    );
    robot.moves();
    robot.end();
}

#[test]
fn a_setting_under_which_the_node_dies_on_its_trial_is_taken_back_whoever_supervises_then() {
    let mut robot = Robot::new().run(&["--set", "nodes.forward.care.trial_s=30"]);
    robot.moves();
    let launch = || std::fs::read_to_string(robot.root().join(".run/launch.json")).unwrap();
    let before = launch();
    for takes_over in [false, true] {
        let old = robot.node("/actions/forward");
        let mut set = robot.command(&["set", "forward.speed_m_s", "0.11"]);
        let set = set.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        robot.until("the new setting is on trial", || {
            let node =
                |n: &supervisor::NodeStatus| n.instance == "/actions/forward" && n.state == "running" && n.on_trial;
            robot.status().nodes.iter().any(node)
        });
        assert!(launch().contains("speed_m_s = 0.11"));
        if takes_over {
            let supervisor = robot.supervisor();
            kill(supervisor, Signal::KILL);
            robot.until("another supervisor beats", || robot.supervisor() != supervisor);
        }
        let on_trial = robot.node("/actions/forward");
        assert_ne!(on_trial, old);
        kill(on_trial, Signal::KILL);
        let output = set.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains("died on its trial"), "{said}");
        assert_eq!(launch(), before);
        robot.until("it goes on as before", || {
            robot.status().nodes.iter().any(|n| n.instance == "/actions/forward" && n.state == "running")
        });
    }
    robot.moves();
    robot.end();
}

#[test]
fn a_stop_lasts_until_it_is_reset_and_resumed_whoever_dies_meanwhile() {
    let mut robot = Robot::new().run(&[]);
    robot.moves();
    robot.says(&["estop", "--reason", "a child in the corridor", "--json"]);
    let page = robot.page();
    robot.until("every driver has obeyed", || page.word().state() == State::Latched);
    let source = &page.sources()[0];
    assert_eq!(source.reason, "a child in the corridor");
    assert!(source.name.starts_with("operator"), "{}", source.name);
    robot.stands(50);
    // Guard, supervisor, driver and motion: each of them finds the stop where it was.
    let guard = robot.guard().unwrap();
    kill(guard, Signal::KILL);
    robot.until("another guard", || robot.guard().is_some_and(|pid| pid != guard));
    kill(robot.supervisor(), Signal::KILL);
    for node in ["/drivers/base", "/motion/drive"] {
        let old = robot.node(node);
        kill(old, Signal::KILL);
        robot.until("the node is back", || {
            robot.status().nodes.iter().any(|n| n.instance == node && n.pid.is_some_and(|pid| pid != old))
        });
    }
    robot.stands(100);
    let refused = robot.sinew(&["resume"]);
    assert!(!refused.status.success());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("must be reset first"), "{refused:?}");
    robot.until("it can be reset", || robot.sinew(&["reset"]).status.success());
    // A reset never starts motion.
    robot.stands(100);
    assert_eq!(robot.says(&["resume", "--json"])["state"], "run");
    robot.moves();
    robot.end();
}

#[test]
fn a_power_cycle_does_not_end_a_stop() {
    let mut robot = Robot::new().run(&[]);
    robot.moves();
    robot.says(&["estop", "--reason", "smoke", "--json"]);
    robot.until("it is on record", || robot.incidents().iter().any(|record| record.event == "emergency_stop"));
    // As if the power had failed: the root, and everything with it.
    kill(robot.root_pid(), Signal::KILL);
    let _ = robot.child.take().unwrap().wait();
    robot.start(&[]);
    let shown = robot.says(&["estop", "--show", "--json"]);
    assert_eq!((&shown["state"], &shown["sources"][0]["reason"]), (&"latched".into(), &"smoke".into()));
    robot.stands(50);
    robot.end();
    robot.start(&[]);
    assert!(robot.sinew(&["reset"]).status.success());
    assert!(robot.sinew(&["resume"]).status.success());
    robot.moves();
    robot.end();
    robot.start(&["--stand"]);
    assert_eq!(robot.says(&["estop", "--show", "--json"])["state"], "armed");
    robot.stands(50);
    robot.end();
}

#[test]
fn an_operators_stop_outlives_the_driver() {
    let mut robot = Robot::new().run(&[]);
    robot.moves();
    assert!(robot.sinew(&["call", "/drivers/base", "stop"]).status.success());
    robot.stands(20);
    let old = robot.node("/drivers/base");
    kill(old, Signal::KILL);
    robot.until("the driver is back", || {
        robot.status().nodes.iter().any(|n| n.instance == "/drivers/base" && n.pid.is_some_and(|pid| pid != old))
    });
    robot.stands(100);
    assert!(robot.sinew(&["call", "/drivers/base", "enable", "on"]).status.success());
    robot.moves();
    robot.end();
}

#[test]
fn a_driver_that_dies_or_hangs_has_its_device_stopped_by_the_guard_also_by_a_replaced_one() {
    let mut robot = Robot::new().run(&[]);
    robot.moves();
    let page = robot.page();
    for (replace_guard, signal) in [(false, Signal::KILL), (true, Signal::KILL), (false, Signal::STOP)] {
        if replace_guard {
            let guard = robot.guard().unwrap();
            kill(guard, Signal::KILL);
            robot.until("another guard", || robot.guard().is_some_and(|pid| pid != guard));
            // Its wills are collected anew: the driver has to be told by the end of its connection first.
            clock::sleep_s(0.3);
        }
        let wills = page.last_will().0;
        let odometry = Tree::shared(&robot.root()).unwrap().reader("/drivers/base/odometry", None).unwrap();
        let (generation, head) = (odometry.generation(), odometry.head());
        kill(robot.node("/drivers/base"), signal);
        robot.until("the guard writes the will", || page.last_will().0 > wills);
        // What the device tells is there again: the successor has it, and has left it with the guard.
        robot.until("the driver is back", || odometry.generation() > generation && odometry.head() > head);
        robot.moves();
    }
    robot.end();
}

#[test]
fn anyone_may_stop_a_robot_and_only_its_user_may_let_it_go() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("skipped: only root can act as another user");
        return;
    }
    let mut robot = Robot::new().run(&[]);
    robot.moves();
    let stranger = |request: &str| {
        // Without a shell or a copy of the program, which the stranger might not be able to read.
        let socket = robot.root().join(guard::SOCKET);
        let script = "import socket,sys\ns=socket.socket(socket.AF_UNIX,socket.SOCK_SEQPACKET)\ns.connect(sys.argv[1])\n\
                      s.send(sys.argv[2].encode())\nprint(s.recv(1024).decode())";
        let output =
            Command::new("python3").args(["-c", script]).arg(socket).arg(request).uid(65_534).gid(65_534).output();
        output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let Ok(answer) = stranger("stop a passer-by\nsmoke") else {
        eprintln!("skipped: no python3 to be the stranger");
        return robot.end();
    };
    assert!(answer.starts_with("ok "), "{answer}");
    let page = robot.page();
    robot.until("it is latched", || page.word().state() == State::Latched);
    assert_eq!(page.sources()[0].by.1, 65_534);
    for request in ["reset", "resume", "lower x", "hold x\ny", "attach /drivers/base"] {
        let answer = stranger(request).unwrap();
        assert!(answer.starts_with("no latched"), "{request}: {answer}");
    }
    assert_eq!(page.word().state(), State::Latched);
    robot.stands(20);
    robot.end();
}

#[test]
fn a_button_holds_the_stop_while_it_is_pressed_and_a_broken_wire_is_a_pressed_button() {
    let mut robot = Robot::new();
    let source = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robots/pioneer");
    let (folder, line) = (robot.base.join("pioneer"), robot.base.join("line"));
    std::fs::create_dir_all(folder.join("worlds")).unwrap();
    std::fs::copy(source.join("worlds/office.toml"), folder.join("worlds/office.toml")).unwrap();
    let text = std::fs::read_to_string(source.join("robot.toml")).unwrap();
    let button = format!(
        "\n[nodes.button]\ntype = \"estop_line\"\nperiod_ms = 10\nconfig = {{ file = \"{}\" }}\n",
        line.display()
    );
    std::fs::write(folder.join("robot.toml"), text + &button).unwrap();
    std::fs::write(&line, "1\n").unwrap();
    robot.start(&[folder.to_str().unwrap()]);
    robot.moves();
    let page = robot.page();
    for pressed in [true, false] {
        if pressed {
            std::fs::write(&line, "0\n").unwrap()
        } else {
            std::fs::write(&line, "").unwrap()
        }
        robot.until("it is latched", || page.word().state() == State::Latched);
        let sources = page.sources();
        assert_eq!((sources[0].name.as_str(), sources[0].held), ("/drivers/button", true));
        robot.stands(20);
        let refused = robot.sinew(&["reset"]);
        assert!(String::from_utf8_lossy(&refused.stderr).contains("/drivers/button holds the stop"), "{refused:?}");
        std::fs::write(&line, "1\n").unwrap();
        robot.until("it can be reset", || robot.sinew(&["reset"]).status.success());
        robot.stands(20);
        assert!(robot.sinew(&["resume"]).status.success());
        robot.moves();
    }
    robot.end();
}

#[test]
fn a_minute_of_chaos_causes_no_contact_leaves_nothing_and_everybody_comes_back() {
    let robot = Robot::new();
    let output = robot.sinew(&["chaos", "--for", "60s", "--seed", "5", "--json", "--name", &robot.name]);
    let words = String::from_utf8_lossy(&output.stdout);
    eprintln!("{words}");
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(told["faults"].as_u64().unwrap() >= 15, "{words}");
    assert_eq!(told["contacts_caused"], 0, "{words}");
    assert_eq!(told["leaks"], 0, "{words}");
    assert_eq!(told["not_recovered"].as_array().unwrap().len(), 0, "{words}");
    assert!(told["distance_m"].as_f64().unwrap() > 1.0, "it went on driving: {words}");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
