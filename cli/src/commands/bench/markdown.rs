//! The reports as a document: `docs/benchmarks.md` is written by this file and by nothing else.

use super::report::{Report, figure, row_cells, yes_or_no};
use std::fmt::Write;

const TITLE: &str = "# Benchmarks";
/// Begin of a section, up to the bench's name.
const SECTION: &str = "## sinew bench ";

/// What stands before the sections. Two commands, because node processes are measured as users have them: without
/// iceoryx2 inside.
const HEAD: &str = "\
Written by

```sh
cargo run --release -p sinew -- bench --markdown docs/benchmarks.md &&
cargo run --release -p sinew --features iceoryx2 -- bench channel --markdown docs/benchmarks.md
```

which measures for about three minutes and replaces the sections below; nothing in here was typed.

Times are in µs and unfiltered: p50, p99 and p99.9 of HDR histograms with three significant digits (two in what nodes
count of themselves), and the greatest that this one run happened to see, which bounds nothing. On a shared or virtual
machine whole cores are taken away now and then. A stall witness on each core (a thread of the highest priority that
sleeps 1 ms at a time) notes every gap over 3 ms: *held up* is the number of samples that overlap such a gap, and *calm
p99.9* leaves these out; everything else does not. A row of which more than 2 % was held up is marked **invalid**.
";

/// The document with the sections of `reports` in place of those that `old` had of the same benches.
pub fn document(old: &str, reports: &[Report]) -> String {
    let mut sections: Vec<(String, String)> = sections(old);
    for report in reports {
        let text = section(report);
        match sections.iter_mut().find(|(name, _)| name == report.bench) {
            Some((_, place)) => *place = text,
            None => sections.push((report.bench.to_owned(), text)),
        }
    }
    let mut text = format!("{TITLE}\n\n{HEAD}");
    for (_, section) in sections {
        text += "\n";
        text += section.trim();
        text += "\n";
    }
    text
}

/// The sections of a document, by the bench's name.
fn sections(text: &str) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    for line in text.lines() {
        if let Some(name) = line.strip_prefix(SECTION) {
            all.push((name.trim().to_owned(), String::new()));
        }
        if let Some((_, section)) = all.last_mut() {
            section.push_str(line);
            section.push('\n');
        }
    }
    all
}

fn section(report: &Report) -> String {
    let mut text = format!("{SECTION}{}\n\n", report.bench);
    for line in report.machine.lines() {
        let (what, rest) = line.split_once(' ').unwrap_or((&line, ""));
        let _ = writeln!(text, "- {what}: {}", rest.trim());
    }
    if !report.targets.is_empty() {
        let rows = report.targets.iter().map(|target| {
            let reached = yes_or_no(target.reached);
            vec![target.aim.clone(), target.measured.clone(), reached.to_owned()]
        });
        table(&mut text, &["target", "measured", "reached"], rows);
    }
    if !report.rows.is_empty() {
        let rows = report.rows.iter().map(|row| {
            let mut cells = row_cells(row).to_vec();
            if row.extra.get("valid").is_some_and(|valid| valid == false) {
                cells[0] += " **invalid**";
            }
            cells
        });
        let heading = ["row", "size", "p50", "p99", "p99.9", "max", "n", "held up", "calm p99.9"];
        table(&mut text, &heading, rows);
    }
    if !report.values.is_empty() {
        let rows = report.values.iter().map(|value| vec![value.name.clone(), figure(value.value), value.unit.clone()]);
        table(&mut text, &["figure", "value", "unit"], rows);
    }
    for note in &report.notes {
        let _ = write!(text, "\n{note}\n");
    }
    text
}

/// A table: first column to the left, the others to the right where they hold numbers.
fn table(text: &mut String, heading: &[&str], rows: impl Iterator<Item = Vec<String>>) {
    let _ = write!(text, "\n| {} |\n|---|", heading.join(" | "));
    let sides = heading
        .iter()
        .skip(1)
        .map(|name| if matches!(*name, "measured" | "reached" | "unit") { "---|" } else { "---:|" });
    text.extend(sides);
    text.push('\n');
    for cells in rows {
        let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
        let _ = writeln!(text, "| {} |", cells.join(" | "));
    }
}

#[cfg(test)]
mod tests {
    use super::super::machine::Before;
    use super::super::report::{Row, Target, Value};
    use super::super::witness::Testimony;
    use super::*;

    #[test]
    fn every_figure_of_a_report_is_in_the_document_with_its_conditions() {
        let mut row = Row::new("sinew_free", 64, [3.25, 9.0, 80.0], 20_000);
        row.note("valid", false);
        let report = Report {
            bench: "channel",
            machine: Before::now().finish(vec!["free: SCHED_OTHER".into()], &Testimony::default()),
            rows: vec![row],
            values: vec![Value::new("lost", 3.0, "SIPs")],
            targets: vec![Target { aim: "fast".into(), measured: "3.25 µs".into(), reached: true }],
            notes: vec!["A note.".into()],
        };
        let text = document("", std::slice::from_ref(&report));
        for wanted in [
            "## sinew bench channel",
            "- kernel: ",
            "- load: ",
            "- scheduling: free: SCHED_OTHER",
            "| sinew_free **invalid** | 64 B | 3.25 | 9 |  | 80 | 20000 |",
            "| lost | 3 | SIPs |",
            "| fast | 3.25 µs | yes |",
            "A note.",
        ] {
            assert!(text.contains(wanted), "{wanted} is not in\n{text}");
        }
        // A second run replaces its own section alone.
        let idle = Report { bench: "idle", ..report.clone() };
        let both = document(&text, &[idle]);
        let again = document(&both, &[Report { notes: vec!["Another note.".into()], ..report }]);
        assert!(again.starts_with(TITLE) && again.find("bench channel\n") < again.find("bench idle\n"), "{again}");
        assert_eq!((again.matches("A note.").count(), again.matches("Another note.").count()), (1, 1));
    }
}
