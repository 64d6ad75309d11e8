//! Nodes that misbehave in every way that nodes do, beside one that behaves: each is seen for what it is, the other
//! goes on, and nothing is left. The same program is the robot and its test.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use messages::Proposal;
use runtime::clock;
use serde::Deserialize;
use sinew::{Fault, Layer, Node, NodeType, OpenError, Ports, Time, Writer};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
enum How {
    #[default]
    Well,
    CrashAtStart,
    CrashAfter,
    HangBeforeReady,
    HangInStep,
    Spin,
    IgnoreTheEnd,
    LeakMemory,
    LeakDescriptors,
    Flap,
    ForkAndCrash,
    ExitZero,
    BlockInTheKernel,
    PublishTooOften,
}

#[derive(Debug, Clone, Default, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Config {
    how: How,
}

struct Misbehaving {
    how: How,
    steps: u32,
    proposal: Writer<Proposal>,
    memory: Vec<Vec<u8>>,
    descriptors: Vec<File>,
}

/// Steps before it shows.
const FINE_STEPS: u32 = 40;

impl Node for Misbehaving {
    const TYPE: &'static str = "misbehaving";
    const LAYER: Layer = Layer::Actions;
    type Config = Config;

    fn open(ports: &mut Ports, config: Config) -> Result<Misbehaving, OpenError> {
        let proposal = ports.writer("proposal")?;
        Ok(Misbehaving { how: config.how, steps: 0, proposal, memory: Vec::new(), descriptors: Vec::new() })
    }

    fn start(&mut self, _now: Time) -> Result<(), Fault> {
        match self.how {
            How::CrashAtStart => std::process::abort(),
            How::HangBeforeReady => clock::sleep_s(3600.0),
            _ => {}
        }
        Ok(())
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.steps += 1;
        let copies = if self.how == How::PublishTooOften { 100 } else { 1 };
        for _ in 0..copies {
            self.proposal.write(now, &Proposal::default());
        }
        match self.how {
            How::LeakMemory => self.memory.push(vec![1; 1 << 20]),
            How::LeakDescriptors => match File::open("/dev/null") {
                Ok(file) => self.descriptors.push(file),
                Err(_) => return Err(Fault::new("no descriptor is left")),
            },
            _ if self.steps < FINE_STEPS => {}
            How::CrashAfter | How::Flap => std::process::abort(),
            How::ForkAndCrash => {
                let _ = Command::new("sleep").arg("60").spawn();
                std::process::abort();
            }
            How::HangInStep => clock::sleep_s(3600.0),
            How::Spin => loop {
                std::hint::spin_loop();
            },
            How::ExitZero => std::process::exit(0),
            How::BlockInTheKernel => {
                let (read, _write) = std::io::pipe().unwrap();
                let _ = std::io::Read::read(&mut &read, &mut [0]);
            }
            _ => {}
        }
        Ok(())
    }

    fn stop(&mut self, _now: Time) {
        if self.how == How::IgnoreTheEnd {
            clock::sleep_s(3600.0);
        }
    }
}

/// A robot of a node that behaves and one that does not, run for a while; what the incidents say of each.
struct Seen {
    misfit: Vec<supervisor::Record>,
    steady: Vec<supervisor::Record>,
    left: Vec<String>,
    ended_well: bool,
}

fn run(how: &str, seconds: u32) -> Seen {
    let name = format!("misfit_{}", std::process::id());
    let base = PathBuf::from(format!("/dev/shm/sinew-test-{name}"));
    let robot = base.join("robot.toml");
    std::fs::create_dir_all(&base).unwrap();
    let text = format!(
        "[robot]\nname = \"{name}\"\n\
         [nodes.steady]\ntype = \"misbehaving\"\nperiod_ms = 20\n\
         [nodes.misfit]\ntype = \"misbehaving\"\nperiod_ms = 20\nconfig = {{ how = \"{how}\" }}\n"
    );
    std::fs::write(&robot, text).unwrap();
    let (shm, state) = (base.join("shm"), base.join("state"));
    let status = Command::new(std::env::current_exe().unwrap())
        .arg("run")
        .arg(&robot)
        .args(["--plain", "--svg", "none", "--for", &format!("{seconds}s")])
        .env("SINEW_SHM", &shm)
        .env("SINEW_STATE", &state)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .unwrap();
    let text = std::fs::read_to_string(state.join(&name).join("incidents.jsonl")).unwrap_or_default();
    let records: Vec<supervisor::Record> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |node: &str| records.iter().filter(|record| record.node.ends_with(node)).cloned().collect();
    let mut left = processes(&shm);
    left.extend(shm.join(&name).exists().then(|| "files".to_owned()));
    let seen = Seen { misfit: of("misfit"), steady: of("steady"), left, ended_well: status.success() };
    let _ = std::fs::remove_dir_all(base);
    seen
}

/// Processes that carry the folder in their environment.
fn processes(shm: &Path) -> Vec<String> {
    let mark = format!("SINEW_SHM={}", shm.display());
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    let carries = |entry: &std::fs::DirEntry| {
        let environment = std::fs::read(entry.path().join("environ")).unwrap_or_default();
        environment.split(|byte| *byte == 0).any(|variable| variable == mark.as_bytes())
    };
    entries.filter(carries).map(|entry| format!("process {}", entry.file_name().to_string_lossy())).collect()
}

/// What each must be seen as: an event of the record, and a part of its sentence.
const CASES: [(&str, u32, &str, &str); 14] = [
    ("well", 2, "", ""),
    ("crash_at_start", 3, "died", "SIGABRT"),
    ("crash_after", 3, "died", "SIGABRT"),
    ("hang_before_ready", 8, "hung", "hung at its start"),
    ("hang_in_step", 4, "hung", "beats missed"),
    ("spin", 4, "hung", "beats missed"),
    ("ignore_the_end", 2, "killed", "did not stop within"),
    ("leak_memory", 3, "", ""),
    ("leak_descriptors", 3, "", ""),
    ("flap", 25, "died", "restart in"),
    ("fork_and_crash", 3, "died", "SIGABRT"),
    ("exit_zero", 3, "died", "exited with code 0"),
    ("block_in_the_kernel", 4, "hung", "beats missed"),
    ("publish_too_often", 3, "", ""),
];

fn judge(case: &(&str, u32, &str, &str)) -> Result<(), String> {
    let (how, seconds, event, words) = *case;
    let seen = run(how, seconds);
    let told = |records: &[supervisor::Record]| {
        records.iter().map(|r| format!("{}: {}", r.event, r.message)).collect::<Vec<_>>().join("; ")
    };
    let as_expected = match event {
        "" => seen.misfit.iter().all(|record| record.event != "died"),
        event => seen.misfit.iter().any(|record| record.event == event && record.message.contains(words)),
    };
    if !as_expected {
        return Err(format!("seen as: {}", told(&seen.misfit)));
    }
    if seen.steady.iter().any(|record| record.event == "died" || record.event == "hung") {
        return Err(format!("its neighbour suffered: {}", told(&seen.steady)));
    }
    match (seen.left.as_slice(), seen.ended_well) {
        ([], true) => Ok(()),
        ([], false) => Err("the run did not end well".to_owned()),
        (left, _) => Err(format!("left behind: {}", left.join(", "))),
    }
}

fn main() -> ExitCode {
    let first = std::env::args().nth(1).unwrap_or_default();
    let commands = ["run", "node", "tree", "supervise", guard::ROOT_WORD, guard::GUARD_WORD];
    if commands.contains(&first.as_str()) {
        return sinew::main(&[NodeType::of::<Misbehaving>()]);
    }
    if std::env::args().any(|argument| argument == "--list") {
        return ExitCode::SUCCESS;
    }
    let wanted: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    let mut failed = 0;
    for case in CASES.iter().filter(|case| wanted.is_empty() || wanted.iter().any(|word| case.0.contains(word))) {
        let result = judge(case);
        failed += u32::from(result.is_err());
        println!("a node that misbehaves: {} ... {}", case.0, result.map_or_else(|why| why, |()| "ok".to_owned()));
    }
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
