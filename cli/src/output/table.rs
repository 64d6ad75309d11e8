//! Tables: columns as wide as their widest cell, two spaces apart, the last one cut where the terminal ends.

use super::paint::{Paint, Tone};

/// On which side a column's texts stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// Texts.
    Left,
    /// Numbers.
    Right,
}

/// One cell.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Cell {
    parts: Vec<(Tone, String)>,
}

impl Cell {
    /// A text in a tone.
    pub fn toned(tone: Tone, text: impl Into<String>) -> Cell {
        Cell { parts: vec![(tone, text.into())] }
    }

    /// The same cell with more text behind it.
    #[must_use]
    pub fn and(mut self, tone: Tone, text: impl Into<String>) -> Cell {
        self.parts.push((tone, text.into()));
        self
    }

    fn width(&self) -> usize {
        self.parts.iter().map(|(_, text)| text.chars().count()).sum()
    }

    /// The text, cut to `most` characters.
    fn paint(&self, paint: Paint, most: usize) -> String {
        let mut left = if self.width() > most { most.saturating_sub(1) } else { most };
        let mut out = String::new();
        for (tone, text) in &self.parts {
            let cut: String = text.chars().take(left).collect();
            left -= cut.chars().count();
            if !cut.is_empty() {
                out += &paint.tone(*tone, cut);
            }
        }
        if self.width() > most && most > 0 {
            out.push('…');
        }
        out
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Cell {
        Cell::toned(Tone::Plain, text)
    }
}

/// A table with a heading.
#[derive(Debug, Clone, Default)]
pub struct Table {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<Cell>>,
}

/// Space between columns.
const GAP: usize = 2;

impl Table {
    /// An empty table; an empty heading leaves the line of headings out when all are empty.
    pub fn new(columns: &[(&str, Align)]) -> Table {
        Table { columns: columns.iter().map(|(name, align)| ((*name).to_owned(), *align)).collect(), rows: Vec::new() }
    }

    /// Adds a row; missing cells are empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The lines; no wider than `width` when it is given.
    pub fn lines(&self, paint: Paint, width: Option<usize>) -> Vec<String> {
        let heading: Vec<Cell> = self.columns.iter().map(|(name, _)| Cell::toned(Tone::Dim, name.as_str())).collect();
        let with_heading = self.columns.iter().any(|(name, _)| !name.is_empty());
        let rows = || with_heading.then_some(&heading).into_iter().chain(&self.rows);
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|column| rows().filter_map(|row| row.get(column)).map(Cell::width).max().unwrap_or(0))
            .collect();
        rows().map(|row| self.line(row, &widths, paint, width)).collect()
    }

    fn line(&self, row: &[Cell], widths: &[usize], paint: Paint, width: Option<usize>) -> String {
        let mut line = String::new();
        let mut pending = 0;
        let mut at = 0;
        for (index, (cell, column)) in row.iter().zip(widths).enumerate() {
            let most = width.map_or(usize::MAX, |width| width.saturating_sub(at + pending));
            let shown = cell.width().min(most);
            let pad = column.saturating_sub(cell.width());
            let (before, after) = match self.columns[index].1 {
                Align::Left => (0, pad),
                Align::Right => (pad, 0),
            };
            if shown > 0 {
                line.extend(std::iter::repeat_n(' ', pending + before));
                line += &cell.paint(paint, most.saturating_sub(before));
                at += pending + before + shown;
                pending = 0;
            } else {
                pending += before;
            }
            pending += after + GAP;
        }
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new(&[("PATH", Align::Left), ("RATE", Align::Right), ("TYPE", Align::Left)]);
        table.row([Cell::toned(Tone::Dim, "/drivers/").and(Tone::Name, "base"), "10 Hz".into(), "Odometry".into()]);
        table.row(["/a".into(), "200 Hz".into(), "".into()]);
        table
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_and_no_line_ends_in_blanks() {
        assert_eq!(
            table().lines(Paint::OFF, None),
            ["PATH             RATE  TYPE", "/drivers/base   10 Hz  Odometry", "/a             200 Hz"]
        );
    }

    #[test]
    fn a_narrow_terminal_cuts_the_end_of_the_line() {
        assert_eq!(table().lines(Paint::OFF, Some(27))[1], "/drivers/base   10 Hz  Odo…");
    }

    #[test]
    fn colours_do_not_change_the_widths() {
        let plain = table().lines(Paint::OFF, None);
        let coloured = table().lines(Paint::ON, None);
        let stripped: Vec<String> = coloured.iter().map(|line| strip(line)).collect();
        assert_eq!(stripped, plain);
    }

    fn strip(line: &str) -> String {
        let mut out = String::new();
        let mut rest = line;
        while let Some(at) = rest.find('\x1b') {
            out += &rest[..at];
            rest = rest[at..].split_once('m').unwrap().1;
        }
        out + rest
    }
}
