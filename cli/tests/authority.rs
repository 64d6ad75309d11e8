//! Attackers against a live robot, from five positions and two without any defence: none moves its wheels, stops its nodes
//! or takes their places, unless the defence is off. The same program is robot, attacker and test.
//!
//! A row is an attempt, a column a position. The wheels are the simulated ones, by the world's own truth. The table in
//! docs/authority.md is what this test finds; SINEW_BLESS=1 writes it anew.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use drivers::p2os::protocol::{Argument, command, encode_command};
use guard::LatchPage;
use guard::latch::State;
use messages::{Command as Wanted, Truth, Twist, bytemuck};
use runtime::channel::{Claim, Geometry, SampleBuffer, Tree};
use runtime::clock;
use rustix::process::{Gid, Pid, Signal, Uid, kill_process};
use rustix::thread::{
    CpuSet, sched_getaffinity, sched_setaffinity, set_thread_groups, set_thread_res_gid, set_thread_res_uid,
};
use std::fs::{self, File};
use std::io::Write;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use supervisor::isolation::{IDENTITY, Ownership};

/// What has not happened by then counts as never [s].
const PATIENCE_S: f64 = 40.0;
/// How long an attack on the wheels goes on [s].
const PUSH_S: f64 = 1.0;
/// Slower than this counts as standing [m/s].
const STANDS_M_S: f64 = 1e-3;
/// An ordinary user, who runs a robot.
const ORDINARY: u32 = 61_100;
/// Another one, who does not.
const OTHER: u32 = 61_101;
/// The node whose place the attacker takes where it is one.
const NODE: &str = "/perception/odometry";

const ATTEMPTS: [(&str, &str); 10] = [
    ("path", "write `/motion/drive/command`"),
    ("map", "open that channel for writing, to map it"),
    ("lock", "open its writer's lock"),
    ("serial", "open the motors' serial port and command them"),
    ("latch", "map the stop latch writable"),
    ("reset", "call `reset`, then `resume`, at the guard"),
    ("call", "ask the supervisor to restart a node"),
    ("schedule", "pin the motion node to another processor"),
    ("signal", "kill the motion node"),
    ("unlink", "remove the channel's file"),
];

/// Where an attacker stands.
#[derive(Debug, Clone)]
struct Position {
    title: &'static str,
    /// User, group and further groups; `None`: those of the test.
    user: Option<(u32, u32)>,
    /// Under the Landlock rules and the filter of the node whose place it takes.
    confined: bool,
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let tree = ["run", "down", "spawn", "node", "tree", "supervise", guard::ROOT_WORD, guard::GUARD_WORD];
    match words.first().map(String::as_str) {
        Some(word) if tree.contains(&word) => sinew::main(&[]),
        Some("attack") => attack(&words[1..]),
        _ if words.iter().any(|word| word == "--list") => ExitCode::SUCCESS,
        _ => {
            test();
            println!("authority ... ok");
            ExitCode::SUCCESS
        }
    }
}

// ---- the attacker ------------------------------------------------------------------------------------------------------

/// `attack ATTEMPT ROOT PID USER:GROUP|- strict|-`: exit code 0 when it was done.
fn attack(words: &[String]) -> ExitCode {
    let [attempt, root, pid, user, confined] = words else { return ExitCode::from(2) };
    let root = PathBuf::from(root);
    if let Some((uid, gid)) = user.split_once(':') {
        let (uid, gid) = (Uid::from_raw(uid.parse().unwrap()), Gid::from_raw(gid.parse().unwrap()));
        if confined != "strict" {
            set_thread_groups(&[]).unwrap();
            set_thread_res_gid(gid, gid, gid).unwrap();
            set_thread_res_uid(uid, uid, uid).unwrap();
        }
    }
    if confined == "strict" {
        // As a node's own program does it, by the same words: SINEW_IDENTITY says which user.
        let file = std::env::var("ATTACK_ROBOT").unwrap();
        let mut robot = robot_of(Path::new(&file));
        let granted = supervisor::isolation::confine(&mut robot, &[NODE.to_owned()], &root).unwrap();
        eprintln!("{granted}");
    }
    let pid = Pid::from_raw(pid.parse().unwrap()).unwrap();
    match attempt_it(attempt, &root, pid) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{attempt}: {why}");
            ExitCode::FAILURE
        }
    }
}

fn attempt_it(attempt: &str, root: &Path, pid: Pid) -> Result<(), String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let ring = root.join("motion/drive/command");
    let writable = |path: &Path| File::options().read(true).write(true).open(path);
    match attempt {
        "path" => {
            let tree = Tree::shared(root).map_err(|e| text(&e))?;
            let geometry = tree.reader("/motion/drive/command", None).map(|ring| ring.geometry().clone());
            let geometry = geometry.unwrap_or_else(|_| Geometry::of::<Wanted>(0, 64));
            // Whoever holds the path is fenced off.
            let mut writer = tree.writer("/motion/drive/command", &geometry, Claim::Fence).map_err(|e| text(&e))?;
            let velocity = Twist { linear_x_m_s: 0.2, ..Twist::default() };
            let wanted = Wanted { velocity, valid_for_s: 0.5, enable: 1 };
            let until = clock::now().after_s(PUSH_S);
            while clock::now() < until {
                writer.publish(clock::now().nanos(), bytemuck::bytes_of(&wanted), &[]);
                clock::sleep_s(0.02);
            }
            Ok(())
        }
        "map" => writable(&ring).map(drop).map_err(|e| text(&e)),
        "lock" => writable(&root.join("motion/drive/.command.lock")).map(drop).map_err(|e| text(&e)),
        "serial" => {
            let places = [root.join(".twins/base/tty"), root.join(".run/base.tty")];
            let opened = places.iter().map(|place| writable(place)).reduce(|best, next| best.or(next)).unwrap();
            let mut port = opened.map_err(|e| text(&e))?;
            let until = clock::now().after_s(PUSH_S);
            while clock::now() < until {
                for (number, argument) in [(command::ENABLE, 1), (command::VEL, 300)] {
                    let mut packet = [0; 16];
                    let length =
                        encode_command(&mut packet, number, Argument::Integer(argument)).map_err(|e| text(&e))?;
                    port.write_all(&packet[..length]).map_err(|e| text(&e))?;
                    clock::sleep_s(0.006);
                }
            }
            Ok(())
        }
        "latch" => {
            let (_, memory) = guard::ask(root, "look", 5.0).map_err(|e| text(&e))?;
            let memory = memory.ok_or("no descriptor")?;
            let path = PathBuf::from(format!("/proc/self/fd/{}", memory.as_raw_fd()));
            let mode = fs::Permissions::from_mode(0o666);
            // Its owner could, by the file's mode alone.
            let _ = fs::set_permissions(&path, mode);
            let again = writable(&path).map_err(|e| text(&e))?;
            LatchPage::map_writable(&again).map(drop).map_err(|e| text(&e))
        }
        "reset" => {
            for word in ["reset", "resume"] {
                let (answer, _) = guard::ask(root, word, 5.0).map_err(|e| text(&e))?;
                if !answer.starts_with("ok ") {
                    return Err(format!("{word}: {answer}"));
                }
            }
            Ok(())
        }
        "call" => {
            let answer = supervisor::ask(root, "restart /coordinator/arbiter", 5.0).map_err(|e| text(&e))?;
            if answer.contains(r#""ok":true"#) { Ok(()) } else { Err(answer) }
        }
        "schedule" => {
            let mut one = CpuSet::new();
            one.set((0..CpuSet::MAX_CPU).find(|&cpu| sched_getaffinity(Some(pid)).unwrap().is_set(cpu)).unwrap());
            sched_setaffinity(Some(pid), &one).map_err(|e| text(&e))
        }
        "signal" => kill_process(pid, Signal::KILL).map_err(|e| text(&e)),
        "unlink" => fs::remove_file(&ring).map_err(|e| text(&e)),
        _ => Err("no such attempt".into()),
    }
}

// ---- the robot ---------------------------------------------------------------------------------------------------------

fn robot_of(file: &Path) -> runtime::robot::Robot {
    let text = fs::read_to_string(file).unwrap();
    let folder = runtime::robot::Resources::Folder(file.parent().unwrap().to_owned());
    let types: Vec<_> =
        [drivers::NODES, perception::NODES, coordinator::NODES, motion::NODES, simulator::NODES].concat();
    runtime::robot::Robot::parse(&text, "robot.toml", folder, &types).unwrap()
}

/// The shipped Pioneer without the actions that would drive it: what moves its wheels is an attack.
struct Robot {
    name: String,
    base: PathBuf,
    file: PathBuf,
    user: Option<u32>,
    child: Option<Child>,
}

impl Robot {
    fn start(word: &str, user: Option<u32>) -> Robot {
        let name = format!("authority_{word}_{}", std::process::id());
        let base = PathBuf::from(format!("/dev/shm/sinew-test-{name}"));
        let folder = base.join("robot");
        fs::create_dir_all(folder.join("worlds")).unwrap();
        let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../robots/pioneer");
        fs::copy(own.join("worlds/office.toml"), folder.join("worlds/office.toml")).unwrap();
        let mut robot: toml::Table = fs::read_to_string(own.join("robot.toml")).unwrap().parse().unwrap();
        robot["robot"]["name"] = name.clone().into();
        robot.remove("limp");
        let nodes = robot["nodes"].as_table_mut().unwrap();
        for action in ["forward", "steer_clear", "echoes"] {
            nodes.remove(action);
        }
        for (_, node) in nodes.iter_mut() {
            node.as_table_mut().unwrap().insert("isolate".into(), "strict".into());
            // Without actions there is nothing that limp mode would leave.
            if let Some(care) = node.get_mut("care").and_then(toml::Value::as_table_mut) {
                care.remove("silence");
                care.insert("loss".into(), "hold".into());
            }
        }
        let reads = nodes["drive"]["reads"].as_table_mut().unwrap();
        reads.insert("ranges".into(), "/drivers/base/sonar".into());
        reads.remove("fallback");
        let file = folder.join("robot.toml");
        fs::write(&file, toml::to_string(&robot).unwrap()).unwrap();
        let mut robot = Robot { name, base, file, user, child: None };
        // A program that other users can run, too.
        let program = robot.base.join("sinew");
        fs::copy(std::env::current_exe().unwrap(), &program).unwrap();
        if let Some(user) = user {
            for entry in [robot.base.clone(), folder.clone(), folder.join("worlds")] {
                std::os::unix::fs::chown(entry, Some(user), Some(user)).unwrap();
            }
        }
        let mut command = robot.command(&["run", "--plain", "--svg", "none", "--seed", "3"]);
        command.arg(&robot.file).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        robot.child = Some(command.spawn().unwrap());
        robot.until("every node runs", || {
            robot.status().is_some_and(|status| status.nodes.iter().all(|node| node.state == "running"))
        });
        robot.until("the world turns", || robot.speed().is_some());
        robot
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(self.base.join("sinew"));
        command.args(words).env("SINEW_SHM", self.base.join("shm")).env("SINEW_STATE", self.base.join("state"));
        if let Some(user) = self.user {
            command.uid(user).gid(user);
        }
        command
    }

    fn root(&self) -> PathBuf {
        self.base.join("shm").join(&self.name)
    }

    fn until(&self, what: &str, mut done: impl FnMut() -> bool) {
        let end = clock::now().after_s(PATIENCE_S);
        while !done() {
            assert!(clock::now() < end, "{}: never: {what}", self.name);
            clock::sleep_s(0.005);
        }
    }

    fn status(&self) -> Option<supervisor::Status> {
        serde_json::from_str(&supervisor::ask(&self.root(), "status", 20.0).ok()?).ok()
    }

    fn pid(&self, instance: &str) -> Option<i32> {
        self.status()?.nodes.into_iter().find(|node| node.instance == instance && node.state == "running")?.pid
    }

    fn state(&self) -> State {
        let (_, memory) = guard::ask(&self.root(), "look", 10.0).unwrap();
        LatchPage::map(memory.unwrap()).unwrap().word().state()
    }

    fn say(&self, word: &str) -> bool {
        guard::ask(&self.root(), word, 10.0).is_ok_and(|(answer, _)| answer.starts_with("ok "))
    }

    fn speed(&self) -> Option<f64> {
        let ring = Tree::shared(&self.root()).ok()?.reader("/simulator/world/truth", None).ok()?;
        let mut buffer = SampleBuffer::new(ring.geometry());
        ring.read(ring.head(), &mut buffer).ok()?;
        let truth: &Truth = bytemuck::from_bytes(buffer.fixed());
        Some(truth.velocity.linear_x_m_s.abs() + truth.velocity.angular_z_rad_s.abs())
    }

    /// Whether the attempt was done, and the greatest speed of the wheels meanwhile.
    fn suffer(&self, attempt: &str, position: &Position) -> (bool, f64) {
        self.until("the wheels rest", || self.speed().is_some_and(|speed| speed < STANDS_M_S));
        self.until("motion runs", || self.pid("/motion/drive").is_some());
        if attempt == "reset" {
            assert!(self.say("stop test\nan attacker is about"));
            self.until("it is latched", || self.state() == State::Latched);
        }
        let drive = self.pid("/motion/drive").unwrap();
        let mut command = Command::new(self.base.join("sinew"));
        let user = match (position.user, position.confined) {
            (Some((uid, gid)), _) => format!("{uid}:{gid}"),
            (None, _) => "-".to_owned(),
        };
        let confined = if position.confined { "strict" } else { "-" };
        command.args(["attack", attempt]).arg(self.root()).args([&drive.to_string(), &user, confined]);
        command.env("ATTACK_ROBOT", &self.file).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        if position.confined
            && self.user.is_none()
            && let Some(identity) = Ownership::of(&robot_of(&self.file)).and_then(|all| all.nodes.get(NODE).cloned())
        {
            command.env(IDENTITY, identity.to_word());
        } else if let Some((uid, gid)) = position.user.filter(|_| position.confined) {
            command.uid(uid).gid(gid);
        }
        let (over, fastest) = (AtomicBool::new(false), AtomicU64::new(0));
        let done = std::thread::scope(|scope| {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    let um_s = (self.speed().unwrap_or(0.0) * 1e6) as u64;
                    fastest.fetch_max(um_s, Ordering::Relaxed);
                    clock::sleep_s(0.005);
                }
            });
            let done = command.status().unwrap().success();
            clock::sleep_s(0.1);
            over.store(true, Ordering::Relaxed);
            done
        });
        let dead = attempt == "signal" && self.pid("/motion/drive") != Some(drive);
        let gone = attempt == "unlink" && !self.root().join("motion/drive/command").exists();
        if !done {
            assert!(!dead && !gone, "{attempt}: said to be refused, and done");
        }
        if attempt == "reset" {
            assert_eq!(self.state() == State::Run, done, "what it says and what the latch says");
            if !done {
                self.until("a person resets", || self.say("reset") && self.say("resume"));
            }
        }
        if attempt == "unlink" && done {
            self.until("the channel is back", || {
                self.root().join("motion/drive/command").exists() || {
                    let _ = self
                        .pid("/motion/drive")
                        .is_some_and(|pid| kill_process(Pid::from_raw(pid).unwrap(), Signal::TERM).is_ok());
                    false
                }
            });
        }
        (done, fastest.load(Ordering::Relaxed) as f64 * 1e-6)
    }

    /// Every node is what the robot file says, by the kernel's word.
    fn is_confined(&self, own_users: bool) {
        let own = fs::read_to_string("/proc/self/status").unwrap();
        let filters = |text: &str| field(text, "Seccomp_filters");
        let mut users = std::collections::BTreeSet::new();
        for node in self.status().unwrap().nodes {
            let text = fs::read_to_string(format!("/proc/{}/status", node.pid.unwrap())).unwrap();
            assert_eq!(field(&text, "NoNewPrivs"), 1, "{}", node.instance);
            assert_eq!(filters(&text), filters(&own) + 1, "{}", node.instance);
            users.insert(field(&text, "Uid"));
            let ring = self.root().join(node.instance.trim_start_matches('/')).join("statistics");
            let found = fs::metadata(ring).unwrap();
            assert_eq!(found.mode() & 0o777, 0o640, "{}", node.instance);
            assert_eq!(u64::from(found.uid()), field(&text, "Uid"), "{}", node.instance);
        }
        assert_eq!(users.len(), if own_users { 5 } else { 1 }, "{users:?}");
        assert!(!own_users || !users.contains(&0));
    }
}

fn field(text: &str, name: &str) -> u64 {
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':')).unwrap();
    line.split_ascii_whitespace().next().unwrap().parse().unwrap()
}

impl Drop for Robot {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            if let Some(owner) = supervisor::owner(&self.root()) {
                let _ = kill_process(Pid::from_raw(owner.pid).unwrap(), Signal::KILL);
            }
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = fs::remove_dir_all(&self.base);
    }
}

// ---- the table ---------------------------------------------------------------------------------------------------------

/// The outcomes of every attempt from `position`, checked against whether there is a defence.
fn column(robot: &Robot, position: &Position, defended: bool) -> Vec<bool> {
    let outcomes = ATTEMPTS.iter().map(|(attempt, _)| {
        let (done, fastest) = robot.suffer(attempt, position);
        println!("{:<8} {:<40} {} ({fastest:.3} m/s)", attempt, position.title, if done { "DONE" } else { "refused" });
        assert_eq!(done, !defended, "{attempt} from: {}", position.title);
        if defended {
            assert!(fastest < STANDS_M_S, "{attempt} from: {}: the wheels turned at {fastest} m/s", position.title);
        } else if ["path", "serial"].contains(attempt) {
            assert!(fastest > 0.02, "{attempt}: without a defence the wheels turn, at {fastest} m/s here");
        }
        done
    });
    outcomes.collect()
}

fn test() {
    let kernel = (supervisor::isolation::landlock().flaw(), supervisor::isolation::seccomp());
    if let (Some(flaw), _) | (_, Some(flaw)) = kernel {
        println!("skipped: {flaw}");
        return;
    }
    let position = |title, user, confined| Position { title, user, confined };
    if !rustix::process::geteuid().is_root() {
        println!("not root: the rows of other users are skipped");
        let robot = Robot::start("same", None);
        robot.is_confined(false);
        column(&robot, &position("a confined node of the same user", None, true), true);
        column(&robot, &position("the same user, not confined", None, false), false);
        return;
    }
    let strict = Robot::start("root", None);
    strict.is_confined(true);
    let spawn = ["spawn", "forward", "--at", "creep", "--period", "400", "--budget", "0.01", "--read"];
    let spawned = strict.command(&[&spawn[..], &["ranges=/drivers/base/sonar"]].concat()).output().unwrap();
    let said = String::from_utf8_lossy(&spawned.stderr);
    assert!(
        !spawned.status.success() && said.contains("isolated by users"),
        "a newcomer has no user of its own: {said}"
    );
    let ownership = Ownership::of(&robot_of(&strict.file)).unwrap();
    let node = ownership.nodes[NODE].clone();
    let same = Robot::start("user", Some(ORDINARY));
    same.is_confined(false);
    let columns = [
        (&strict, position("another user", Some((OTHER, OTHER)), false), true),
        (&strict, position("a stranger in the robot's group", Some((OTHER, node.gid)), false), true),
        (&strict, position("another node's user (users alone)", Some((node.uid, node.gid)), false), true),
        (
            &same,
            position("a strict node of the same user (Landlock and seccomp alone)", Some((ORDINARY, ORDINARY)), true),
            true,
        ),
        (&strict, position("a strict node with its own user", None, true), true),
        (&same, position("the same user, not isolated", Some((ORDINARY, ORDINARY)), false), false),
    ];
    let outcomes: Vec<Vec<bool>> =
        columns.iter().map(|(robot, position, defended)| column(robot, position, *defended)).collect();
    let mut table = String::from("| attempt |");
    columns.iter().for_each(|(_, position, _)| table += &format!(" {} |", position.title));
    table += "\n|---|";
    columns.iter().for_each(|_| table += "---|");
    for (row, (_, title)) in ATTEMPTS.iter().enumerate() {
        table += &format!("\n| {title} |");
        outcomes.iter().for_each(|column| table += if column[row] { " **done** |" } else { " refused |" });
    }
    println!("{table}");
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs/authority.md");
    let text = fs::read_to_string(&file).unwrap();
    let (begin, end) = ("<!-- table: begin -->\n", "\n<!-- table: end -->");
    let (before, rest) = text.split_once(begin).unwrap();
    let (shown, after) = rest.split_once(end).unwrap();
    if std::env::var_os("SINEW_BLESS").is_some() {
        fs::write(&file, format!("{before}{begin}{table}{end}{after}")).unwrap();
        return;
    }
    assert_eq!(
        shown, table,
        "docs/authority.md is stale: SINEW_BLESS=1 cargo test --release -p sinew --test authority"
    );
}
