//! What the robot file says about hangs, deaths, silence and what they mean for the robot: `[nodes.X.care]`, `[limp]`,
//! `[supervision]`.

use schemars::JsonSchema;
use serde::Deserialize;

use super::file::RobotFile;
use crate::path;

/// A rung of the severity ladder: each includes the lower ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rung {
    /// Nothing.
    None,
    /// People are told.
    #[default]
    Warn,
    /// Limp mode.
    Limp,
    /// The robot stands still until the cause is gone.
    Hold,
    /// Emergency stop: waits for a person.
    Stop,
}

/// When a cause no longer counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Leave {
    /// Once it has been gone for a while.
    #[default]
    Recovered,
    /// Once it is gone and a person says so (`sinew reset`).
    Reset,
    /// Never in this run.
    Never,
}

/// Who is started anew with a member of a group that died.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// Nobody else.
    #[default]
    OneForOne,
    /// All members.
    OneForAll,
    /// The members named after it.
    RestForOne,
}

/// How a node is cared for. Nodes that share a process share their care.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CareTable {
    /// What it means for the robot when the node cannot be had.
    pub loss: Option<Rung>,
    /// When that, or its silence, no longer counts; where nothing is said, as `[limp]` says, else recovered.
    pub clear: Option<Leave>,
    /// How long a cause must be gone [ms].
    pub clear_after_ms: Option<f64>,
    /// A node that is down counts as lost after this long [ms].
    pub absent_after_ms: Option<f64>,
    /// How long later groups wait for it to be ready at the start [ms].
    pub ready_within_ms: Option<f64>,
    /// A node that is not ready after this long hangs and is killed [ms].
    pub start_deadline_ms: Option<f64>,
    /// From the request to stop to SIGKILL [ms].
    pub grace_ms: Option<f64>,
    /// Restarts allowed within `within_s`; one more, and it is given up.
    pub restarts: Option<u32>,
    /// Window of `restarts` [s].
    pub within_s: Option<f64>,
    /// Delay before the first restart [ms].
    pub first_delay_ms: Option<f64>,
    /// Delay before the second one; doubles with each further [ms].
    pub delay_ms: Option<f64>,
    /// Longest delay [ms].
    pub longest_delay_ms: Option<f64>,
    /// A node that was ready for so long starts with the first delay again [s].
    pub healthy_s: Option<f64>,
    /// Missed heartbeats that raise its priority and are told.
    pub missed_low: Option<u32>,
    /// Missed heartbeats that count as a hang.
    pub missed_high: Option<u32>,
    /// Greatest age of the newest sample of written ports [ms]: older, and the node is silent.
    pub fresh_ms: std::collections::BTreeMap<String, f64>,
    /// What silence means for the robot.
    pub silence: Option<Rung>,
    /// Whether a silent node is killed, to be started again.
    pub restart_when_silent: bool,
    /// What missed deadlines mean for the robot when no priority helps.
    pub lateness: Option<Rung>,
    /// Priority above the robot file's that it may be given while it misses deadlines and processors are idle.
    pub raise_most: Option<u8>,
    /// How long it must keep its deadlines before its priority is lowered again [s].
    pub calm_s: Option<f64>,
    /// Whether a second process waits, warmed up, to take over.
    pub standby: bool,
    /// How long a replacement is on trial [s].
    pub trial_s: Option<f64>,
}

/// Limp mode: what remains when a node that matters cannot be had.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limp {
    /// Actions whose proposals still count; the others keep nothing but their caps.
    pub actions: Vec<String>,
    /// Greatest speed in either direction [m/s].
    pub max_speed_m_s: f64,
    /// Greatest turn rate [rad/s].
    #[serde(default)]
    pub max_turn_rad_s: Option<f64>,
    /// The way out, for causes whose node says nothing else.
    #[serde(default)]
    pub leave: Leave,
    /// How long the cause must be gone [ms].
    #[serde(default)]
    pub after_ms: f64,
}

/// What nodes share, and what else follows.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SupervisionTable {
    /// Nodes that share a fate.
    pub groups: Vec<GroupTable>,
    /// What follows conditions, beside the care of each node.
    pub reactions: Vec<ReactionTable>,
}

/// Nodes that share a fate.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GroupTable {
    /// Its members, in the order in which they are started.
    pub nodes: Vec<String>,
    /// Who is started anew with one that died.
    pub strategy: Strategy,
    /// Group restarts allowed within `within_s`.
    #[serde(default = "restarts")]
    pub restarts: u32,
    /// Window of `restarts` [s].
    #[serde(default = "within_s")]
    pub within_s: f64,
}

fn restarts() -> u32 {
    10
}

fn within_s() -> f64 {
    60.0
}

/// What a reaction waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// The node's process ended unasked.
    Death,
    /// It ended by a signal or with a code other than 0.
    AbnormalDeath,
    /// It missed `missed_low` heartbeats.
    MissedLow,
    /// It missed `missed_high` heartbeats.
    MissedHigh,
    /// It came under the supervisor's care.
    Attach,
    /// It left the supervisor's care.
    Detach,
    /// It was started again.
    Restart,
    /// Somebody raised `code`; without `code`: any.
    Raised,
    /// Its samples are too old.
    Silent,
    /// It missed a deadline.
    Late,
    /// It was not ready in time.
    NotReady,
    /// It was given up.
    GivenUp,
}

/// One thing that a reaction does.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Do {
    /// Start this node anew.
    Restart(String),
    /// Run this program with these arguments, and wait for its end.
    Execute(Vec<String>),
    /// Wait until this path has a sample, for at most so long.
    WaitFor {
        /// The path.
        path: String,
        /// How long at most [ms].
        within_ms: f64,
    },
    /// Wait [ms].
    WaitMs(f64),
    /// Tell people.
    Notify,
    /// Keep a record.
    Log,
    /// Count the node's heartbeat as healthy.
    Heal,
    /// Put the robot on this rung until the node is well again.
    Rung(Rung),
}

/// What follows a condition.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReactionTable {
    /// Whose condition; absent: any node's.
    #[serde(default)]
    pub node: Option<String>,
    /// What it waits for.
    pub when: When,
    /// The code of `when = "raised"`.
    #[serde(default)]
    pub code: Option<u16>,
    /// What is done, one after another.
    #[serde(rename = "do")]
    pub acts: Vec<Do>,
    /// What is done instead of the rest when one of them fails.
    #[serde(default)]
    pub otherwise: Vec<Do>,
    /// Whether it acts only once.
    #[serde(default)]
    pub once: bool,
    /// When a rung that it put the robot on no longer counts.
    #[serde(default)]
    pub clear: Leave,
}

/// Hands every contradiction to `complain`: keys of its place, reason, what to do.
pub(super) fn check(file: &RobotFile, complain: &mut dyn FnMut(&[&str], String, &str)) {
    let known = |name: &str| file.nodes.contains_key(name);
    for (instance, node) in &file.nodes {
        let Some(care) = &node.care else { continue };
        let at = |key: &'static str| ["nodes", instance.as_str(), "care", key];
        if file.limp.is_none() {
            let rungs = [("loss", care.loss), ("silence", care.silence), ("lateness", care.lateness)];
            for (key, _) in rungs.into_iter().filter(|(_, rung)| *rung == Some(Rung::Limp)) {
                complain(
                    &at(key),
                    format!("\"{instance}\" asks for limp mode, which this robot has not"),
                    "add [limp] with `actions` and `max_speed_m_s`",
                );
            }
        }
        let stops = [care.loss, care.silence].contains(&Some(Rung::Stop));
        if stops && care.clear == Some(Leave::Recovered) {
            complain(
                &at("clear"),
                "an emergency stop never ends by itself".into(),
                "write clear = \"reset\", or another rung than \"stop\"",
            );
        }
        if let (Some(low), Some(high)) = (care.missed_low, care.missed_high)
            && low >= high
        {
            complain(
                &at("missed_low"),
                format!("missed_low = {low} comes no sooner than missed_high = {high}"),
                "write a smaller missed_low",
            );
        }
        if care.standby && node.restart == super::file::Restart::Never {
            complain(
                &at("standby"),
                "a standby takes over after a death, but restart = \"never\"".into(),
                "drop one of the two",
            );
        }
        if care.restart_when_silent && care.fresh_ms.is_empty() {
            complain(
                &at("restart_when_silent"),
                "nothing says when the node is silent".into(),
                "add fresh_ms = { PORT = 500 }",
            );
        }
        let spans = [
            ("clear_after_ms", care.clear_after_ms),
            ("absent_after_ms", care.absent_after_ms),
            ("ready_within_ms", care.ready_within_ms),
            ("start_deadline_ms", care.start_deadline_ms),
            ("grace_ms", care.grace_ms),
            ("within_s", care.within_s),
            ("first_delay_ms", care.first_delay_ms),
            ("delay_ms", care.delay_ms),
            ("longest_delay_ms", care.longest_delay_ms),
            ("healthy_s", care.healthy_s),
            ("calm_s", care.calm_s),
            ("trial_s", care.trial_s),
        ];
        for (key, value) in spans.into_iter().filter_map(|(key, value)| Some((key, value?))) {
            if !(0.0..=3.6e6).contains(&value) {
                complain(
                    &at(key),
                    format!("{key} is {value}: it must lie between 0 and 3600000"),
                    "write a number of that range",
                );
            }
        }
        for (port, ms) in care.fresh_ms.iter().filter(|(_, ms)| !(1.0..=3.6e6).contains(*ms)) {
            complain(
                &at("fresh_ms"),
                format!("fresh_ms.{port} is {ms}: it must lie between 1 and 3600000"),
                "write a number of that range",
            );
        }
        let partners = file.nodes.iter().filter(|(_, other)| node.process.is_some() && other.process == node.process);
        if let Some((other, _)) =
            partners.filter(|(_, other)| other.care.as_ref().is_some_and(|c| c != care)).min_by_key(|(name, _)| *name)
            && other < instance
        {
            complain(
                &["nodes", instance, "care"],
                format!("\"{instance}\" and \"{other}\" share a process but not their care"),
                "write the care at one of them",
            );
        }
    }
    if let Some(limp) = &file.limp {
        for action in limp.actions.iter().filter(|action| !known(action)) {
            complain(&["limp", "actions"], format!("there is no node \"{action}\""), "name actions of this robot file");
        }
        let speed = limp.max_speed_m_s;
        if !(0.0..=file.body.max_forward_m_s).contains(&speed) {
            let most = file.body.max_forward_m_s;
            complain(
                &["limp", "max_speed_m_s"],
                format!("max_speed_m_s is {speed}, which is not slower than the body's {most}"),
                "write a smaller speed, 0 or more",
            );
        }
        if limp.max_turn_rad_s.is_some_and(|turn| !(0.0..=file.body.max_turn_rad_s).contains(&turn)) {
            complain(
                &["limp", "max_turn_rad_s"],
                "it is not slower than the body's".into(),
                "write a smaller turn rate, 0 or more",
            );
        }
        if !(0.0..=3.6e6).contains(&limp.after_ms) {
            complain(&["limp", "after_ms"], format!("after_ms is {}", limp.after_ms), "write 0 to 3600000");
        }
    }
    let mut taken: Vec<&str> = Vec::new();
    for (index, group) in file.supervision.groups.iter().enumerate() {
        let at = ["supervision", "groups"];
        if group.nodes.len() < 2 {
            complain(
                &at,
                format!("group {index} has fewer than two nodes"),
                "name all that share a fate, or drop the group",
            );
        }
        if !(group.within_s > 0.0 && group.within_s <= 86_400.0) {
            complain(
                &at,
                format!("within_s of group {index} is {}", group.within_s),
                "write a number above 0 and below a day",
            );
        }
        for node in &group.nodes {
            if !known(node) {
                complain(&at, format!("group {index}: there is no node \"{node}\""), "name nodes of this robot file");
            }
            if taken.contains(&node.as_str()) {
                complain(&at, format!("\"{node}\" is named twice"), "a node shares one fate only");
            }
            taken.push(node);
        }
    }
    for (index, reaction) in file.supervision.reactions.iter().enumerate() {
        let at = ["supervision", "reactions"];
        if let Some(node) = reaction.node.as_ref().filter(|node| !known(node)) {
            complain(&at, format!("reaction {index}: there is no node \"{node}\""), "name a node of this robot file");
        }
        if reaction.code.is_some() && reaction.when != When::Raised {
            complain(
                &at,
                format!("reaction {index} has a code, but does not wait for a raised one"),
                "write when = \"raised\"",
            );
        }
        if reaction.acts.is_empty() {
            complain(&at, format!("reaction {index} does nothing"), "add `do`, or drop it");
        }
        if reaction.otherwise.iter().any(|act| matches!(act, Do::Restart(_))) {
            complain(&at, format!("reaction {index}: a fallback restarts nothing"), "move the restart into `do`");
        }
        for act in reaction.acts.iter().chain(&reaction.otherwise) {
            match act {
                Do::Restart(node) if !known(node) => {
                    complain(
                        &at,
                        format!("reaction {index}: there is no node \"{node}\""),
                        "name a node of this robot file",
                    );
                }
                Do::Execute(words) if words.is_empty() => {
                    complain(
                        &at,
                        format!("reaction {index} executes nothing"),
                        "write execute = [\"program\", \"argument\"]",
                    );
                }
                Do::WaitFor { path: wanted, within_ms } => {
                    if let Err(e) = path::split_path(wanted) {
                        complain(&at, format!("reaction {index}: {e}"), "write a path of the tree");
                    }
                    if !(0.0..=3.6e6).contains(within_ms) {
                        complain(&at, format!("reaction {index}: within_ms is {within_ms}"), "write 0 to 3600000");
                    }
                }
                Do::WaitMs(ms) if !(0.0..=3.6e6).contains(ms) => {
                    complain(&at, format!("reaction {index}: wait_ms is {ms}"), "write 0 to 3600000");
                }
                Do::Rung(Rung::Limp) if file.limp.is_none() => {
                    complain(
                        &at,
                        format!("reaction {index} asks for limp mode, which this robot has not"),
                        "add [limp]",
                    );
                }
                _ => {}
            }
        }
    }
}

/// Period of a node's grid: fixed, or elastic between two bounds [ms].
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema)]
#[schemars(untagged)]
pub enum Period {
    /// Fixed.
    Fixed(f64),
    /// Elastic: as short as `min`; under overload stretched up to `max`.
    Elastic {
        /// Shortest: the one that is wanted [ms].
        min: f64,
        /// Longest [ms].
        max: f64,
    },
}

impl Period {
    /// The wanted one [ms].
    pub fn wanted_ms(self) -> f64 {
        match self {
            Period::Fixed(ms) => ms,
            Period::Elastic { min, .. } => min,
        }
    }

    /// The longest [ms].
    pub fn longest_ms(self) -> f64 {
        match self {
            Period::Fixed(ms) => ms,
            Period::Elastic { max, .. } => max,
        }
    }
}

impl<'de> Deserialize<'de> for Period {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Period, D::Error> {
        struct PeriodVisitor;
        impl<'de> serde::de::Visitor<'de> for PeriodVisitor {
            type Value = Period;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number of milliseconds or { min = …, max = … }")
            }

            fn visit_f64<E>(self, ms: f64) -> Result<Period, E> {
                Ok(Period::Fixed(ms))
            }

            fn visit_i64<E>(self, ms: i64) -> Result<Period, E> {
                Ok(Period::Fixed(ms as f64))
            }

            fn visit_u64<E>(self, ms: u64) -> Result<Period, E> {
                Ok(Period::Fixed(ms as f64))
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(self, mut map: A) -> Result<Period, A::Error> {
                let (mut min, mut max) = (None, None);
                while let Some(key) = map.next_key::<String>()? {
                    match key.as_str() {
                        "min" => min = Some(map.next_value()?),
                        "max" => max = Some(map.next_value()?),
                        other => return Err(serde::de::Error::unknown_field(other, &["min", "max"])),
                    }
                }
                let missing = serde::de::Error::missing_field;
                Ok(Period::Elastic { min: min.ok_or_else(|| missing("min"))?, max: max.ok_or_else(|| missing("max"))? })
            }
        }
        deserializer.deserialize_any(PeriodVisitor)
    }
}
