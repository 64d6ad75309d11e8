//! `sinew info`: what is in a recording.

use crate::exit::{CHECK, Failure};
use crate::output::{Align, Cell, Out, Table, Tone, bytes, rate, span};
use recorder::info::Info;
use std::path::PathBuf;

/// Tells what is in a recording: topics, types, counts, rates, losses, incidents
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    file: PathBuf,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// Prints what is in the file.
pub fn run(args: Args) -> Result<(), Failure> {
    let info = recorder::info::info(&args.file)?;
    let mut out = Out::stdout();
    match args.json {
        true => out.json(&serde_json::to_value(&info)?)?,
        false => print(&info, &mut out)?,
    }
    out.flush()?;
    match &info.damage {
        Some(_) if args.json => Err(Failure::new(CHECK, "")),
        Some(damage) => Err(Failure::new(CHECK, damage.clone())),
        None => Ok(()),
    }
}

fn print(info: &Info, out: &mut Out) -> Result<(), Failure> {
    let title = format!("robot \"{}\", {}, {}", info.robot, info.host, span(info.duration_s));
    out.line(out.paint.strong(title))?;
    let started = if info.started.is_empty() { String::new() } else { format!(", started {}", info.started) };
    out.line(format!("{}, seed {}, build {}{started}", bytes(info.bytes), info.seed, info.build))?;
    let lossless = info.missing == 0 && info.lost == 0;
    let losses = format!("{} messages, {} missing, {} lost by the recorder", info.messages, info.missing, info.lost);
    out.line(if lossless { losses } else { out.paint.tone(Tone::Warn, losses) })?;
    let replayable = match info.replayable.is_empty() {
        true => "none: see `sinew replay --help`".to_owned(),
        false => info.replayable.join(" "),
    };
    out.line(format!("replayable: {replayable}"))?;
    out.line("")?;
    let mut table = Table::new(&[
        ("TOPIC", Align::Left),
        ("TYPE", Align::Left),
        ("COUNT", Align::Right),
        ("RATE", Align::Right),
        ("BYTES", Align::Right),
        ("MISSING", Align::Right),
    ]);
    for topic in &info.topics {
        table.row([
            Cell::from(topic.topic.clone()),
            Cell::from(topic.ros_type.clone()),
            Cell::from(topic.count.to_string()),
            Cell::from(rate(topic.rate_hz)),
            Cell::from(bytes(topic.bytes)),
            Cell::from(topic.missing.to_string()),
        ]);
    }
    out.table(&table)?;
    if !info.incidents.is_empty() {
        out.line("")?;
    }
    for incident in &info.incidents {
        out.line(format!("{:>12.3} s  {}  {}", incident.at_s, incident.node, incident.message))?;
    }
    Ok(())
}
