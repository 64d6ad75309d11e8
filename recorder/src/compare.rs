//! Counts how a replay compares with what was recorded, and measures how far apart they are.

use std::collections::BTreeMap;

use runtime::Time;
use runtime::channel::RawSample;
use serde::Serialize;
use serde_json::Value;

use crate::difference::FirstDifference;
use crate::replay::Channels;

/// How the replay of some nodes compares.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Whether every replayed step gave the recorded bytes.
    pub identical: bool,
    /// Node by node.
    pub nodes: Vec<NodeComparison>,
}

impl Comparison {
    /// All nodes together.
    pub fn of(nodes: Vec<NodeComparison>) -> Comparison {
        Comparison { identical: nodes.iter().all(NodeComparison::is_identical), nodes }
    }
}

/// How the replay of one node compares.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NodeComparison {
    /// The node.
    pub node: String,
    /// Recorded steps, `start` and `stop` included.
    pub steps: u64,
    /// Steps that were replayed from a known state and gave the recorded bytes.
    pub identical_steps: u64,
    /// Steps that were replayed from a known state and gave others.
    pub different_steps: u64,
    /// Steps of which an input is missing: nothing is said about them.
    pub not_replayable: u64,
    /// Steps after such a one, or of a node whose start was not recorded: its state is not known, and they prove
    /// nothing. How many of them gave the recorded bytes all the same is `unproven_identical`.
    pub unproven: u64,
    /// See `unproven`.
    pub unproven_identical: u64,
    /// Why steps were not replayable, and how often.
    pub reasons: BTreeMap<String, u64>,
    /// Lives of the node: starts in the recording.
    pub lives: u64,
    /// Path by path.
    pub paths: Vec<PathComparison>,
    /// The first difference.
    pub first_difference: Option<Box<FirstDifference>>,
}

impl NodeComparison {
    /// Whether it was replayed at all, and gave the recorded bytes wherever that can be said.
    pub fn is_identical(&self) -> bool {
        self.identical_steps > 0 && self.different_steps == 0
    }
}

/// How one written path compares, over the steps from a known state.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct PathComparison {
    /// The path.
    pub path: String,
    /// Samples with the recorded bytes and stamps.
    pub identical: u64,
    /// Samples with others.
    pub different: u64,
    /// Samples of the replay that the recording does not have, because it ends before or lost them.
    pub not_recorded: u64,
    /// Steps that wrote another number of samples than then.
    pub other_count: u64,
    /// How far the numbers of the samples are apart, field by field, where any is.
    pub fields: Vec<FieldStatistics>,
    /// Times and both values of the fields that differ most, for the plot.
    #[serde(skip)]
    pub series: Vec<Series>,
}

/// How far a field's replayed values are from its recorded ones.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct FieldStatistics {
    /// The field; a position in an array is left out where it has more than sixteen.
    pub field: String,
    /// Values compared.
    pub values: u64,
    /// Values that differ.
    pub different: u64,
    /// Mean of replayed minus recorded.
    pub mean: f64,
    /// Root of the mean square of replayed minus recorded.
    pub rms: f64,
    /// Greatest magnitude of replayed minus recorded.
    pub max: f64,
}

/// A field over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// The field, with its path.
    pub name: String,
    /// Time [s], recorded, replayed.
    pub points: Vec<(f64, f64, f64)>,
}

/// Arrays longer than this are taken as a whole.
const LONG_ARRAY: usize = 16;
/// Fields plotted per path.
const PLOTTED: usize = 4;

/// A comparison in the making.
pub(crate) struct Compared<'a> {
    channels: &'a Channels,
    node: NodeComparison,
    paths: BTreeMap<String, Path>,
    known: bool,
}

#[derive(Default)]
struct Path {
    counts: PathComparison,
    /// Both sides of every sample, kept from the first difference on, and the ones before as identical.
    pairs: Vec<Pair>,
}

/// One sample as it was recorded and as it is replayed: fixed part and tail.
struct Pair {
    at: Time,
    recorded: (Vec<u8>, Vec<u8>),
    replayed: (Vec<u8>, Vec<u8>),
}

/// Pairs kept per path for the statistics.
const MOST_PAIRS: usize = 100_000;

impl<'a> Compared<'a> {
    pub fn new(node: &str, written: &[String], channels: &'a Channels) -> Compared<'a> {
        let node = NodeComparison {
            node: node.into(),
            steps: 0,
            identical_steps: 0,
            different_steps: 0,
            not_replayable: 0,
            unproven: 0,
            unproven_identical: 0,
            reasons: BTreeMap::new(),
            lives: 0,
            paths: Vec::new(),
            first_difference: None,
        };
        let path = |path: &String| {
            let counts = PathComparison { path: path.clone(), ..PathComparison::default() };
            (path.clone(), Path { counts, pairs: Vec::new() })
        };
        Compared { channels, node, paths: written.iter().map(path).collect(), known: false }
    }

    pub fn start(&mut self) {
        self.node.lives += 1;
    }

    pub fn not_replayable(&mut self, why: &str) {
        self.node.steps += 1;
        self.node.not_replayable += 1;
        self.known = false;
        *self.node.reasons.entry(why.to_owned()).or_default() += 1;
    }

    /// Steps whose own record is missing.
    pub fn not_recorded(&mut self, steps: u64) {
        self.known = false;
        if steps == 0 {
            return;
        }
        *self.node.reasons.entry("its own record is missing".to_owned()).or_default() += steps;
        self.node.steps += steps;
        self.node.not_replayable += steps;
    }

    pub fn step(&mut self, known: bool, same: bool) {
        self.known = known;
        self.node.steps += 1;
        match (known, same) {
            (true, true) => self.node.identical_steps += 1,
            (true, false) => self.node.different_steps += 1,
            (false, same) => {
                self.node.unproven += 1;
                self.node.unproven_identical += u64::from(same);
            }
        }
    }

    /// Compares a sample; false where it differs.
    pub fn sample(
        &mut self,
        path: &str,
        recorded: Option<(RawSample, &[u8], &[u8])>,
        (stamp, fixed, tail): (Time, &[u8], &[u8]),
        known: bool,
    ) -> bool {
        let Some(entry) = self.paths.get_mut(path).filter(|_| known) else {
            return recorded.is_none_or(|(sample, f, t)| sample.stamp_ns == stamp.nanos() && f == fixed && t == tail);
        };
        let Some((sample, recorded_fixed, recorded_tail)) = recorded else {
            entry.counts.not_recorded += 1;
            return true;
        };
        let same = sample.stamp_ns == stamp.nanos() && recorded_fixed == fixed && recorded_tail == tail;
        match same {
            true => entry.counts.identical += 1,
            false => entry.counts.different += 1,
        }
        if entry.pairs.len() < MOST_PAIRS {
            let recorded = (recorded_fixed.to_vec(), recorded_tail.to_vec());
            let replayed = (fixed.to_vec(), tail.to_vec());
            entry.pairs.push(Pair { at: Time::from_nanos(sample.stamp_ns), recorded, replayed });
        }
        same
    }

    /// The step before wrote `next` − 1 samples in all, the recorded one `expected` − 1.
    pub fn count_differs(&mut self, path: &str, next: u64, expected: u64) {
        // A step that was not replayed wrote what it wrote; nothing can be said.
        if let Some(entry) = self.paths.get_mut(path).filter(|_| self.known && next != expected) {
            entry.counts.other_count += 1;
            self.node.different_steps += 1;
            self.node.identical_steps = self.node.identical_steps.saturating_sub(1);
        }
    }

    pub fn wants_first(&self) -> bool {
        self.node.first_difference.is_none()
    }

    pub fn first(&mut self, first: FirstDifference) {
        self.node.first_difference.get_or_insert_with(|| Box::new(first));
    }

    pub fn finish(mut self) -> NodeComparison {
        for (path, entry) in std::mem::take(&mut self.paths) {
            let mut counts = entry.counts;
            if counts.different > 0
                && let Some(held) = self.channels.get(&path)
            {
                let mut fields = Fields::default();
                for Pair { at, recorded, replayed } in &entry.pairs {
                    let one = held.schema.to_json(&recorded.0, &recorded.1);
                    let other = held.schema.to_json(&replayed.0, &replayed.1);
                    fields.add(at.seconds(), String::new(), &one, &other);
                }
                (counts.fields, counts.series) = fields.finish(&path);
            }
            self.node.paths.push(counts);
        }
        self.node
    }
}

/// Sums per field, in the order of the fields.
#[derive(Default)]
struct Fields {
    order: Vec<String>,
    sums: BTreeMap<String, (FieldStatistics, f64, f64, Series)>,
}

impl Fields {
    fn add(&mut self, at_s: f64, name: String, recorded: &Value, replayed: &Value) {
        match (recorded, replayed) {
            (Value::Object(one), Value::Object(other)) => {
                for (key, value) in one {
                    let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                    self.add(at_s, name, value, other.get(key).unwrap_or(&Value::Null));
                }
            }
            (Value::Array(one), Value::Array(other)) => {
                let long = one.len() > LONG_ARRAY;
                for (index, (value, other)) in one.iter().zip(other).enumerate() {
                    let name = if long { format!("{name}[]") } else { format!("{name}[{index}]") };
                    self.add(at_s, name, value, other);
                }
            }
            (Value::Number(one), Value::Number(other)) => {
                if let (Some(one), Some(other)) = (one.as_f64(), other.as_f64()) {
                    self.number(at_s, name, one, other);
                }
            }
            _ => self.number(at_s, name, 0.0, f64::from(u8::from(recorded != replayed))),
        }
    }

    fn number(&mut self, at_s: f64, name: String, one: f64, other: f64) {
        let (statistics, sum, squares, series) = self.sums.entry(name.clone()).or_insert_with(|| {
            self.order.push(name.clone());
            Default::default()
        });
        let apart = other - one;
        statistics.values += 1;
        statistics.different += u64::from(one != other);
        statistics.max = statistics.max.max(apart.abs());
        *sum += apart;
        *squares += apart * apart;
        series.points.push((at_s, one, other));
    }

    fn finish(self, path: &str) -> (Vec<FieldStatistics>, Vec<Series>) {
        let Fields { order, mut sums } = self;
        let mut fields = Vec::new();
        let mut plotted = Vec::new();
        for name in order {
            let Some((mut statistics, sum, squares, mut series)) = sums.remove(&name) else { continue };
            if statistics.different == 0 {
                continue;
            }
            statistics.mean = sum / statistics.values as f64;
            statistics.rms = (squares / statistics.values as f64).sqrt();
            series.name = format!("{path} {name}");
            statistics.field = name;
            // What differs most against its own spread is shown.
            let spread = series.points.iter().map(|(_, one, _)| one.abs()).fold(1e-9, f64::max);
            plotted.push((statistics.rms / spread, series));
            fields.push(statistics);
        }
        plotted.sort_by(|one, other| other.0.total_cmp(&one.0));
        (fields, plotted.into_iter().take(PLOTTED).map(|(_, series)| series).collect())
    }
}
