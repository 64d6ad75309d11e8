//! `sinew experiments`: the service robot's experiments, and whether they reach what they must.

use crate::built_in::node_types;
use crate::exit::{CHECK, Failure, USAGE};
use crate::experiments::{ALL, Extent, Figure, Outcome, Target};
use crate::output::{Align, Cell, Out, Table, Tone, number};
use runtime::robot::nearest_advice;
use serde_json::json;
use std::path::PathBuf;

/// Repeats the reflexive layer's experiments in simulation and holds them to their figures
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which: goto, goto_avoid, goto_avoid_laser, emergency_stop, move, profiles; without any all of them
    name: Vec<String>,
    /// A tenth of the runs: for a look, not for figures
    #[arg(long)]
    quick: bool,
    /// Threads; without it all cores. The results do not depend on it
    #[arg(long)]
    jobs: Option<usize>,
    /// Another robot file in the service robot's stead, with the same nodes: to try other settings
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Draws plots into this folder
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
    /// Prints JSON, an object per experiment
    #[arg(long)]
    json: bool,
}

/// Runs the experiments and prints what they found.
pub fn run(args: Args) -> Result<(), Failure> {
    let names: Vec<&str> = ALL.iter().map(|(name, _)| *name).collect();
    for name in &args.name {
        if !names.contains(&name.as_str()) {
            return Err(Failure::new(
                USAGE,
                format!("there is no experiment \"{name}\"; {}", nearest_advice(name, &names)),
            ));
        }
    }
    let jobs = args.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let changes = crate::load::Changes::default();
    let robot =
        args.robot.as_deref().map(|file| crate::load::robot(Some(file), &changes, &node_types(&[]))).transpose()?;
    let extent = Extent { part: if args.quick { 0.1 } else { 1.0 }, jobs, robot };
    let mut out = Out::stdout();
    let mut missed = Vec::new();
    for (name, experiment) in ALL.iter().filter(|(name, _)| args.name.is_empty() || args.name.iter().any(|n| n == name))
    {
        let outcome = experiment(&extent)?;
        if let Some(folder) = &args.plot {
            draw(&outcome, folder)?;
        }
        if !outcome.holds() {
            missed.push(*name);
        }
        print(&outcome, args.json, &mut out)?;
        out.flush()?;
    }
    match missed.is_empty() {
        true => Ok(()),
        false => Err(Failure::new(CHECK, format!("not reached: {}", missed.join(", ")))),
    }
}

fn draw(outcome: &Outcome, folder: &std::path::Path) -> Result<(), Failure> {
    let cannot = |e: std::io::Error| Failure::from(format!("cannot write to {}: {e}", folder.display()));
    std::fs::create_dir_all(folder).map_err(cannot)?;
    for (name, svg) in &outcome.pictures {
        std::fs::write(folder.join(name), svg).map_err(cannot)?;
    }
    Ok(())
}

fn print(outcome: &Outcome, as_json: bool, out: &mut Out) -> Result<(), Failure> {
    if as_json {
        let mut value = serde_json::to_value(outcome)?;
        value["holds"] = json!(outcome.holds());
        return out.json(&value);
    }
    let title = out.paint.strong(outcome.experiment);
    let about = out.paint.dim(format!("{} runs: {}", outcome.runs, outcome.conditions));
    out.line(format!("{title}  {about}"))?;
    let mut table =
        Table::new(&[("FIGURE", Align::Left), ("VALUE", Align::Right), ("", Align::Left), ("TARGET", Align::Left)]);
    for figure in &outcome.figures {
        table.row([
            figure.name.into(),
            Cell::toned(if figure.holds() { Tone::Good } else { Tone::Bad }, number(figure.value)),
            figure.unit.into(),
            Cell::toned(Tone::Dim, target(figure)),
        ]);
    }
    out.table(&table)?;
    for remark in &outcome.remarks {
        out.line(out.paint.dim(format!("  {remark}")))?;
    }
    out.line("")
}

fn target(figure: &Figure) -> String {
    match figure.target {
        Some(Target::AtMost(bound)) => format!("at most {}", number(bound)),
        Some(Target::AtLeast(bound)) => format!("at least {}", number(bound)),
        None => String::new(),
    }
}
