//! `sinew bench simulator`: how fast whole robots and swarms are simulated, beside a peer where it is installed.
//!
//! Every row runs in a process of its own, so that its memory is its own; a row says by how much simulated time exceeds
//! the clock's (`realtime_factor`) and the time that all its threads together spent on cores (`realtime_factor_core`: what
//! one core would reach; others on the machine do not count), and the greatest resident memory of its process (`rss_mib`).

mod growth;
mod missions;
mod peer;
pub mod row;

use super::machine::Before;
use super::report::{Report, Row, Target, Value};
use super::witness::Witnesses;
use crate::exit::Failure;
use row::Measured;

/// Wall time of a row [s].
const ROW_S: f64 = 4.0;

/// A row of the table, and what is aimed at.
struct Wanted {
    row: &'static str,
    name: &'static str,
    /// Real-time factor, where there is an aim.
    factor: Option<f64>,
    /// Greatest memory, where there is an aim [MiB].
    rss_mib: Option<f64>,
    /// Cores that it may use; the factor is by the clock when there are several.
    threads: usize,
}

const TABLE: [Wanted; 7] = [
    Wanted {
        row: "hospital",
        name: "1,000 robots × 12 short rays, 140 × 60 m hospital-like map, 100 ms steps",
        factor: Some(30.0),
        rss_mib: Some(100.0),
        threads: 1,
    },
    Wanted {
        row: "cave_sonars",
        name: "100 Pioneers × 16 sonars, 16 × 16 m cave",
        factor: Some(150.0),
        rss_mib: None,
        threads: 1,
    },
    Wanted {
        row: "cave_laser",
        name: "100 Pioneers × 180-ray 8 m laser",
        factor: Some(60.0),
        rss_mib: None,
        threads: 1,
    },
    Wanted { row: "simple_10000", name: "10,000 simple robots", factor: Some(1.0), rss_mib: None, threads: 2 },
    Wanted {
        row: "simple_100000",
        name: "100,000 simple robots, 440 × 190 m",
        factor: None,
        rss_mib: None,
        threads: 2,
    },
    Wanted {
        row: "wander",
        name: "one wander robot, whole stack with protocol bytes",
        factor: Some(2000.0),
        rss_mib: None,
        threads: 1,
    },
    Wanted {
        row: "peer_task",
        name: "50 robots × 180 beams, furnished hall of 50 × 50 m, as IR-SIM in the next row",
        factor: Some(50.0),
        rss_mib: None,
        threads: 1,
    },
];

/// Measures all rows; `part` of the usual time. `long`: all of the 10,000 missions, not a sample.
pub fn run(part: f64, long: bool) -> Result<Report, Failure> {
    let before = Before::now();
    let witnesses = Witnesses::start()?;
    let (mut rows, mut values, mut targets, mut notes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for wanted in &TABLE {
        let measured = row::in_own_process(wanted.row, wanted.threads, ROW_S * part)?;
        targets.extend(wanted.judge(&measured));
        rows.push(to_row(wanted.name, &measured));
        if wanted.row == "peer_task" {
            match peer::ir_sim(ROW_S * part) {
                Ok(peer) => {
                    let name = "50 robots × 180 beams, the same hall, starts and steps in IR-SIM from PyPI";
                    values.push(Value::new(
                        "faster_than_ir_sim",
                        measured.realtime_factor_core / peer.realtime_factor_core,
                        "× per core (same run)",
                    ));
                    rows.push(to_row(name, &peer));
                }
                Err(reason) => notes.push(format!("IR-SIM was left out: {reason}")),
            }
        }
    }
    missions::measure(part, long)?.add_to(&mut rows, &mut values, &mut targets);
    let growth = growth::measure(part)?;
    for line in &growth {
        values.push(Value::new(format!("cost of a step against {}", line.against), line.exponent, line.unit()));
    }
    notes.push(growth::table(&growth));
    notes.push(
        "A realtime factor is simulated time over the clock's; per core it is over the time that all threads together \
         spent on cores, so that with two threads it is about half of the other. The rows' times \
         are those of a step of 100 ms of the whole swarm, or of a run of 60 s of the whole robot."
            .into(),
    );
    let seen = witnesses.stop();
    let machine = before.finish(vec!["SCHED_OTHER, a process per row".into()], &seen);
    Ok(Report { bench: "simulator", machine, rows, values, targets, notes })
}

impl Wanted {
    fn judge(&self, measured: &Measured) -> Option<Target> {
        let aim = self.factor?;
        let (factor, by) = match self.threads {
            1 => (measured.realtime_factor_core, "per core"),
            _ => (measured.realtime_factor, "by the clock"),
        };
        let memory = self.rss_mib.map(|most| format!(", at most {most} MiB")).unwrap_or_default();
        let cores = if self.threads == 1 { "a core".into() } else { format!("{} cores", self.threads) };
        Some(Target {
            aim: format!("{}: at least {aim} × real time on {cores}{memory}", self.name),
            measured: format!("{factor:.1} × {by}, {:.0} MiB", measured.rss_mib),
            reached: factor >= aim && self.rss_mib.is_none_or(|most| measured.rss_mib <= most),
        })
    }
}

fn to_row(name: &str, measured: &Measured) -> Row {
    let mut row = Row::new(name, 0, measured.step_us, measured.n);
    row.note("realtime_factor", measured.realtime_factor);
    row.note("realtime_factor_core", measured.realtime_factor_core);
    row.note("rss_mib", measured.rss_mib);
    row.note("threads", measured.threads);
    row
}
