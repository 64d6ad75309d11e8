//! The files of a robot: a folder on disk, or files built into the program.

use std::path::{Path, PathBuf};

/// Files built into a program: name relative to the robot's folder, and content.
pub type Embedded = &'static [(&'static str, &'static [u8])];

/// Where a robot's files (worlds, maps) are read from.
#[derive(Debug, Clone)]
pub enum Resources {
    /// A folder on disk.
    Folder(PathBuf),
    /// Files built into the program.
    Embedded(Embedded),
}

impl Resources {
    /// The content of `name`, a path relative to the robot's folder (or an absolute one).
    pub fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        match self {
            Resources::Folder(folder) => {
                let file = folder.join(name);
                std::fs::read(&file).map_err(|e| format!("cannot read {}: {e}", file.display()))
            }
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
