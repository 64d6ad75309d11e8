//! Does a recorded node's steps again: from the samples, cursors and events that were recorded, and nothing else.
//!
//! The node is opened as in the simulated host, over a tree of its own that holds the recorded samples under their
//! recorded numbers, and a journal that answers for its devices and calls. A step sees what it saw then, or says that
//! something of it is missing; nothing is guessed.

use crate::channel::{Claim, Geometry, RawSample, RawWriter, SampleBuffer, Tree};
use crate::device::MemoryLinks;
use crate::host::Opened;
use crate::journal::{Entries, FIRST_OUTPUT, Journal, name};
use crate::node::OpenError;
use crate::ports::Devices;
use crate::robot::{NodeSpec, Robot, open_replayed};
use crate::time::Time;
use guard::Word;
use messages::{InputCursor, StepInputs, StepKind, WRITTEN, path_number};
use std::collections::BTreeMap;

/// Why a node cannot be replayed at all.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReplayError {
    /// The recording's robot has no such node.
    #[error("robot \"{robot}\" has no node {path}; its nodes are {nodes}")]
    Unknown {
        /// The robot.
        robot: String,
        /// The node asked for.
        path: String,
        /// Those that there are.
        nodes: String,
    },
    /// The node does not open as the recording has it.
    #[error("node {path} cannot be opened as recorded: {source}")]
    Open {
        /// Which.
        path: String,
        /// Why.
        source: OpenError,
    },
    /// A recorded channel cannot be made.
    #[error("{0}")]
    Channel(String),
}

/// One recorded step.
#[derive(Debug, Clone, Copy)]
pub struct RecordedStep<'a> {
    /// Step, time, kind.
    pub inputs: StepInputs,
    /// Where sources and written ports stood.
    pub cursors: &'a [InputCursor],
    /// Entries of its events.
    pub events: &'a [u8],
}

/// What became of a replayed step.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Replayed {
    /// It was done again.
    Done {
        /// Whether it returned a fault.
        fault: bool,
        /// What it told devices and callers: entries as recorded.
        told: Vec<u8>,
    },
    /// Something that it depended on was not recorded; it was done with what there is, and proves nothing.
    NotReplayable(&'static str),
}

/// A sample that a replayed step wrote.
#[derive(Debug, Clone, Copy)]
pub struct Written<'a> {
    /// The path.
    pub path: &'a str,
    /// Its stamp.
    pub stamp: Time,
    /// The message's fixed part.
    pub fixed: &'a [u8],
    /// Its tail.
    pub tail: &'a [u8],
}

/// A node that is replayed.
pub struct ReplayNode {
    robot: Robot,
    spec: NodeSpec,
    seed: u64,
    /// What it reads, under recorded numbers.
    read: Tree,
    sources: BTreeMap<u32, Source>,
    life: Life,
}

/// A recorded path.
struct Source {
    path: String,
    writer: RawWriter,
    newest: u64,
}

/// One life of the node: from a start to the next.
struct Life {
    opened: Opened,
    journal: Journal,
    /// What it writes: its own tree, because a node may read what it writes.
    written: Tree,
    taken: BTreeMap<String, u64>,
    /// Its state is the recorded one: it has been followed from its start without a gap.
    known: bool,
}

impl ReplayNode {
    /// Opens node `path` of `robot` for a replay from `channels`, the recorded paths with their rings' geometry.
    pub fn open<'a>(
        robot: &Robot,
        path: &str,
        seed: u64,
        channels: impl IntoIterator<Item = (&'a str, &'a Geometry)>,
    ) -> Result<ReplayNode, ReplayError> {
        let spec = robot.nodes.iter().find(|node| node.path() == path).cloned();
        let spec = spec.ok_or_else(|| ReplayError::Unknown {
            robot: robot.name.clone(),
            path: path.into(),
            nodes: robot.nodes.iter().map(NodeSpec::path).collect::<Vec<_>>().join(", "),
        })?;
        let read = Tree::local();
        let mut sources = BTreeMap::new();
        for (path, geometry) in channels {
            let writer =
                read.writer(path, geometry, Claim::Continue).map_err(|e| ReplayError::Channel(e.to_string()))?;
            sources.insert(path_number(path), Source { path: path.into(), writer, newest: 0 });
        }
        let life = Life::begin(robot, &spec, seed).map_err(|source| ReplayError::Open { path: path.into(), source })?;
        Ok(ReplayNode { robot: robot.clone(), spec, seed, read, sources, life })
    }

    /// The paths that the node itself writes, without those that the runtime adds.
    pub fn written_paths(&self) -> Vec<String> {
        let outputs = self.life.opened.ports.outputs().iter();
        outputs.filter(|output| !output.by_runtime).map(|output| output.path.clone()).collect()
    }

    /// The path of a source in a step's cursors, where it was recorded.
    pub fn source_path(&self, number: u32) -> Option<&str> {
        self.sources.get(&number).map(|source| source.path.as_str())
    }

    /// Puts a recorded sample where the node can read it; call it before the step that can see it. False where the
    /// channel was made anew, so that its numbers began again.
    pub fn put(&mut self, path: &str, sample: &RawSample, fixed: &[u8], tail: &[u8]) -> bool {
        let Some(source) = self.sources.get_mut(&path_number(path)) else { return false };
        let placed = source.writer.place(sample, fixed, tail);
        source.newest = source.newest.max(sample.sequence);
        placed
    }

    /// Does `step` again and hands what it writes to `each`.
    pub fn step(
        &mut self,
        step: &RecordedStep<'_>,
        each: &mut dyn FnMut(Written<'_>),
    ) -> Result<Replayed, ReplayError> {
        let kind = step.inputs.kind;
        if kind == StepKind::Start as u32 {
            self.life = Life::begin(&self.robot, &self.spec, self.seed)
                .map_err(|source| ReplayError::Open { path: self.spec.path(), source })?;
            self.life.known = true;
        }
        let mut flaw = if step.inputs.lost != 0 { Some("a sample was lost while it ran") } else { None };
        if step.inputs.event_bytes as usize != step.events.len() {
            flaw = Some("its events were not recorded");
        }
        let ports = self.life.opened.ports.inputs().len();
        let mut sources: Vec<Vec<(String, InputCursor)>> = vec![Vec::new(); ports];
        for cursor in step.cursors.iter().filter(|cursor| cursor.port < WRITTEN) {
            let Some(port) = sources.get_mut(cursor.port as usize) else {
                flaw = Some("the node has fewer read ports than then");
                continue;
            };
            match self.sources.get(&cursor.source) {
                Some(source) => {
                    if source.newest < cursor.sequence {
                        flaw = Some("a sample that it saw was not recorded");
                    }
                    port.push((source.path.clone(), *cursor));
                }
                None if cursor.sequence > 0 => flaw = Some("a channel that it read was not recorded"),
                // A path that never carried a sample: any name that is nobody's.
                None => port.push((format!("/link/absent_{:08x}/none", cursor.source), *cursor)),
            }
        }
        let now = Time::from_nanos(step.inputs.now_ns);
        let life = &mut self.life;
        let froze = life.opened.ports.freeze_as(now, &self.read, &sources);
        if froze.is_err() {
            flaw = Some("a channel carries another type than the node reads");
        }
        life.opened.ports.latch.show(Word(step.inputs.latch as u32));
        life.journal.begin(step.events);
        let node = &mut life.opened.node;
        let fault = match kind {
            _ if kind == StepKind::Start as u32 => node.start(now).is_err(),
            _ if kind == StepKind::Stop as u32 => {
                node.stop(now);
                false
            }
            _ => node.step(now).is_err(),
        };
        life.hand_over(each);
        if life.opened.ports.inputs().iter().fold(false, |lost, input| input.take_lost() | lost) {
            flaw = Some("a sample that it read was not recorded");
        }
        life.known &= flaw.is_none();
        match flaw {
            Some(why) => Ok(Replayed::NotReplayable(why)),
            None => Ok(Replayed::Done { fault, told: life.journal.read(|entries, _| entries.to_vec()) }),
        }
    }

    /// The next step does not follow the one before: a step between them was not recorded.
    pub fn lose_state(&mut self) {
        self.life.known = false;
    }

    /// Whether the node's state is the recorded one: replayed from its start without a gap.
    pub fn state_is_known(&self) -> bool {
        self.life.known
    }
}

impl Life {
    fn begin(robot: &Robot, spec: &NodeSpec, seed: u64) -> Result<Life, OpenError> {
        let journal = Journal::playing();
        let opened = open_replayed(robot, spec, seed, Devices::Memory(MemoryLinks::new()), journal.clone())?;
        let written = Tree::local();
        for output in opened.ports.outputs() {
            output.bind(&written, Claim::Continue)?;
        }
        Ok(Life { opened, journal, written, taken: BTreeMap::new(), known: false })
    }

    /// Hands over what was written since the last time.
    fn hand_over(&mut self, each: &mut dyn FnMut(Written<'_>)) {
        for output in self.opened.ports.outputs().iter().filter(|output| !output.by_runtime) {
            let Ok(ring) = self.written.reader(&output.path, None) else { continue };
            let mut buffer = SampleBuffer::new(ring.geometry());
            let taken = self.taken.entry(output.path.clone()).or_default();
            while *taken < ring.head() {
                *taken += 1;
                if let Ok(sample) = ring.read(*taken, &mut buffer) {
                    let (stamp, path) = (Time::from_nanos(sample.stamp_ns), output.path.as_str());
                    each(Written { path, stamp, fixed: buffer.fixed(), tail: buffer.tail() });
                }
            }
        }
    }
}

/// What a step told devices and callers, out of all its events: whole entries, one after another.
pub fn told(events: &[u8]) -> Vec<u8> {
    let mut told = Vec::new();
    for entry in Entries(events).filter(|entry| entry.kind >= FIRST_OUTPUT) {
        told.extend_from_slice(&[entry.kind, entry.port, 0, 0]);
        told.extend_from_slice(&(entry.payload.len() as u32).to_le_bytes());
        told.extend_from_slice(entry.payload);
    }
    told
}

/// The entries of a step's events for people: what, of which port, and its bytes.
pub fn describe(events: &[u8]) -> Vec<String> {
    let line = |bytes: &[u8]| bytes.iter().take(64).map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ");
    Entries(events).map(|entry| format!("{} {}: {}", name(entry.kind), entry.port, line(entry.payload))).collect()
}
