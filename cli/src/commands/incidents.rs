//! `sinew incidents`: what went wrong, and right again.

use crate::exit::{Failure, NOT_RUNNING};
use crate::live;
use crate::output::Out;
use crate::output::{Align, Cell, Table, Tone};
use supervisor::Record;

/// Lists what went wrong on a robot, and what was done about it
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot; without it the only running one
    name: Option<String>,
    /// Only so many, the newest
    #[arg(long, value_name = "COUNT", default_value_t = 100)]
    last: usize,
    /// Only those of this node
    #[arg(long, value_name = "NODE")]
    node: Option<String>,
    /// Also the last lines that each dead process wrote
    #[arg(long)]
    lines: bool,
    /// Prints a JSON object per incident
    #[arg(long)]
    json: bool,
}

/// Prints the incidents, oldest first.
pub fn run(args: &Args) -> Result<(), Failure> {
    let name = match &args.name {
        Some(name) => name.clone(),
        None => live::find_below(&live::root(), None)?.name,
    };
    let folder = supervisor::log_folder(&name)
        .ok_or_else(|| Failure::new(NOT_RUNNING, "no logs are kept: set SINEW_STATE to a folder"))?;
    let file = folder.join("incidents.jsonl");
    let text = std::fs::read_to_string(&file).map_err(|e| {
        let text = format!("robot \"{name}\" has no incidents: {}: {e}", file.display());
        Failure::new(NOT_RUNNING, text)
    })?;
    // A line that a full disk has cut off is no incident.
    let mut records: Vec<Record> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    if let Some(node) = &args.node {
        records.retain(|record| record.node == *node || record.node.rsplit('/').next() == Some(node));
    }
    let newest = records.split_off(records.len().saturating_sub(args.last));
    let mut out = Out::stdout();
    if args.json {
        for record in &newest {
            out.json(&serde_json::to_value(record)?)?;
        }
        return out.flush();
    }
    let columns = [("time", Align::Left), ("node", Align::Left), ("incident", Align::Left), ("", Align::Left)];
    let mut table = Table::new(&columns);
    for record in &newest {
        let node = if record.node.is_empty() { "the robot" } else { record.node.as_str() };
        table.row([
            Cell::toned(Tone::Dim, record.time.as_str()),
            Cell::toned(Tone::Name, node),
            Cell::from(record.event.as_str()),
            Cell::from(record.message.as_str()),
        ]);
        for line in record.last_lines.iter().filter(|_| args.lines) {
            let nothing = || Cell::from("");
            table.row([nothing(), nothing(), nothing(), Cell::toned(Tone::Dim, format!("| {line}"))]);
        }
    }
    match table.is_empty() {
        true => out.line(format!("robot \"{name}\": nothing has gone wrong"))?,
        false => out.table(&table)?,
    }
    out.flush()
}
