//! Replays nodes of a recording: every recorded step is done again, and what it writes is compared byte for byte.
//!
//! What is needed of the recording (what the node reads and writes, its step records) is held in memory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use messages::{InputCursor, Schema, StepInputs, StepKind, WRITTEN, bytemuck};
use runtime::channel::{Geometry, RawSample};
use runtime::replay::{self, RecordedStep, ReplayError, ReplayNode, Replayed};
use runtime::robot::{NodeSpec, Robot};
use runtime::{SUPERVISOR_LOAD, SUPERVISOR_STATE, path};

use crate::compare::{Compared, NodeComparison};
use crate::difference::FirstDifference;
use crate::error::RecordingError;
use crate::reader::{Item, Recording};

/// Why a recording cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayFailure {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] RecordingError),
    /// The node cannot be made.
    #[error(transparent)]
    Node(#[from] ReplayError),
    /// The node's steps are not in it.
    #[error(
        "{file} holds no steps of {node}: record with `[record]` in the robot file, `sinew run --record FILE` or \
         `sinew simulate --record FILE`, which publish what each step reads"
    )]
    NoSteps {
        /// The file.
        file: PathBuf,
        /// The node.
        node: String,
    },
}

/// One channel's samples, held in memory.
pub(crate) struct Held {
    pub geometry: Geometry,
    pub schema: Schema,
    /// Sample, where its bytes begin; the tail follows the fixed part.
    samples: Vec<(RawSample, usize)>,
    bytes: Vec<u8>,
}

impl Held {
    fn add(&mut self, sample: RawSample, fixed: &[u8], tail: &[u8]) {
        self.samples.push((sample, self.bytes.len()));
        self.bytes.extend_from_slice(fixed);
        self.bytes.extend_from_slice(tail);
    }

    pub fn len(&self) -> usize {
        self.samples.len()
    }

    pub fn get(&self, index: usize) -> Option<(RawSample, &[u8], &[u8])> {
        let (sample, at) = *self.samples.get(index)?;
        let fixed = self.bytes.get(at..at + self.geometry.fixed_bytes)?;
        let tail = self.bytes.get(at + fixed.len()..at + fixed.len() + sample.tail_bytes)?;
        Some((sample, fixed, tail))
    }

    /// The sample with this number, of a channel whose numbers only grow.
    pub fn numbered(&self, sequence: u64) -> Option<(RawSample, &[u8], &[u8])> {
        self.get(self.samples.binary_search_by_key(&sequence, |(sample, _)| sample.sequence).ok()?)
    }

    fn newest(&self) -> u64 {
        self.samples.last().map_or(0, |(sample, _)| sample.sequence)
    }
}

/// The channels of a recording that a replay needs.
pub(crate) type Channels = BTreeMap<String, Held>;

/// Replays node `node` ("/layer/instance") of `robot` from `file`.
pub fn replay(file: &Path, robot: &Robot, node: &str) -> Result<NodeComparison, ReplayFailure> {
    let channels = load(file, robot, node)?;
    let geometries = channels.iter().map(|(path, held)| (path.as_str(), &held.geometry));
    let seed = Recording::open(file)?.facts().seed;
    let mut again = ReplayNode::open(robot, node, seed, geometries)?;
    let Some(steps) = channels.get(&format!("{node}/inputs")).filter(|held| held.len() > 0) else {
        return Err(ReplayFailure::NoSteps { file: file.to_owned(), node: node.into() });
    };
    let events = channels.get(&format!("{node}/events"));
    let mut run = Run {
        channels: &channels,
        compared: Compared::new(node, &again.written_paths(), &channels),
        put: BTreeMap::new(),
        event: 0,
        last_step: None,
        next: BTreeMap::new(),
    };
    for index in 0..steps.len() {
        let Some((_, fixed, tail)) = steps.get(index) else { continue };
        let Ok(inputs) = bytemuck::try_pod_read_unaligned::<StepInputs>(fixed) else { continue };
        let cursors: Vec<InputCursor> = tail
            .chunks_exact(size_of::<InputCursor>())
            .filter_map(|bytes| bytemuck::try_pod_read_unaligned(bytes).ok())
            .collect();
        let events = run.events_of(events, &inputs);
        run.step(&mut again, &RecordedStep { inputs, cursors: &cursors, events })?;
    }
    Ok(run.compared.finish())
}

/// Reads what `node` reads, writes and did.
fn load(file: &Path, robot: &Robot, node: &str) -> Result<Channels, ReplayFailure> {
    let spec = robot.nodes.iter().find(|spec| spec.path() == node);
    let mut channels = Channels::new();
    let wanted = |topic: &str| {
        let own = topic.strip_prefix(node).is_some_and(|rest| rest.starts_with('/'));
        own || spec.is_some_and(|spec| reads(spec, topic))
    };
    Recording::open(file)?.read(&mut |item| match item {
        Item::Channel(channel) => {
            if let Some(own) = channel.own.as_ref().filter(|_| wanted(&channel.topic)) {
                channels.entry(channel.topic.clone()).or_insert_with(|| Held {
                    geometry: own.geometry.clone(),
                    schema: own.schema.clone(),
                    samples: Vec::new(),
                    bytes: Vec::new(),
                });
            }
        }
        Item::Sample { channel, sample, fixed, tail } => {
            if let Some(held) = channels.get_mut(&channel.topic)
                && sample.sequence > held.newest()
                && fixed.len() == held.geometry.fixed_bytes
            {
                held.add(sample, fixed, tail);
            }
        }
        _ => {}
    })?;
    Ok(channels)
}

fn reads(spec: &NodeSpec, topic: &str) -> bool {
    // What the supervisor lets a robot do is wired to every node that asks for it, without a word in the robot file.
    let mut wires = spec.reads.values().flat_map(|wire| &wire.from);
    topic == SUPERVISOR_STATE
        || topic == SUPERVISOR_LOAD
        || wires.any(|from| from == topic || path::covers(from, topic))
}

/// The state of one node's replay.
struct Run<'a> {
    channels: &'a Channels,
    compared: Compared<'a>,
    /// Samples handed to the node so far, per path.
    put: BTreeMap<&'a str, usize>,
    /// Index of the next event sample.
    event: usize,
    /// Number of the step before.
    last_step: Option<u64>,
    /// Number that the next sample on each written path should have.
    next: BTreeMap<String, u64>,
}

impl<'a> Run<'a> {
    /// The events of the step that these inputs belong to.
    fn events_of(&mut self, events: Option<&'a Held>, inputs: &StepInputs) -> &'a [u8] {
        let Some(events) = events.filter(|_| inputs.event_bytes > 0) else { return &[] };
        // Both come in order, and a step is known by its time: numbers begin anew with each life.
        while let Some((_, fixed, tail)) = events.get(self.event) {
            let Ok(step) = bytemuck::try_pod_read_unaligned::<messages::StepEvents>(fixed) else { break };
            match (step.now_ns, step.step).cmp(&(inputs.now_ns, inputs.step)) {
                std::cmp::Ordering::Less => self.event += 1,
                std::cmp::Ordering::Equal => {
                    self.event += 1;
                    return tail;
                }
                std::cmp::Ordering::Greater => break,
            }
        }
        &[]
    }

    fn step(&mut self, again: &mut ReplayNode, step: &RecordedStep<'_>) -> Result<(), ReplayFailure> {
        let starts = step.inputs.kind == StepKind::Start as u32;
        // `stop` has the number of the last step.
        let follows = step.inputs.kind == StepKind::Stop as u32
            || self.last_step.is_some_and(|last| step.inputs.step == last + 1);
        if !starts && !follows {
            again.lose_state();
            // A recording that began in the node's midlife lacks nothing but the node's state.
            let missing = self.last_step.map_or(0, |last| step.inputs.step.saturating_sub(last + 1));
            self.compared.not_recorded(missing);
        }
        self.last_step = Some(step.inputs.step);
        for cursor in step.cursors {
            if cursor.port >= WRITTEN {
                self.note_written(cursor, starts);
            } else if let Some(path) = again.source_path(cursor.source).map(str::to_owned) {
                self.put_up_to(again, &path, cursor.sequence);
            }
        }
        if starts {
            self.compared.start();
        }
        let mut written = Vec::new();
        let outcome = again.step(step, &mut |sample| {
            written.push((sample.path.to_owned(), sample.stamp, sample.fixed.to_vec(), sample.tail.to_vec()));
        })?;
        let known = match &outcome {
            Replayed::NotReplayable(why) => {
                self.compared.not_replayable(why);
                false
            }
            Replayed::Done { .. } => again.state_is_known(),
        };
        let mut difference = None;
        for (path, stamp, fixed, tail) in &written {
            let sequence = self.next.entry(path.clone()).or_insert(1);
            let number = std::mem::replace(sequence, *sequence + 1);
            let recorded = self.channels.get(path).and_then(|held| held.numbered(number));
            let same = self.compared.sample(path, recorded, (*stamp, fixed, tail), known);
            if !same && difference.is_none() {
                difference = Some((path.clone(), number, *stamp, fixed.clone(), tail.clone()));
            }
        }
        let Replayed::Done { fault, told } = outcome else { return Ok(()) };
        let recorded_told = replay::told(step.events);
        let others = told != recorded_told || u32::from(fault) != step.inputs.fault;
        self.compared.step(known, difference.is_none() && !others);
        if known && self.compared.wants_first() && (difference.is_some() || others) {
            let first = match difference {
                Some((path, number, stamp, fixed, tail)) => {
                    FirstDifference::of_sample(self.channels, step, &path, number, stamp, &fixed, &tail)
                }
                None => FirstDifference::of_events(step, &recorded_told, &told, fault),
            };
            self.compared.first(first.with_inputs(self.channels, again, step));
        }
        Ok(())
    }

    /// A written path's cursor says how many samples the step before wrote then.
    fn note_written(&mut self, cursor: &InputCursor, starts: bool) {
        let Some(path) = self.channels.keys().find(|path| messages::path_number(path) == cursor.source) else { return };
        let expected = cursor.sequence + 1;
        if let Some(next) = self.next.insert(path.clone(), expected)
            && next != expected
            && !starts
        {
            self.compared.count_differs(path, next, expected);
        }
    }

    /// Hands the node all samples of a path up to `sequence`.
    fn put_up_to(&mut self, again: &mut ReplayNode, path: &str, sequence: u64) {
        let Some((path, held)) = self.channels.get_key_value(path) else { return };
        let put = self.put.entry(path).or_default();
        while let Some((sample, fixed, tail)) = held.get(*put).filter(|(sample, ..)| sample.sequence <= sequence) {
            again.put(path, &sample, fixed, tail);
            *put += 1;
        }
    }
}
