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
        let runs = run_all(&robot, 11..14, 20.0, None, jobs, &|seed| Some(name(seed)), &|_| {}).unwrap();
        let hashes: Vec<String> = runs.iter().map(|run| run.result.hash.clone()).collect();
        let files: Vec<PathBuf> = (11..14).map(name).collect();
        (hashes, files)
    };
    let (one, two) = (record(1), record(2));
    let plain = run_all(&robot, 11..14, 20.0, None, 1, &|_| None, &|_| {}).unwrap();
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
    run_all(&pioneer(), 11..12, 20.0, None, 1, &|_| Some(file.clone()), &|_| {}).unwrap();
    let change = Override { key: "nodes.forward.config.speed_m_s".into(), value: "0.2".into() };
    let robot = Recording::open(&file).unwrap().facts().robot(&types()).unwrap();
    let changed = robot.with_overrides(&[change], &types()).unwrap();
    let forward = replay(&file, &changed, "/actions/forward").unwrap();
    assert!(forward.different_steps > 0, "{forward:#?}");
    assert_eq!(forward.paths[0].fields[0].field, "forward.value");
    assert!(replay(&file, &changed, "/actions/steer_clear").unwrap().is_identical());
}

/// Kills the process of `node`, as in drivers.base.
fn kill(folder: &Path, node: &str) {
    let pid = std::fs::read_to_string(folder.join(format!("recorded/.run/{node}.pid"))).unwrap();
    let pid = pid.split_whitespace().next().and_then(|pid| pid.parse().ok()).unwrap();
    rustix::process::kill_process(rustix::process::Pid::from_raw(pid).unwrap(), rustix::process::Signal::KILL).unwrap();
}

/// Wiring, configuration, files, build, seed, calls.
fn check_what_is_said_of_the_run(file: &Path) {
    let mut recording = Recording::open(file).unwrap();
    let facts = recording.facts().clone();
    assert_eq!((facts.robot.as_str(), facts.seed, facts.nodes.len()), ("recorded", 3, 8));
    assert_eq!(facts.build, recorder::info::info(file).unwrap().build);
    assert!(facts.build.starts_with(env!("CARGO_PKG_VERSION")) && facts.build.len() > 20, "{}", facts.build);
    let wire = "/perception/odometry odometry <- /drivers/base/odometry";
    assert!(facts.wiring.lines().any(|line| line == wire), "{}", facts.wiring);
    assert!(facts.robot_text.contains("[nodes.steer_clear"), "{}", facts.robot_text);
    assert!(facts.files.keys().any(|name| name.starts_with("worlds/")), "{:?}", facts.files.keys());
    let mut calls = 0;
    recording
        .read(&mut |item| {
            if let recorder::Item::Sample { channel, tail, .. } = item
                && channel.topic == "/drivers/base/events"
            {
                calls += runtime::replay::describe(tail).iter().filter(|entry| entry.starts_with("request")).count();
            }
        })
        .unwrap();
    assert_eq!(calls, 1, "somebody switched the sonar on");
}

/// The robot's processes share the machine with everything else: a sample may be lost, and then its reader says so.
#[test]
fn a_live_wander_replays_to_the_byte_through_the_deaths_of_an_action_and_of_the_driver() {
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
    let ask = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sinew"));
        command.args(arguments).env("SINEW_SHM", &folder).env("SINEW_STATE", folder.join("state"));
        assert!(command.output().unwrap().status.success(), "{arguments:?}");
    };
    let mut deaths = vec![(5.0, "drivers.base"), (2.0, "actions.steer_clear")];
    let mut asked = false;
    for line in lines {
        let news: serde_json::Value = serde_json::from_str(&line.unwrap()).unwrap();
        if news["nodes_up"] == 8 && !std::mem::replace(&mut asked, true) {
            ask(&["call", "/drivers/base", "switch_sonar", "on", "--robot", "recorded"]);
            ask(&["restart", "forward", "--robot", "recorded"]);
        }
        let Some((at_s, node)) = deaths.last() else { continue };
        // On a loaded machine a node may start late; a death is one of a node that lives.
        let all_up = news["event"] == "state" && news["nodes_up"] == 8;
        if all_up && news["time_s"].as_f64().is_some_and(|time| time > *at_s) {
            kill(&folder, node);
            deaths.pop();
        }
    }
    assert!(child.wait().unwrap().success() && deaths.is_empty());
    let told = recorder::info::info(&file).unwrap();
    for node in ["/actions/steer_clear", "/drivers/base"] {
        assert!(told.incidents.iter().any(|incident| incident.node == node), "{told:#?}");
    }
    assert_eq!((told.host.as_str(), told.damage.as_deref()), ("live", None));
    assert_eq!(told.changes, 1, "an operator's restart: {told:#?}");
    check_what_is_said_of_the_run(&file);
    let nodes = replay_all(&file);
    let (mut identical, mut steps) = (0, 0);
    for node in &nodes {
        assert_eq!(node.different_steps, 0, "{node:#?}");
        identical += node.identical_steps;
        steps += node.steps;
        let lives = if ["/actions/steer_clear", "/drivers/base", "/actions/forward"].contains(&node.node.as_str()) {
            2
        } else {
            1
        };
        assert_eq!(node.lives, lives, "{node:#?}");
        let not_replayable = (node.not_replayable, node.unproven, &node.reasons);
        println!("{}: {} of {} steps identical, {not_replayable:?}", node.node, node.identical_steps, node.steps);
    }
    assert_eq!(nodes.len(), 8);
    assert!(identical * 10 > steps * 9, "{identical} of {steps} steps were proven: {nodes:#?}");
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Its own recorder gets a disk of 300 KB where this user may mount one, else one that is full from the beginning; two more
/// recorders get a full disk and a file that may not grow.
#[test]
fn a_disk_that_runs_full_ends_the_recording_with_a_word_and_never_the_robot() {
    let folder = PathBuf::from(format!("/dev/shm/sinew-test-full-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("small")).unwrap();
    let sinew = env!("CARGO_BIN_EXE_sinew");
    let at = |name: &str| folder.join(name).display().to_string();
    let command = |program: &str| {
        let mut command = Command::new(program);
        command.env("SINEW_SHM", &folder).env("SINEW_STATE", folder.join("state")).env("NO_COLOR", "1");
        command
    };
    let mounts = command("unshare").args(["-rm", "mount", "-t", "tmpfs", "none", &at("small")]).output();
    let small = mounts.is_ok_and(|output| output.status.success());
    let mut run = if small {
        let mut run = command("unshare");
        let script =
            "mount -t tmpfs -o size=300k none \"$0\"; \"$@\"; code=$?; cp \"$0\"/run.mcap \"$0\".mcap; exit $code";
        run.args(["-rm", "sh", "-c", script, &at("small"), sinew]);
        run
    } else {
        println!("no small disk can be mounted here: a full one takes its place");
        command(sinew)
    };
    run.args(["run", "--json", "--svg", "none", "--name", "full", "--for", "10s", "--record"]);
    run.arg(if small { at("small/run.mcap") } else { "/dev/full".into() });
    let mut child = run.stdout(Stdio::piped()).stderr(Stdio::inherit()).spawn().unwrap();
    let lines = std::io::BufRead::lines(std::io::BufReader::new(child.stdout.take().unwrap()));
    let (mut others, mut events) = (Vec::new(), Vec::new());
    for line in lines {
        let news: serde_json::Value = serde_json::from_str(&line.unwrap()).unwrap();
        if others.is_empty() && news["event"] == "state" && news["time_s"].as_f64().is_some_and(|time| time > 1.0) {
            let limited = ["-c", "ulimit -f 400; exec \"$0\" record full -o \"$1\"", sinew, &at("limited.mcap")];
            others.push(command("sh").args(limited).output().unwrap());
            others.push(command(sinew).args(["record", "full", "-o", "/dev/full"]).output().unwrap());
        }
        events.push(news);
    }
    child.wait().unwrap();
    for (output, words) in others.iter().zip(["may not grow beyond", "is full"]) {
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains(words), "{said}");
        assert!(said.contains("recording stopped") && said.contains("the robot goes on"), "{said}");
    }
    assert_eq!(others.len(), 2);
    let died: Vec<_> = events.iter().filter(|news| news["incident"] == "died").collect();
    assert_eq!((died.len(), died[0]["node"].as_str()), (1, Some("recorder")), "{died:#?}");
    assert!(died[0]["last_lines"].to_string().contains("is full: recording stopped"), "{died:#?}");
    let end = events.last().unwrap();
    assert_eq!((end["event"].as_str(), end["restarts"].as_u64()), (Some("end"), Some(0)), "{end}");
    assert!(end["distance_m"].as_f64().is_some_and(|distance| distance > 0.5), "it went on: {end}");
    let files = if small { vec![at("small.mcap"), at("limited.mcap")] } else { vec![at("limited.mcap")] };
    for file in files.iter().map(Path::new) {
        let saved = recorder::recover::recover(file, &file.with_extension("saved")).unwrap();
        assert!(saved.messages > 100, "{saved:?}");
        let told = recorder::info::info(&saved.file).unwrap();
        assert_eq!((told.robot.as_str(), told.damage), ("full", None));
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
