//! A stop outlives the power: `stop.json` in the log folder says that the robot was stopped when it was last seen.
//!
//! Where no logs can be kept it is forgotten with the robot's memory, and the run says so.

use std::fs;
use std::io;
use std::path::Path;

use guard::latch::State;
use guard::{LatchPage, SourceInfo};
use serde::{Deserialize, Serialize};

const FILE: &str = "stop.json";

/// A latch that does not allow motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    armed: bool,
    sources: Vec<Source>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Source {
    name: String,
    reason: String,
    unix_ms: u64,
    pid: u32,
    uid: u32,
}

impl Stop {
    /// Where a later run begins.
    pub fn state(&self) -> State {
        if self.armed { State::Armed } else { State::Latched }
    }

    /// Who wanted it.
    pub fn sources(&self) -> Vec<SourceInfo> {
        let info = |source: &Source| SourceInfo {
            name: source.name.clone(),
            reason: source.reason.clone(),
            held: false,
            at_ns: 0,
            unix_ms: source.unix_ms,
            by: (source.pid, source.uid),
        };
        self.sources.iter().map(info).collect()
    }
}

/// What an earlier run was left with.
pub fn read(folder: &Path) -> Option<Stop> {
    serde_json::from_slice(&fs::read(folder.join(FILE)).ok()?).ok()
}

/// Writes down, or forgets, what the latch says.
pub fn write(folder: &Path, page: &LatchPage) -> io::Result<()> {
    let file = folder.join(FILE);
    let state = page.word().state();
    if state == State::Run {
        return match fs::remove_file(file) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        };
    }
    let source = |source: SourceInfo| Source {
        name: source.name,
        reason: source.reason,
        unix_ms: source.unix_ms,
        pid: source.by.0,
        uid: source.by.1,
    };
    let stop = Stop { armed: state == State::Armed, sources: page.sources().into_iter().map(source).collect() };
    let new = folder.join("stop.json.new");
    fs::write(&new, serde_json::to_vec(&stop)?)?;
    fs::File::open(&new)?.sync_all()?;
    fs::rename(new, file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_is_found_by_the_next_run_and_forgotten_once_the_robot_runs() {
        let folder = tempfile::tempdir().unwrap();
        let page = LatchPage::local();
        assert_eq!(read(folder.path()), None);
        let source = SourceInfo {
            name: "operator".into(),
            reason: "smoke".into(),
            held: false,
            at_ns: 0,
            unix_ms: 12,
            by: (3, 4),
        };
        page.begin_stopped(State::Latched, std::slice::from_ref(&source), 5);
        write(folder.path(), &page).unwrap();
        let stop = read(folder.path()).unwrap();
        assert_eq!((stop.state(), stop.sources()), (State::Latched, vec![source]));
        page.set(State::Run, 6);
        write(folder.path(), &page).unwrap();
        assert_eq!(read(folder.path()), None);
    }
}
