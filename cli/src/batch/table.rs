//! Missions as CSV: a heading, a line per mission, readable by every table program.
//!
//! The last column, `setup`, tells robot, scenario and faults apart: a batch is only resumed, and two batches of one
//! setup are only mixed, where it agrees.

use super::mission::{Mission, NodeCost};

/// The columns, in order.
const HEADING: &str = "seed,failure,time_s,goals,contacts_caused,contacts_suffered,distance_m,mean_speed_m_s,\
max_speed_m_s,jerk_rms_m_s3,least_clearance_m,mean_clearance_m,energy_j,missed_deadlines,cpu_share,\
faults,restarts,cpu_and_misses_by_node,hash,setup";

/// A file of missions.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// In the order of the file.
    pub missions: Vec<Mission>,
    /// Their setup; empty when there are none.
    pub setup: String,
    /// Bytes of the file that hold whole lines; what a sudden end cut in two lies behind them.
    pub whole: usize,
}

/// Why a CSV file cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TableError {
    /// Another kind of file, or another version's.
    #[error("line 1 is no heading of a batch of this version; write to another file")]
    Heading,
    /// A damaged line.
    #[error("line {line} is no mission: {reason}; delete it to simulate its seed again")]
    Line {
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// Lines of different batches.
    #[error("line {line} comes from another robot, scenario or faults; give each batch a file of its own")]
    Mixed {
        /// Counted from 1.
        line: usize,
    },
}

/// The heading with its end of line.
pub fn heading() -> String {
    format!("{HEADING}\n")
}

/// A mission's line with its end.
pub fn line(mission: &Mission, setup: &str) -> String {
    let m = mission;
    // Reasons and paths hold no commas or quotes; were one to, the table would still be whole.
    let plain = |text: &str| text.replace([',', '"', ';', '\n', '\r'], " ");
    let nodes: Vec<String> =
        m.nodes.iter().map(|node| format!("{} {} {}", plain(&node.path), node.cpu, node.missed_deadlines)).collect();
    format!(
        "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:.6},{},{},{},{},{}\n",
        m.seed,
        plain(&m.failure),
        m.time_s,
        m.goals,
        m.contacts[0],
        m.contacts[1],
        m.distance_m,
        m.speed_m_s[0],
        m.speed_m_s[1],
        m.jerk_m_s3,
        m.clearance_m[0],
        m.clearance_m[1],
        m.energy_j,
        m.missed_deadlines(),
        m.cpu(),
        m.faults[0],
        m.faults[1],
        nodes.join(";"),
        m.hash,
        setup
    )
}

/// Reads a file; a last line without its end is left out.
pub fn parse(text: &str) -> Result<Table, TableError> {
    let mut table = Table::default();
    for (index, line) in text.split_inclusive('\n').enumerate() {
        let Some(words) = line.strip_suffix('\n') else { break };
        let words = words.strip_suffix('\r').unwrap_or(words);
        if index == 0 {
            if words != HEADING {
                return Err(TableError::Heading);
            }
        } else {
            let (mission, setup) = read(words).map_err(|reason| TableError::Line { line: index + 1, reason })?;
            if table.missions.is_empty() {
                table.setup = setup;
            } else if table.setup != setup {
                return Err(TableError::Mixed { line: index + 1 });
            }
            table.missions.push(mission);
        }
        table.whole += line.len();
    }
    Ok(table)
}

fn read(line: &str) -> Result<(Mission, String), String> {
    let cells: Vec<&str> = line.split(',').collect();
    let names: Vec<&str> = HEADING.split(',').collect();
    if cells.len() != names.len() {
        return Err(format!("it has {} columns of {}", cells.len(), names.len()));
    }
    let real = |k: usize| cells[k].parse::<f64>().map_err(|_| format!("{} is {:?}", names[k], cells[k]));
    let whole = |k: usize| cells[k].parse::<u64>().map_err(|_| format!("{} is {:?}", names[k], cells[k]));
    let mission = Mission {
        seed: whole(0)?,
        failure: cells[1].to_owned(),
        time_s: real(2)?,
        goals: whole(3)?,
        contacts: [whole(4)?, whole(5)?],
        distance_m: real(6)?,
        speed_m_s: [real(7)?, real(8)?],
        jerk_m_s3: real(9)?,
        clearance_m: [real(10)?, real(11)?],
        energy_j: real(12)?,
        faults: [whole(15)?, whole(16)?],
        nodes: cells[17]
            .split_terminator(';')
            .map(node)
            .collect::<Option<_>>()
            .ok_or_else(|| format!("{} is {:?}", names[17], cells[17]))?,
        hash: cells[18].to_owned(),
    };
    Ok((mission, cells[19].to_owned()))
}

/// "PATH SHARE MISSES"
fn node(words: &str) -> Option<NodeCost> {
    let (rest, missed) = words.rsplit_once(' ')?;
    let (path, cpu) = rest.rsplit_once(' ')?;
    Some(NodeCost { path: path.into(), cpu: cpu.parse().ok()?, missed_deadlines: missed.parse().ok()? })
}
