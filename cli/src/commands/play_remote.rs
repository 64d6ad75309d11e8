//! What a viewer of a played recording wants: keys of a terminal, or lines of the standard input.
//!
//! | key | line | |
//! |---|---|---|
//! | space | `pause`, `go` | stands still, goes on |
//! | ← → | `skip -5s`, `skip 5s` | back, on |
//! | + - | `rate 2` | twice, half as fast |
//! | Home | `seek 20s` | to the beginning; to so far into it |
//! | q | `end` | ends |

use crate::output::parse_seconds;
use crossterm::event::{Event, KeyCode, KeyEventKind, KeyModifiers, poll, read};
use crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use recorder::Ask;
use std::io::{BufRead, IsTerminal, stderr, stdin};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// How far an arrow skips [s].
const SKIP_S: f64 = 5.0;

/// Where wishes come from.
pub enum Remote {
    /// A terminal in raw mode, until it is dropped.
    Keys,
    /// Lines, read by a thread.
    Lines(Receiver<String>),
    /// Nowhere.
    None,
}

impl Remote {
    /// Keys where there is a terminal, lines where they are asked for.
    pub fn new(lines: bool) -> Remote {
        if lines {
            let (send, receive) = channel();
            // It ends with the process: nobody can wake it out of a read.
            std::thread::spawn(move || {
                for line in stdin().lock().lines().map_while(Result::ok) {
                    if send.send(line).is_err() {
                        break;
                    }
                }
            });
            return Remote::Lines(receive);
        }
        match stdin().is_terminal() && stderr().is_terminal() && enable_raw_mode().is_ok() {
            true => Remote::Keys,
            false => Remote::None,
        }
    }

    /// Whether keys are obeyed.
    pub fn has_keys(&self) -> bool {
        matches!(self, Remote::Keys)
    }

    /// The next wish, if there is one; a wish to end sets `stop`.
    pub fn ask(&mut self, stop: &AtomicBool) -> Option<Ask> {
        match self {
            Remote::None => None,
            Remote::Keys => {
                while poll(Duration::ZERO).ok()? {
                    let Event::Key(key) = read().ok()? else { continue };
                    let control = key.modifiers.contains(KeyModifiers::CONTROL);
                    match key.code {
                        _ if key.kind == KeyEventKind::Release => {}
                        KeyCode::Char('c') if control => stop.store(true, Ordering::Relaxed),
                        KeyCode::Char('q') | KeyCode::Esc => stop.store(true, Ordering::Relaxed),
                        KeyCode::Char(' ') => return Some(Ask::TogglePause),
                        KeyCode::Left => return Some(Ask::Skip(-SKIP_S)),
                        KeyCode::Right => return Some(Ask::Skip(SKIP_S)),
                        KeyCode::Char('+' | '=') => return Some(Ask::Faster(2.0)),
                        KeyCode::Char('-') => return Some(Ask::Faster(0.5)),
                        KeyCode::Home => return Some(Ask::Seek(0.0)),
                        _ => {}
                    }
                }
                None
            }
            Remote::Lines(lines) => {
                while let Ok(line) = lines.try_recv() {
                    match parse(&line) {
                        Ok(Some(ask)) => return Some(ask),
                        Ok(None) => stop.store(true, Ordering::Relaxed),
                        Err(reason) => eprintln!("{}: {reason}", line.trim()),
                    }
                }
                None
            }
        }
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        if self.has_keys() {
            let _ = disable_raw_mode();
        }
    }
}

/// What a line asks for; nothing where it asks for the end.
fn parse(line: &str) -> Result<Option<Ask>, String> {
    const KNOWN: &str = "write pause, go, rate 2, seek 20s, skip 5s, skip -5s or end";
    let mut words = line.split_whitespace();
    let ask = match (words.next(), words.next(), words.next()) {
        (Some("pause"), None, _) => Ask::Pause(true),
        (Some("go"), None, _) => Ask::Pause(false),
        (Some("end"), None, _) => return Ok(None),
        (Some("seek"), Some(time), None) => Ask::Seek(parse_seconds(time)?),
        (Some("skip"), Some(time), None) => Ask::Skip(match time.strip_prefix('-') {
            Some(back) => -parse_seconds(back)?,
            None => parse_seconds(time)?,
        }),
        (Some("rate"), Some(rate), None) => {
            let rate = rate.parse::<f64>().ok().filter(|rate| *rate > 0.0 && rate.is_finite());
            Ask::Rate(rate.ok_or("a rate is a number above 0")?)
        }
        _ => return Err(KNOWN.to_owned()),
    };
    Ok(Some(ask))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_a_wish_or_says_what_would_be_one() {
        for (line, ask) in [
            ("pause", Ask::Pause(true)),
            (" go ", Ask::Pause(false)),
            ("rate 0.5", Ask::Rate(0.5)),
            ("seek 1.5s", Ask::Seek(1.5)),
            ("skip -2s", Ask::Skip(-2.0)),
        ] {
            assert_eq!(parse(line), Ok(Some(ask)), "{line}");
        }
        assert_eq!(parse("end"), Ok(None));
        for line in ["", "stop now", "rate 0", "rate fast", "seek", "seek soon", "go on"] {
            assert!(parse(line).is_err(), "{line}");
        }
    }
}
