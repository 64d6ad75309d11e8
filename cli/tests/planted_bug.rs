//! A bug that is planted is found by a batch of seeds, shrunk to the few faults that it needs, and replayed from the
//! commands of the report. The same program is the robot, which has an action that ignores one sonar, and its test.
#![allow(clippy::unwrap_used, reason = "tests")]

use actions::steer_clear::{Memory, SteerClearConfig, steer};
use messages::{Beam, FreeSectors, Proposal, Ranges};
use serde::Deserialize;
use sinew::{Fault, Layer, Node, NodeType, OpenError, Ports, Reader, Time, Writer};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Output};

#[derive(Debug, Clone, Default, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Config {
    steer: SteerClearConfig,
}

/// Steers clear, and does not look at the sonar at +10°.
struct Deaf {
    ranges: Reader<Ranges>,
    proposal: Writer<Proposal>,
    free_sectors: Writer<FreeSectors>,
    memory: Memory,
    answered: Option<(u64, u64)>,
    heard: Vec<Beam>,
    config: SteerClearConfig,
}

/// Sonars of a Pioneer, and the bearing of the one that is ignored, 10° to the left [rad].
const SONARS: usize = 16;
const IGNORED_RAD: f32 = 0.1745;

impl Node for Deaf {
    const TYPE: &'static str = "deaf_steer_clear";
    const LAYER: Layer = Layer::Actions;
    type Config = Config;

    fn open(ports: &mut Ports, config: Config) -> Result<Deaf, OpenError> {
        Ok(Deaf {
            ranges: ports.reader("ranges")?,
            proposal: ports.writer("proposal")?,
            free_sectors: ports.writer("free_sectors")?,
            memory: Memory::default(),
            answered: None,
            heard: Vec::with_capacity(SONARS),
            config: config.steer,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let Some(ranges) = self.ranges.fresh(now) else { return Ok(()) };
        let packet = Some((ranges.generation, ranges.sequence));
        if packet == self.answered {
            return Ok(());
        }
        self.answered = packet;
        self.heard.clear();
        let heard = |beam: &&Beam| (beam.bearing_rad - IGNORED_RAD).abs() > 0.05;
        self.heard.extend(ranges.tail.iter().take(SONARS).filter(heard));
        let (proposal, free_sectors) = steer(&self.heard, &self.config, &mut self.memory);
        self.proposal.write(now, &proposal);
        self.free_sectors.write(now, &free_sectors);
        Ok(())
    }
}

/// Seeds of the batch. On them the healthy robot touches nothing.
const SEEDS: &str = "0..45";
/// Nothing but the action keeps the robot from the walls: motion's stop zone would hide the bug.
const MISSION: [&str; 8] = [
    "--for",
    "60s",
    "--faults",
    "chaos",
    "--set",
    "nodes.drive.config.horizon_m=0.0",
    "--set",
    "nodes.forward.config.speed_m_s=0.15",
];
const PLANTED: &str = "nodes.steer_clear.type=\"deaf_steer_clear\"";

struct Bench {
    folder: PathBuf,
}

impl Bench {
    fn sinew(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(arguments).current_dir(&self.folder).output().unwrap()
    }

    fn json(&self, arguments: &[&str]) -> (i32, serde_json::Value) {
        let output = self.sinew(arguments);
        let value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&output.stderr)));
        (output.status.code().unwrap(), value)
    }

    /// A command as a report or a shrinking prints it, in a shell.
    fn shell(&self, command: &str) -> (i32, String) {
        let output = Command::new("sh").args(["-c", command]).current_dir(&self.folder).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        (output.status.code().unwrap(), text)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.join(name)).unwrap()
    }
}

/// Arguments of the batch.
fn batch<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["simulate", "--seeds", SEEDS, "--json"], &MISSION[..], more].concat()
}

fn end_to_end(folder: &Path) {
    let bench = Bench { folder: folder.to_owned() };

    // Healthy: no contact on these seeds, whatever the faults.
    let (code, healthy) = bench.json(&batch(&["--csv", "healthy.csv"]));
    assert_eq!((code, &healthy["succeeded"]), (0, &healthy["wanted"]), "the healthy robot fails on its own");
    // Planted: the batch finds it.
    let (code, planted) = bench.json(&batch(&["--set", PLANTED, "--csv", "planted.csv", "--report", "planted.html"]));
    assert_eq!(code, 4, "the batch does not find the bug");
    let failed: Vec<&serde_json::Value> =
        planted["missions"].as_array().unwrap().iter().filter(|mission| mission["success"] == false).collect();
    assert!(failed.iter().all(|mission| mission["contacts_caused"].as_u64().unwrap() > 0), "{failed:?}");
    let seeds: Vec<u64> = failed.iter().map(|mission| mission["seed"].as_u64().unwrap()).collect();
    println!("the batch found it on seeds {seeds:?}");

    // Replayed: each command of the report ends in the same bytes, and in the same failure.
    let report = bench.read("planted.html");
    let commands: Vec<String> = report
        .lines()
        .filter(|line| line.starts_with("<section>"))
        .filter_map(|line| Some(line.split_once("<pre>")?.1.split_once("</pre>")?.0.to_owned()))
        .map(|text| text.replace("&quot;", "\"").replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))
        .collect();
    assert_eq!(commands.len(), seeds.len().min(12));
    for command in commands.iter().take(2) {
        let (code, said) = bench.shell(command);
        assert!(code == 4 && said.contains("replayed byte for byte"), "{command}\n{said}");
    }

    // Shrunk: at least one failure needs faults, and what is left of them is few, and replays.
    let mut shrunk = 0;
    for seed in &seeds {
        let seed = seed.to_string();
        let arguments = [&["shrink", "--seed", &seed, "--json"], &MISSION[..], &["--set", PLANTED]].concat();
        let output = bench.sinew(&arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.code() == Some(4) {
            assert!(error.contains("fails without any fault as well"), "{error}");
            continue;
        }
        let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {error}"));
        let count = |key: &str| told[key].as_u64().unwrap();
        println!("seed {seed}: {} of {} faults are left after {} runs", count("after"), count("before"), count("runs"));
        assert!(count("after") >= 1 && count("after") * 3 < count("before"), "{told}");
        let (code, said) = bench.shell(told["again"].as_str().unwrap());
        assert!(code == 4 && said.contains("replayed byte for byte"), "{said}");
        // The same again: the same file.
        let file = bench.read(told["file"].as_str().unwrap());
        std::fs::remove_file(bench.folder.join(told["file"].as_str().unwrap())).unwrap();
        bench.sinew(&arguments);
        assert_eq!(bench.read(told["file"].as_str().unwrap()), file);
        shrunk += 1;
        // One is enough; SINEW_LONG=1 shrinks them all.
        if std::env::var_os("SINEW_LONG").is_none() {
            break;
        }
    }
    assert!(shrunk > 0, "no failure depended on faults");

    // Compared: the bug is seen in the tables alone, too.
    let (_, found) = bench.json(&["compare", "healthy.csv", "planted.csv", "--json"]);
    assert_eq!(found["only"][0].as_array().unwrap().len(), seeds.len(), "{found}");
}

fn main() -> ExitCode {
    let first = std::env::args().nth(1).unwrap_or_default();
    if ["simulate", "shrink", "compare"].contains(&first.as_str()) {
        return sinew::main(&[NodeType::of::<Deaf>()]);
    }
    if std::env::args().any(|argument| argument == "--list") {
        return ExitCode::SUCCESS;
    }
    let folder = tempfile::tempdir().unwrap();
    end_to_end(folder.path());
    println!("a planted bug is found, shrunk and replayed ... ok");
    ExitCode::SUCCESS
}
