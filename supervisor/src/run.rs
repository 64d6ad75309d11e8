//! One run of a robot, from the claim of its name to the removal of its folder.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::Path;

use runtime::clock::{self, wall_seconds};

use crate::claim::{Claim, ClaimError};
use crate::control::Control;
use crate::host::Host;
use crate::incidents::{Journal, Record};
use crate::leftovers;
use crate::logs::NodeLog;
use crate::observer::{Guarded, Observer, Outcome, Report, StopCause};
use crate::plan::{Plan, Program};
use crate::policy::Policy;
use crate::processes::{Command, Launcher, READY_FD};
use crate::signals::Signals;
use crate::slot::Slot;
use crate::wall::utc;

/// Why a robot was not run.
#[derive(Debug, thiserror::Error)]
pub enum SuperviseError {
    /// The plan contradicts itself.
    #[error("{0}")]
    Plan(String),
    /// A node's program cannot be run.
    #[error("node `{instance}`: {error}")]
    Program {
        /// The node.
        instance: String,
        /// What is wrong with its program.
        error: io::Error,
    },
    /// The robot's folder cannot be had.
    #[error(transparent)]
    Claim(#[from] ClaimError),
    /// The robot's folder could not be filled.
    #[error("{0}")]
    Fill(String),
    /// The process tree ended without saying how.
    #[error(
        "the process tree of the robot ended unexpectedly ({0}); its nodes stop by themselves; `sinew logs` may say why"
    )]
    Lost(String),
    /// The system refused something that every run needs.
    #[error("cannot {what}: {error}")]
    System {
        /// What was tried.
        what: &'static str,
        /// The system's reason.
        error: io::Error,
    },
}

pub(crate) fn system(what: &'static str) -> impl FnOnce(io::Error) -> SuperviseError {
    move |error| SuperviseError::System { what, error }
}

/// [`run_prepared`] without anything to prepare.
pub fn run(plan: Plan, observer: &mut dyn Observer) -> Result<Outcome, SuperviseError> {
    run_prepared(plan, |_| Ok(()), observer)
}

/// Runs the plan's nodes until SIGINT, SIGTERM, SIGHUP, `down` or the plan's stop handle ends it, or none is left.
/// Returns when no process and no file of the run is left. `fill` puts what the nodes need to find into the robot's
/// folder, once it is claimed and empty; when it fails nothing is started.
pub fn run_prepared(
    plan: Plan,
    fill: impl FnOnce(&Path) -> Result<(), String>,
    observer: &mut dyn Observer,
) -> Result<Outcome, SuperviseError> {
    if let Some(flaw) = plan.flaw() {
        return Err(SuperviseError::Plan(flaw));
    }
    let launcher = Launcher::new().map_err(system("open /dev/null"))?;
    // Before the claim, so that no signal finds a claimed folder and nobody to clear it.
    let signals = Signals::catch().map_err(system("catch signals"))?;
    let claim = Claim::take(&plan.root, &plan.robot)?;
    let found = leftovers::clear(&claim).map_err(system("remove what an earlier run left"))?;
    let filled = fill(claim.root()).map_err(SuperviseError::Fill);
    let prepared = filled.and_then(|()| claim.announce().map_err(SuperviseError::from)).and_then(|()| {
        let commands = commands(&plan, &claim, false)?;
        Ok((commands, Control::listen(claim.root()).map_err(system("listen for requests"))?))
    });
    let (commands, control) = match prepared {
        Ok(prepared) => prepared,
        Err(error) => {
            claim.release().map_err(system("remove the robot's folder"))?;
            return Err(error);
        }
    };
    let mut observer = Guarded::new(observer);
    let (log_folder, journal) = open_journal(&plan, &mut observer);
    // A robot whose reactions execute nothing needs no log of it.
    let errands_log = log_folder.filter(|_| !plan.commands.is_empty());
    let errands_log = errands_log.and_then(|folder| NodeLog::create(folder, "reactions").ok());
    let mut slots = Vec::new();
    for (program, command) in plan.programs.iter().zip(commands) {
        let log = open_log(log_folder, program, &mut observer, false);
        slots.push(Slot::new(program.instance.clone(), program.file_name(), command, program.rule.reports_ready, log));
    }
    let mut host = Host {
        slots,
        policy: Policy::new(plan.programs.iter().map(|program| program.rule)),
        control,
        signals,
        stop: plan.stop.clone(),
        launcher,
        log_folder: log_folder.map(|folder| folder.display().to_string()),
        journal,
        incidents: VecDeque::new(),
        observer,
        channels: crate::channels::Channels::none(),
        detectors: crate::detectors::Detectors::none(),
        errands: crate::errands::Errands::new(
            &plan.robot,
            claim.root(),
            plan.commands.clone(),
            plan.awaited.clone(),
            errands_log,
        ),
        begun: clock::now(),
        stopped_by: StopCause::NothingLeft,
        interrupts: 0,
        told: None,
        done: false,
        inside: None,
        run_folder: claim.run_folder(),
        claim,
    };
    if let Some(found) = found {
        host.keep(robot_record(&plan.robot, found.sentence()));
    }
    host.run();
    finish(host)
}

/// The programs as they will be started; one that cannot be found is refused before the first process is started.
pub(crate) fn commands(plan: &Plan, claim: &Claim, in_tree: bool) -> Result<Vec<Command>, SuperviseError> {
    let mut line = 0;
    let command = |program: &Program| {
        let mut told = environment(plan, program, claim);
        if in_tree {
            told.push(("SINEW_LATCH_FD".into(), LATCH_FD.to_string().into()));
            told.push(("SINEW_TABLE".into(), format!("{TABLE_FD} {line} {}", program.beats).into()));
        }
        line += program.beats;
        let failed = |error| SuperviseError::Program { instance: program.instance.clone(), error };
        Command::new(&program.argv, &told).map_err(failed)
    };
    plan.programs.iter().map(command).collect()
}

/// Numbers of the descriptors under which a node of a process tree finds the heartbeats and the latch.
pub(crate) const TABLE_FD: i32 = 4;
pub(crate) const LATCH_FD: i32 = 5;

/// What every node is told; `Process::start` adds SINEW_RESTARTS.
fn environment(plan: &Plan, program: &Program, claim: &Claim) -> Vec<(OsString, OsString)> {
    let mut told: Vec<(OsString, OsString)> = vec![
        ("SINEW_ROBOT".into(), plan.robot.clone().into()),
        ("SINEW_NODE".into(), program.instance.clone().into()),
        ("SINEW_ROOT".into(), plan.root.clone().into()),
        ("SINEW_RUN".into(), claim.owner().run.clone().into()),
        ("SINEW_SUPERVISOR_PID".into(), claim.owner().pid.to_string().into()),
    ];
    if program.rule.reports_ready {
        told.push(("SINEW_READY_FD".into(), READY_FD.to_string().into()));
    }
    let own = |(name, _): &&(OsString, OsString)| told.iter().all(|(taken, _)| taken != name);
    let more: Vec<_> = program.env.iter().filter(own).cloned().collect();
    told.extend(more);
    told
}

/// The folder of the logs with the journal in it. A robot whose disk is full or read-only runs without, and says so.
pub(crate) fn open_journal<'a>(plan: &'a Plan, observer: &mut Guarded<'_>) -> (Option<&'a Path>, Journal) {
    let Some(folder) = plan.log_folder.as_deref() else { return (None, Journal::none()) };
    match fs::create_dir_all(folder).and_then(|()| Journal::open(folder)) {
        Ok(journal) => (Some(folder), journal),
        Err(error) => {
            let folder = folder.display();
            observer.report(Report::Note(&format!("no logs are kept: {folder}: {error}; set SINEW_STATE to a folder")));
            (None, Journal::none())
        }
    }
}

pub(crate) fn open_log(
    folder: Option<&Path>,
    program: &Program,
    observer: &mut Guarded<'_>,
    go_on: bool,
) -> Option<NodeLog> {
    let open = if go_on { NodeLog::go_on } else { NodeLog::create };
    let error = match open(folder?, &program.file_name()) {
        Ok(log) => return Some(log),
        Err(error) => error,
    };
    observer.report(Report::Note(&format!("no log is kept of {}: {error}", program.instance)));
    None
}

/// Leaves nothing behind: also not what nodes forked and put into sessions of their own.
pub(crate) fn finish(mut host: Host<'_>) -> Result<Outcome, SuperviseError> {
    let strays = leftovers::kill_run(host.claim.owner());
    if strays > 0 {
        let message = format!("killed {strays} processes that nodes had started and left behind");
        host.keep(robot_record(&host.claim.owner().robot.clone(), message));
    }
    let outcome = host.outcome();
    let Host { claim, control, observer, .. } = host;
    claim.release().map_err(system("remove the robot's folder"))?;
    // Last: the end of their connections tells those who said `down` that nothing is left.
    drop(control);
    observer.resume();
    Ok(outcome)
}

pub(crate) fn robot_record(robot: &str, message: String) -> Record {
    let (time, at_s) = (utc(wall_seconds()), clock::now().seconds());
    Record { time, at_s, robot: robot.to_owned(), event: "leftovers".to_owned(), message, ..Record::default() }
}
