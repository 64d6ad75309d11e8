//! `sinew play`: a recording's paths come alive.

use crate::commands::play_remote::Remote;
use crate::exit::{Failure, USAGE};
use crate::live;
use crate::output::{Out, count, parse_seconds, span};
use recorder::Recording;
use recorder::play::{Options, play};
use runtime::path;
use std::path::PathBuf;

/// Plays a recording: its paths come alive as if the robot ran
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    file: PathBuf,
    /// Times as fast as it was
    #[arg(long, default_value_t = 1.0)]
    rate: f64,
    /// Begins this far into it, as in 20s
    #[arg(long, value_name = "TIME")]
    from: Option<String>,
    /// Plays this much of it
    #[arg(long = "for", value_name = "TIME")]
    length: Option<String>,
    /// Begins again at the end, until Ctrl-C
    #[arg(long = "loop")]
    looped: bool,
    /// Obeys lines of the standard input: pause, go, rate 2, seek 20s, skip -5s; in a terminal keys do the same
    #[arg(long)]
    commands: bool,
    /// Name of the robot; without it the recorded one
    #[arg(long)]
    name: Option<String>,
    /// Prints one JSON object at the end
    #[arg(long)]
    json: bool,
}

/// Plays until the end or Ctrl-C.
pub fn run(args: Args) -> Result<(), Failure> {
    let usage = |reason: String| Failure::new(USAGE, reason);
    if !(args.rate > 0.0 && args.rate.is_finite()) {
        return Err(usage(format!("--rate {}: it must be a number above 0", args.rate)));
    }
    let time = |text: &Option<String>| text.as_deref().map(parse_seconds).transpose().map_err(usage);
    let (from_s, length_s) = (time(&args.from)?.unwrap_or(0.0), time(&args.length)?);
    let recording = Recording::open(&args.file)?;
    let name = args.name.unwrap_or_else(|| recording.facts().robot.clone());
    if !path::is_name(&name) {
        return Err(usage(format!(
            "\"{name}\" is no robot's name: use 1 to 32 of a-z, 0-9 and _, beginning with a letter"
        )));
    }
    let root = live::root().join(&name);
    if live::runs(&root) {
        return Err(Failure::from(format!("a robot \"{name}\" is running: give another name with --name")));
    }
    let stop = recorder::live::stop_by_signals()?;
    let until_s = length_s.map_or(f64::INFINITY, |length| from_s + length);
    let options = Options { file: args.file, root, rate: args.rate, from_s, until_s, looped: args.looped };
    let json = args.json;
    let mut remote = Remote::new(args.commands);
    let keys = remote.has_keys();
    let played = play(&options, &stop, &mut || remote.ask(&stop), || {
        let more = if keys { "; space pauses, ← and → skip 5 s, + and - change the rate\r" } else { "" };
        if !json {
            eprintln!("playing as robot \"{name}\"; Ctrl-C ends it{more}");
        }
    });
    drop(remote);
    let played = played?;
    let mut out = Out::stdout();
    match json {
        true => out.json(&serde_json::to_value(played)?)?,
        false => out.line(format!("played {} in {}", count(played.samples as usize, "sample"), span(played.took_s)))?,
    }
    out.flush()
}
