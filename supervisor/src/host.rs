//! The policy's hands on a live robot: processes, descriptors, people.
//!
//! One thread, one wait on all descriptors. Deaths are looked at before anything else; nothing waits for anybody but
//! the kernel.

use std::collections::VecDeque;
use std::os::fd::BorrowedFd;
use std::path::{Path, PathBuf};
use std::time::Duration;

use runtime::Time;
use runtime::clock::{self, wall_seconds};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::channels::Channels;
use crate::claim::Claim;
use crate::control::{Control, StopHandle};
use crate::cores::CorePattern;
use crate::detectors::Detectors;
use crate::errands::Errands;
use crate::event::{Action, Event, Incident, IncidentKind};
use crate::exit::Exit;
use crate::host_tree::InTree;
use crate::incidents::{Journal, Record};
use crate::observer::{Guarded, Outcome, Report, StopCause};
use crate::policy::Policy;
use crate::processes::{Launcher, Process};
use crate::requests;
use crate::signals::Signals;
use crate::slot::Slot;
use crate::spawn;
use crate::state::{NodeState, RobotState};
use crate::status::{NodeStatus, Status};
use crate::wall::utc;

/// Incidents kept in memory.
const KEPT_INCIDENTS: usize = 1024;

/// Everything that a run holds.
pub(crate) struct Host<'a> {
    pub claim: Claim,
    pub run_folder: PathBuf,
    pub log_folder: Option<String>,
    pub slots: Vec<Slot>,
    pub policy: Policy,
    pub control: Control,
    pub signals: Signals,
    pub stop: Option<StopHandle>,
    pub launcher: Launcher,
    pub journal: Journal,
    pub incidents: VecDeque<Record>,
    pub observer: Guarded<'a>,
    /// Channels of the robot's tree, where it has one.
    pub channels: Channels,
    pub detectors: Detectors,
    pub errands: Errands,
    pub begun: Time,
    pub stopped_by: StopCause,
    /// Requests that a second one of the same kind turns into an immediate end.
    pub interrupts: u32,
    pub told: Option<RobotState>,
    pub done: bool,
    /// The process tree that this is a part of, if it is.
    pub inside: Option<InTree>,
}

/// Whose descriptor has something to say.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Source {
    Death(usize),
    Ready(usize),
    StandbyDeath(usize),
    StandbyReady(usize),
    Errand,
    Signal,
    Stop,
    Control,
    Front,
    Root,
}

impl Host<'_> {
    /// Runs the robot until no process is left.
    pub fn run(&mut self) {
        // What came while the claim was being taken: then nothing is started at all.
        self.take_signals();
        match self.inside.as_mut().and_then(|inside| inside.tree.saved.take()) {
            Some(saved) => self.take_over(&saved),
            None => self.take(Event::Begin),
        }
        while !self.done {
            for source in self.wait() {
                match source {
                    Source::Death(node) => self.look_for_death(node),
                    Source::Ready(node) => self.look_for_ready(node),
                    Source::StandbyDeath(node) => self.look_for_standby_death(node),
                    Source::StandbyReady(node) => self.look_for_standby_ready(node),
                    // Looked at below, like the paths that are waited for.
                    Source::Errand => {}
                    Source::Signal => self.take_signals(),
                    Source::Stop => self.take_stops(),
                    Source::Control => self.serve(),
                    Source::Front => self.hear_front(),
                    Source::Root => self.orphaned("the root of the process tree is dead: the robot stops"),
                }
            }
            self.look_around();
            self.detect();
            for event in self.errands.look(clock::now()) {
                self.take(event);
            }
            self.take(Event::Timer);
            if self.observer.has_panicked() {
                self.end(StopCause::Program, false);
            }
        }
    }

    /// Silence and lateness.
    fn detect(&mut self) {
        let running = |node: usize| match self.policy.node(node) {
            NodeState::Running { since } => Some(since),
            _ => None,
        };
        for event in self.detectors.look(clock::now(), &running) {
            self.take(event);
        }
    }

    /// How the run ended.
    pub fn outcome(&self) -> Outcome {
        let lost = self.slots.iter().enumerate().filter(|(node, _)| self.policy.node(*node).is_lost());
        Outcome {
            stopped_by: self.stopped_by,
            ran_s: clock::now().since(self.begun),
            lost: lost.map(|(_, slot)| slot.instance.clone()).collect(),
            restarts: self.slots.iter().map(Slot::restarts).sum(),
            incidents: self.incidents.iter().cloned().collect(),
        }
    }

    /// Waits for the next event; those that have come, deaths first.
    fn wait(&self) -> Vec<Source> {
        let mut watched: Vec<(Source, BorrowedFd<'_>)> = Vec::new();
        let living = || self.slots.iter().enumerate().filter_map(|(node, slot)| Some((node, slot.process.as_ref()?)));
        watched.extend(living().map(|(node, process)| (Source::Death(node), process.death())));
        watched.extend(living().filter_map(|(node, process)| Some((Source::Ready(node), process.ready()?))));
        let waiting = || self.slots.iter().enumerate().filter_map(|(node, slot)| Some((node, slot.standby.as_ref()?)));
        watched.extend(waiting().map(|(node, standby)| (Source::StandbyDeath(node), standby.death())));
        watched.extend(waiting().filter_map(|(node, standby)| Some((Source::StandbyReady(node), standby.ready()?))));
        watched.extend(self.errands.watched().map(|descriptor| (Source::Errand, descriptor)));
        watched.push((Source::Signal, self.signals.arrival()));
        watched.extend(self.stop.iter().map(|stop| (Source::Stop, stop.requested())));
        watched.extend(self.control.watched().map(|descriptor| (Source::Control, descriptor)));
        watched.extend(self.inside.iter().flat_map(InTree::watched));

        let mut polled: Vec<PollFd<'_>> =
            watched.iter().map(|(_, descriptor)| PollFd::from_borrowed_fd(*descriptor, PollFlags::IN)).collect();
        let look = self.inside.as_ref().map(|inside| inside.next_look);
        let errand = self.errands.next_look(clock::now());
        let next = [self.policy.next_timer(), look, errand].into_iter().flatten().min();
        let timeout = next.map(|at| Duration::from_nanos(at.nanos_since(clock::now())));
        let timeout = timeout.and_then(|timeout| Timespec::try_from(timeout).ok());
        // A wait that fails (no kernel memory) looks at everything instead: every look is free to find nothing.
        let failed = poll(&mut polled, timeout.as_ref()).is_err_and(|error| error != rustix::io::Errno::INTR);
        let spoke = polled.iter().zip(&watched).filter(|(fd, _)| failed || !fd.revents().is_empty());
        spoke.map(|(_, (source, _))| *source).collect()
    }

    /// Gives the policy an event and does what it says.
    pub fn take(&mut self, event: Event) {
        let mut events = VecDeque::from([event]);
        while let Some(event) = events.pop_front() {
            let (mut actions, mut started) = (Vec::new(), Vec::new());
            self.policy.handle(clock::now(), event, &mut actions);
            for action in actions {
                match action {
                    Action::Start { node } => {
                        self.leave_state();
                        match self.slots[node].start(&self.launcher, &self.run_folder) {
                            Ok(()) => started.push(node),
                            Err(exit) => events.push_back(Event::Died { node, exit }),
                        }
                    }
                    Action::Terminate { node } => self.with_process(node, Process::terminate),
                    Action::Kill { node } => self.with_process(node, Process::kill),
                    Action::Notify(incident) => self.record(incident),
                    Action::StartStandby { node, other } => {
                        if let Err(exit) = self.slots[node].start_standby(&self.launcher, other) {
                            events.push_back(Event::StandbyDied { node, exit });
                        }
                    }
                    Action::Promote { node } => {
                        self.leave_state();
                        match self.slots[node].promote(&self.run_folder) {
                            Ok(()) => started.push(node),
                            Err(exit) => events.push_back(Event::Died { node, exit }),
                        }
                    }
                    // Whoever is dropped is killed and reaped.
                    Action::KillStandby { node } => self.slots[node].standby = None,
                    Action::Revert { node } => {
                        self.slots[node].revert();
                        self.undo(node);
                    }
                    Action::Accept { node } => {
                        self.slots[node].accept();
                        self.forget_undo(node);
                    }
                    Action::Dismiss { node } => {
                        // What is on trial stays as it is: only what was to come after it does not.
                        if self.slots[node].forget_other() && !self.policy.on_trial(node) {
                            self.undo(node);
                        }
                    }
                    Action::Execute { ticket, command } => {
                        if !self.errands.execute(clock::now(), ticket, command, &self.launcher) {
                            events.push_back(Event::Outcome { ticket, success: false });
                        }
                    }
                    Action::Await { ticket, path, within_s } => {
                        if !self.errands.wait_for(clock::now(), ticket, path, within_s) {
                            events.push_back(Event::Outcome { ticket, success: false });
                        }
                    }
                    Action::Heal { node } => {
                        if let Some(inside) = &mut self.inside {
                            inside.beats.heal(node, clock::now());
                        }
                    }
                    // Nodes read both on `/supervisor/robot/state`.
                    Action::Hold { .. } | Action::Limp { .. } => {}
                    Action::Reprioritise { node, above } => self.slots[node].reprioritise(above),
                    Action::Stop { node } => self.latch_stop(node),
                    Action::Done => self.done = true,
                }
            }
            for node in started {
                let slot = &self.slots[node];
                let (instance, pid, restarts) = (&*slot.instance, slot.pid.unwrap_or(0), slot.restarts());
                self.observer.report(Report::Started { instance, pid, restarts });
            }
        }
        self.leave_state();
        self.channels.say(clock::now(), &self.policy);
        let state = self.policy.robot();
        if self.told.replace(state) != Some(state) {
            self.observer.report(Report::Robot(state));
        }
    }

    fn with_process(&self, node: usize, act: impl Fn(&Process)) {
        self.slots[node].process.iter().for_each(act);
    }

    fn look_for_death(&mut self, node: usize) {
        if let Some(exit) = self.slots[node].look_for_death() {
            self.take(Event::Died { node, exit });
            self.slots[node].bury();
        }
    }

    fn look_for_ready(&mut self, node: usize) {
        let slot = &mut self.slots[node];
        if slot.process.as_mut().is_some_and(Process::take_ready) {
            self.observer.report(Report::Ready { instance: &slot.instance });
            self.take(Event::Ready { node });
        }
    }

    fn look_for_standby_death(&mut self, node: usize) {
        if let Some(exit) = self.slots[node].look_for_standby_death() {
            self.take(Event::StandbyDied { node, exit });
        }
    }

    fn look_for_standby_ready(&mut self, node: usize) {
        if self.slots[node].standby.as_mut().is_some_and(Process::take_ready) {
            self.slots[node].standby_waits = true;
            self.take(Event::StandbyReady { node });
        }
    }

    fn take_signals(&mut self) {
        for signal in self.signals.take() {
            if signal == libc::SIGTSTP {
                self.observer.report(Report::Note("not suspended: a robot must not drive unattended; Ctrl-C ends it"));
                continue;
            }
            // Only Ctrl-C counts: a system that ends a session may well send SIGHUP and SIGTERM together.
            self.interrupts += u32::from(signal == libc::SIGINT);
            let again = signal == libc::SIGINT && self.interrupts > 1;
            self.end(StopCause::Signal(signal), again);
        }
    }

    fn take_stops(&mut self) {
        let asked = self.stop.as_ref().map_or(0, StopHandle::take);
        let again = asked > 1 || self.policy.robot() == RobotState::Stopping && self.stopped_by == StopCause::Program;
        if asked > 0 {
            self.end(StopCause::Program, again);
        }
    }

    fn serve(&mut self) {
        let status = serde_json::to_string(&self.status()).unwrap_or_default();
        let instances: Vec<String> = self.slots.iter().map(|slot| slot.instance.clone()).collect();
        let lines = self.inside.as_ref().map(|inside| inside.beats.lines());
        let (policy, mut asked, mut newcomers) = (&self.policy, Vec::new(), Vec::new());
        let down = self.control.serve(&status, &mut |words| {
            if let Some(text) = words.strip_prefix("spawn ") {
                let answer = spawn::accept(text, &instances, policy, lines);
                let (answer, newcomer) = answer.map_or_else(spawn::refused, spawn::accepted);
                newcomers.extend(newcomer);
                return Some(answer);
            }
            let (answer, request) = requests::answer(words, &instances, policy)?;
            asked.extend(request.map(|request| (words.to_owned(), request)));
            Some(answer)
        });
        for (words, request) in asked {
            self.carry_out(&words, request);
        }
        for newcomer in newcomers {
            self.spawn(&newcomer);
            self.take(Event::Timer);
        }
        if down {
            self.end(StopCause::Down, false);
        }
    }

    pub fn end(&mut self, cause: StopCause, at_once: bool) {
        if self.stopped_by == StopCause::NothingLeft {
            self.stopped_by = cause;
        }
        self.take(if at_once { Event::KillRequested } else { Event::StopRequested });
    }

    fn record(&mut self, incident: Incident) {
        let slot = &mut self.slots[incident.node];
        let died = matches!(incident.kind, IncidentKind::Died { .. });
        let record = Record {
            time: utc(wall_seconds()),
            at_s: incident.at.seconds(),
            robot: self.claim.owner().robot.clone(),
            node: slot.instance.clone(),
            pid: if died { slot.dead_pid } else { slot.pid },
            last_lines: if died { slot.last_lines() } else { Vec::new() },
            ..Record::default()
        };
        let mut record = record.with_kind(&incident.kind);
        if let IncidentKind::Died { exit: Exit::Signal { core: true, .. }, .. } = incident.kind {
            let kept = self.log_folder.as_ref().map(|folder| format!("{folder}/{}.core", slot.file_name()));
            let cwd = std::env::current_dir().unwrap_or_default();
            let told = CorePattern::of_machine().account(record.pid.unwrap_or(0), &cwd, kept.as_deref().map(Path::new));
            record.message += &format!("; {told}");
            record.core = Some(told);
        }
        self.keep(record);
    }

    /// Tells and keeps a record.
    pub fn keep(&mut self, record: Record) {
        self.observer.report(Report::Incident(&record));
        self.journal.write(&record);
        self.channels.incident(clock::now(), &serde_json::to_string(&record).unwrap_or_default());
        if self.incidents.len() == KEPT_INCIDENTS {
            self.incidents.pop_front();
        }
        self.incidents.push_back(record);
    }

    fn status(&self) -> Status {
        let owner = self.claim.owner();
        let nodes = self.slots.iter().enumerate().map(|(node, slot)| NodeStatus {
            on_trial: self.policy.on_trial(node),
            ..slot.status(self.policy.node(node))
        });
        Status {
            robot: owner.robot.clone(),
            pid: std::process::id() as i32,
            run: owner.run.clone(),
            since: utc(owner.since_unix_s),
            running_s: clock::now().since(self.begun),
            state: self.policy.robot().word().to_owned(),
            log_folder: self.log_folder.clone(),
            nodes: nodes.collect(),
        }
    }
}
