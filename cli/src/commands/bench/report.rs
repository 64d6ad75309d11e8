//! What every bench prints: the conditions, rows of times, single values.

use super::machine::Machine;
use crate::exit::Failure;
use crate::output::{Align, Cell, Out, Table};
use serde::Serialize;
use serde_json::{Map, Value as Json};

/// One distribution of times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What was timed.
    pub name: String,
    /// Size of its payload [byte].
    pub size_bytes: usize,
    /// Median [µs].
    pub p50_us: f64,
    /// 99 % [µs].
    pub p99_us: f64,
    /// Greatest [µs]; an observation of one run, never a bound.
    pub max_us: f64,
    /// Number of times taken.
    pub n: u64,
    /// More about them.
    #[serde(flatten)]
    pub extra: Map<String, Json>,
}

impl Row {
    /// A row of median, 99 % and greatest.
    pub fn new(name: &str, size_bytes: usize, three_us: [f64; 3], n: u64) -> Row {
        let [p50_us, p99_us, max_us] = three_us;
        Row { name: name.into(), size_bytes, p50_us, p99_us, max_us, n, extra: Map::new() }
    }

    /// Adds a key.
    pub fn note(&mut self, key: &str, value: impl Into<Json>) {
        self.extra.insert(key.into(), value.into());
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.extra.get(key)?.as_f64()
    }
}

/// One figure that is no distribution of times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Value {
    /// What it is.
    pub name: String,
    /// The figure.
    pub value: f64,
    /// Its unit.
    pub unit: String,
}

impl Value {
    /// A figure and its unit.
    pub fn new(name: impl Into<String>, value: f64, unit: &str) -> Value {
        Value { name: name.into(), value, unit: unit.into() }
    }
}

/// Whether a figure is what was aimed at.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    /// The aim in words.
    pub aim: String,
    /// What was measured.
    pub measured: String,
    /// Whether it was reached.
    pub reached: bool,
}

/// The result of one bench.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Which.
    pub bench: &'static str,
    /// Under which conditions.
    pub machine: Machine,
    /// Distributions of times.
    pub rows: Vec<Row>,
    /// Single figures.
    pub values: Vec<Value>,
    /// Aims.
    pub targets: Vec<Target>,
    /// What a reader must know.
    pub notes: Vec<String>,
}

impl Report {
    /// Prints it: one JSON object, or conditions and tables.
    pub fn print(&self, out: &mut Out, json: bool) -> Result<(), Failure> {
        if json {
            out.json(&serde_json::to_value(self)?)?;
            return out.flush();
        }
        let heading = format!("bench {}", self.bench);
        out.line(out.paint.strong(&heading))?;
        for line in self.machine.lines() {
            out.line(out.paint.dim(line))?;
        }
        if !self.rows.is_empty() {
            out.line("")?;
            out.table(&self.row_table())?;
        }
        if !self.values.is_empty() {
            out.line("")?;
            out.table(&self.value_table())?;
        }
        if !self.targets.is_empty() {
            out.line("")?;
            out.table(&self.target_table())?;
        }
        for note in &self.notes {
            out.line("")?;
            out.line(note)?;
        }
        out.flush()
    }

    /// The rows as a table.
    pub fn row_table(&self) -> Table {
        let right = |name| (name, Align::Right);
        let mut table = Table::new(&[
            ("ROW", Align::Left),
            right("SIZE"),
            right("P50 µs"),
            right("P99 µs"),
            right("P99.9 µs"),
            right("MAX µs"),
            right("N"),
            right("HELD UP"),
            right("CALM P99.9 µs"),
        ]);
        for row in &self.rows {
            table.row(row_cells(row).map(Cell::from));
        }
        table
    }

    fn value_table(&self) -> Table {
        let mut table = Table::new(&[("FIGURE", Align::Left), ("VALUE", Align::Right), ("UNIT", Align::Left)]);
        for value in &self.values {
            table.row([value.name.as_str().into(), figure(value.value).into(), value.unit.as_str().into()]);
        }
        table
    }

    fn target_table(&self) -> Table {
        let mut table = Table::new(&[("TARGET", Align::Left), ("MEASURED", Align::Left), ("REACHED", Align::Left)]);
        for target in &self.targets {
            table.row([target.aim.as_str(), &target.measured, yes_or_no(target.reached)].map(Cell::from));
        }
        table
    }
}

/// The cells of a row, as tables and documents show them.
pub fn row_cells(row: &Row) -> [String; 9] {
    let of = |key: &str| row.number(key).map(figure).unwrap_or_default();
    [
        row.name.clone(),
        size(row.size_bytes),
        figure(row.p50_us),
        figure(row.p99_us),
        of("p999_us"),
        figure(row.max_us),
        row.n.to_string(),
        of("held_up"),
        of("calm_p999_us"),
    ]
}

/// Yes or no.
pub fn yes_or_no(reached: bool) -> &'static str {
    if reached { "yes" } else { "NO" }
}

/// A size as people say it.
pub fn size(bytes: usize) -> String {
    match bytes {
        0 => String::new(),
        _ if bytes < 1024 => format!("{bytes} B"),
        _ if bytes < 1024 * 1024 => format!("{} KiB", (bytes as f64 / 1024.0).round()),
        _ => format!("{} MiB", bytes / 1024 / 1024),
    }
}

/// A number with three significant digits or so; whole numbers as they are.
pub fn figure(value: f64) -> String {
    match value.abs() {
        size if value == value.trunc() && size < 1e15 => format!("{value:.0}"),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        size if size >= 0.1 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_has_the_keys_that_are_promised_and_extra_ones_beside_them() {
        let mut row = Row::new("sinew", 64, [3.5, 5.25, 80.0], 1000);
        row.note("held_up", 2);
        let json = serde_json::to_value(&row).unwrap();
        let wanted = serde_json::json!({"name": "sinew", "size_bytes": 64, "p50_us": 3.5, "p99_us": 5.25, "max_us": 80.0, "n": 1000, "held_up": 2});
        assert_eq!(json, wanted);
    }

    #[test]
    fn figures_have_three_digits() {
        assert_eq!(
            [figure(1234.5), figure(12.345), figure(1.2345), figure(0.01234), figure(20000.0)],
            ["1234", "12.3", "1.23", "0.012", "20000"]
        );
        assert_eq!([size(64), size(3072), size(235_520), size(1 << 20)], ["64 B", "3 KiB", "230 KiB", "1 MiB"]);
    }
}
