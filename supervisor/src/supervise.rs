//! The supervisor's process in a tree: started by the root, again and again if need be.

use std::collections::VecDeque;
use std::fs;
use std::os::fd::OwnedFd;

use guard::{Client, Phase, SUPERVISOR_LINE};
use runtime::clock;

use crate::beats::{BEATS_PER_LIMIT, BeatWatch};
use crate::care::{Care, Supervision};
use crate::channels::Channels;
use crate::claim::Claim;
use crate::detectors::Detectors;
use crate::errands::Errands;
use crate::host::Host;
use crate::host_tree::InTree;
use crate::leftovers;
use crate::load::Teller;
use crate::logs::NodeLog;
use crate::observer::{Guarded, StopCause};
use crate::plan::Plan;
use crate::policy::Policy;
use crate::processes::Launcher;
use crate::run::{LATCH_FD, SuperviseError, TABLE_FD, commands, finish, open_journal, open_log, system};
use crate::saved::Saved;
use crate::signals::Signals;
use crate::slot::Slot;
use crate::telling::{Distant, Telling, tell};
use crate::tree::{FOUND, Tree};
use crate::witness::Witnesses;

/// Above every node: a supervisor that waits for its nodes cannot help them.
const PRIORITY: u8 = 95;

/// A node that says when it is ready and has not said so by then hangs [s].
const START_WITHIN_S: f64 = 5.0;

/// Supervises `plan` as a part of the tree whose root has started this process. Returns when nothing of the run is left
/// but root and guard; the process must then end with [`guard::DONE`].
pub fn supervise(plan: Plan) -> Result<(), SuperviseError> {
    let mut launcher = Launcher::new().map_err(system("open /dev/null"))?;
    let signals = Signals::catch().map_err(system("catch signals"))?;
    let (mut tree, control) = Tree::adopt()?;
    let told = tree.front.try_clone().map_err(system("talk to the program that started the robot"))?;
    let claim = Claim::of_root(&plan.root).ok_or_else(|| {
        SuperviseError::Fill(format!("{} is not held by the root of this process tree", plan.root.display()))
    })?;
    runtime::realtime::ask_for_fifo(PRIORITY);
    let clone = |descriptor: &OwnedFd| descriptor.try_clone().map_err(system("duplicate a descriptor"));
    launcher.give(clone(&tree.table_memory)?, TABLE_FD);
    launcher.give(clone(&tree.latch_memory)?, LATCH_FD);
    let commands = match commands(&plan, &claim, true) {
        Ok(commands) => commands,
        Err(error) => return refuse(&told, claim, error),
    };
    let mut distant = Distant(&told);
    let mut observer = Guarded::new(&mut distant);
    let (log_folder, journal) = open_journal(&plan, &mut observer);
    // A robot whose reactions execute nothing needs no log of it.
    let errands_log = log_folder.filter(|_| !plan.commands.is_empty());
    let errands_log = errands_log.and_then(|folder| NodeLog::create(folder, "reactions").ok());
    let mut slots = Vec::new();
    for (program, command) in plan.programs.iter().zip(commands) {
        let log = open_log(log_folder, program, &mut observer, tree.saved.is_some());
        slots.push(Slot::new(program.instance.clone(), program.file_name(), command, program.rule.reports_ready, log));
    }
    let lines: Vec<usize> = plan.programs.iter().map(|program| program.beats).collect();
    let found = fs::read_to_string(claim.run_folder().join(FOUND)).ok();
    let _ = fs::remove_file(claim.run_folder().join(FOUND));
    let flaw = tree.flaw.take();
    // A state that nobody can read: then the nodes say themselves who they are.
    if flaw.is_some() && tree.saved.is_none() {
        tree.saved = Some(Saved::nameless(&plan));
    }
    let takeovers = tree.saved.as_ref().map_or(0, |saved| saved.takeovers + 1);
    let (channels, flaws) = Channels::open(claim.root());
    let mut host = Host {
        slots,
        policy: Policy::supervising(plan.supervision.clone().unwrap_or_else(|| Supervision {
            nodes: plan.programs.iter().map(care).collect(),
            ..Supervision::default()
        })),
        control,
        signals,
        stop: None,
        launcher,
        log_folder: log_folder.map(|folder| folder.display().to_string()),
        journal,
        incidents: VecDeque::new(),
        observer,
        channels,
        detectors: Detectors::of(claim.root(), &plan.crews),
        errands: Errands::new(&plan.robot, claim.root(), plan.commands.clone(), plan.awaited.clone(), errands_log),
        begun: clock::now(),
        stopped_by: StopCause::NothingLeft,
        interrupts: 0,
        told: None,
        done: false,
        run_folder: claim.run_folder(),
        inside: Some(InTree {
            beats: BeatWatch::new(&tree.table, &lines, clock::now()),
            witnesses: Witnesses::start(),
            // At once: the guard and others wait for the first beat.
            next_look: clock::now(),
            latch_seen: if takeovers == 0 { guard::Word::default() } else { tree.latch.word() },
            takeovers,
            log_folder: log_folder.map(ToOwned::to_owned),
            orphaned: false,
            own: tree.table.line(SUPERVISOR_LINE),
            load: Teller::start(claim.root(), &tree.table, &plan.tasks, clock::now()),
            tree,
        }),
        claim,
    };
    if let Some(found) = found {
        host.tell_of_robot("leftovers", found);
    }
    for flaw in flaws {
        host.tell_of_robot("no_channel", flaw);
    }
    if let Some(flaw) = flaw {
        host.tell_of_robot("state_refused", flaw);
    }
    if takeovers > 0 {
        host.tell_of_robot("takeover", format!("supervisor {takeovers} before this one has died; all nodes go on"));
    }
    let own = host.inside.as_ref().and_then(|inside| inside.own);
    if let Some(own) = own {
        own.begin(std::process::id(), 0, 0);
    }
    // The guard watches this process, too, and is told when it ends in order by its end.
    let attached = Client::connect(host.claim.root()).ok().filter(|guard| guard.attach("supervisor").is_ok());
    host.run();
    if let Some(own) = own {
        own.beat(clock::now().nanos(), Phase::Ended);
    }
    drop(attached);
    let outcome = finish(host)?;
    tell(&told, &Telling::Over(Box::new(outcome)));
    Ok(())
}

/// A plan that cannot be carried out ends the tree: nothing was started.
fn refuse(front: &OwnedFd, claim: Claim, error: SuperviseError) -> Result<(), SuperviseError> {
    let _ = leftovers::kill_run(claim.owner());
    claim.release().map_err(system("remove the robot's folder"))?;
    tell(front, &Telling::Refused { message: error.to_string(), flaw: false });
    Ok(())
}

/// Nodes that beat are killed when they have missed as many beats as their limit holds.
fn care(program: &crate::plan::Program) -> Care {
    let plain = Care::plain(program.rule);
    match program.beats {
        0 => plain,
        _ => beating(plain),
    }
}

/// The same care for a node that beats.
pub(crate) fn beating(plain: Care) -> Care {
    Care { beats_low: BEATS_PER_LIMIT - 1, beats_high: BEATS_PER_LIMIT, start_deadline_s: START_WITHIN_S, ..plain }
}
