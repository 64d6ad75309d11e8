//! `sinew recover`: what is whole in a damaged recording, as a new one.

use crate::exit::Failure;
use crate::output::{Out, count, span};
use std::path::PathBuf;

/// Saves what is whole in a recording that was cut off or damaged
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The damaged recording
    file: PathBuf,
    /// The new one
    #[arg(long = "output", short, value_name = "FILE")]
    output: PathBuf,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// Saves what is whole.
pub fn run(args: Args) -> Result<(), Failure> {
    let saved = recorder::recover::recover(&args.file, &args.output)?;
    let mut out = Out::stdout();
    if args.json {
        out.json(&serde_json::to_value(&saved)?)?;
        return out.flush();
    }
    let messages = count(saved.messages as usize, "message");
    out.line(format!("saved {messages} over {} to {}", span(saved.duration_s), saved.file.display()))?;
    if saved.damaged_chunks > 0 {
        out.line(format!("{} left out", count(saved.damaged_chunks as usize, "damaged chunk")))?;
    }
    if let Some(damage) = &saved.damage {
        out.line(format!("what was wrong: {damage}"))?;
    }
    out.flush()
}
