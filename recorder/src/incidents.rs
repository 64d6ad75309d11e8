//! Follows the supervisor's journal of incidents, `incidents.jsonl`.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;

use supervisor::Record;

/// How far the journal has been read.
pub(crate) struct Incidents {
    file: PathBuf,
    /// Incidents before this belong to an earlier run [s].
    from_s: f64,
    read_to: u64,
    rest: Vec<u8>,
}

impl Incidents {
    /// The journal of `robot`, from `from_s` on.
    pub fn of(robot: &str, from_s: f64) -> Option<Incidents> {
        let file = supervisor::log_folder(robot)?.join("incidents.jsonl");
        Some(Incidents { file, from_s, read_to: 0, rest: Vec::new() })
    }

    /// The incidents that have come since the last time of asking. A journal that cannot be read has none.
    pub fn take(&mut self) -> Vec<Record> {
        let Ok(mut file) = File::open(&self.file) else { return Vec::new() };
        let size = file.metadata().map_or(0, |known| known.len());
        if size < self.read_to {
            // A journal that grew too large was put aside and begun anew.
            self.read_to = 0;
            self.rest.clear();
        }
        if size == self.read_to || file.seek(SeekFrom::Start(self.read_to)).is_err() {
            return Vec::new();
        }
        self.read_to += file.read_to_end(&mut self.rest).unwrap_or(0) as u64;
        let whole = self.rest.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        let lines: Vec<u8> = self.rest.drain(..whole).collect();
        let records = lines.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice(line).ok());
        records.filter(|record: &Record| record.at_s >= self.from_s).collect()
    }
}
