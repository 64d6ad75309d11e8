//! What a supervisor does that is part of a process tree: it takes over, watches heartbeats and the latch, and leaves its
//! state to its successor.

use std::collections::HashMap;
use std::os::fd::BorrowedFd;
use std::path::PathBuf;

use guard::latch::State;
use guard::{Client, Line, Phase, Word};
use runtime::Time;
use runtime::clock::{self, wall_seconds};

use crate::beats::BeatWatch;
use crate::event::{Event, Request};
use crate::exit::Exit;
use crate::host::{Host, Source};
use crate::incidents::Record;
use crate::load::Teller;
use crate::observer::StopCause;
use crate::proc;
use crate::remembered;
use crate::saved::{Saved, SavedNode};
use crate::severity::CauseKind;
use crate::state::RobotState;
use crate::telling::{Ask, Heard, hear};
use crate::tree::Tree;
use crate::wall::utc;
use crate::witness::Witnesses;

/// How often heartbeats and the latch are looked at [s].
const LOOK_S: f64 = 0.01;

/// The tree, and what is remembered of it.
pub(crate) struct InTree {
    pub tree: Tree,
    pub beats: BeatWatch,
    pub witnesses: Witnesses,
    pub next_look: Time,
    pub latch_seen: Word,
    pub takeovers: u32,
    /// Where a stop is written down.
    pub log_folder: Option<PathBuf>,
    /// The root or the front is gone, and that is known.
    pub orphaned: bool,
    /// The supervisor's own heartbeat, which the guard looks at.
    pub own: Option<Line>,
    /// Tells how busy the nodes are.
    pub load: Teller,
}

impl InTree {
    /// Descriptors to wait for.
    pub fn watched(&self) -> impl Iterator<Item = (Source, BorrowedFd<'_>)> {
        use std::os::fd::AsFd;
        let both = [(Source::Front, self.tree.front.as_fd()), (Source::Root, self.tree.root.as_fd())];
        both.into_iter().filter(|_| !self.orphaned)
    }
}

impl Host<'_> {
    /// Takes every running node over from the supervisor before this one.
    pub fn take_over(&mut self, saved: &Saved) {
        self.begun = Time::from_nanos(saved.begun_ns);
        self.interrupts = saved.interrupts;
        let mut gone = Vec::new();
        let mut nameless = false;
        for (node, slot) in self.slots.iter_mut().enumerate() {
            let Some(known) = saved.nodes.iter().find(|known| known.instance == slot.instance) else { continue };
            let lives = slot.adopt(known.process, known.starts, Time::from_nanos(known.started_ns));
            slot.adopt_programs(
                known.program.as_deref(),
                known.program_before.as_deref(),
                known.past.trial_ns.is_some(),
            );
            known.teach(&mut self.policy, node);
            if matches!(known.state.as_str(), "alive" | "ready") && !lives {
                gone.push(node);
                // It was just being started: its process may run under a number that was not yet written down.
                nameless |= known.process.is_none();
            }
        }
        if nameless {
            let found = self.by_name();
            gone.retain(|&node| {
                let process = found.get(&self.slots[node].instance).copied();
                let slot = &mut self.slots[node];
                let (starts, started) = (slot.starts(), clock::now());
                !process.is_some_and(|process| slot.adopt(Some(process), starts, started))
            });
        }
        self.policy.adopt_robot(clock::now(), &saved.past);
        for cause in self.policy.causes().iter().filter(|cause| cause.kind == CauseKind::Silent) {
            // It is silent until the detector hears it again.
            self.detectors.believe_silent(cause.node);
        }
        self.take(Event::Begin);
        // Reset and resumed while nobody supervised.
        let word = self.inside.as_ref().map(|inside| inside.tree.latch.word().state());
        if self.policy.latched()
            && matches!(word, Some(State::Run | State::Armed))
            && self.policy.refusal(Request::Reset).is_none()
        {
            self.take(Event::Call(Request::Reset));
        }
        for node in gone {
            self.take(Event::Died { node, exit: Exit::Unknown });
        }
        for node in 0..self.slots.len() {
            // The pipe on which it would have said so died with its reader.
            if self.slots[node].process.as_ref().is_some_and(|process| process.ready().is_none()) {
                self.take(Event::Ready { node });
            }
        }
        if let Some(cause) = saved.stopping {
            self.end(cause, false);
        }
    }

    /// The processes of this run by the nodes that they say they are: leaders of their sessions only.
    fn by_name(&self) -> HashMap<String, (i32, u64)> {
        let owner = self.claim.owner();
        let mut found = HashMap::new();
        for (pid, _descriptor) in proc::processes_of(&owner.run, owner.start_ticks) {
            if let (Some(node), Some(ticks)) = (proc::variable(pid, "SINEW_NODE"), proc::start_ticks(pid))
                && proc::is_session_leader(pid)
            {
                found.insert(node, (pid, ticks));
            }
        }
        found
    }

    /// Leaves the successor what it must know.
    pub fn leave_state(&mut self) {
        let stopping = self.policy.robot() == RobotState::Stopping;
        let saved = |(node, slot)| SavedNode::of(slot, self.policy.node(node), self.policy.past(node));
        let nodes = self.slots.iter().enumerate().map(saved);
        let Some(inside) = &mut self.inside else { return };
        let saved = Saved {
            begun_ns: self.begun.nanos(),
            takeovers: inside.takeovers,
            stopping: stopping.then_some(self.stopped_by),
            interrupts: self.interrupts,
            nodes: nodes.collect(),
            past: self.policy.robot_past(),
        };
        if let Err(error) = inside.tree.keeper.keep(&saved) {
            eprintln!("{error}");
        }
    }

    /// Looks at heartbeats and the latch, when it is time to.
    pub fn look_around(&mut self) {
        let Some(inside) = &mut self.inside else { return };
        let now = clock::now();
        if now < inside.next_look {
            return;
        }
        inside.next_look = now.after_s(LOOK_S);
        if let Some(own) = &inside.own {
            own.beat(now.nanos(), Phase::Waiting);
        }
        let mut events = Vec::new();
        let slots = &self.slots;
        let process = |node: usize| slots[node].process.as_ref().and(slots[node].pid);
        inside.beats.look(now, LOOK_S, &inside.witnesses, process, &mut events);
        let channels = &mut self.channels;
        events.extend(inside.load.look(now, process, |load, nodes| channels.load(now, load, nodes)));
        for event in events {
            self.take(event);
        }
        self.look_at_latch();
    }

    fn look_at_latch(&mut self) {
        let Some(inside) = &mut self.inside else { return };
        let word = inside.tree.latch.word();
        let before = std::mem::replace(&mut inside.latch_seen, word);
        if word == before {
            return;
        }
        let forgotten = match &inside.log_folder {
            Some(folder) => remembered::write(folder, &inside.tree.latch).err().map(|error| error.to_string()),
            None => Some("no logs are kept".to_owned()),
        };
        if word.state() == State::Armed && self.policy.latched() {
            // A person's reset, heard by the guard: what the policy held because of it may go, too.
            let request = Request::Reset;
            if self.policy.refusal(request).is_none() {
                self.take(Event::Call(request));
            }
        }
        let Some(inside) = &self.inside else { return };
        let (event, mut message) = match word.state() {
            State::Run => ("resumed", "motion is allowed again".to_owned()),
            State::Armed => ("reset", "reset; it stands until `sinew resume`".to_owned()),
            State::Stopping | State::Latched => {
                let sources = inside.tree.latch.sources();
                let who = |source: &guard::SourceInfo| {
                    let held = if source.held { ", still held" } else { "" };
                    format!("{} (process {}, user {}{held}): {}", source.name, source.by.0, source.by.1, source.reason)
                };
                let list: Vec<String> = sources.iter().map(who).collect();
                ("emergency_stop", format!("{} by {}", word.state().word(), list.join("; ")))
            }
        };
        if let Some(why) = forgotten.filter(|_| word.state() != State::Run) {
            message += &format!(" (not remembered across a power cycle: {why})");
        }
        self.tell_of_robot(event, message);
    }

    /// A record that concerns the robot as a whole.
    pub fn tell_of_robot(&mut self, event: &str, message: String) {
        let robot = self.claim.owner().robot.clone();
        let (time, at_s) = (utc(wall_seconds()), clock::now().seconds());
        self.keep(Record { time, at_s, robot, event: event.to_owned(), message, ..Record::default() });
    }

    /// What the program that started the robot wants.
    pub fn hear_front(&mut self) {
        loop {
            let Some(inside) = &self.inside else { return };
            match hear::<Ask>(&inside.tree.front) {
                Heard::Some(Ask { cause, at_once }) => {
                    if let StopCause::Signal(signal) = cause
                        && signal == libc::SIGINT
                    {
                        self.interrupts += 1;
                    }
                    self.end(cause, at_once);
                }
                Heard::Nothing => return,
                // A robot must not drive unattended.
                Heard::Gone => return self.orphaned("the program that started the robot has ended: it stops"),
            }
        }
    }

    /// The root or the front is gone.
    pub fn orphaned(&mut self, why: &str) {
        if let Some(inside) = &mut self.inside
            && !std::mem::replace(&mut inside.orphaned, true)
        {
            self.tell_of_robot("orphaned", why.to_owned());
            self.end(StopCause::Program, false);
        }
    }

    /// Latches the emergency stop.
    pub fn latch_stop(&mut self, node: usize) {
        let instance = self.slots[node].instance.clone();
        let said = Client::connect(self.claim.root())
            .map_err(|error| error.to_string())
            .and_then(|guard| guard.say(&format!("stop supervisor\n{instance}")).map_err(|error| error.to_string()));
        if let Err(error) = said {
            self.tell_of_robot("emergency_stop", format!("could not be latched because of {instance}: {error}"));
        }
    }
}
