//! The files by which a machine tells about itself, below a root that a test can choose.

use std::path::PathBuf;

/// A machine.
pub struct Machine {
    root: PathBuf,
}

impl Machine {
    /// The one that this program runs on.
    pub fn this() -> Machine {
        Machine { root: "/".into() }
    }

    /// One whose files lie below `root`.
    #[cfg(test)]
    pub fn below(root: &std::path::Path) -> Machine {
        Machine { root: root.into() }
    }

    /// Where `path` is.
    pub fn path(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }

    /// Text of a file, without the last line's end; `None` when it cannot be read.
    pub fn text(&self, path: &str) -> Option<String> {
        let bytes = std::fs::read(self.path(path)).ok()?;
        Some(String::from_utf8_lossy(&bytes).trim_end().to_owned())
    }

    /// Names in a folder, sorted.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    /// Whether a process of this name runs.
    pub fn has_process(&self, name: &str) -> bool {
        // The kernel keeps the first fifteen bytes.
        let kept: String = name.chars().take(15).collect();
        let pids = self.names("/proc").into_iter().filter(|entry| entry.bytes().all(|b| b.is_ascii_digit()));
        pids.into_iter().any(|pid| self.text(&format!("/proc/{pid}/comm")).is_some_and(|comm| comm == kept))
    }
}

/// A made-up machine for tests: files with their texts.
#[cfg(test)]
pub fn fake(name: &str, files: &[(&str, &str)]) -> Machine {
    let root = std::env::temp_dir().join(format!("sinew-doctor-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&root);
    std::fs::create_dir_all(&root).unwrap();
    let machine = Machine::below(&root);
    for (path, text) in files {
        let path = machine.path(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    machine
}

#[cfg(test)]
impl Drop for Machine {
    fn drop(&mut self) {
        if self.root.starts_with(std::env::temp_dir()) {
            let _ = std::fs::remove_dir_all(&self.root);
        }
    }
}
