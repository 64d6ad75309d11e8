//! What commands print: tables and colours for people, one JSON object per line for programs, and a silent end when
//! whoever was reading has gone.

mod fields;
mod number;
mod paint;
mod select;
mod table;

pub use fields::{FieldLine, field_lines, message_lines};
pub use number::{bytes, count, metres_per_second, number, parse_seconds, rate, span};
pub use paint::{Paint, Tone};
pub use select::select;
pub use table::{Align, Cell, Table};

use crate::exit::{Failure, OK};
use std::io::{BufWriter, ErrorKind, IsTerminal, Stdout, Write};

/// Standard output. Lines gather until [`Out::flush`] or the end; a reader that has gone ends the program silently.
pub struct Out {
    writer: BufWriter<Stdout>,
    /// Colours, where a person looks.
    pub paint: Paint,
    terminal: bool,
}

impl Out {
    /// The program's standard output.
    pub fn stdout() -> Out {
        let stdout = std::io::stdout();
        let terminal = stdout.is_terminal();
        Out { writer: BufWriter::new(stdout), paint: Paint::wanted_on(terminal), terminal }
    }

    /// Whether a person looks.
    pub fn is_terminal(&self) -> bool {
        self.terminal
    }

    /// Columns and rows of the terminal; `None` when it is none.
    pub fn size(&self) -> Option<(usize, usize)> {
        let size = self.terminal.then(|| crossterm::terminal::size().ok()).flatten()?;
        (size.0 > 0 && size.1 > 0).then(|| (usize::from(size.0), usize::from(size.1)))
    }

    /// Writes one line.
    pub fn line(&mut self, text: impl AsRef<str>) -> Result<(), Failure> {
        self.raw(text.as_ref())?;
        self.raw("\n")
    }

    /// Writes text as it is.
    pub fn raw(&mut self, text: &str) -> Result<(), Failure> {
        self.writer.write_all(text.as_bytes()).map_err(|e| ended(&e))
    }

    /// Writes a table.
    pub fn table(&mut self, table: &Table) -> Result<(), Failure> {
        let width = self.size().map(|(columns, _)| columns);
        for line in table.lines(self.paint, width) {
            self.line(line)?;
        }
        Ok(())
    }

    /// Writes one JSON value on one line.
    pub fn json(&mut self, value: &serde_json::Value) -> Result<(), Failure> {
        self.line(value.to_string())
    }

    /// Hands everything written so far to the reader.
    pub fn flush(&mut self) -> Result<(), Failure> {
        self.writer.flush().map_err(|e| ended(&e))
    }
}

/// Standard output that cannot be written to: no error when its reader has simply seen enough, as `head` has.
fn ended(error: &std::io::Error) -> Failure {
    match error.kind() {
        ErrorKind::BrokenPipe => Failure::new(OK, ""),
        _ => Failure::from(format!("cannot write to standard output: {error}")),
    }
}
