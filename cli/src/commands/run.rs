//! `sinew run`: a robot with all its nodes as supervised processes, until Ctrl-C.

use crate::exit::{CHECK, Failure, USAGE};
use crate::launch::Launch;
use crate::load::{self, Changes};
use crate::view;
use runtime::channel::Tree;
use runtime::robot::{Graph, Isolate, RecordTable, Robot};
use runtime::{Layer, NodeType, TWINS, clock};
use std::path::PathBuf;
use std::sync::mpsc;
use supervisor::isolation::{self, IDENTITY, Ownership};
use supervisor::{Care, Crew, Front, Outcome, Plan, Program, Restart, RobotPlan, StopHandle};

/// Runs a robot: every node as a supervised process of its own
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder or file of the robot; without it the built-in Pioneer in its office
    robot: Option<PathBuf>,
    /// Stops after this time, as in 60s or 5min
    #[arg(long = "for", value_name = "TIME")]
    length: Option<String>,
    /// Prints one JSON object per second and one at the end
    #[arg(long)]
    json: bool,
    /// Prints lines even on a terminal
    #[arg(long)]
    plain: bool,
    /// Seed of the simulated world
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where the picture of the run goes; "none" for none
    #[arg(long, value_name = "FILE", default_value = "sinew-run.svg")]
    svg: PathBuf,
    /// Records the run to this file, so that every node of it can be replayed
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Starts standing: nothing moves before `sinew resume`
    #[arg(long)]
    stand: bool,
    #[command(flatten)]
    changes: Changes,
}

/// Runs the robot and shows it.
pub fn run(mut args: Args, types: &[NodeType]) -> Result<(), Failure> {
    if let Some(file) = &args.record {
        let file = toml::Value::String(std::path::absolute(file)?.display().to_string());
        args.changes.set.push(format!("record.file={file}"));
    }
    let length_s = args.length.as_deref().map(crate::output::parse_seconds).transpose();
    let length_s = length_s.map_err(|reason| Failure::new(USAGE, reason))?;
    let robot = load::robot(args.robot.as_deref(), &args.changes, types)?;
    let graph = robot.graph().map_err(load::errors)?;
    let verdict = crate::admission::judge(&graph, &robot.file);
    if !verdict.errors.is_empty() {
        return Err(load::errors(verdict.errors));
    }
    for warning in &graph.warnings {
        eprintln!("warning: {warning}");
    }
    warn_of_refused_real_time(&robot);
    for line in isolation::warnings(&robot) {
        eprintln!("warning: {line}");
    }
    let stop = StopHandle::new()?;
    let (reports, inbox) = mpsc::channel();
    let root = plan(&robot)?.root;
    let front = Front {
        program: std::env::current_exe()?,
        arguments: ["tree"].into_iter().chain(args.stand.then_some("--stand")).map(Into::into).collect(),
        input: serde_json::to_vec(&Launch::new(&robot, args.seed))?,
        stop: Some(stop.clone()),
    };
    let supervising = std::thread::Builder::new().name("supervisor".into()).spawn(move || {
        let mut observer = |report: supervisor::Report<'_>| {
            let _ = reports.send(view::News::of(report));
        };
        supervisor::run_tree(front, &mut observer)
    })?;
    let until = length_s.map(|seconds| clock::now().after_s(seconds));
    let over = || supervising.is_finished();
    let face = view::Face::choose(args.json, args.plain);
    let shown = view::show(face, &robot, &root, inbox, until, &stop, &over);
    if shown.is_err() {
        stop.stop();
    }
    let outcome = supervising.join().map_err(|_| Failure::from("the supervisor's thread panicked"))?;
    let outcome = outcome.map_err(|e| Failure::new(code_of(&e), e.to_string()))?;
    let seen = shown?;
    if args.svg.as_os_str() != "none" && seen.track.len() > 1 {
        let picture = crate::picture::of_track(&robot, &seen.track)?;
        std::fs::write(&args.svg, picture)
            .map_err(|e| Failure::from(format!("cannot write {}: {e}", args.svg.display())))?;
    }
    view::farewell(face, &outcome, &seen, &args.svg)?;
    judge(&outcome)
}

/// Everything that the nodes find in the robot's folder: the launch's facts and every ring. All memory that the
/// channels need is taken here, before anything moves.
pub(super) fn fill(root: &std::path::Path, launch: &Launch, graph: &Graph) -> Result<(), String> {
    launch.write(root).map_err(|e| e.message)?;
    let tree = Tree::shared(root).map_err(|e| e.to_string())?;
    if graph.nodes.iter().any(|node| node.spec.isolate == Isolate::Strict) {
        // Where driver and twin meet: the twin must not be able to write among the supervisor's files.
        for node in graph.nodes.iter().filter(|node| node.spec.kind.layer == Layer::Drivers) {
            std::fs::create_dir_all(root.join(TWINS).join(&node.spec.instance)).map_err(|e| e.to_string())?;
        }
    }
    for node in &graph.nodes {
        for written in &node.writes {
            tree.prepare(&written.path, &written.geometry).map_err(|e| e.to_string())?;
        }
    }
    for (path, geometry) in supervisor::supervisor_channels() {
        tree.prepare(path, &geometry).map_err(|e| e.to_string())?;
    }
    Ok(())
}

/// A process for each node, or for each group of nodes that share one.
pub(super) fn plan(robot: &Robot) -> Result<Plan, Failure> {
    let program = std::env::current_exe()?;
    let root = supervisor::root_folder(&robot.name);
    let ownership = Ownership::of(robot);
    let RobotPlan { mut crews, mut supervision, commands, paths } = RobotPlan::of(robot);
    let programs = crews.iter().zip(&supervision.nodes).map(|(crew, care)| {
        let mut argv = vec![program.clone().into_os_string(), "node".into(), "--root".into(), root.clone().into()];
        argv.extend(crew.nodes.iter().map(|&node| robot.nodes[node].path().into()));
        let mut program = Program::new(crew.name.clone(), argv);
        program.beats = crew.nodes.len();
        program.rule = care.rule;
        let identity = ownership.as_ref().and_then(|ownership| ownership.of_process(&crew.paths));
        program.env.extend(identity.map(|identity| (IDENTITY.into(), identity.to_word().into())));
        program
    });
    let mut programs: Vec<Program> = programs.collect();
    if let Some(record) = &robot.record {
        let program = recorder(robot, record, &program)?;
        crews.push(Crew { name: program.instance.clone(), nodes: Vec::new(), paths: Vec::new(), fresh: Vec::new() });
        supervision.nodes.push(Care::plain(program.rule));
        programs.push(program);
    }
    Ok(Plan {
        supervision: Some(supervision),
        crews,
        tasks: supervisor::node_tasks(robot),
        commands,
        awaited: paths,
        ownership,
        ..Plan::new(robot.name.clone(), programs)
    })
}

/// The recorder: the first to start and the last to stop. When it ends, for want of space say, the robot goes on.
fn recorder(robot: &Robot, record: &RecordTable, program: &std::path::Path) -> Result<Program, Failure> {
    let file = match &record.file {
        Some(file) => PathBuf::from(file),
        None => std::path::absolute(&record.folder)?.join(super::record::file_name(&robot.name)),
    };
    if file.is_file() {
        let text = format!("{} is there already, and a recording replaces nothing", file.display());
        return Err(Failure::new(USAGE, text));
    }
    let mut argv = vec![program.as_os_str().to_owned(), "record".into(), robot.name.clone().into()];
    argv.extend(["-o".into(), file.into_os_string(), "--from-start".into(), "--json".into()]);
    for path in &record.paths {
        argv.extend(["--paths".into(), path.into()]);
    }
    let mut program = Program::new("recorder", argv);
    program.rule.restart = Restart::Never;
    program.rule.stop_group = 3;
    program.rule.grace_s = 10.0;
    Ok(program)
}

/// One warning for all nodes, where the robot file asks for what this user may not have.
fn warn_of_refused_real_time(robot: &Robot) {
    let asked = robot.realtime;
    // Asked in a thread of its own: what it is granted ends with it.
    let grants = std::thread::spawn(move || {
        let probe = runtime::robot::RealtimeTable { runaway_ms: 0, lock_memory: false, ..asked };
        runtime::realtime::apply(&probe, 1, "probe")
    });
    if let Ok(grants) = grants.join()
        && let runtime::realtime::Grant::Refused(why) = grants.scheduler
    {
        eprintln!("warning: running without real-time priority: {why}");
    }
}

fn code_of(error: &supervisor::SuperviseError) -> u8 {
    match error {
        supervisor::SuperviseError::Plan(_) => CHECK,
        _ => crate::exit::FAILED,
    }
}

fn judge(outcome: &Outcome) -> Result<(), Failure> {
    match outcome.lost.as_slice() {
        [] => Ok(()),
        lost => {
            Err(Failure::from(format!("nodes given up: {}; `sinew logs NODE` shows their last words", lost.join(", "))))
        }
    }
}
