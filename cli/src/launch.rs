//! What a run tells its node processes: the robot file as resolved, where its other files are, the seed.

use crate::built_in::PIONEER;
use crate::exit::Failure;
use crate::load;
use runtime::NodeType;
use runtime::robot::{Resources, Robot};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Written to `.run/launch.json` below the robot's folder of channels, and read by every node process and tool.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Launch {
    /// The robot file as a person named it.
    pub file: String,
    /// Text of the robot file, with the command line's changes.
    pub text: String,
    /// Folder of its worlds and maps; none for the built-in robot.
    pub folder: Option<PathBuf>,
    /// Seed of the run.
    pub seed: u64,
    /// Nodes of the run, as in /drivers/base: a robot with real devices runs without its world.
    pub nodes: Vec<String>,
    /// Those of them that came while it ran, in the order of their coming: they stand last in every list.
    #[serde(default)]
    pub spawned: Vec<String>,
}

impl Launch {
    /// What there is to tell about `robot`.
    pub fn new(robot: &Robot, seed: u64) -> Launch {
        Launch {
            file: robot.file.clone(),
            text: robot.text.clone(),
            folder: match &robot.resources {
                Resources::Folder(folder) => Some(folder.clone()),
                Resources::Embedded(_) | Resources::Held(_) => None,
            },
            seed,
            nodes: robot.nodes.iter().map(runtime::robot::NodeSpec::path).collect(),
            spawned: Vec::new(),
        }
    }

    /// Leaves it below `root`.
    pub fn write(&self, root: &Path) -> Result<(), Failure> {
        let folder = root.join(".run");
        std::fs::create_dir_all(&folder)?;
        // Whole or not at all: a node may start at this moment.
        let beside = folder.join(format!("launch.{}", std::process::id()));
        std::fs::write(&beside, serde_json::to_vec_pretty(self)?)?;
        std::fs::rename(&beside, folder.join("launch.json"))?;
        Ok(())
    }

    /// Leaves it where the supervisor takes it from when the change of `node` fails its trial; that file.
    pub fn leave_undo(&self, root: &Path, node: &str) -> Result<PathBuf, Failure> {
        let name = node.trim_start_matches('/').replace('/', ".");
        let file = root.join(".run").join(format!("{}{name}", supervisor::UNDO));
        std::fs::write(&file, serde_json::to_vec_pretty(self)?)?;
        Ok(file)
    }

    /// Finds it below `root`.
    pub fn read(root: &Path) -> Result<Launch, Failure> {
        let file = root.join(".run/launch.json");
        let bytes = std::fs::read(&file).map_err(|e| {
            let text = format!("cannot read {}: {e}\nNodes are started by `sinew run`.", file.display());
            Failure::new(crate::exit::NOT_RUNNING, text)
        })?;
        Ok(serde_json::from_slice(&bytes)?)
    }

    /// The robot, as it runs.
    pub fn robot(&self, types: &[NodeType]) -> Result<Robot, Failure> {
        let resources = match &self.folder {
            Some(folder) => Resources::Folder(folder.clone()),
            None => Resources::Embedded(PIONEER),
        };
        let mut robot = Robot::parse(&self.text, &self.file, resources, types).map_err(load::errors)?;
        robot.nodes.retain(|node| self.nodes.contains(&node.path()));
        // The others keep their lines in the table of heartbeats. The sort is stable.
        let came = |path: &str| self.spawned.iter().position(|spawned| spawned == path).map_or(0, |place| place + 1);
        robot.nodes.sort_by_key(|node| came(&node.path()));
        Ok(robot)
    }
}
