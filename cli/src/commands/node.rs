//! `sinew node`: one process of nodes. The supervisor starts it; a person may too, to debug a node alone.

use crate::exit::Failure;
use crate::launch::Launch;
use runtime::NodeType;
use runtime::live::{self, LiveOptions};
use std::path::PathBuf;
use supervisor::isolation;

/// Runs nodes of a robot in this process
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot's folder of channels
    #[arg(long)]
    root: PathBuf,
    /// Take the written paths from a predecessor that hangs
    #[arg(long)]
    fence: bool,
    /// The nodes, as in /drivers/base
    #[arg(required = true)]
    nodes: Vec<String>,
}

/// Runs the nodes until SIGTERM.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let launch = Launch::read(&args.root)?;
    let mut robot = launch.robot(types)?;
    // Before there is a second thread, and before anything of the node itself is run.
    if let Some(confined) = isolation::confine(&mut robot, &args.nodes, &args.root) {
        eprintln!("{confined}");
    }
    let options = LiveOptions {
        root: args.root,
        seed: launch.seed,
        supervisor: std::env::var("SINEW_SUPERVISOR_PID").ok().and_then(|pid| pid.parse().ok()),
        fence: args.fence,
        tree: live::TreeShare::inherited(),
        go: std::env::var("SINEW_STANDBY_FD").ok().and_then(|number| number.parse().ok()),
    };
    live::run(&robot, &args.nodes, &options, |grants| {
        for grant in grants {
            eprintln!("{grant}");
        }
        live::report_ready();
    })?;
    Ok(())
}
