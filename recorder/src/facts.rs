//! What a recording says about its run, beside the samples: enough to open every node of it again.
//!
//! A metadata record `sinew` holds the words below; attachments hold the robot file (`robot.toml`) and the robot's other
//! files (`files/<name>`), as far as nodes can have read them.

use runtime::NodeType;
use runtime::robot::{Resources, Robot, RobotError};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// The newest format that this program writes and reads.
pub const FORMAT: u32 = 1;
/// Name of the metadata record.
pub(crate) const METADATA: &str = "sinew";
/// Name of the attachment that holds the robot file.
pub(crate) const ROBOT_FILE: &str = "robot.toml";
/// What the names of the attachments of the robot's other files begin with.
pub(crate) const FILES: &str = "files/";
/// Files of a robot beyond this are left out, and named [byte].
const MOST_FILE_BYTES: u64 = 16 << 20;
/// Files of a robot beyond this number are left out.
const MOST_FILES: usize = 200;
/// Files of a robot beyond this are left out together [byte].
const MOST_BYTES: usize = 64 << 20;

/// What a recording says about its run.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Facts {
    /// The robot's name.
    pub robot: String,
    /// The robot file as a person named it.
    pub robot_file: String,
    /// Its text, with all changes.
    pub robot_text: String,
    /// The run's seed.
    pub seed: u64,
    /// `live` or `simulated`.
    pub host: String,
    /// The program that ran: version and a number of its bytes.
    pub build: String,
    /// When it began, UTC; empty for a simulated run, whose bytes depend on nothing but its seed.
    pub started: String,
    /// What the file's clock is ahead of the robot's [ns].
    pub clock_offset_ns: u64,
    /// Nodes of the run, as in /drivers/base.
    pub nodes: Vec<String>,
    /// Who reads whom: `reader port <- path`, one per line.
    pub wiring: String,
    /// The robot's other files, by name.
    pub files: BTreeMap<String, Vec<u8>>,
}

impl Facts {
    /// What there is to say about a run of `robot`.
    pub fn of(robot: &Robot, seed: u64, host: &str) -> Facts {
        let mut facts = Facts {
            robot: robot.name.clone(),
            robot_file: robot.file.clone(),
            robot_text: robot.text.clone(),
            seed,
            host: host.into(),
            nodes: robot.nodes.iter().map(runtime::robot::NodeSpec::path).collect(),
            wiring: wiring(robot),
            ..Facts::default()
        };
        match &robot.resources {
            Resources::Folder(folder) => collect(folder, "", &mut facts.files),
            Resources::Embedded(files) => {
                facts.files.extend(files.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.to_vec())));
            }
            Resources::Held(files) => {
                facts.files.extend(files.iter().map(|(name, bytes)| (name.clone(), bytes.clone())))
            }
        }
        // Files outside the robot's folder that a setting names, such as a world of the command line.
        for node in &robot.nodes {
            texts(&toml_value(&node.config), &mut |text| {
                if Path::new(text).is_absolute()
                    && !facts.files.contains_key(text)
                    && let Ok(bytes) = robot.resources.read(text)
                {
                    facts.files.insert(text.to_owned(), bytes);
                }
            });
        }
        facts.files.remove(ROBOT_FILE);
        facts
    }

    /// The robot that ran, with the files that it had.
    pub fn robot(&self, types: &[NodeType]) -> Result<Robot, Vec<RobotError>> {
        let resources = Resources::Held(Arc::new(self.files.clone()));
        let mut robot = Robot::parse(&self.robot_text, &self.robot_file, resources, types)?;
        robot.nodes.retain(|node| self.nodes.contains(&node.path()));
        Ok(robot)
    }

    /// As the metadata record has it.
    pub(crate) fn to_metadata(&self) -> BTreeMap<String, String> {
        let words = [
            ("format", FORMAT.to_string()),
            ("robot", self.robot.clone()),
            ("robot_file", self.robot_file.clone()),
            ("seed", self.seed.to_string()),
            ("host", self.host.clone()),
            ("build", self.build.clone()),
            ("started", self.started.clone()),
            ("clock_offset_ns", self.clock_offset_ns.to_string()),
            ("nodes", self.nodes.join("\n")),
            ("wiring", self.wiring.clone()),
        ];
        words.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// Takes over a metadata record; its format.
    pub(crate) fn read_metadata(&mut self, words: &BTreeMap<String, String>) -> u32 {
        let word = |key: &str| words.get(key).cloned().unwrap_or_default();
        self.robot = word("robot");
        self.robot_file = word("robot_file");
        self.seed = word("seed").parse().unwrap_or_default();
        self.host = word("host");
        self.build = word("build");
        self.started = word("started");
        self.clock_offset_ns = word("clock_offset_ns").parse().unwrap_or_default();
        self.nodes = word("nodes").lines().map(str::to_owned).collect();
        self.wiring = word("wiring");
        word("format").parse().unwrap_or(u32::MAX)
    }
}

fn wiring(robot: &Robot) -> String {
    let mut lines = Vec::new();
    for node in &robot.nodes {
        for (port, wire) in &node.reads {
            lines.push(format!("{} {port} <- {}", node.path(), wire.from.join(", ")));
        }
        for (port, (path, command)) in &node.calls {
            lines.push(format!("{} {port} -> {path} {command}", node.path()));
        }
    }
    lines.join("\n")
}

/// Regular files below `folder`, without hidden ones.
fn collect(folder: &Path, above: &str, files: &mut BTreeMap<String, Vec<u8>>) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries {
        let Ok(name) = entry.file_name().into_string() else { continue };
        let Ok(kind) = entry.metadata() else { continue };
        if name.starts_with('.')
            || name.ends_with(".mcap")
            || files.len() >= MOST_FILES
            || files.values().map(Vec::len).sum::<usize>() >= MOST_BYTES
        {
            continue;
        }
        let path = if above.is_empty() { name } else { format!("{above}/{name}") };
        if kind.is_dir() {
            collect(&entry.path(), &path, files);
        } else if kind.len() <= MOST_FILE_BYTES
            && let Ok(bytes) = std::fs::read(entry.path())
        {
            files.insert(path, bytes);
        }
    }
}

fn toml_value(table: &impl serde::Serialize) -> serde_json::Value {
    serde_json::to_value(table).unwrap_or_default()
}

/// Hands every text in a value to `each`.
fn texts(value: &serde_json::Value, each: &mut dyn FnMut(&str)) {
    match value {
        serde_json::Value::String(text) => each(text),
        serde_json::Value::Array(items) => items.iter().for_each(|item| texts(item, each)),
        serde_json::Value::Object(items) => items.values().for_each(|item| texts(item, each)),
        _ => {}
    }
}

/// Version of this program and a number of its bytes: equal numbers mean the same program.
pub fn build_id() -> String {
    let hash = std::fs::read("/proc/self/exe").map(|bytes| {
        let (words, _) = bytes.as_chunks::<8>();
        words.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, word| {
            (hash ^ u64::from_le_bytes(*word)).wrapping_mul(0x100_0000_01b3).rotate_left(17)
        })
    });
    format!("{} {:016x}", env!("CARGO_PKG_VERSION"), hash.unwrap_or_default())
}
