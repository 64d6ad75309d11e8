//! `sinew record`: a running robot into an MCAP file.

use crate::exit::{Failure, NOT_RUNNING, USAGE};
use crate::launch::Launch;
use crate::live::{self, LiveRobot};
use crate::output::{Out, bytes, count, parse_seconds, span};
use recorder::{Facts, RecordError};
use runtime::{NodeType, clock};
use std::path::PathBuf;

/// Records a running robot to an MCAP file that ROS 2 tools read too
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot, where several run
    robot: Option<String>,
    /// Where to; without it NAME-TIME.mcap in the current folder
    #[arg(long = "output", short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// A path, a folder such as /drivers, or a pattern such as /actions/*/proposal; without one everything
    #[arg(long = "paths", value_name = "PATH")]
    paths: Vec<String>,
    /// Stops after this time, as in 60s or 5min
    #[arg(long = "for", value_name = "TIME")]
    length: Option<String>,
    /// Prints one JSON object at the end
    #[arg(long)]
    json: bool,
    /// The supervisor starts it, before the nodes
    #[arg(long, hide = true)]
    from_start: bool,
}

/// Records until Ctrl-C, the end of the time, or the end of the robot.
pub fn run(args: Args, types: &[NodeType]) -> Result<(), Failure> {
    let length_s = args.length.as_deref().map(parse_seconds).transpose();
    let length_s = length_s.map_err(|reason| Failure::new(USAGE, reason))?;
    if let Some(path) = args.paths.iter().find(|path| !path.starts_with('/')) {
        let text = format!("--paths {path}: a path begins with a slash, as in /drivers/base/sonar or /drivers");
        return Err(Failure::new(USAGE, text));
    }
    let stop = recorder::live::stop_by_signals()?;
    let robot = live::find_below(&live::root(), args.robot.as_deref())?;
    if !args.from_start && !live::runs(&robot.folder) {
        return Err(Failure::new(NOT_RUNNING, format!("robot \"{}\" does not run", robot.name)));
    }
    let facts = facts(&robot, types);
    let options = recorder::live::Options {
        root: robot.folder.clone(),
        file: args.output.unwrap_or_else(|| PathBuf::from(file_name(&robot.name))),
        paths: args.paths,
        length_s,
        from_start: args.from_start,
    };
    let from_start = args.from_start;
    let shown = options.file.display().to_string();
    let recorded = recorder::live::record(&options, &facts, &stop, || {
        if from_start {
            runtime::live::report_ready();
        } else if !args.json {
            eprintln!("recording robot \"{}\" to {shown}; Ctrl-C ends it", robot.name);
        }
    });
    let recorded = recorded.map_err(|e| match e {
        RecordError::Exists { .. } | RecordError::Create { .. } => Failure::new(USAGE, e.to_string()),
        e => Failure::from(e),
    })?;
    let mut out = Out::stdout();
    match args.json {
        true => out.json(&serde_json::to_value(&recorded)?)?,
        false => out.line(format!(
            "recorded {} of robot \"{}\" to {}: {} on {}, {} lost, {}",
            span(recorded.duration_s),
            robot.name,
            recorded.file.display(),
            count(recorded.samples as usize, "sample"),
            count(recorded.channels, "channel"),
            recorded.lost,
            bytes(recorded.bytes)
        ))?,
    }
    out.flush()
}

/// Name of a recording: robot and time.
pub fn file_name(robot: &str) -> String {
    let time: String = supervisor::utc(clock::wall_seconds()).chars().filter(char::is_ascii_alphanumeric).collect();
    format!("{robot}-{}.mcap", time.get(..15).unwrap_or(&time))
}

/// What the file says about the run. A robot that was started by hand has no launch: then only its name is known.
fn facts(robot: &LiveRobot, types: &[NodeType]) -> Facts {
    let launch = Launch::read(&robot.folder).ok();
    let known = launch.as_ref().and_then(|launch| Some((launch.robot(types).ok()?, launch.seed)));
    let mut facts = known.map_or_else(Facts::default, |(robot, seed)| Facts::of(&robot, seed, "live"));
    facts.robot.clone_from(&robot.name);
    facts.host = "live".into();
    facts.build = recorder::facts::build_id();
    let (wall_s, now) = (clock::wall_seconds(), clock::now());
    facts.started = supervisor::utc(wall_s);
    facts.clock_offset_ns = ((wall_s * 1e9) as u64).saturating_sub(now.nanos());
    facts
}
