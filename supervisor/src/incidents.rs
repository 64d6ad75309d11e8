//! The record of what went wrong: kept in memory, and as JSON lines in `<log folder>/incidents.jsonl`.
//!
//! The file is written by a thread of its own, because a slow disk must never delay a restart.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::Path;
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use serde::{Deserialize, Serialize};

use crate::event::{IncidentKind, Next, Request};
use crate::exit::Exit;
use crate::logs::put_aside;
use crate::wall::span;

/// An incident file larger than this at the start of a run is put aside.
const LARGEST_BYTES: u64 = 1 << 20;
/// Lines that may wait for the disk; further ones are counted and left out.
const WAITING_LINES: usize = 256;

/// One incident as people and programs read it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// UTC, `2026-11-22T21:48:34.120Z`.
    pub time: String,
    /// The same instant on the robot's clock, s.
    pub at_s: f64,
    /// Name of the robot.
    pub robot: String,
    /// Name of the node; empty if it concerns the robot.
    pub node: String,
    /// `died`, `restarted`, `recovered`, `not_ready`, `killed`, `unkillable`, `leftovers`, `hung`, `silent`, `cause` …: the
    /// words of [`describe`].
    pub event: String,
    /// All of it in one line.
    pub message: String,
    /// Process that it concerns.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub pid: Option<i32>,
    /// Exit code, if the process left by itself.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub code: Option<i32>,
    /// Number of the signal that ended the process.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub signal: Option<i32>,
    /// How long the process had lived (`died`), or the node had been down (`restarted`, `recovered`), s.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub span_s: Option<f64>,
    /// Where the core dump of the process is, in words.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub core: Option<String>,
    /// What the process wrote last.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub last_lines: Vec<String>,
}

/// Word and sentence for an incident of `node`.
pub fn describe(kind: &IncidentKind) -> (&'static str, String) {
    match *kind {
        IncidentKind::Died { exit, lived_s, next } => {
            let next = match next {
                Next::Restart { delay_s: 0.0 } => "restarted at once".to_owned(),
                Next::Restart { delay_s } => format!("restart in {}", span(delay_s)),
                Next::GiveUp { restarts, window_s } => {
                    format!("given up: {restarts} restarts within {}; the robot goes on without it", span(window_s))
                }
                Next::Promote => "its standby takes over".to_owned(),
                Next::RestartGroup { group, delay_s } => {
                    format!("group {group} is started anew with it in {}", span(delay_s))
                }
                Next::End => "not to be restarted".to_owned(),
                Next::Stop => "the robot is stopping".to_owned(),
            };
            ("died", format!("{exit} after {}; {next}", span(lived_s)))
        }
        IncidentKind::Restarted { attempt: 1, down_s } => {
            ("restarted", format!("restarted, {:.1} ms down", down_s * 1e3))
        }
        IncidentKind::Restarted { attempt, down_s } => {
            ("restarted", format!("restarted, {} down, attempt {attempt}", span(down_s)))
        }
        IncidentKind::Recovered { down_s } => ("recovered", format!("ready again, {:.1} ms down", down_s * 1e3)),
        IncidentKind::NotReady { waited_s } => {
            ("not_ready", format!("not ready after {}; the others start without waiting for it", span(waited_s)))
        }
        IncidentKind::Killed { grace_s } => ("killed", format!("did not stop within {} and was killed", span(grace_s))),
        IncidentKind::Unkillable => {
            ("unkillable", "still there after SIGKILL: it hangs in the kernel, look at its device".to_owned())
        }
        IncidentKind::Sluggish { beats, starved: true } => {
            ("sluggish", format!("{beats} beats missed for want of a processor"))
        }
        IncidentKind::Sluggish { beats, starved: false } => ("sluggish", format!("{beats} beats missed")),
        IncidentKind::Hung { beats } => ("hung", format!("hung: {beats} beats missed; killed")),
        IncidentKind::HungAtStart { waited_s } => {
            ("hung", format!("hung at its start: not ready after {}; killed", span(waited_s)))
        }
        IncidentKind::Silent { age_s } => ("silent", format!("silent: newest sample {} old", span(age_s))),
        IncidentKind::Raised { misses, above } => {
            ("raised", format!("{misses} deadlines missed; priority raised, now {above} above the robot file's"))
        }
        IncidentKind::Overload { misses, idle } => (
            "overload",
            format!("{misses} deadlines missed and {:.0} % of the processors idle: no priority helps", idle * 100.0),
        ),
        IncidentKind::Eased { above: 0 } => ("eased", "keeps its deadlines; priority as in the robot file".to_owned()),
        IncidentKind::Eased { above } => {
            ("eased", format!("keeps its deadlines; priority still {above} above the robot file's"))
        }
        IncidentKind::CauseBegan { cause, severity } => {
            ("cause", format!("{}; the robot's rung is {} or higher", cause.words(), severity.word()))
        }
        IncidentKind::CauseEnded { cause, severity, lasted_s } => {
            ("cause_ended", format!("no longer {} ({}), after {}", cause.words(), severity.word(), span(lasted_s)))
        }
        IncidentKind::WithGroup { group, began: false } => ("group", format!("stopped with group {group}")),
        IncidentKind::WithGroup { group, began: true } => ("group", format!("started with group {group}")),
        IncidentKind::Asked { request } => ("asked", format!("{} asked for", words(request))),
        IncidentKind::Refused { request } => {
            ("refused", format!("{} refused: it does not fit its state", words(request)))
        }
        IncidentKind::TookOver { down_s } => {
            ("took_over", format!("its standby took over, {:.1} ms down", down_s * 1e3))
        }
        IncidentKind::Replaced => ("replaced", "its replacement took over and is on trial".to_owned()),
        IncidentKind::Reverted => ("reverted", "the replacement failed; the program before it goes on".to_owned()),
        IncidentKind::Reaction { reaction, act, failed: false } => {
            ("reaction", format!("reaction {reaction} did its act {act}"))
        }
        IncidentKind::Reaction { reaction, act, failed: true } => {
            ("reaction", format!("act {act} of reaction {reaction} failed; its fallback follows"))
        }
        IncidentKind::Care { attached: true } => ("attached", "came under the supervisor's care".to_owned()),
        IncidentKind::Care { attached: false } => ("detached", "left the supervisor's care".to_owned()),
    }
}

fn words(request: Request) -> &'static str {
    match request {
        Request::Start { .. } => "start",
        Request::Stop { .. } => "stop",
        Request::Restart { .. } => "restart",
        Request::Replace { .. } => "replacement",
        Request::Reset => "reset",
    }
}

impl Record {
    /// Fills in what the kind of incident says.
    pub(crate) fn with_kind(mut self, kind: &IncidentKind) -> Record {
        let (event, message) = describe(kind);
        self.event = event.to_owned();
        self.message = message;
        match *kind {
            IncidentKind::Died { exit, lived_s, .. } => {
                self.span_s = Some(lived_s);
                match exit {
                    Exit::Code(code) => self.code = Some(code),
                    Exit::Signal { signal, .. } => self.signal = Some(signal),
                    Exit::NotStarted(_) | Exit::Unknown => {}
                }
            }
            IncidentKind::Restarted { down_s, .. } | IncidentKind::Recovered { down_s } => self.span_s = Some(down_s),
            IncidentKind::TookOver { down_s } => self.span_s = Some(down_s),
            IncidentKind::CauseEnded { lasted_s, .. } => self.span_s = Some(lasted_s),
            _ => {}
        }
        self
    }
}

/// The incident file.
#[derive(Debug)]
pub struct Journal {
    lines: Option<SyncSender<String>>,
    writer: Option<JoinHandle<()>>,
    /// Lines that the disk was too slow for.
    pub left_out: u64,
}

impl Journal {
    /// Continues `incidents.jsonl` in `folder`.
    pub fn open(folder: &Path) -> io::Result<Journal> {
        let path = folder.join("incidents.jsonl");
        if fs::metadata(&path).is_ok_and(|file| file.len() > LARGEST_BYTES) {
            put_aside(&path)?;
        }
        let mut file = OpenOptions::new().append(true).create(true).open(&path)?;
        let (lines, waiting) = sync_channel::<String>(WAITING_LINES);
        let write = move || {
            for line in waiting {
                // A full disk loses records, never nodes; what the robot does is told on the terminal too.
                let _ = file.write_all(line.as_bytes());
            }
        };
        let writer = std::thread::Builder::new().name("incidents".to_owned()).stack_size(64 << 10).spawn(write)?;
        Ok(Journal { lines: Some(lines), writer: Some(writer), left_out: 0 })
    }

    /// A journal that keeps nothing.
    pub fn none() -> Journal {
        Journal { lines: None, writer: None, left_out: 0 }
    }

    /// Hands the record to the writing thread.
    pub fn write(&mut self, record: &Record) {
        let Some(lines) = &self.lines else { return };
        let mut line = serde_json::to_string(record).unwrap_or_default();
        line.push('\n');
        if let Err(TrySendError::Full(_)) = lines.try_send(line) {
            self.left_out += 1;
        }
    }
}

impl Drop for Journal {
    fn drop(&mut self) {
        self.lines = None;
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_death_says_how_when_and_what_follows() {
        let exit = Exit::Signal { signal: 9, core: false };
        let died = |next| describe(&IncidentKind::Died { exit, lived_s: 3.04, next }).1;
        assert_eq!(died(Next::Restart { delay_s: 0.0 }), "killed by SIGKILL after 3.0 s; restarted at once");
        assert_eq!(died(Next::Restart { delay_s: 0.4 }), "killed by SIGKILL after 3.0 s; restart in 0.4 s");
        assert!(died(Next::GiveUp { restarts: 10, window_s: 60.0 }).contains("given up: 10 restarts within 60 s"));
    }

    #[test]
    fn the_journal_is_a_line_of_json_per_incident() {
        let folder = tempfile::tempdir().unwrap();
        let last_lines = vec!["a \"quoted\"\tword".to_owned()];
        let record = Record { at_s: 1.5, node: "base".to_owned(), pid: Some(7), last_lines, ..Record::default() };
        let kind = IncidentKind::Died { exit: Exit::Code(2), lived_s: 0.5, next: Next::End };
        let record = record.with_kind(&kind);
        for _ in 0..2 {
            Journal::open(folder.path()).unwrap().write(&record);
        }
        let text = fs::read_to_string(folder.path().join("incidents.jsonl")).unwrap();
        let read: Vec<Record> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(read, [record.clone(), record]);
        assert_eq!((read[0].code, read[0].span_s), (Some(2), Some(0.5)));
    }
}
