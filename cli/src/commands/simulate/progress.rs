//! A bar with the time left, on a terminal; elsewhere a line now and then, where there are many missions.

use runtime::clock;
use std::io::{IsTerminal, Write};

/// Width of the bar.
const BAR: usize = 30;
/// From so many missions on there are lines, and so many of them.
const MANY: usize = 1000;
const LINES: usize = 20;

/// See the module's text.
pub struct Progress {
    all: usize,
    done: usize,
    begin: runtime::Time,
    shown: bool,
    lines: bool,
}

impl Progress {
    /// For so many missions.
    pub fn new(all: usize) -> Progress {
        let terminal = std::io::stderr().is_terminal();
        Progress { all, done: 0, begin: clock::now(), shown: terminal && all > 1, lines: !terminal && all >= MANY }
    }

    /// One more is done.
    pub fn step(&mut self) {
        self.done += 1;
        let left_s = || clock::now().since(self.begin) / self.done as f64 * (self.all - self.done) as f64;
        if self.lines && self.done.is_multiple_of(self.all / LINES) {
            eprintln!("{} of {} missions, {} left", self.done, self.all, left(left_s()));
        }
        if self.shown {
            let full = BAR * self.done / self.all.max(1);
            let (bar, rest) = ("#".repeat(full), " ".repeat(BAR - full));
            eprint!("\r[{bar}{rest}] {}/{}, {} left   ", self.done, self.all, left(left_s()));
            let _ = std::io::stderr().flush();
        }
    }

    /// Wipes the bar.
    pub fn end(&self) {
        if self.shown {
            eprint!("\r{:70}\r", "");
        }
    }

    /// Missions done, and how long they took [s].
    pub fn so_far(&self) -> (usize, f64) {
        (self.done, clock::now().since(self.begin))
    }
}

/// A time left in one or two words.
fn left(seconds: f64) -> String {
    match seconds.ceil() as u64 {
        s if s < 100 => format!("{s} s"),
        s if s < 6000 => format!("{} min", s.div_ceil(60)),
        s => format!("{:.1} h", s as f64 / 3600.0),
    }
}
