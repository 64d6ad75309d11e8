//! `sinew estop`, `sinew reset`, `sinew resume`: the stop latch, straight at the guard, past supervisor and nodes.

use crate::exit::{FAILED, Failure, NOT_RUNNING};
use crate::live::{self, LiveRobot};
use crate::output::{Out, span};
use guard::latch::State;
use guard::{ClientError, LatchPage, SourceInfo};
use runtime::clock;
use serde_json::{Value, json};

/// Stops a robot at once; it stands until it is reset and resumed. Anyone may
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot, where several run
    name: Option<String>,
    /// Why, for the record
    #[arg(long, default_value = "no reason given")]
    reason: String,
    /// Only tells where the latch stands, and who wanted it
    #[arg(long)]
    show: bool,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// Takes back a stop, in two steps: reset, then resume
#[derive(Debug, clap::Args)]
pub struct PersonArgs {
    /// The robot, where several run
    name: Option<String>,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

/// How long the guard may take to answer [s].
const ANSWER_WITHIN_S: f64 = 2.0;
/// How long every driver's confirmation is waited for, to be told [s].
const LATCHED_WITHIN_S: f64 = 1.0;

/// Raises the stop, or shows the latch.
pub fn run(args: Args) -> Result<(), Failure> {
    let robot = live::find_below(&live::root(), args.name.as_deref())?;
    let begun = clock::now();
    if !args.show {
        // The first thing to be done, before anything is looked at.
        ask(&robot, &format!("stop {}\n{}", who(), one_line(&args.reason)))?;
    }
    let took_s = clock::now().since(begun);
    let page = look(&robot)?;
    let until = clock::now().after_s(LATCHED_WITHIN_S);
    while !args.show && page.word().state() == State::Stopping && clock::now() < until {
        clock::sleep_s(0.001);
    }
    let latched_s = clock::now().since(begun);
    let mut out = Out::stdout();
    match args.json {
        true => {
            let mut told = told(&robot, &page);
            if !args.show {
                told["took_s"] = json!(took_s);
            }
            out.json(&told)?;
        }
        false if args.show => show(&mut out, &page)?,
        false => {
            out.line(format!("robot \"{}\": {} after {}", robot.name, page.word().state().word(), span(latched_s)))?;
            out.line("It stands until `sinew reset` and then `sinew resume`.")?;
        }
    }
    out.flush()
}

/// Says `reset` or `resume`.
pub fn person(args: &PersonArgs, word: &str) -> Result<(), Failure> {
    let robot = live::find_below(&live::root(), args.name.as_deref())?;
    let answer = ask(&robot, word)?;
    let state = answer.strip_prefix("ok ");
    let Some(state) = state else {
        let why = answer.split_once('\n').map_or(answer.as_str(), |(_, why)| why);
        return Err(Failure::new(FAILED, format!("robot \"{}\": not {word}: {why}", robot.name)));
    };
    let mut out = Out::stdout();
    match args.json {
        true => out.json(&told(&robot, &look(&robot)?))?,
        false if word == "reset" => {
            out.line(format!("robot \"{}\": {state}; it stands until `sinew resume`", robot.name))?;
        }
        false => out.line(format!("robot \"{}\": {state}; it may move", robot.name))?,
    }
    out.flush()
}

fn ask(robot: &LiveRobot, request: &str) -> Result<String, Failure> {
    Ok(guard::ask(&robot.folder, request, ANSWER_WITHIN_S).map_err(failed)?.0)
}

fn failed(error: ClientError) -> Failure {
    match error {
        ClientError::NoGuard(_) => Failure::new(NOT_RUNNING, error.to_string()),
        error => Failure::from(error),
    }
}

fn look(robot: &LiveRobot) -> Result<LatchPage, Failure> {
    let (_, descriptor) = guard::ask(&robot.folder, "look", ANSWER_WITHIN_S).map_err(failed)?;
    let descriptor = descriptor.ok_or_else(|| Failure::from("the guard does not show its latch"))?;
    Ok(LatchPage::map(descriptor)?)
}

fn who() -> String {
    let user = std::env::var("USER").ok().filter(|user| !user.is_empty());
    let user = user.unwrap_or_else(|| format!("user {}", rustix::process::geteuid().as_raw()));
    format!("operator {}", one_line(&user))
}

fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(120).collect()
}

fn told(robot: &LiveRobot, page: &LatchPage) -> Value {
    let source = |source: SourceInfo| {
        json!({
            "name": source.name, "reason": source.reason, "held": source.held, "unix_ms": source.unix_ms,
            "pid": source.by.0, "uid": source.by.1,
        })
    };
    let sources: Vec<Value> = page.sources().into_iter().map(source).collect();
    json!({ "robot": robot.name, "state": page.word().state().word(), "changes": page.word().epoch(), "sources": sources })
}

fn show(out: &mut Out, page: &LatchPage) -> Result<(), Failure> {
    out.line(page.word().state().word())?;
    for source in page.sources() {
        let held = if source.held { ", still held" } else { "" };
        let (pid, uid) = source.by;
        let ago = span(clock::now().since(runtime::Time::from_nanos(source.at_ns)).max(0.0));
        out.line(format!("  {}: {} ({ago} ago, process {pid}, user {uid}{held})", source.name, source.reason))?;
    }
    Ok(())
}
