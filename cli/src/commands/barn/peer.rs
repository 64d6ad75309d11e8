//! MRPT's planners through the same worlds: a program of its own (`benches/peers/mrpt`), which prints a line of JSON.

use super::Args;
use super::report::Peer;
use crate::exit::Failure;
use std::path::Path;
use std::process::{Command, Stdio};

/// Method and greatest speed of each peer: MRPT's best, and what else it offers, at the speed that suits it.
const PEERS: [(&str, &str); 3] = [("full-eval", "1.0"), ("nd", "2.0"), ("vff", "2.0")];
/// MRPT's shipped settings, built in so that the program finds them wherever it is run.
const SETTINGS: &str = include_str!("../../../../benches/peers/mrpt/reactive2d_config.ini");

/// Runs the peers one after another.
pub fn run(program: &Path, args: &Args) -> Result<Vec<Peer>, Failure> {
    let settings = std::env::temp_dir().join(format!("sinew-peer-{}.ini", std::process::id()));
    std::fs::write(&settings, SETTINGS)?;
    let peers = PEERS.iter().map(|(method, speed)| one(program, args, &settings, method, speed)).collect();
    // Nothing depends on it any more.
    let _ = std::fs::remove_file(&settings);
    peers
}

fn one(program: &Path, args: &Args, settings: &Path, method: &str, speed: &str) -> Result<Peer, Failure> {
    let mut command = Command::new(program);
    command.arg("--data").arg(&args.data).arg("--settings").arg(settings);
    command.args(["--method", method, "--speed", speed, "--every", &args.every.to_string()]);
    if args.dynamic {
        command.arg("--dynamic");
    }
    if let Some((from, to)) = args.worlds.as_deref().and_then(|range| range.split_once("..")) {
        command.args(["--from", from.trim(), "--to", to.trim()]);
    }
    let output = command.stderr(Stdio::null()).output().map_err(|e| {
        Failure::from(format!("cannot run {}: {e}\nBuild it with `cargo xtask peers`.", program.display()))
    })?;
    // Its libraries may have printed before; the last line is the result.
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().rev().find(|line| line.starts_with('{')).unwrap_or_default();
    serde_json::from_str(line)
        .map_err(|e| Failure::from(format!("{} ({method}) printed no result: {e}", program.display())))
}
