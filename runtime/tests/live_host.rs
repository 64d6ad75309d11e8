//! The live host in real processes: this test program starts itself again as the node processes.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use messages::Twist;
use runtime::channel::{PrivateWord, RawReader, SampleBuffer, Tree, Waiter};
use runtime::live::{self, LiveOptions};
use runtime::robot::{Resources, Robot};
use runtime::{Fault, Layer, Node, NodeType, OpenError, Ports, Reader, Time, Writer, clock};
use schemars::JsonSchema;
use serde::Deserialize;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct NoConfig {}

/// Counts its steps.
struct Clockwork(f64, Writer<Twist>);

impl Node for Clockwork {
    const TYPE: &'static str = "clockwork";
    const LAYER: Layer = Layer::Drivers;
    type Config = NoConfig;

    fn open(ports: &mut Ports, _config: NoConfig) -> Result<Self, OpenError> {
        Ok(Clockwork(0.0, ports.writer("ticks")?))
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.0 += 1.0;
        self.1.write(now, &Twist { linear_x_m_s: self.0, ..Twist::default() });
        Ok(())
    }
}

/// Passes every tick on; says so when it is stopped in order.
struct Relay(Reader<Twist>, Writer<Twist>);

impl Node for Relay {
    const TYPE: &'static str = "relay";
    const LAYER: Layer = Layer::Perception;
    type Config = NoConfig;

    fn open(ports: &mut Ports, _config: NoConfig) -> Result<Self, OpenError> {
        Ok(Relay(ports.reader("ticks")?, ports.writer("seen")?))
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        while let Some(tick) = self.0.next_unread() {
            self.1.write(now, tick.message);
        }
        Ok(())
    }

    fn stop(&mut self, now: Time) {
        self.1.write(now, &Twist { linear_x_m_s: -1.0, ..Twist::default() });
    }
}

const TYPES: &[NodeType] = &[NodeType::of::<Clockwork>(), NodeType::of::<Relay>()];

const TOY: &str = r#"
[robot]
name = "toy"
[realtime]
scheduler = "fifo"
lock_memory = true
[nodes.clock]
type = "clockwork"
period_ms = 5
[nodes.relay]
type = "relay"
trigger = "ticks"
reads.ticks = "/drivers/clock/ticks"
"#;

fn robot() -> Robot {
    Robot::parse(TOY, "toy.toml", Resources::Folder(".".into()), TYPES).unwrap()
}

/// Not a test of its own: what the child processes run.
#[test]
fn node_process() {
    let Ok(nodes) = std::env::var("TOY_NODES") else { return };
    let options = LiveOptions {
        root: std::env::var("TOY_ROOT").unwrap().into(),
        seed: 1,
        supervisor: std::env::var("TOY_SUPERVISOR").ok().map(|pid| pid.parse().unwrap()),
        fence: false,
        tree: None,
        go: None,
    };
    let paths: Vec<String> = nodes.split(' ').map(str::to_owned).collect();
    let done = live::run(&robot(), &paths, &options, |grants| {
        for grant in grants {
            eprintln!("granted: {grant}");
        }
    });
    std::process::exit(match done {
        Ok(()) => 0,
        Err(e) => {
            eprintln!("{e}");
            1
        }
    });
}

/// A robot's folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let folder = PathBuf::from(format!("/dev/shm/sinew-test-live-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        let tree = Tree::shared(&folder).unwrap();
        for node in robot().graph().unwrap().nodes {
            for written in node.writes {
                tree.prepare(&written.path, &written.geometry).unwrap();
            }
        }
        Folder(folder)
    }

    fn reader(&self, path: &str) -> RawReader {
        Tree::shared(&self.0).unwrap().reader(path, None).unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A process of nodes, killed at the end of the test if it still lives.
struct Process(Child);

impl Process {
    fn start(root: &Path, nodes: &str, change: impl FnOnce(&mut Command)) -> Process {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["node_process", "--exact", "--nocapture"]);
        command.env("TOY_NODES", nodes).env("TOY_ROOT", root).stdout(Stdio::null()).stderr(Stdio::piped());
        change(&mut command);
        Process(command.spawn().unwrap())
    }

    fn terminate(&self) {
        let pid = rustix::process::Pid::from_child(&self.0);
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    }

    fn words(&mut self) -> String {
        let mut words = String::new();
        self.0.stderr.take().unwrap().read_to_string(&mut words).unwrap();
        words
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until the ring holds a sample that `good` accepts; false after ten seconds without one.
fn sees(ring: &RawReader, mut good: impl FnMut(&Twist, u64) -> bool) -> bool {
    let private = PrivateWord::new();
    let mut waiter = Waiter::new(&private, vec![ring.word()]).unwrap();
    let mut buffer = SampleBuffer::new(ring.geometry());
    let end = clock::now().after_s(10.0);
    let mut next = 1;
    while clock::now() < end {
        waiter.snapshot();
        while next <= ring.head() {
            if let Ok(raw) = ring.read(next, &mut buffer)
                && good(messages::bytemuck::from_bytes(buffer.fixed()), raw.generation)
            {
                return true;
            }
            next += 1;
        }
        waiter.wait(Some(end.nanos()));
    }
    false
}

#[test]
fn samples_flow_between_processes_and_an_ordered_stop_runs_stop_and_leaves_no_socket() {
    let folder = Folder::new("flow");
    let _clock = Process::start(&folder.0, "/drivers/clock", |_| {});
    let mut relay = Process::start(&folder.0, "/perception/relay", |_| {});
    let seen = folder.reader("/perception/relay/seen");
    assert!(sees(&seen, |tick, _| tick.linear_x_m_s > 20.0), "ticks reach the relay: {}", relay.words());
    assert!(folder.0.join("perception/relay/.calls").exists());
    relay.terminate();
    assert!(sees(&seen, |tick, _| tick.linear_x_m_s == -1.0), "stop ran");
    assert!(relay.0.wait().unwrap().success());
    assert!(!folder.0.join("perception/relay/.calls").exists());
}

#[test]
fn a_killed_node_continues_its_ring_with_the_next_generation_and_its_reader_goes_on() {
    let folder = Folder::new("kill");
    let mut clock = Process::start(&folder.0, "/drivers/clock", |_| {});
    let _relay = Process::start(&folder.0, "/perception/relay", |_| {});
    let (ticks, seen) = (folder.reader("/drivers/clock/ticks"), folder.reader("/perception/relay/seen"));
    assert!(sees(&seen, |tick, _| tick.linear_x_m_s > 5.0));
    clock.0.kill().unwrap();
    clock.0.wait().unwrap();
    let head = ticks.head();
    let _again = Process::start(&folder.0, "/drivers/clock", |_| {});
    assert!(sees(&ticks, |_, generation| generation == 2), "the next generation writes");
    assert!(ticks.head() > head, "into the same ring");
    let before = seen.head();
    assert!(sees(&seen, |tick, _| tick.linear_x_m_s > 0.0 && seen.head() > before), "the relay saw it");
}

#[test]
fn two_nodes_of_one_process_share_it_as_threads() {
    let folder = Folder::new("group");
    let mut both = Process::start(&folder.0, "/drivers/clock /perception/relay", |_| {});
    let seen = folder.reader("/perception/relay/seen");
    assert!(sees(&seen, |tick, _| tick.linear_x_m_s > 20.0));
    let writers = [folder.reader("/drivers/clock/ticks").writer_pid(), seen.writer_pid()];
    assert_eq!(writers, [Some(both.0.id()), Some(both.0.id())]);
    both.terminate();
    assert!(both.0.wait().unwrap().success());
}

#[test]
fn a_second_writer_of_a_path_is_refused_by_the_name_of_the_first() {
    let folder = Folder::new("second");
    let first = Process::start(&folder.0, "/drivers/clock", |_| {});
    assert!(sees(&folder.reader("/drivers/clock/ticks"), |_, _| true));
    let mut second = Process::start(&folder.0, "/drivers/clock", |_| {});
    assert!(!second.0.wait().unwrap().success());
    let words = second.words();
    assert!(words.contains(&format!("has a writer already, process {}", first.0.id())), "{words}");
}

#[test]
fn nodes_stop_by_themselves_when_their_supervisor_has_died() {
    let folder = Folder::new("orphan");
    let mut supervisor = Command::new("sleep").arg("60").spawn().unwrap();
    let pid = supervisor.id().to_string();
    let mut clock = Process::start(&folder.0, "/drivers/clock", |command| {
        command.env("TOY_SUPERVISOR", pid);
    });
    assert!(sees(&folder.reader("/drivers/clock/ticks"), |_, _| true));
    supervisor.kill().unwrap();
    supervisor.wait().unwrap();
    assert!(clock.0.wait().unwrap().success(), "an ordered stop: {}", clock.words());
}

#[test]
fn a_user_without_real_time_rights_is_told_what_was_refused_and_the_node_runs_all_the_same() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("skipped: only root can become a user who surely has no real-time rights");
        return;
    }
    let folder = Folder::new("nobody");
    for entry in ["", "drivers", "drivers/clock"] {
        std::os::unix::fs::chown(folder.0.join(entry), Some(65534), Some(65534)).unwrap();
    }
    for file in std::fs::read_dir(folder.0.join("drivers/clock")).unwrap() {
        std::os::unix::fs::chown(file.unwrap().path(), Some(65534), Some(65534)).unwrap();
    }
    let copy = folder.0.join("test-program");
    std::fs::copy(std::env::current_exe().unwrap(), &copy).unwrap();
    std::fs::set_permissions(&copy, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let mut command = Command::new(&copy);
    command.args(["node_process", "--exact", "--nocapture"]).uid(65534).gid(65534);
    command.env("TOY_NODES", "/drivers/clock").env("TOY_ROOT", &folder.0).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut clock = Process(command.spawn().unwrap());
    let runs = sees(&folder.reader("/drivers/clock/ticks"), |tick, _| tick.linear_x_m_s > 3.0);
    clock.terminate();
    let words = clock.words();
    assert!(runs, "{words}");
    assert!(words.contains("scheduler REFUSED: SCHED_FIFO 50 refused") && words.contains("CAP_SYS_NICE"), "{words}");
}
