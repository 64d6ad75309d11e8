//! The command line: one binary, one word per thing to do.

pub mod bench;
mod call;
mod cat;
mod check;
mod compare;
mod doctor;
mod down;
mod drive;
mod experiments;
mod goto;
mod graph;
mod help;
mod hz;
mod logs;
mod ls;
mod mode;
pub mod node;
pub mod run;
mod schema;
pub mod simulate;

use crate::built_in::node_types;
use crate::exit::{Failure, OK};
use crate::output::{Paint, Tone};
use clap::{FromArgMatches, Parser, Subcommand};
use runtime::NodeType;
use std::process::ExitCode;

/// Sinew runs, watches and simulates mobile robots
#[derive(Debug, Parser)]
#[command(name = "sinew", version, disable_help_subcommand = true)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[command(after_help = help::RUN)]
    Run(run::Args),
    #[command(after_help = help::SIMULATE)]
    Simulate(simulate::Args),
    #[command(after_help = help::COMPARE)]
    Compare(compare::Args),
    #[command(after_help = help::DRIVE)]
    Drive(drive::Args),
    #[command(after_help = help::GOTO)]
    Goto(goto::Args),
    #[command(after_help = help::MODE)]
    Mode(mode::Args),
    #[command(after_help = help::DOWN)]
    Down(down::Args),
    #[command(after_help = help::LS)]
    Ls(ls::Args),
    #[command(after_help = help::CAT)]
    Cat(cat::Args),
    #[command(after_help = help::HZ)]
    Hz(hz::Args),
    #[command(after_help = help::CALL)]
    Call(call::Args),
    #[command(after_help = help::LOGS)]
    Logs(logs::Args),
    #[command(after_help = help::CHECK)]
    Check(check::Args),
    #[command(after_help = help::GRAPH)]
    Graph(graph::Args),
    #[command(after_help = help::SCHEMA)]
    Schema(schema::Args),
    #[command(after_help = help::EXPERIMENTS)]
    Experiments(experiments::Args),
    #[command(after_help = help::BENCH)]
    Bench(bench::Args),
    #[command(after_help = help::DOCTOR)]
    Doctor(doctor::Args),
    #[command(hide = true, after_help = help::NODE)]
    Node(node::Args),
}

/// The program: `sinew` itself, or a user's binary that adds node types of its own.
pub fn main(extra: &[NodeType]) -> ExitCode {
    let parsed = help::command_line().try_get_matches();
    let command = match parsed.and_then(|matches| CommandLine::from_arg_matches(&matches)) {
        Ok(line) => line.command,
        // Help and version are no errors; clap knows, and knows where to print them.
        Err(e) => e.exit(),
    };
    match dispatch(command, &node_types(extra)) {
        Ok(()) => ExitCode::from(OK),
        Err(failure) => {
            if !failure.message.is_empty() {
                eprintln!("{} {}", Paint::stderr().tone(Tone::Bad, "error:"), failure.message);
            }
            ExitCode::from(failure.code)
        }
    }
}

fn dispatch(command: Command, types: &[NodeType]) -> Result<(), Failure> {
    match command {
        Command::Run(args) => run::run(args, types),
        Command::Simulate(args) => simulate::run(args, types),
        Command::Compare(args) => compare::run(&args),
        Command::Drive(args) => drive::run(args, types),
        Command::Goto(args) => goto::run(args),
        Command::Mode(args) => mode::run(args, types),
        Command::Down(args) => down::run(args),
        Command::Ls(args) => ls::run(args),
        Command::Cat(args) => cat::run(args),
        Command::Hz(args) => hz::run(args),
        Command::Call(args) => call::run(args),
        Command::Logs(args) => logs::run(args),
        Command::Check(args) => check::run(args, types),
        Command::Graph(args) => graph::run(args, types),
        Command::Schema(args) => schema::run(args, types),
        Command::Experiments(args) => experiments::run(args),
        Command::Bench(args) => bench::run(args, types),
        Command::Doctor(args) => doctor::run(args),
        Command::Node(args) => node::run(args, types),
    }
}
