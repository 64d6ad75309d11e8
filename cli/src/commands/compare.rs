//! `sinew compare`: two batches on the same seeds, from their tables.

use crate::batch::{self, Comparison};
use crate::exit::{Failure, USAGE};
use crate::output::{Align, Cell, Out, Table};
use std::path::{Path, PathBuf};

/// Compares two batches of `sinew simulate --csv`: two builds or two configurations on the same seeds
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Table of the first batch
    a: PathBuf,
    /// Table of the second batch
    b: PathBuf,
    /// Prints the comparison as JSON
    #[arg(long)]
    json: bool,
}

/// Compares and prints.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (a, b) = (read(&args.a)?, read(&args.b)?);
    let comparison = batch::compare(&a.missions, &b.missions);
    if comparison.seeds == 0 {
        let (a, b) = (args.a.display(), args.b.display());
        return Err(Failure::new(
            USAGE,
            format!("{a} and {b} have no seed in common; simulate both with the same --seeds"),
        ));
    }
    let mut out = Out::stdout();
    if args.json {
        out.json(&serde_json::to_value(&comparison)?)?;
        return out.flush();
    }
    print(&mut out, &comparison)
}

fn read(file: &Path) -> Result<batch::Table, Failure> {
    let failed = |reason: String| Failure::new(USAGE, format!("{}: {reason}", file.display()));
    let text = std::fs::read_to_string(file).map_err(|e| failed(format!("cannot be read: {e}")))?;
    batch::parse(&text).map_err(|e| failed(e.to_string()))
}

fn print(out: &mut Out, found: &Comparison) -> Result<(), Failure> {
    let share = |side: usize| {
        let [low, high] = found.success_interval[side];
        format!("{:.1} % ({:.1}…{:.1})", 100.0 * found.success[side], 100.0 * low, 100.0 * high)
    };
    out.line(format!("{} seeds in common, {} of them the same to the last bit", found.seeds, found.identical))?;
    if found.unpaired > 0 {
        out.line(format!("{} missions without a partner were left out", found.unpaired))?;
    }
    out.line(format!("success: A {}, B {}; 95 % intervals", share(0), share(1)))?;
    let [a, b] = &found.only;
    let odds = format!("only A succeeded on {} seeds, only B on {}: p = {:.3} (sign test)", a.len(), b.len(), found.p);
    out.line(odds)?;
    for (name, seeds) in [("A", a), ("B", b)] {
        if !seeds.is_empty() {
            let first: Vec<String> = seeds.iter().take(10).map(u64::to_string).collect();
            out.line(format!("  only {name}: seeds {}", first.join(", ")))?;
        }
    }
    out.line("")?;
    let right = |name| (name, Align::Right);
    let mut table = Table::new(&[
        ("METRIC", Align::Left),
        right("MEAN A"),
        right("MEAN B"),
        right("B − A"),
        right("95 % FROM"),
        right("TO"),
        ("", Align::Left),
    ]);
    for metric in &found.metrics {
        let number = |value: f64| format!("{value:.4}");
        let cells = [
            metric.metric.to_owned(),
            number(metric.mean[0]),
            number(metric.mean[1]),
            number(metric.difference),
            number(metric.interval[0]),
            number(metric.interval[1]),
            if metric.significant { "differs".into() } else { String::new() },
        ];
        table.row(cells.map(Cell::from));
    }
    out.table(&table)?;
    out.flush()
}
