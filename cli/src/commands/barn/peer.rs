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

/// Runs the peers one after another, in a folder of their own: MRPT leaves files where it runs.
pub fn run(program: &Path, args: &Args) -> Result<Vec<Peer>, Failure> {
    let folder = std::env::temp_dir().join(format!("sinew-peer-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("settings.ini"), SETTINGS)?;
    let (program, data) = (std::path::absolute(program)?, std::path::absolute(&args.data)?);
    let one =
        |(method, speed): &(&str, &str)| one(Command::new(&program).current_dir(&folder), &data, args, method, speed);
    let peers = PEERS.iter().map(one).collect();
    // Nothing depends on it any more.
    let _ = std::fs::remove_dir_all(&folder);
    peers
}

fn one(command: &mut Command, data: &Path, args: &Args, method: &str, speed: &str) -> Result<Peer, Failure> {
    command.arg("--data").arg(data).args(["--settings", "settings.ini"]);
    command.args(["--method", method, "--speed", speed, "--every", &args.every.to_string()]);
    if args.dynamic {
        command.arg("--dynamic");
    }
    if let Some((from, to)) = args.worlds.as_deref().and_then(|range| range.split_once("..")) {
        command.args(["--from", from.trim(), "--to", to.trim()]);
    }
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command
        .stderr(Stdio::null())
        .output()
        .map_err(|e| Failure::from(format!("cannot run {program}: {e}\nBuild it with `cargo xtask mrpt`.")))?;
    // Its libraries may have printed before; the last line is the result.
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().rev().find(|line| line.starts_with('{')).unwrap_or_default();
    serde_json::from_str(line).map_err(|e| Failure::from(format!("{program} ({method}) printed no result: {e}")))
}
