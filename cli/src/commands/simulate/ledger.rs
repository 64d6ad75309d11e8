//! The CSV file of a batch: opened anew or gone on with, and written in the order of the seeds whatever the threads.

use crate::batch::{self, Mission};
use crate::exit::{Failure, USAGE};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;

/// See the module's text.
pub struct Ledger {
    file: Option<File>,
    setup: String,
    /// Seeds to be written, in order, and how many of them are.
    order: Vec<u64>,
    written: usize,
    /// Finished before an earlier seed.
    held: BTreeMap<u64, Mission>,
}

impl Ledger {
    /// Missions of `seeds` that the file has already, and the ledger for the others. Without a file everything is new.
    pub fn open(
        file: Option<&Path>,
        resume: bool,
        setup: String,
        seeds: std::ops::Range<u64>,
    ) -> Result<(Vec<Mission>, Ledger), Failure> {
        let (mut missions, file) = match file {
            Some(file) => {
                let failed = |reason: String| Failure::new(USAGE, format!("{}: {reason}", file.display()));
                let (missions, out) = open(file, resume, &setup).map_err(failed)?;
                (missions, Some(out))
            }
            None => (Vec::new(), None),
        };
        missions.retain(|mission| seeds.contains(&mission.seed));
        let known: std::collections::BTreeSet<u64> = missions.iter().map(|mission| mission.seed).collect();
        let order = seeds.filter(|seed| !known.contains(seed)).collect();
        Ok((missions, Ledger { file, setup, order, written: 0, held: BTreeMap::new() }))
    }

    /// Seeds that are still to be simulated.
    pub fn left(&self) -> &[u64] {
        &self.order
    }

    /// Takes a finished mission, and writes what is due.
    pub fn take(&mut self, mission: &Mission) -> std::io::Result<()> {
        let Some(file) = &mut self.file else { return Ok(()) };
        self.held.insert(mission.seed, mission.clone());
        let mut lines = String::new();
        while let Some(mission) = self.order.get(self.written).and_then(|seed| self.held.remove(seed)) {
            lines += &batch::line(&mission, &self.setup);
            self.written += 1;
        }
        file.write_all(lines.as_bytes())
    }

    /// Writes what waits for a seed that will not come.
    pub fn close(mut self) -> std::io::Result<()> {
        let lines: String = self.held.values().map(|mission| batch::line(mission, &self.setup)).collect();
        self.file.as_mut().map_or(Ok(()), |file| file.write_all(lines.as_bytes()))
    }
}

fn open(file: &Path, resume: bool, setup: &str) -> Result<(Vec<Mission>, File), String> {
    let there = match std::fs::read_to_string(file) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
        Err(e) => return Err(format!("cannot be read: {e}")),
    };
    if !there.is_empty() && !resume {
        return Err("it is there already; --resume goes on with it, or give another name".into());
    }
    let table = batch::parse(&there).map_err(|e| e.to_string())?;
    if !table.missions.is_empty() && table.setup != setup {
        return Err(
            "it comes from another program, robot, world, scenario or other faults; give this batch a file of \
                    its own"
                .into(),
        );
    }
    let cannot = |e: std::io::Error| format!("cannot be written: {e}");
    let mut out = OpenOptions::new().create(true).append(true).open(file).map_err(cannot)?;
    out.set_len(table.whole as u64).map_err(cannot)?;
    if table.whole == 0 {
        out.write_all(batch::heading().as_bytes()).map_err(cannot)?;
    }
    Ok((table.missions, out))
}
