//! What is in a recording.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::RecordingError;
use crate::feed::INCIDENTS;
use crate::reader::{Item, Recording};

/// What is in a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Info {
    /// The file.
    pub file: PathBuf,
    /// Its size [byte].
    pub bytes: u64,
    /// The robot.
    pub robot: String,
    /// `live` or `simulated`.
    pub host: String,
    /// Seed of the run.
    pub seed: u64,
    /// The program that ran.
    pub build: String,
    /// When it began, UTC; empty for a simulated run.
    pub started: String,
    /// From the first to the last sample [s].
    pub duration_s: f64,
    /// Messages, copies and incidents included.
    pub messages: u64,
    /// Samples of the robot that are missing in the numbers of their channels.
    pub missing: u64,
    /// Samples that the recorder says it lost.
    pub lost: u64,
    /// Nodes whose steps can be replayed from their start.
    pub replayable: Vec<String>,
    /// The topics, by name.
    pub topics: Vec<Topic>,
    /// What went wrong in the run: one line each.
    pub incidents: Vec<Incident>,
    /// Changes of the run while it was recorded.
    pub changes: u64,
    /// Hash over the exact samples, whatever the file's compression: the same seed and build give the same.
    pub content_hash: String,
    /// What is wrong with the file, where it is cut off or damaged.
    pub damage: Option<String>,
}

/// One topic.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Topic {
    /// Its name: the path, or `/ros` and the path.
    pub topic: String,
    /// Its ROS 2 type.
    #[serde(rename = "type")]
    pub ros_type: String,
    /// Messages.
    pub count: u64,
    /// Messages per second, between the first and the last.
    pub rate_hz: f64,
    /// Bytes of the messages, before compression.
    pub bytes: u64,
    /// Gaps in the numbers of the channel; 0 for copies.
    pub missing: u64,
}

/// One incident.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Incident {
    /// On the robot's clock [s].
    pub at_s: f64,
    /// Which node.
    pub node: String,
    /// What.
    pub message: String,
}

/// Where the supervisor says what changed in a run: operators' orders, wiring.
const CHANGES: &str = "/supervisor/robot/changes";

#[derive(Default)]
struct Tally {
    ros_type: String,
    count: u64,
    bytes: u64,
    first_ns: u64,
    last_ns: u64,
    missing: u64,
    last_sequence: u64,
}

impl Tally {
    fn add(&mut self, ns: u64, bytes: usize) {
        if self.count == 0 {
            self.first_ns = ns;
        }
        self.last_ns = self.last_ns.max(ns);
        self.count += 1;
        self.bytes += bytes as u64;
    }
}

/// Looks through a recording. One that is cut off or damaged is told as far as it goes.
pub fn info(file: &Path) -> Result<Info, RecordingError> {
    let bytes = std::fs::metadata(file).map_or(0, |known| known.len());
    let mut recording = Recording::open(file)?;
    let mut tallies: BTreeMap<String, Tally> = BTreeMap::new();
    let mut incidents = Vec::new();
    let (mut lost, mut launches) = (0, 0);
    let mut starts: BTreeMap<String, bool> = BTreeMap::new();
    let mut hash = Hash::default();
    let done = recording.read(&mut |item| match item {
        Item::Channel(channel) => {
            tallies.entry(channel.topic.clone()).or_default().ros_type = channel.ros_type.clone();
        }
        Item::Sample { channel, sample, fixed, tail } => {
            let tally = tallies.entry(channel.topic.clone()).or_default();
            if tally.last_sequence > 0 && sample.sequence > tally.last_sequence {
                tally.missing += sample.sequence - tally.last_sequence - 1;
            }
            tally.last_sequence = sample.sequence;
            tally.add(sample.stamp_ns, fixed.len() + tail.len());
            hash.add(channel.topic.as_bytes());
            for word in [sample.stamp_ns, sample.sequence, sample.generation] {
                hash.add(&word.to_le_bytes());
            }
            hash.add(fixed);
            hash.add(tail);
            if let Some(node) = channel.topic.strip_suffix("/inputs") {
                // The first step record of a node says whether it was followed from its start.
                let kind = fixed.get(16..20).and_then(|b| b.first_chunk()).map(|b| u32::from_le_bytes(*b));
                starts.entry(node.to_owned()).or_insert(kind == Some(messages::StepKind::Start as u32));
            }
        }
        Item::Copy { channel, log_ns, data } => {
            tallies.entry(channel.topic.clone()).or_default().add(log_ns, data.len());
            if channel.topic == INCIDENTS {
                incidents.extend(incident(data));
            }
        }
        Item::Change { .. } => launches += 1,
        Item::Losses(losses) => lost = losses.values().sum(),
    });
    let damage = match done {
        Ok(()) => None,
        Err(e @ (RecordingError::Truncated { .. } | RecordingError::Corrupt { .. })) => Some(e.to_string()),
        Err(e) => return Err(e),
    };
    let own = || {
        tallies.iter().filter(|(topic, tally)| !topic.starts_with("/ros/") && tally.count > 0 && *topic != INCIDENTS)
    };
    let first = own().map(|(_, tally)| tally.first_ns).min().unwrap_or(0);
    let last = own().map(|(_, tally)| tally.last_ns).max().unwrap_or(0);
    let changes = launches + tallies.get(CHANGES).map_or(0, |tally| tally.count);
    let facts = recording.facts();
    Ok(Info {
        file: file.to_owned(),
        bytes,
        robot: facts.robot.clone(),
        host: facts.host.clone(),
        seed: facts.seed,
        build: facts.build.clone(),
        started: facts.started.clone(),
        duration_s: (last - first) as f64 * 1e-9,
        messages: tallies.values().map(|tally| tally.count).sum(),
        missing: tallies.values().map(|tally| tally.missing).sum(),
        lost,
        replayable: starts.into_iter().filter(|(_, whole)| *whole).map(|(node, _)| node).collect(),
        topics: tallies.into_iter().map(|(topic, tally)| topic_of(topic, &tally)).collect(),
        incidents,
        changes,
        content_hash: hash.text(),
        damage,
    })
}

fn topic_of(topic: String, tally: &Tally) -> Topic {
    let span_s = tally.last_ns.saturating_sub(tally.first_ns) as f64 * 1e-9;
    let rate_hz = if span_s > 0.0 { (tally.count - 1) as f64 / span_s } else { 0.0 };
    Topic {
        topic,
        ros_type: tally.ros_type.clone(),
        count: tally.count,
        rate_hz,
        bytes: tally.bytes,
        missing: tally.missing,
    }
}

/// The incident in a CDR message: its last text is its JSON.
fn incident(data: &[u8]) -> Option<Incident> {
    let open = data.iter().position(|byte| *byte == b'{')?;
    let close = data.iter().rposition(|byte| *byte == b'}')?;
    // A sentence may hold a brace too: the JSON is what parses.
    let mut texts = data.get(open..=close)?;
    loop {
        if let Ok(record) = serde_json::from_slice::<supervisor::Record>(texts) {
            return Some(Incident { at_s: record.at_s, node: record.node, message: record.message });
        }
        let next = texts.get(1..)?.iter().position(|byte| *byte == b'{')?;
        texts = &texts[next + 1..];
    }
}

/// FNV-1a over 64 bits.
pub(crate) struct Hash(u64);

impl Default for Hash {
    fn default() -> Hash {
        Hash(0xcbf2_9ce4_8422_2325)
    }
}

impl Hash {
    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    pub fn text(self) -> String {
        format!("{:016x}", self.0)
    }
}
