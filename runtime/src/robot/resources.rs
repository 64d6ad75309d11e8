//! The files of a robot: a folder on disk, or files built into the program.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Files built into a program: name relative to the robot's folder, and content.
pub type Embedded = &'static [(&'static str, &'static [u8])];

/// Where a robot's files (worlds, maps) are read from.
#[derive(Debug, Clone)]
pub enum Resources {
    /// A folder on disk.
    Folder(PathBuf),
    /// Files built into the program.
    Embedded(Embedded),
    /// Files out of a recording, by name.
    Held(Arc<BTreeMap<String, Vec<u8>>>),
}

impl Resources {
    /// The content of `name`, a path relative to the robot's folder (or an absolute one).
    pub fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        match self {
            Resources::Folder(folder) => {
                let file = folder.join(name);
                std::fs::read(&file).map_err(|e| format!("cannot read {}: {e}", file.display()))
            }
            Resources::Held(files) => files
                .get(name.strip_prefix("./").unwrap_or(name))
                .cloned()
                .ok_or_else(|| format!("the recording holds no file \"{name}\" of the robot")),
            Resources::Embedded(files) => match files.iter().find(|(known, _)| *known == name) {
                Some((_, bytes)) => Ok(bytes.to_vec()),
                None if Path::new(name).is_absolute() => {
                    std::fs::read(name).map_err(|e| format!("cannot read {name}: {e}"))
                }
                None => Err(format!(
                    "the built-in robot has no file \"{name}\"; it has {}",
                    files.iter().map(|(known, _)| *known).collect::<Vec<_>>().join(", ")
                )),
            },
        }
    }
}
