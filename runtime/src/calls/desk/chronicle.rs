//! What a node has not done of what it was asked, told to its log: who asked, for what, and why it was not done.
//!
//! A caller that asks over and over fills no disk: [`LINES`] lines a second, then a count. What a caller writes into its name
//! or its command stays on its line.

use crate::Time;
use crate::calls::stage::Sender;
use crate::calls::wire::Kind;
use crate::pump::Log;

/// Lines that one second may have.
pub(super) const LINES: usize = 10;
const SECOND_S: f64 = 1.0;

/// See the module's text.
pub(super) struct Chronicle {
    log: Log,
    waiting: Vec<String>,
    left_out: u64,
    /// When the present second began, and the lines that it has had.
    begun: Time,
    said: usize,
}

impl Chronicle {
    /// Tells `log`.
    pub fn new(log: Log) -> Chronicle {
        Chronicle { log, waiting: Vec::new(), left_out: 0, begun: Time::ZERO, said: 0 }
    }

    /// The last word to `from` about `command` was a no: [`Kind::Refused`] or [`Kind::Failed`].
    pub fn note(&mut self, from: &Sender, command: &str, kind: Kind, reason: &str) {
        if self.waiting.len() >= LINES {
            self.left_out += 1;
            return;
        }
        let verb = if kind == Kind::Failed { "failed" } else { "refused" };
        let what = if command.is_empty() { "a call".to_owned() } else { format!("\"{command}\"") };
        let line = format!("{verb} {what} of {}: {reason}", name(from));
        self.waiting.push(line.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }).collect());
    }

    /// Says what may be said at `now`.
    pub fn tell(&mut self, now: Time) {
        if self.waiting.is_empty() && self.left_out == 0 {
            return;
        }
        if now.since(self.begun) >= SECOND_S {
            (self.begun, self.said) = (now, 0);
            let left_out = std::mem::take(&mut self.left_out);
            if left_out > 0 {
                (self.log)(&format!("{left_out} more calls were not done: somebody asks over and over"));
            }
        }
        for line in self.waiting.drain(..) {
            if self.said < LINES {
                self.said += 1;
                (self.log)(&line);
            } else {
                self.left_out += 1;
            }
        }
    }

    /// When there will be something to say.
    pub fn next(&self) -> Option<Time> {
        (self.left_out > 0).then(|| self.begun.after_s(SECOND_S))
    }
}

/// A caller as a person knows it.
fn name(from: &Sender) -> String {
    let name = if from.name.as_str().is_empty() { "a caller without a name" } else { from.name.as_str() };
    match from.pid {
        0 => name.to_owned(),
        pid => format!("{name} (process {pid}, user {})", from.uid),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calls::wire::Name;
    use std::sync::{Arc, Mutex};

    fn chronicle() -> (Chronicle, Arc<Mutex<Vec<String>>>) {
        let lines: Arc<Mutex<Vec<String>>> = Arc::default();
        let told = Arc::clone(&lines);
        (Chronicle::new(Arc::new(move |line| told.lock().unwrap().push(line.to_owned()))), lines)
    }

    #[test]
    fn a_refusal_says_who_asked_for_what_and_why_it_was_not_done() {
        let (mut chronicle, lines) = chronicle();
        let from = Sender { name: Name::new("sinew"), pid: 42, uid: 1000 };
        chronicle.note(&from, "goto", Kind::Refused, "something stands at the goal");
        chronicle.note(&Sender { pid: 0, ..from }, "goto", Kind::Failed, "it never came near");
        chronicle.note(&Sender { name: Name::default(), pid: 0, ..from }, "", Kind::Refused, "nobody\ncan read that");
        chronicle.tell(Time::from_seconds(5.0));
        let wanted = [
            "refused \"goto\" of sinew (process 42, user 1000): something stands at the goal",
            "failed \"goto\" of sinew: it never came near",
            "refused a call of a caller without a name: nobody\u{FFFD}can read that",
        ];
        assert_eq!(*lines.lock().unwrap(), wanted);
    }

    #[test]
    fn who_asks_over_and_over_gets_a_count_and_fills_no_disk() {
        let (mut chronicle, lines) = chronicle();
        let nobody = Sender { name: Name::default(), pid: 0, uid: 0 };
        for k in 0..1000 {
            chronicle.note(&nobody, "goto", Kind::Refused, "no");
            chronicle.tell(Time::from_seconds(7.0 + 0.0009 * f64::from(k)));
        }
        assert_eq!(lines.lock().unwrap().len(), LINES);
        let next = chronicle.next().unwrap();
        assert_eq!(next, Time::from_seconds(8.0));
        chronicle.tell(next);
        assert!(lines.lock().unwrap()[LINES].starts_with("990 more calls"), "{lines:?}");
        assert_eq!(chronicle.next(), None);
    }
}
