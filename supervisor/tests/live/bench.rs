//! Robots made of shell scripts, in private folders, supervised in this process or in one of their own.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;

use runtime::clock;
use supervisor::{Outcome, Plan, Program, Record, Report, StopHandle, SuperviseError};

/// Says that it is ready and lives for a bounded time.
pub const READY: &str = "echo >&3; exec 3>&-; exec sleep 60";
/// The same, but deaf to SIGTERM.
pub const DEAF: &str = "trap '' TERM; echo >&3; exec 3>&-; for n in $(seq 600); do sleep 0.1; done";

/// A private /dev/shm/sinew, and a folder for logs and what scripts write; both go with it, processes included.
pub struct Place {
    pub base: PathBuf,
    shm: PathBuf,
}

impl Place {
    pub fn new() -> Place {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("sinew-test-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        // The scripts' files lie elsewhere: another test may be filling /dev/shm on purpose.
        let base = std::env::temp_dir().join(&name);
        fs::create_dir_all(&base).unwrap();
        Place { base, shm: Path::new("/dev/shm").join(name) }
    }

    pub fn shm(&self) -> PathBuf {
        self.shm.clone()
    }

    pub fn root(&self) -> PathBuf {
        self.shm().join("robot")
    }

    pub fn logs(&self) -> PathBuf {
        self.base.join("state/robot")
    }

    pub fn plan(&self, programs: Vec<Program>) -> Plan {
        let mut plan = Plan::new("robot", programs);
        plan.root = self.root();
        plan.log_folder = Some(self.logs());
        plan
    }

    /// Everything of the run is gone: the folder, and every process that carries its folder's name.
    pub fn assert_nothing_left(&self) {
        assert!(!self.shm().exists(), "files are left: {:?}", fs::read_dir(self.shm()).map(Iterator::count));
        assert_eq!(self.processes(), Vec::<i32>::new(), "processes are left");
    }

    /// Processes whose environment names this place's root, but supervisors.
    pub fn processes(&self) -> Vec<i32> {
        let mark = format!("SINEW_ROOT={}", self.root().display());
        let entries = fs::read_dir("/proc").unwrap().flatten();
        let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
        let carries = |pid: i32| {
            // A process in the middle of exec shows no environment for a moment.
            let looks = (0..20).map(|look| {
                clock::sleep_s(f64::from(look) * 0.001);
                fs::read(format!("/proc/{pid}/environ")).unwrap_or_default()
            });
            let environment = looks.into_iter().find(|environment| !environment.is_empty()).unwrap_or_default();
            environment.split(|&byte| byte == 0).any(|entry| entry == mark.as_bytes())
        };
        let has_program = |pid: &i32| fs::read_link(format!("/proc/{pid}/exe")).is_ok();
        pids.filter(has_program).filter(|&pid| carries(pid)).collect()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        for pid in self.processes() {
            kill(pid, rustix::process::Signal::KILL);
        }
        let _ = fs::remove_dir_all(&self.base);
        let _ = fs::remove_dir_all(&self.shm);
    }
}

pub fn kill(pid: i32, signal: rustix::process::Signal) {
    let _ = rustix::process::kill_process(rustix::process::Pid::from_raw(pid).unwrap(), signal);
}

/// A node that is a shell script.
pub fn node(instance: &str, script: &str) -> Program {
    Program::new(instance, ["/bin/sh", "-c", script])
}

/// What an observer was told, to keep.
#[derive(Debug, Clone)]
pub enum Told {
    Note(String),
    Started { instance: String, pid: i32, at: runtime::Time },
    Ready { instance: String, at: runtime::Time },
    Incident(Record),
    Robot(String),
}

impl Told {
    fn from(report: Report<'_>) -> Told {
        let at = clock::now();
        match report {
            Report::Note(line) => Told::Note(line.to_owned()),
            Report::Started { instance, pid, .. } => Told::Started { instance: instance.to_owned(), pid, at },
            Report::Ready { instance } => Told::Ready { instance: instance.to_owned(), at },
            Report::Incident(record) => Told::Incident(record.clone()),
            Report::Robot(state) => Told::Robot(state.word().to_owned()),
        }
    }
}

/// A robot that is supervised by a thread of this process.
pub struct Local {
    pub stop: StopHandle,
    told: Receiver<Told>,
    thread: Option<JoinHandle<Result<Outcome, SuperviseError>>>,
}

impl Local {
    pub fn run(mut plan: Plan) -> Local {
        let stop = StopHandle::new().unwrap();
        plan.stop = Some(stop.clone());
        let (sender, told) = channel();
        let mut observer = move |report: Report<'_>| {
            let _ = sender.send(Told::from(report));
        };
        let thread = std::thread::spawn(move || supervisor::run(plan, &mut observer));
        Local { stop, told, thread: Some(thread) }
    }

    /// Waits until `wanted` finds what it looks for in what is told.
    pub fn until<T>(&self, mut wanted: impl FnMut(&Told) -> Option<T>) -> T {
        loop {
            let told = self.told.recv().expect("the run ended before it happened");
            if let Some(found) = wanted(&told) {
                return found;
            }
        }
    }

    /// Waits until the node is ready; its process.
    pub fn until_ready(&self, wanted: &str) -> i32 {
        let mut newest = 0;
        self.until(|told| match told {
            Told::Started { instance, pid, .. } if instance == wanted => {
                newest = *pid;
                None
            }
            Told::Ready { instance, .. } if instance == wanted => Some(newest),
            _ => None,
        })
    }

    pub fn until_incident(&self, event: &str) -> Record {
        self.until(|told| match told {
            Told::Incident(record) if record.event == event => Some(record.clone()),
            _ => None,
        })
    }

    pub fn end(self) -> Result<Outcome, SuperviseError> {
        self.stop.stop();
        self.join()
    }

    pub fn join(mut self) -> Result<Outcome, SuperviseError> {
        self.thread.take().unwrap().join().unwrap()
    }
}

impl Drop for Local {
    /// A test that failed leaves no robot running.
    fn drop(&mut self) {
        if let Some(thread) = self.thread.take() {
            self.stop.stop();
            self.stop.stop();
            let _ = thread.join();
        }
    }
}

/// A robot that is supervised by a process of its own: this test program, run again.
pub struct Remote {
    pub process: Child,
    lines: BufReader<ChildStdout>,
}

impl Remote {
    /// Nodes are given as name and script; all report ready and share `grace_s`.
    pub fn run(place: &Place, nodes: &[(&str, &str)], grace_s: f64) -> Remote {
        let nodes: Vec<String> = nodes.iter().map(|(name, script)| format!("{name}\u{1}{script}")).collect();
        let mut process = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "supervises_as_a_process_of_its_own", "--nocapture"])
            .env("SUPERVISOR_TEST_NODES", nodes.join("\u{2}"))
            .env("SUPERVISOR_TEST_GRACE_S", grace_s.to_string())
            .env("SINEW_SHM", place.shm())
            .env("SINEW_STATE", place.base.join("state"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(process.stdout.take().unwrap());
        Remote { process, lines }
    }

    /// Waits for a line that begins with `start`, and returns the rest of it.
    pub fn until(&mut self, start: &str) -> String {
        let mut seen = String::new();
        loop {
            let mut line = String::new();
            assert_ne!(self.lines.read_line(&mut line).unwrap(), 0, "no line `{start}…` in:\n{seen}");
            if let Some(rest) = line.strip_prefix(start) {
                return rest.trim().to_owned();
            }
            seen.push_str(&line);
        }
    }

    /// Waits until all these nodes are ready, in whatever order.
    pub fn until_ready(&mut self, nodes: &[&str]) {
        let mut waiting: Vec<&str> = nodes.to_vec();
        while !waiting.is_empty() {
            let node = self.until("ready ");
            waiting.retain(|&waited| waited != node);
        }
    }

    pub fn signal(&self, signal: rustix::process::Signal) {
        kill(self.process.id() as i32, signal);
    }

    pub fn ended(mut self) {
        self.process.wait().unwrap();
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The other side of `Remote`: what the test program does when it is run as a supervisor.
pub fn supervise_for_remote() {
    let Ok(nodes) = std::env::var("SUPERVISOR_TEST_NODES") else { return };
    // A hanging supervisor must not outlive its test for long.
    std::thread::spawn(|| {
        clock::sleep_s(90.0);
        std::process::exit(99);
    });
    let grace_s = std::env::var("SUPERVISOR_TEST_GRACE_S").unwrap().parse().unwrap();
    let program = |text: &str| {
        let (name, script) = text.split_once('\u{1}').unwrap();
        let mut program = node(name, script);
        program.rule.grace_s = grace_s;
        // Nodes of a robot under test must not believe that they are supervisors.
        program.env.push(("SUPERVISOR_TEST_NODES".into(), "".into()));
        program
    };
    let plan = Plan::new("robot", nodes.split('\u{2}').map(program).collect());
    println!();
    let result = supervisor::run(plan, &mut |report: Report<'_>| match report {
        Report::Note(line) => println!("note {line}"),
        Report::Started { instance, pid, .. } => println!("started {instance} {pid}"),
        Report::Ready { instance } => println!("ready {instance}"),
        Report::Incident(record) => println!("{} {} {}", record.event, record.node, record.message),
        Report::Robot(state) => println!("robot {}", state.word()),
    });
    match result {
        Ok(outcome) => println!("ended by {}", outcome.stopped_by),
        Err(error) => println!("refused {error}"),
    }
}

/// What `path` holds once somebody has written a whole line into it.
pub fn line_from(path: &Path) -> String {
    loop {
        let text = fs::read_to_string(path).unwrap_or_default();
        if text.ends_with('\n') {
            return text;
        }
        std::thread::yield_now();
    }
}
