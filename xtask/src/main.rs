//! `cargo xtask check`: what CI does, as one command. `cargo xtask` alone lists the steps.

use std::process::{Command, ExitCode};

/// One step: its name, the command, and variables to set.
struct Step {
    name: &'static str,
    command: &'static [&'static str],
    variables: &'static [(&'static str, &'static str)],
}

const fn step(name: &'static str, command: &'static [&'static str]) -> Step {
    Step { name, command, variables: &[] }
}

/// In the order of cost: what fails soonest comes first.
const STEPS: &[Step] = &[
    step("format", &["cargo", "fmt", "--all", "--check"]),
    step("lint", &["cargo", "clippy", "--workspace", "--all-targets", "--release", "--quiet", "--", "-D", "warnings"]),
    step("build", &["cargo", "build", "--workspace", "--release", "--quiet"]),
    step("peers", &["recorder/tests/peers/run"]),
    step("laser-peers", &["tests/peers/run"]),
    step("test", &["cargo", "test", "--workspace", "--release", "--quiet"]),
    Step {
        name: "loom",
        command: &["cargo", "test", "--release", "--quiet", "-p", "sinew-runtime", "--test", "channel_loom"],
        variables: &[("RUSTFLAGS", "--cfg loom"), ("CARGO_TARGET_DIR", "target/loom")],
    },
    Step {
        name: "docs",
        command: &["cargo", "doc", "--workspace", "--no-deps", "--quiet", "--release"],
        variables: &[("RUSTDOCFLAGS", "-D warnings -A rustdoc::broken_intra_doc_links")],
    },
];

/// What only some machines can do, or what takes minutes of building for itself: not part of `check`.
const EXTRAS: &[Step] = &[
    step("live", &["edges/foxglove/tests/run"]),
    step("debug", &["tests/debug_and_release"]),
    step("mrpt", &["make", "--no-print-directory", "-C", "benches/peers/mrpt"]),
    // 10,000 missions under faults, and what SINEW_LONG=1 adds to the tests: an hour.
    step("nightly", &[".ci/nightly"]),
];

fn main() -> ExitCode {
    let mut wanted: Vec<String> = std::env::args().skip(1).collect();
    if wanted.is_empty() {
        println!("cargo xtask check        all steps, as CI does");
        for step in STEPS.iter().chain(EXTRAS) {
            println!("cargo xtask {:<12} {}", step.name, step.command.join(" "));
        }
        return ExitCode::SUCCESS;
    }
    if wanted == ["check"] {
        wanted = STEPS.iter().map(|step| step.name.to_owned()).collect();
    }
    for name in &wanted {
        let Some(step) = STEPS.iter().chain(EXTRAS).find(|step| step.name == name) else {
            let names: Vec<&str> = STEPS.iter().map(|step| step.name).collect();
            eprintln!("cargo xtask {name}: there is no such step; steps are check, {}", names.join(", "));
            return ExitCode::from(2);
        };
        eprintln!("── {}: {}", step.name, step.command.join(" "));
        let mut command = Command::new(step.command[0]);
        command.args(&step.command[1..]).envs(step.variables.iter().copied());
        match command.status() {
            Ok(status) if status.success() => {}
            Ok(status) => {
                eprintln!("── {} failed: {status}", step.name);
                return ExitCode::FAILURE;
            }
            Err(e) => {
                eprintln!("── {} could not run {}: {e}", step.name, step.command[0]);
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}
