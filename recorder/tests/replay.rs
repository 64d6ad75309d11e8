//! Nodes do their recorded steps again: the same bytes from the same inputs, and a word where an input is missing.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use recorder::NodeComparison;
use recorder::replay::{ReplayFailure, replay};
use runtime::robot::Override;
use std::path::Path;
use support::{TYPES, record, robot};

const NODES: [&str; 4] = ["/simulator/source", "/drivers/adder", "/perception/mean", "/tasks/boss"];

fn replayed(file: &Path, node: &str) -> NodeComparison {
    replay(file, &robot(), node).unwrap()
}

/// What the boss saw of its orders, each state once: idle, running, answered, failed, cancelled, lost.
fn states_of_orders(file: &Path) -> Vec<u8> {
    let mut states = std::collections::BTreeSet::new();
    recorder::Recording::open(file)
        .unwrap()
        .read(&mut |item| {
            if let recorder::Item::Sample { channel, fixed, .. } = item
                && channel.topic == "/tasks/boss/state"
            {
                let twist: messages::Twist = messages::bytemuck::pod_read_unaligned(fixed);
                states.insert(match twist.linear_x_m_s {
                    answered if answered > 1000.0 => 3,
                    failed if failed > 10.0 => 4,
                    state => state as u8,
                });
            }
        })
        .unwrap();
    states.into_iter().collect()
}

#[test]
fn every_node_gives_its_recorded_bytes_again_through_calls_device_bytes_a_death_and_an_inheritance() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, 2.0, 5, &mut |_, _, _| true);
    for node in NODES {
        let comparison = replayed(&file, node);
        assert!(comparison.is_identical(), "{comparison:#?}");
        assert_eq!((comparison.not_replayable, comparison.unproven), (0, 0), "{comparison:#?}");
        assert_eq!(comparison.lives, if node == "/drivers/adder" { 2 } else { 1 });
    }
    assert_eq!(
        states_of_orders(&file),
        [0, 2, 3, 4, 5, 6],
        "every way but pending: a request releases its step at once"
    );
    let adder = replayed(&file, "/drivers/adder");
    assert!(adder.identical_steps > 150 && adder.paths[0].identical > 100, "{adder:#?}");
}

#[test]
fn a_sample_that_is_other_than_then_is_found_with_the_inputs_that_led_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, 1.0, 5, &mut |path, sample, fixed| {
        if path == "/perception/mean/mean" && sample.sequence == 20 {
            fixed[3] ^= 1;
        }
        true
    });
    let comparison = replayed(&file, "/perception/mean");
    assert_eq!((comparison.different_steps, comparison.paths[0].different), (1, 1), "{comparison:#?}");
    let first = comparison.first_difference.unwrap();
    assert_eq!((first.path.as_str(), first.sequence, first.step), ("/perception/mean/mean", 20, 20));
    assert_eq!(first.fields[0].field, "x_m");
    assert!(first.inputs.iter().any(|input| input.path == "/drivers/adder/sum"), "{first:#?}");
    assert!(replayed(&file, "/drivers/adder").is_identical());
}

#[test]
fn other_bytes_to_a_device_and_other_answers_are_differences_too() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, 1.0, 5, &mut |_, _, _| true);
    // The same robot from another seed: the source sends other bytes, and writes no channel at all.
    let mut text = robot().text;
    text = text.replace("[nodes.source]\ntype = \"source\"", "[nodes.source]\ntype = \"adder\"");
    assert!(text.contains("type = \"adder\"\nperiod_ms = 7"));
    let other = folder.path().join("other.mcap");
    record(&other, 1.0, 6, &mut |_, _, _| true);
    let (one, two) = (replayed(&file, "/simulator/source"), replayed(&other, "/simulator/source"));
    assert!(one.is_identical() && two.is_identical());
    let changed = folder.path().join("changed.mcap");
    record(&changed, 1.0, 5, &mut |path, sample, fixed| {
        // The step's own time moves by a microsecond: nothing that the source sends depends on it.
        if path == "/simulator/source/inputs" && sample.sequence == 9 {
            fixed[20] = 0;
        }
        // A fault that was none.
        if path == "/drivers/adder/inputs" && sample.sequence == 9 {
            fixed[24] = 1;
        }
        true
    });
    assert!(replayed(&changed, "/simulator/source").is_identical());
    let adder = replayed(&changed, "/drivers/adder");
    assert_eq!(adder.different_steps, 1, "{adder:#?}");
    assert_eq!(adder.first_difference.unwrap().path, "fault");
}

#[test]
fn a_step_of_which_a_sample_is_missing_is_not_replayable_and_those_after_it_prove_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, 1.0, 5, &mut |path, sample, _| !(path == "/drivers/adder/sum" && sample.sequence == 31));
    let comparison = replayed(&file, "/perception/mean");
    assert!(comparison.not_replayable >= 1, "{comparison:#?}");
    assert_eq!(comparison.different_steps, 0, "{comparison:#?}");
    assert!(comparison.unproven > 10 && comparison.identical_steps > 10, "{comparison:#?}");
    // Its sum lacks a term for ever: had these steps counted, they would have been called different.
    assert!(comparison.unproven_identical < comparison.unproven, "{comparison:#?}");
}

#[test]
fn a_step_whose_record_or_events_are_missing_is_counted_until_the_node_starts_anew() {
    let folder = tempfile::tempdir().unwrap();
    for lost in ["inputs", "events"] {
        let file = folder.path().join(format!("{lost}.mcap"));
        let path_of = format!("/drivers/adder/{lost}");
        record(&file, 1.0, 5, &mut |path, sample, _| !(path == path_of && sample.sequence == 12));
        let adder = replayed(&file, "/drivers/adder");
        assert_eq!(adder.not_replayable, 1, "{lost}: {adder:#?}");
        assert_eq!(adder.different_steps, 0, "{lost}: {adder:#?}");
        // The second life begins with a known state again.
        assert!(adder.unproven > 0 && adder.identical_steps > 40, "{lost}: {adder:#?}");
    }
}

#[test]
fn a_recording_that_begins_in_the_middle_proves_nothing_before_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, 1.0, 5, &mut |_, sample, _| sample.stamp_ns > 200_000_000);
    let mean = replayed(&file, "/perception/mean");
    assert_eq!((mean.identical_steps, mean.different_steps), (0, 0), "{mean:#?}");
    assert!(!mean.is_identical() && mean.unproven > 20, "{mean:#?}");
    let adder = replayed(&file, "/drivers/adder");
    assert!(adder.is_identical() && adder.unproven > 0 && adder.lives == 1, "{adder:#?}");
}

#[test]
fn a_changed_node_is_measured_field_by_field_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, 1.0, 5, &mut |_, _, _| true);
    let change = Override { key: "nodes.mean.config.gain".into(), value: "1.5".into() };
    let changed = robot().with_overrides(&[change], TYPES).unwrap();
    let comparison = replay(&file, &changed, "/perception/mean").unwrap();
    let fields = &comparison.paths[0].fields;
    assert_eq!(fields.len(), 1, "{fields:#?}");
    assert_eq!(
        (fields[0].field.as_str(), fields[0].values),
        ("x_m", comparison.paths[0].different + comparison.paths[0].identical)
    );
    assert!(fields[0].rms > 0.0 && fields[0].max >= fields[0].rms && fields[0].mean > 0.0);
    let (adder, boss) = (replayed(&file, "/drivers/adder"), replay(&file, &changed, "/tasks/boss").unwrap());
    assert_eq!(recorder::plot(&[adder.clone(), boss]), None, "what is identical is not drawn");
    let twice = recorder::plot(&[adder, comparison.clone(), comparison]).unwrap();
    assert!(twice.contains("x_m") && twice.matches("<polyline").count() == 4, "{twice}");
    assert!(twice.matches("/perception/mean: ").count() == 2 && !twice.contains("/drivers/adder: "), "{twice}");
}

#[test]
fn a_node_without_recorded_steps_says_how_to_record_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, 0.3, 5, &mut |path, _, _| !path.ends_with("/inputs"));
    let failure = replay(&file, &robot(), "/perception/mean").unwrap_err();
    assert!(matches!(&failure, ReplayFailure::NoSteps { .. }) && failure.to_string().contains("--record"), "{failure}");
    let unknown = replay(&file, &robot(), "/perception/nobody").unwrap_err().to_string();
    assert!(unknown.contains("has no node /perception/nobody") && unknown.contains("/perception/mean"), "{unknown}");
}

#[test]
fn the_same_seed_gives_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str, seed| {
        let file = folder.path().join(name);
        record(&file, 1.0, seed, &mut |_, _, _| true);
        std::fs::read(file).unwrap()
    };
    assert!(bytes("one", 5) == bytes("two", 5));
    assert!(bytes("three", 5) != bytes("four", 6));
}
