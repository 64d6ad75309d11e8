//! Where nodes write what they say, and the last lines of it.
//!
//! One file per node, `<log folder>/<instance>.log`, opened for appending and handed to the node as its standard output
//! and error. A run begins with an empty file and keeps the one before as `<instance>.previous.log`; so does a start
//! that finds more than `LARGEST_BYTES`. A robot that cannot write logs runs without them: it says so once.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// A log larger than this at the start of its node is put aside.
const LARGEST_BYTES: u64 = 8 << 20;
/// How much of a log is searched for its last lines.
const TAIL_BYTES: u64 = 4096;
/// How many last lines an incident keeps.
const TAIL_LINES: usize = 8;

/// The robot's log folder: below `$SINEW_STATE`, else `$XDG_STATE_HOME/sinew`, else `~/.local/state/sinew`.
pub fn log_folder(robot: &str) -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let base = set("SINEW_STATE")
        .or_else(|| set("XDG_STATE_HOME").map(|state| state.join("sinew")))
        .or_else(|| set("HOME").map(|home| home.join(".local/state/sinew")))?;
    Some(base.join(robot))
}

/// The log of one node.
#[derive(Debug)]
pub struct NodeLog {
    path: PathBuf,
    file: File,
    /// Where the words of the present process begin.
    from: u64,
    /// Where those of the newest dead one begin and end, until they are read.
    marked: Option<(u64, u64)>,
    /// Its last ones, where its file was put aside before they were read.
    kept: Vec<String>,
}

impl NodeLog {
    /// A new, empty log; the one of the run before is kept beside it.
    pub fn create(folder: &Path, instance: &str) -> io::Result<NodeLog> {
        let path = folder.join(format!("{instance}.log"));
        put_aside(&path)?;
        let file = open(&path)?;
        Ok(NodeLog { path, file, from: 0, marked: None, kept: Vec::new() })
    }

    /// The log that a supervisor before this one has begun.
    pub fn go_on(folder: &Path, instance: &str) -> io::Result<NodeLog> {
        let path = folder.join(format!("{instance}.log"));
        let file = open(&path)?;
        Ok(NodeLog { path, file, from: 0, marked: None, kept: Vec::new() })
    }

    /// The file that a new process of the node writes to. A full or missing disk never keeps a node from starting.
    pub fn begin(&mut self) -> &File {
        let metadata = self.file.metadata();
        let too_large = metadata.as_ref().is_ok_and(|file| file.len() > LARGEST_BYTES);
        let removed = metadata.is_ok_and(|file| file.nlink() == 0);
        if ((too_large && put_aside(&self.path).is_ok()) || removed)
            && let Ok(file) = open(&self.path)
        {
            self.kept = self.marked_lines();
            self.file = file;
        }
        self.from = self.file.metadata().map_or(0, |file| file.len());
        &self.file
    }

    /// The file, for a process that runs beside the present one.
    pub fn beside(&self) -> &File {
        &self.file
    }

    /// From here on the present process is another one, which was started with [`NodeLog::beside`].
    pub fn hand_over(&mut self) {
        self.from = self.file.metadata().map_or(self.from, |file| file.len());
    }

    /// The present process is dead: its words end here. They can be read later, when there is time.
    pub fn mark(&mut self) {
        let end = self.file.metadata().map_or(0, |file| file.len());
        (self.marked, self.kept) = (Some((self.from, end)), Vec::new());
    }

    /// There was no process.
    pub fn unmark(&mut self) {
        (self.marked, self.kept) = (None, Vec::new());
    }

    /// The last lines that the marked process has written; once.
    pub fn marked_lines(&mut self) -> Vec<String> {
        let Some((begin, end)) = self.marked.take() else { return std::mem::take(&mut self.kept) };
        let from = begin.max(end.saturating_sub(TAIL_BYTES));
        let mut bytes = vec![0_u8; end.saturating_sub(from) as usize];
        let read = self.file.read_at(&mut bytes, from).unwrap_or(0);
        last_lines(&bytes[..read])
    }
}

fn last_lines(bytes: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(bytes);
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    lines[lines.len().saturating_sub(TAIL_LINES)..].iter().map(|&line| line.to_owned()).collect()
}

/// Renames `name.log` to `name.previous.log` if there is anything in it.
pub(crate) fn put_aside(path: &Path) -> io::Result<()> {
    match fs::metadata(path) {
        Ok(file) if file.len() > 0 => {
            let extension = path.extension().unwrap_or_default().to_string_lossy().into_owned();
            fs::rename(path, path.with_extension(format!("previous.{extension}")))
        }
        _ => Ok(()),
    }
}

fn open(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).append(true).create(true).mode(0o640).open(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn the_last_lines_are_those_of_the_present_process() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = NodeLog::create(folder.path(), "base").unwrap();
        writeln!(log.begin(), "first life").unwrap();
        writeln!(log.begin(), "second life\n\nlast words").unwrap();
        log.mark();
        writeln!(log.begin(), "third life").unwrap();
        assert_eq!(log.marked_lines(), ["second life", "last words"]);
        assert!(log.marked_lines().is_empty(), "they are told once");
    }

    #[test]
    fn the_log_of_the_run_before_is_kept_beside_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        writeln!(NodeLog::create(folder.path(), "base").unwrap().begin(), "old").unwrap();
        let log = NodeLog::create(folder.path(), "base").unwrap();
        assert_eq!(log.file.metadata().unwrap().len(), 0);
        assert_eq!(fs::read_to_string(folder.path().join("base.previous.log")).unwrap(), "old\n");
    }

    #[test]
    fn a_log_that_has_grown_too_large_is_put_aside_at_the_next_start() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = NodeLog::create(folder.path(), "base").unwrap();
        writeln!(log.begin(), "last words").unwrap();
        log.mark();
        log.begin().set_len(LARGEST_BYTES + 1).unwrap();
        assert_eq!(log.begin().metadata().unwrap().len(), 0);
        assert!(folder.path().join("base.previous.log").exists());
        assert_eq!(log.marked_lines(), ["last words"]);
    }

    #[test]
    fn a_log_that_somebody_removed_is_made_anew() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = NodeLog::create(folder.path(), "base").unwrap();
        fs::remove_file(folder.path().join("base.log")).unwrap();
        log.begin();
        assert!(folder.path().join("base.log").exists());
    }

    #[test]
    fn many_lines_are_cut_to_the_last_ones() {
        let text: String = (0..100).map(|n| format!("line {n}\n")).collect();
        let lines = last_lines(text.as_bytes());
        assert_eq!((lines.len(), lines[7].as_str()), (TAIL_LINES, "line 99"));
    }
}
