//! `sinew-live`: a running robot on Foxglove's WebSocket protocol (`foxglove.sdk.v1`), for Lichtblick and Foxglove.
//!
//! The topics, types, definitions and CDR bytes are those of a recording. A process of its own that reads the robot's rings
//! and writes none, with no priority, so no node ever waits for a viewer; a slow viewer loses its oldest messages. Clients
//! may subscribe and nothing else. `sinew live` finds the robot and starts this program.

mod outlet;
mod serve;

use clap::Parser;
use std::net::IpAddr;
use std::path::PathBuf;
use std::process::ExitCode;

/// Serves a running robot to Foxglove and Lichtblick; started by `sinew live`
#[derive(Debug, Parser)]
#[command(name = "sinew-live", version)]
struct Args {
    /// The robot's folder of channels
    #[arg(long)]
    folder: PathBuf,
    /// The robot's name
    #[arg(long)]
    robot: String,
    /// Address to listen on
    #[arg(long, default_value = "127.0.0.1")]
    bind: IpAddr,
    /// Port to listen on; 0 lets the kernel choose
    #[arg(long, default_value_t = 8765)]
    port: u16,
    /// A path, a folder or a pattern; without one everything
    #[arg(long = "paths", value_name = "PATH")]
    paths: Vec<String>,
    /// Prints JSON objects, one per line
    #[arg(long)]
    json: bool,
}

fn main() -> ExitCode {
    match serve::serve(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::FAILURE
        }
    }
}
