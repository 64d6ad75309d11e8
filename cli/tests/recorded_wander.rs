//! A wander recorded and replayed: every node gives byte-identical outputs, live and simulated, on one thread and on two.
#![allow(clippy::unwrap_used, reason = "tests")]

use recorder::replay::replay;
use recorder::{NodeComparison, Recording};
use runtime::NodeType;
use runtime::robot::{NodeSpec, Override, Resources, Robot};
use sinew::simulation::run_all;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A minute, where `SINEW_LONG` is set; a shorter one finds the same in less time.
fn length_s() -> u64 {
    if std::env::var_os("SINEW_LONG").is_some() { 60 } else { 8 }
}

fn types() -> Vec<NodeType> {
    sinew::built_in::node_types(&[])
}

fn pioneer() -> Robot {
    let (_, text) = sinew::built_in::PIONEER[0];
    let resources = Resources::Embedded(sinew::built_in::PIONEER);
    Robot::parse(std::str::from_utf8(text).unwrap(), "robot.toml", resources, &types()).unwrap()
}

fn replay_all(file: &Path) -> Vec<NodeComparison> {
    let robot = Recording::open(file).unwrap().facts().robot(&types()).unwrap();
    robot.nodes.iter().map(NodeSpec::path).map(|node| replay(file, &robot, &node).unwrap()).collect()
}

#[test]
fn simulated_runs_give_the_same_recording_on_one_thread_and_on_two_and_replay_to_the_byte() {
    let folder = tempfile::tempdir().unwrap();
    let robot = pioneer();
    let record = |jobs: usize| {
        let name = |seed: u64| folder.path().join(format!("{jobs}-{seed}.mcap"));
        let runs = run_all(&robot, 11..14, 20.0, jobs, &|seed| Some(name(seed)), &|_| {}).unwrap();
        let hashes: Vec<String> = runs.iter().map(|run| run.result.hash.clone()).collect();
        let files: Vec<PathBuf> = (11..14).map(name).collect();
        (hashes, files)
    };
    let (one, two) = (record(1), record(2));
    let plain = run_all(&robot, 11..14, 20.0, 1, &|_| None, &|_| {}).unwrap();
    let plain: Vec<String> = plain.iter().map(|run| run.result.hash.clone()).collect();
    assert_eq!(one.0, plain, "recording changes nothing");
    for (file, other) in one.1.iter().zip(&two.1) {
        assert!(std::fs::read(file).unwrap() == std::fs::read(other).unwrap(), "{} differs", other.display());
    }
    for node in replay_all(&two.1[0]) {
        assert!(node.is_identical(), "{node:#?}");
        assert_eq!((node.identical_steps, node.not_replayable, node.unproven), (node.steps, 0, 0), "{node:#?}");
    }
}

#[test]
fn a_changed_setting_shows_in_the_node_that_has_it_and_in_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    run_all(&pioneer(), 11..12, 20.0, 1, &|_| Some(file.clone()), &|_| {}).unwrap();
    let change = Override { key: "nodes.forward.config.speed_m_s".into(), value: "0.2".into() };
    let robot = Recording::open(&file).unwrap().facts().robot(&types()).unwrap();
    let changed = robot.with_overrides(&[change], &types()).unwrap();
    let forward = replay(&file, &changed, "/actions/forward").unwrap();
    assert!(forward.different_steps > 0, "{forward:#?}");
    assert_eq!(forward.paths[0].fields[0].field, "forward.value");
    assert!(replay(&file, &changed, "/actions/steer_clear").unwrap().is_identical());
}

/// The robot's processes share the machine with everything else: a sample may be lost, and then its reader says so.
#[test]
fn a_live_wander_replays_to_the_byte_through_the_death_of_a_node() {
    let folder = PathBuf::from(format!("/dev/shm/sinew-test-recorded-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("run.mcap");
    let seconds = format!("{}s", length_s());
    let mut child = Command::new(env!("CARGO_BIN_EXE_sinew"))
        .args(["run", "--json", "--seed", "3", "--svg", "none", "--name", "recorded", "--for", &seconds, "--record"])
        .arg(&file)
        .env("SINEW_SHM", &folder)
        .env("SINEW_STATE", folder.join("state"))
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap();
    let lines = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
    let mut killed = false;
    for line in lines {
        let news: serde_json::Value = serde_json::from_str(&line.unwrap()).unwrap();
        if !killed && news["event"] == "state" && news["time_s"].as_f64().is_some_and(|time| time > 3.0) {
            let pid = std::fs::read_to_string(folder.join("recorded/.run/actions.steer_clear.pid")).unwrap();
            let pid = pid.split_whitespace().next().and_then(|pid| pid.parse().ok()).unwrap();
            let pid = rustix::process::Pid::from_raw(pid).unwrap();
            rustix::process::kill_process(pid, rustix::process::Signal::KILL).unwrap();
            killed = true;
        }
    }
    assert!(child.wait().unwrap().success() && killed);
    let told = recorder::info::info(&file).unwrap();
    assert!(told.incidents.iter().any(|incident| incident.node == "/actions/steer_clear"), "{told:#?}");
    assert_eq!((told.host.as_str(), told.damage.as_deref()), ("live", None));
    let nodes = replay_all(&file);
    let (mut identical, mut steps) = (0, 0);
    for node in &nodes {
        assert_eq!(node.different_steps, 0, "{node:#?}");
        identical += node.identical_steps;
        steps += node.steps;
    }
    assert_eq!(nodes.len(), 8);
    assert!(identical * 10 > steps * 9, "{identical} of {steps} steps were proven: {nodes:#?}");
    let steer_clear = nodes.iter().find(|node| node.node == "/actions/steer_clear").unwrap();
    assert_eq!(steer_clear.lives, 2, "{steer_clear:#?}");
    std::fs::remove_dir_all(&folder).unwrap();
}
