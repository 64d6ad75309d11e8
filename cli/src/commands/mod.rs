//! The command line: one binary, one word per thing to do.

mod barn;
pub mod bench;
mod call;
mod cat;
mod change;
mod chaos;
mod check;
mod compare;
mod doctor;
mod down;
mod drive;
mod estop;
mod experiments;
mod goto;
mod graph;
mod help;
mod hz;
mod incidents;
mod info;
mod live;
mod logs;
mod ls;
mod mode;
pub mod node;
mod play;
mod play_remote;
mod record;
mod recover;
mod replay;
pub mod run;
mod schema;
mod shrink;
pub mod simulate;
mod spawn;
mod steer;
mod top;
mod tree;

use crate::built_in::node_types;
use crate::exit::{Failure, OK};
use crate::output::{Paint, Tone};
use clap::{FromArgMatches, Parser, Subcommand};
use runtime::NodeType;
use std::io::Write;
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
    #[command(after_help = help::SHRINK)]
    Shrink(shrink::Args),
    #[command(after_help = help::COMPARE)]
    Compare(compare::Args),
    #[command(after_help = help::BARN)]
    Barn(barn::Args),
    #[command(after_help = help::DRIVE)]
    Drive(drive::Args),
    #[command(after_help = help::GOTO)]
    Goto(goto::Args),
    #[command(after_help = help::MODE)]
    Mode(mode::Args),
    #[command(after_help = help::DOWN)]
    Down(down::Args),
    #[command(after_help = help::ESTOP)]
    Estop(estop::Args),
    #[command(after_help = help::RESET)]
    Reset(estop::PersonArgs),
    #[command(after_help = help::RESUME)]
    Resume(estop::PersonArgs),
    #[command(after_help = help::START)]
    Start(steer::Args),
    #[command(after_help = help::STOP)]
    Stop(steer::Args),
    #[command(after_help = help::RESTART)]
    Restart(steer::Args),
    #[command(after_help = help::CLEAR)]
    Clear(steer::ClearArgs),
    #[command(after_help = help::SET)]
    Set(change::SetArgs),
    #[command(after_help = help::WIRE)]
    Wire(change::WireArgs),
    #[command(after_help = help::SPAWN)]
    Spawn(spawn::Args),
    #[command(after_help = help::REPLACE)]
    Replace(steer::ReplaceArgs),
    #[command(after_help = help::TOP)]
    Top(top::Args),
    #[command(after_help = help::INCIDENTS)]
    Incidents(incidents::Args),
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
    #[command(after_help = help::RECORD)]
    Record(record::Args),
    #[command(after_help = help::LIVE)]
    Live(live::Args),
    #[command(after_help = help::INFO)]
    Info(info::Args),
    #[command(after_help = help::PLAY)]
    Play(play::Args),
    #[command(after_help = help::REPLAY)]
    Replay(replay::Args),
    #[command(after_help = help::RECOVER)]
    Recover(recover::Args),
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
    #[command(after_help = help::CHAOS)]
    Chaos(chaos::Args),
    #[command(hide = true, after_help = help::NODE)]
    Node(node::Args),
    #[command(hide = true, after_help = help::TREE)]
    Tree(tree::TreeArgs),
    #[command(hide = true, after_help = help::SUPERVISE)]
    Supervise(tree::SuperviseArgs),
}

/// The program: `sinew` itself, or a user's binary that adds node types of its own.
pub fn main(extra: &[NodeType]) -> ExitCode {
    // Root and guard of a process tree run in this image: they need nothing of what follows.
    guard::main_of(std::env::args_os().skip(1).collect());
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
                let error = Paint::stderr().tone(Tone::Bad, "error:");
                // A terminal that has gone hears nothing, and that is no reason to panic.
                let _ = writeln!(std::io::stderr(), "{error} {}", failure.message);
            }
            ExitCode::from(failure.code)
        }
    }
}

fn dispatch(command: Command, types: &[NodeType]) -> Result<(), Failure> {
    match command {
        Command::Run(args) => run::run(args, types),
        Command::Simulate(args) => simulate::run(args, types),
        Command::Shrink(args) => shrink::run(&args, types),
        Command::Compare(args) => compare::run(&args),
        Command::Barn(args) => barn::run(args, types),
        Command::Drive(args) => drive::run(args, types),
        Command::Goto(args) => goto::run(args),
        Command::Mode(args) => mode::run(args, types),
        Command::Down(args) => down::run(args),
        Command::Estop(args) => estop::run(args),
        Command::Reset(args) => estop::person(&args, "reset"),
        Command::Resume(args) => estop::person(&args, "resume"),
        Command::Start(args) => steer::run(&args, "start"),
        Command::Stop(args) => steer::run(&args, "stop"),
        Command::Restart(args) => steer::run(&args, "restart"),
        Command::Replace(args) => steer::replace(&args),
        Command::Clear(args) => steer::clear(&args),
        Command::Set(args) => change::set(&args, types),
        Command::Wire(args) => change::wire(&args, types),
        Command::Spawn(args) => spawn::run(&args, types),
        Command::Top(args) => top::run(&args),
        Command::Incidents(args) => incidents::run(&args),
        Command::Ls(args) => ls::run(args),
        Command::Cat(args) => cat::run(args),
        Command::Hz(args) => hz::run(args),
        Command::Call(args) => call::run(args),
        Command::Logs(args) => logs::run(args),
        Command::Record(args) => record::run(args, types),
        Command::Live(args) => live::run(&args),
        Command::Info(args) => info::run(args),
        Command::Play(args) => play::run(args),
        Command::Replay(args) => replay::run(args, types),
        Command::Recover(args) => recover::run(args),
        Command::Check(args) => check::run(args, types),
        Command::Graph(args) => graph::run(args, types),
        Command::Schema(args) => schema::run(args, types),
        Command::Experiments(args) => experiments::run(args),
        Command::Chaos(args) => chaos::run(args, types),
        Command::Bench(args) => bench::run(args, types),
        Command::Doctor(args) => doctor::run(args),
        Command::Node(args) => node::run(args, types),
        Command::Tree(args) => tree::prepare(args, types),
        Command::Supervise(args) => tree::supervise(args, types),
    }
}
