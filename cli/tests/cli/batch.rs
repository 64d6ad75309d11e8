//! Batches of missions as processes: tables, reports, Ctrl-C in the middle, shrinking, comparing, and bad input.

use crate::place::{Place, Said};
use crate::terminal::{Keys, Terminal};
use rustix::process::{Pid, Signal, kill_process};
use std::process::Stdio;

impl Place {
    /// A file in this place, as an argument.
    fn path(&self, name: &str) -> String {
        std::fs::create_dir_all(&self.root).unwrap();
        self.root.join(name).display().to_string()
    }

    fn file(&self, name: &str, text: &str) -> String {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }
}

fn refused(said: &Said, code: i32, words: &[&str]) {
    assert_eq!((said.code, said.out.as_str()), (Some(code), ""), "{said:?}");
    assert!(words.iter().all(|word| said.err.contains(word)), "{words:?}: {said:?}");
}

#[test]
fn a_batch_ended_by_ctrl_c_keeps_what_it_has_and_resumed_it_is_the_same_to_the_last_byte() {
    let place = Place::new("batch-interrupted");
    let batch = ["simulate", "--seeds", "0..80", "--for", "30s", "--faults", "chaos"];
    let run = |name: &str, more: &[&str]| {
        let (csv, report) = (place.path(&format!("{name}.csv")), place.path(&format!("{name}.html")));
        let mut command = place.command(&batch);
        command.args(["--csv", &csv, "--report", &report]).args(more);
        (command, csv, report)
    };
    let (mut command, csv, report) = run("part", &["--jobs", "1"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let lines = || std::fs::read_to_string(&csv).unwrap_or_default().lines().count();
    while lines() < 3 {
        std::thread::yield_now();
    }
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let said = Said::of(child.wait_with_output().unwrap());
    assert_eq!(said.code, Some(130), "{said:?}");
    assert!(said.err.contains("of 80 missions are finished; --resume goes on"), "{said:?}");
    let kept = std::fs::read_to_string(&csv).unwrap();
    let missions = kept.lines().count() - 1;
    assert!((2..80).contains(&missions), "{missions} missions");
    assert!(std::fs::read_to_string(&report).unwrap().contains(&format!("of {missions} missions succeeded")));

    // A line cut in two, as by a sudden end, is simulated again.
    std::fs::write(&csv, &kept[..kept.len() - 7]).unwrap();
    let said = Said::of(run("part", &["--jobs", "2", "--resume"]).0.output().unwrap());
    assert_eq!(said.code, Some(0), "{said:?}");
    let (mut command, whole_csv, whole_report) = run("whole", &["--jobs", "2"]);
    let said = Said::of(command.output().unwrap());
    assert!(said.out.contains("80 of 80 missions succeeded"), "{said:?}");
    let read = |file: &str| std::fs::read(file).unwrap();
    assert!(read(&csv) == read(&whole_csv), "the tables differ");
    assert!(read(&report) == read(&whole_report), "the reports differ");

    refused(&Said::of(run("whole", &[]).0.output().unwrap()), 2, &["is there already", "--resume"]);
    let other = ["simulate", "--seeds", "0..80", "--for", "29s", "--csv", &csv, "--resume"];
    refused(&place.sinew(&other), 2, &["comes from another program, robot, world, scenario or other faults"]);
    // Nothing was lost by the refusals.
    assert!(read(&csv) == read(&whole_csv));
}

#[test]
fn a_terminal_sees_a_bar_with_the_time_left() {
    let place = Place::new("batch-bar");
    let csv = place.path("a.csv");
    let command = place.command(&["simulate", "--seeds", "0..30", "--for", "5s", "--csv", &csv]);
    let mut terminal = Terminal::run(command, Keys::Plain);
    while !terminal.screen.contains("missions succeeded") {
        terminal.serve(true);
    }
    let screen = &terminal.screen;
    assert!(screen.contains("30 of 30 missions succeeded") && screen.contains("] 30/30, 0 s left"), "{screen}");
    assert!(terminal.child.wait().unwrap().success());
}

#[test]
fn seeds_scenarios_faults_and_files_that_make_no_sense_are_refused_before_anything_runs() {
    let place = Place::new("batch-refused");
    let simulate = |more: &[&str]| place.sinew(&[&["simulate"], more].concat());
    for seeds in ["0..0", "5..3", "5", "a..b", "-2..3", "0..2000000"] {
        refused(&simulate(&[&format!("--seeds={seeds}")]), 2, &[seeds, "write A..B with A below B"]);
    }
    let scenario = |text: &str| simulate(&["--scenario", &place.file("mission.toml", text)]);
    refused(&scenario("timeout_s = inf"), 4, &["mission.toml", "can never end; write a time"]);
    refused(&scenario("timeout_s = 60.0\n[[goal]]\nx_m = 99.0\ny_m = 1.0\nwithin_m = 0.5"), 4, &["outside the world"]);
    refused(&scenario("timeout_s = 60.0\nspeed = 1"), 4, &["unknown field `speed`"]);
    refused(&scenario("timeout_s = "), 4, &["mission.toml"]);
    refused(&simulate(&["--scenario", "nowhere.toml"]), 4, &["nowhere.toml: cannot be read"]);
    for (text, words) in [
        ("deths = 1", "unknown field `deths`"),
        ("[[fault]]\nkind = \"flood\"\nat_s = 1.0", "fault 1: unknown variant `flood`"),
        ("[[fault]]\nkind = \"hang\"\nat_s = 1.0\nfor_s = 1.0\nnode = \"/actions/x\"", "no node \"/actions/x\""),
        ("\u{1}", "TOML parse error"),
    ] {
        refused(&simulate(&["--faults", &place.file("faults.toml", text)]), 2, &["faults.toml", words]);
    }
    refused(&simulate(&["--faults", "nowhere.toml"]), 2, &["nowhere.toml: cannot be read", "write \"chaos\""]);
    refused(&simulate(&["--faults", "deaths=often"]), 2, &["--faults deaths=often"]);
    refused(&simulate(&["--csv", "/nowhere/a.csv"]), 2, &["/nowhere/a.csv: cannot be written"]);
    refused(&simulate(&["--report", "/nowhere/a.html"]), 1, &["cannot write /nowhere/a.html"]);
    let foreign = place.file("foreign.csv", "a,b\n1,2\n");
    refused(&simulate(&["--csv", &foreign, "--resume"]), 2, &["line 1 is no heading of a batch"]);
    assert_eq!(std::fs::read_to_string(&foreign).unwrap(), "a,b\n1,2\n");
    refused(&simulate(&["--resume"]), 2, &["--csv"]);
    refused(&simulate(&["--seeds", "0..2", "--expect", "12"]), 2, &["--expect: give a single seed"]);
}

#[test]
fn a_seed_is_replayed_byte_for_byte_or_it_is_said_that_it_was_not() {
    let place = Place::new("batch-replay");
    let csv = place.path("a.csv");
    let mission = ["simulate", "--seeds", "3..4", "--for", "10s", "--faults", "deaths=20"];
    assert_eq!(place.sinew(&[&mission[..], &["--csv", &csv]].concat()).code, Some(0));
    let text = std::fs::read_to_string(&csv).unwrap();
    let hash = text.trim_end().rsplit(',').nth(1).unwrap().to_owned();
    let said = place.sinew(&[&mission[..], &["--expect", &hash]].concat());
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains(&format!("replayed byte for byte: hash {hash} as expected")), "{said:?}");
    let other =
        place.sinew(&["simulate", "--seeds", "3..4", "--for", "10s", "--faults", "deaths=21", "--expect", &hash]);
    assert_eq!(other.code, Some(1), "{other:?}");
    assert!(other.err.contains("it is no replay"), "{other:?}");
}

#[test]
fn what_cannot_be_shrunk_is_said() {
    let place = Place::new("batch-shrink");
    let out = place.path("few.toml");
    let shrink = |more: &[&str]| place.sinew(&[&["shrink", "--seed", "3", "--for", "10s"], more].concat());
    refused(&shrink(&[]), 2, &["--faults is missing"]);
    refused(&shrink(&["--faults", "chaos", "--out", &out]), 4, &["seed 3 does not fail with --faults chaos"]);
    // So long a way in so short a time has nothing to do with faults.
    let far = place.file("far.toml", "timeout_s = 10.0\n[success]\nmin_distance_m = 2.99");
    let said = shrink(&["--faults", "bursts=5", "--scenario", &far, "--out", &out]);
    refused(&said, 4, &["fails without any fault as well (drove", "does not depend on them"]);
    std::fs::write(&out, "mine").unwrap();
    refused(&shrink(&["--faults", "chaos", "--out", &out]), 2, &["few.toml is there already"]);
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "mine");
}

#[test]
fn two_configurations_are_compared_on_the_same_seeds() {
    let place = Place::new("batch-compare");
    let batch = |name: &str, seeds: &str, more: &[&str]| {
        let csv = place.path(name);
        let said = place.sinew(&[&["simulate", "--seeds", seeds, "--for", "20s", "--csv", &csv], more].concat());
        assert_eq!(said.code, Some(0), "{said:?}");
        csv
    };
    let a = batch("a.csv", "0..20", &[]);
    let slower = batch("b.csv", "0..22", &["--set", "nodes.forward.config.speed_m_s=0.2"]);
    let said = place.sinew(&["compare", &a, &slower, "--json"]);
    let found: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((said.code, &found["seeds"], &found["unpaired"]), (Some(0), &20.into(), &2.into()), "{said:?}");
    let metric = |name: &str| found["metrics"].as_array().unwrap().iter().find(|m| m["metric"] == name).unwrap();
    let speed = metric("max_speed_m_s");
    let at = |key: &str, side: usize| speed[key][side].as_f64().unwrap();
    assert!(speed["significant"] == true && at("interval", 1) < -0.05, "{speed}");
    assert!((at("mean", 0) - 0.3).abs() < 0.04 && (at("mean", 1) - 0.2).abs() < 0.04, "{speed}");
    let said = place.sinew(&["compare", &a, &slower]);
    assert!(said.out.contains("20 seeds in common") && said.out.contains("differs"), "{said:?}");
    let same = place.sinew(&["compare", &a, &a]);
    assert!(same.out.contains("20 of them the same to the last bit") && !same.out.contains("differs"), "{same:?}");
    let other = batch("c.csv", "50..51", &[]);
    refused(&place.sinew(&["compare", &a, &other]), 2, &["no seed in common"]);
    let foreign = place.file("foreign.csv", "seed,failure\n1,\n");
    refused(&place.sinew(&["compare", &a, &foreign]), 2, &["foreign.csv: line 1 is no heading"]);
    refused(&place.sinew(&["compare", &a, "nowhere.csv"]), 2, &["nowhere.csv: cannot be read"]);
}
