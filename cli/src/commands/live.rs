//! `sinew live`: a running robot on Foxglove's WebSocket protocol, for Lichtblick and Foxglove.
//!
//! The server is a program of its own, `sinew-live`: it is made of a tree of crates that nobody else needs. This command
//! finds the robot and the program, and becomes it.

use crate::exit::{Failure, NOT_RUNNING, USAGE};
use crate::live;
use std::net::IpAddr;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The server's name.
const PROGRAM: &str = "sinew-live";

/// Serves a running robot to Lichtblick and Foxglove (WebSocket)
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot, where several run
    robot: Option<String>,
    /// Address to listen on; another than this machine's own lets the network watch
    #[arg(long, default_value = "127.0.0.1", value_name = "ADDRESS")]
    bind: IpAddr,
    /// Port to listen on; 0 lets the kernel choose
    #[arg(long, default_value_t = 8765)]
    port: u16,
    /// A path, a folder such as /drivers, or a pattern such as /actions/*/proposal; without one everything
    #[arg(long = "paths", value_name = "PATH")]
    paths: Vec<String>,
    /// Prints JSON objects, one per line
    #[arg(long)]
    json: bool,
}

/// Serves until Ctrl-C or the end of the robot.
pub fn run(args: &Args) -> Result<(), Failure> {
    if let Some(path) = args.paths.iter().find(|path| !path.starts_with('/')) {
        let text = format!("--paths {path}: a path begins with a slash, as in /drivers/base/sonar or /drivers");
        return Err(Failure::new(USAGE, text));
    }
    let robot = live::find_below(&live::root(), args.robot.as_deref())?;
    if !live::runs(&robot.folder) {
        return Err(Failure::new(NOT_RUNNING, format!("robot \"{}\" does not run", robot.name)));
    }
    let program = program().ok_or_else(|| Failure::from(missing()))?;
    let mut server = Command::new(&program);
    server.arg("--folder").arg(&robot.folder).arg("--robot").arg(&robot.name);
    server.arg("--bind").arg(args.bind.to_string()).arg("--port").arg(args.port.to_string());
    for path in &args.paths {
        server.arg("--paths").arg(path);
    }
    if args.json {
        server.arg("--json");
    }
    Err(Failure::from(format!("cannot start {}: {}", program.display(), server.exec())))
}

/// The server: beside this program, else in PATH.
fn program() -> Option<PathBuf> {
    let beside = std::env::current_exe().ok().and_then(|own| Some(own.parent()?.join(PROGRAM)));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let in_path = std::env::split_paths(&path).map(|folder| folder.join(PROGRAM));
    beside.into_iter().chain(in_path).find(|file| is_program(file))
}

fn is_program(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    std::fs::metadata(file).is_ok_and(|known| known.is_file() && known.permissions().mode() & 0o111 != 0)
}

fn missing() -> String {
    format!(
        "{PROGRAM} is neither beside sinew nor in PATH: it is built by itself, because of its size, with `cargo xtask live` \
         in Sinew's sources, which puts it beside sinew"
    )
}
