//! The robot file as it is written: TOML tables, before anything is looked up or checked against node types.

use super::care::{CareTable, Limp, Period, SupervisionTable};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::{self, MapAccess, SeqAccess, Visitor};
use std::collections::BTreeMap;
use std::fmt;

/// A robot: its name, body, real-time wishes and nodes.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotFile {
    /// Who it is.
    pub robot: RobotTable,
    /// Its footprint and what it can do.
    #[serde(default)]
    pub body: Body,
    /// What to ask of the kernel.
    #[serde(default)]
    pub realtime: RealtimeTable,
    /// Records every run of the robot.
    #[serde(default)]
    pub record: Option<RecordTable>,
    /// What remains when a node that matters cannot be had.
    #[serde(default)]
    pub limp: Option<Limp>,
    /// Nodes that share a fate, and what follows conditions.
    #[serde(default)]
    pub supervision: SupervisionTable,
    /// The nodes by instance name; the name is the second part of every path that the node writes.
    #[serde(default)]
    pub nodes: BTreeMap<String, NodeTable>,
}

/// What of a run is recorded, and where to.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordTable {
    /// Folder of the recordings, relative to where `sinew run` is started; they are named after robot and time.
    pub folder: String,
    /// One file instead, which must not exist yet.
    pub file: Option<String>,
    /// Paths, folders or patterns to record; all when empty.
    pub paths: Vec<String>,
    /// Publish what every step of every node reads, so that the nodes can be replayed.
    pub inputs: bool,
}

impl Default for RecordTable {
    fn default() -> RecordTable {
        RecordTable { folder: "recordings".into(), file: None, paths: Vec::new(), inputs: true }
    }
}

/// Who the robot is.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotTable {
    /// Name of the robot: the folder of its channels, 1 to 32 of a-z, 0-9, _.
    pub name: String,
    /// One line about it.
    #[serde(default)]
    pub description: String,
}

/// The body: a rectangle about its centre of rotation, and its limits.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Body {
    /// From the centre of rotation to the foremost point [m].
    pub length_ahead_m: f64,
    /// From the centre of rotation to the rearmost point [m].
    pub length_behind_m: f64,
    /// From the centre line to either side [m].
    pub half_width_m: f64,
    /// Greatest forward speed [m/s].
    pub max_forward_m_s: f64,
    /// Greatest backward speed [m/s].
    pub max_backward_m_s: f64,
    /// Greatest turn rate [rad/s].
    pub max_turn_rad_s: f64,
    /// Greatest acceleration [m/s²].
    pub acceleration_m_s2: f64,
    /// Greatest deceleration that the wheels are sure to give [m/s²].
    pub deceleration_m_s2: f64,
    /// Greatest turn acceleration [rad/s²].
    pub turn_acceleration_rad_s2: f64,
    /// Greatest speed in a direction that no sensor covers [m/s].
    pub blind_cap_m_s: f64,
}

impl Default for Body {
    /// A small, slow, cautious body.
    fn default() -> Body {
        Body {
            length_ahead_m: 0.21,
            length_behind_m: 0.30,
            half_width_m: 0.20,
            max_forward_m_s: 0.3,
            max_backward_m_s: 0.1,
            max_turn_rad_s: 0.8,
            acceleration_m_s2: 0.3,
            deceleration_m_s2: 0.3,
            turn_acceleration_rad_s2: 1.5,
            blind_cap_m_s: 0.05,
        }
    }
}

/// How threads are scheduled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scheduler {
    /// The kernel's ordinary time sharing.
    #[default]
    Other,
    /// SCHED_FIFO at each node's `priority`.
    Fifo,
}

/// What to ask of the kernel; what was granted is reported per thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RealtimeTable {
    /// Scheduling class.
    pub scheduler: Scheduler,
    /// Lock stacks, rings and pools into memory, and touch them before the first step.
    pub lock_memory: bool,
    /// RLIMIT_RTTIME: a thread that computes longer than this without sleeping is killed; 0 for no limit [ms].
    pub runaway_ms: u32,
}

impl Default for RealtimeTable {
    fn default() -> RealtimeTable {
        RealtimeTable { scheduler: Scheduler::Other, lock_memory: false, runaway_ms: 0 }
    }
}

/// What a node does about periods that it missed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Missed {
    /// Go on with the next period of the grid; count the others.
    #[default]
    Skip,
    /// Do the missed steps one after another, at most ten; count the rest.
    CatchUp,
}

/// Whether a node that ended is started again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Restart {
    /// Whatever the reason.
    #[default]
    Always,
    /// Only after a crash or a non-zero exit.
    OnFailure,
    /// Never.
    Never,
}

/// How a node's process is kept apart from the rest of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Isolate {
    /// By nothing but the files' modes.
    #[default]
    None,
    /// A user of its own where the robot is run by root, Landlock and seccomp: it can touch what the robot file names for it.
    Strict,
}

/// One node.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NodeTable {
    /// Node type, as `sinew check --types` lists them.
    #[serde(rename = "type")]
    pub kind: String,
    /// Step on this grid [ms]; { min, max } where the governor may stretch it.
    #[serde(default)]
    pub period_ms: Option<Period>,
    /// Step when a sample arrives on one of these read ports; "device" for bytes of the node's device.
    #[serde(default)]
    pub trigger: Triggers,
    /// A step must have ended this long after its release [ms].
    #[serde(default)]
    pub deadline_ms: Option<f64>,
    /// What to do about missed periods.
    #[serde(default)]
    pub missed: Missed,
    /// Scheduling priority, 1 (least) to 89; used under SCHED_FIFO.
    #[serde(default)]
    pub priority: Option<u8>,
    /// Nodes with the same word share a process, as threads of one.
    #[serde(default)]
    pub process: Option<String>,
    /// How its process is kept apart from the rest of the machine.
    #[serde(default)]
    pub isolate: Isolate,
    /// The user that it runs as, where the robot is run by root; without one a strict node gets a user that nobody else is.
    #[serde(default)]
    pub user: Option<String>,
    /// What follows when it ends.
    #[serde(default)]
    pub restart: Restart,
    /// Hangs, silence, standbys, and what its loss means for the robot.
    #[serde(default)]
    pub care: Option<CareTable>,
    /// How little the robot can do without it, 0 to 100: the governor stretches and suspends the least important first.
    #[serde(default)]
    pub importance: Option<u8>,
    /// Longest execution of a step that is reckoned with before any was measured [ms].
    #[serde(default)]
    pub budget_ms: Option<f64>,
    /// Sources of the read ports.
    #[serde(default)]
    pub reads: BTreeMap<String, ReadTable>,
    /// Targets of the node's callers: "/layer/node command".
    #[serde(default)]
    pub calls: BTreeMap<String, String>,
    /// Ring depth of written ports, in samples.
    #[serde(default)]
    pub depth: BTreeMap<String, u32>,
    /// Publish what each step read, for replay.
    #[serde(default)]
    pub record_inputs: bool,
    /// The node type's own settings.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    pub config: Option<toml::Table>,
}

/// One trigger or several.
#[derive(Debug, Clone, Default, PartialEq, Eq, JsonSchema)]
#[schemars(transparent)]
pub struct Triggers(#[schemars(with = "OneOrMany")] pub Vec<String>);

/// A read port's sources.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
pub struct ReadTable {
    /// A path, a pattern for a set, or candidates in order of preference.
    #[schemars(with = "OneOrMany")]
    pub from: Vec<String>,
    /// A sample older than this counts as absent [ms].
    pub max_age_ms: Option<f64>,
    /// A better candidate must have been fresh for this long before it is used again [ms].
    pub return_after_ms: Option<f64>,
}

/// For the published schema only.
#[derive(JsonSchema)]
#[schemars(untagged)]
#[allow(dead_code, reason = "gives the JSON Schema its shape; never built")]
enum OneOrMany {
    /// One.
    One(String),
    /// Several.
    Many(Vec<String>),
}

struct TextsVisitor;

impl<'de> Visitor<'de> for TextsVisitor {
    type Value = Vec<String>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a text or a list of texts")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Vec<String>, E> {
        Ok(vec![text.to_owned()])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Vec<String>, A::Error> {
        let mut all = Vec::new();
        while let Some(text) = seq.next_element()? {
            all.push(text);
        }
        Ok(all)
    }
}

struct Texts(Vec<String>);

impl<'de> Deserialize<'de> for Texts {
    fn deserialize<D: de::Deserializer<'de>>(deserializer: D) -> Result<Texts, D::Error> {
        deserializer.deserialize_any(TextsVisitor).map(Texts)
    }
}

impl<'de> Deserialize<'de> for Triggers {
    fn deserialize<D: de::Deserializer<'de>>(deserializer: D) -> Result<Triggers, D::Error> {
        deserializer.deserialize_any(TextsVisitor).map(Triggers)
    }
}

impl<'de> Deserialize<'de> for ReadTable {
    fn deserialize<D: de::Deserializer<'de>>(deserializer: D) -> Result<ReadTable, D::Error> {
        struct ReadVisitor;
        impl<'de> Visitor<'de> for ReadVisitor {
            type Value = ReadTable;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a path, a list of paths, or a table with `from`")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<ReadTable, E> {
                Ok(ReadTable { from: vec![text.to_owned()], max_age_ms: None, return_after_ms: None })
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<ReadTable, A::Error> {
                Ok(ReadTable { from: TextsVisitor.visit_seq(seq)?, max_age_ms: None, return_after_ms: None })
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<ReadTable, A::Error> {
                let mut table = ReadTable { from: Vec::new(), max_age_ms: None, return_after_ms: None };
                while let Some(key) = map.next_key::<String>()? {
                    match key.as_str() {
                        "from" => table.from = map.next_value::<Texts>()?.0,
                        "max_age_ms" => table.max_age_ms = Some(map.next_value()?),
                        "return_after_ms" => table.return_after_ms = Some(map.next_value()?),
                        other => {
                            return Err(de::Error::unknown_field(other, &["from", "max_age_ms", "return_after_ms"]));
                        }
                    }
                }
                Ok(table)
            }
        }
        deserializer.deserialize_any(ReadVisitor)
    }
}
