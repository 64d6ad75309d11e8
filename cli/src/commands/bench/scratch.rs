//! A folder in shared memory for one run of a bench; gone when it ends.

use crate::exit::Failure;
use std::path::{Path, PathBuf};

/// Begin of the names; a robot's name cannot begin so.
const PREFIX: &str = ".bench-";

/// The folder.
pub struct Scratch(PathBuf);

impl Scratch {
    /// Makes one, and removes those that killed benches left behind.
    pub fn new() -> Result<Scratch, Failure> {
        let base = supervisor::base_folder();
        std::fs::create_dir_all(&base).map_err(|e| Failure::from(format!("cannot make {}: {e}", base.display())))?;
        remove_leftovers(&base);
        let folder = base.join(format!("{PREFIX}{}", std::process::id()));
        std::fs::create_dir(&folder).map_err(|e| Failure::from(format!("cannot make {}: {e}", folder.display())))?;
        Ok(Scratch(folder))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// A new folder in it.
    pub fn folder(&self, name: &str) -> Result<PathBuf, Failure> {
        let folder = self.0.join(name);
        std::fs::create_dir_all(&folder)?;
        Ok(folder)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn remove_leftovers(base: &Path) {
    for entry in std::fs::read_dir(base).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let owner = name.strip_prefix(PREFIX).and_then(|pid| pid.parse::<u32>().ok());
        if owner.is_some_and(|pid| !Path::new(&format!("/proc/{pid}")).exists()) {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}
