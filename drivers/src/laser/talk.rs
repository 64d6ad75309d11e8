//! What every laser session has in common: one question at a time and how long its answer may take, what was heard so far,
//! and when a stream counts as silent or as none.

use crate::contact::Contact;
use messages::{LaserState, Link};
use runtime::Time;

/// Time before a laser that cannot be used, or said that it cannot measure, is asked again [s].
const PAUSE_S: f64 = 5.0;

/// Questions of type `R`, and what is known of the laser; see the module's text.
#[derive(Debug, Clone)]
pub struct Talk<R> {
    /// The port, the line's rate, the link.
    pub contact: Contact,
    /// The laser's last word that was not "all well"; 0 for none.
    pub status: u32,
    /// It has said that it cannot measure.
    pub is_faulty: bool,
    /// An answer came since the beginning.
    pub heard: bool,
    /// What waits to be sent, and what was sent and is not answered.
    waiting: Option<R>,
    asked: Option<R>,
    asked_at: Time,
    deadline: Time,
    last_scan: Time,
    /// Scans that are none since the last one that is.
    misfits: u32,
    connections: u32,
    scans: u32,
    damaged: u32,
}

impl<R: Copy> Talk<R> {
    /// With a closed port whose line has this rate, if any, and rates to try where nothing answers.
    pub fn new(line_baud: Option<u32>, hunt_bauds: Vec<u32>) -> Talk<R> {
        Talk {
            contact: Contact::new(line_baud, hunt_bauds),
            status: 0,
            is_faulty: false,
            heard: false,
            waiting: None,
            asked: None,
            asked_at: Time::ZERO,
            deadline: Time::ZERO,
            last_scan: Time::ZERO,
            misfits: 0,
            connections: 0,
            scans: 0,
            damaged: 0,
        }
    }

    /// From the top.
    pub fn begin(&mut self) {
        (self.heard, self.misfits, self.is_faulty) = (false, 0, false);
    }

    /// The port is not open.
    pub fn end(&mut self) {
        (self.waiting, self.asked, self.is_faulty) = (None, None, false);
    }

    /// Asks; the answer may take so long.
    pub fn ask(&mut self, now: Time, request: R, patience_s: f64) {
        (self.waiting, self.asked) = (Some(request), None);
        self.deadline = now.after_s(patience_s);
    }

    /// What goes out now; from now on its answer may take so long.
    pub fn next_request(&mut self, now: Time, patience_s: f64) -> Option<R> {
        let request = self.waiting.take()?;
        (self.asked, self.asked_at) = (Some(request), now);
        self.deadline = now.after_s(patience_s);
        Some(request)
    }

    /// What was sent and is not answered, and when it was sent.
    pub fn asked(&self) -> Option<(R, Time)> {
        self.asked.map(|request| (request, self.asked_at))
    }

    /// Asks the same again.
    pub fn ask_again(&mut self) {
        self.waiting = self.asked.take();
    }

    /// The answer may take so long from now on, if that is longer.
    pub fn wait_on(&mut self, now: Time, patience_s: f64) {
        self.deadline = self.deadline.max(now.after_s(patience_s));
    }

    /// The answer has not come in time, or a pause is over.
    pub fn is_over(&self, now: Time) -> bool {
        now >= self.deadline
    }

    /// Asks nothing for a while.
    pub fn pause(&mut self, now: Time, link: Link) {
        (self.contact.link, self.waiting, self.asked) = (link, None, None);
        self.deadline = now.after_s(PAUSE_S);
    }

    /// The laser agrees to stream.
    pub fn streams(&mut self, now: Time) {
        (self.last_scan, self.status, self.is_faulty) = (now, 0, false);
    }

    /// It says that it is busy with itself: no silence.
    pub fn is_busy(&mut self, now: Time) {
        (self.is_faulty, self.last_scan) = (true, now);
    }

    /// A whole scan.
    pub fn scanned(&mut self, now: Time) {
        (self.last_scan, self.misfits) = (now, 0);
        // Up with its first sound scan, so that one whose scans are none never looks well.
        self.connections = self.connections.saturating_add(u32::from(self.contact.up()));
        self.scans = self.scans.saturating_add(1);
    }

    /// Something that is damaged, or says what it cannot say.
    pub fn misfit(&mut self) {
        self.damaged = self.damaged.saturating_add(1);
        self.misfits = self.misfits.saturating_add(1);
    }

    /// Whether a stream has given no scan for `silence_s`; the link then says which way.
    pub fn fell_silent(&mut self, now: Time, silence_s: f64) -> bool {
        let silent = now.since(self.last_scan) > silence_s;
        if silent {
            self.contact.link = if self.misfits > 0 { Link::Foreign } else { Link::Silent };
        }
        silent
    }

    /// An answer did not come; `junk`: something else did, which is foreign where nothing was ever understood.
    pub fn miss(&mut self, junk: bool) {
        self.contact.miss(junk && !self.heard);
    }

    /// The rate to switch the line to, where it has another one.
    pub fn other_rate(&self, wanted_baud: Option<u32>) -> Option<u32> {
        wanted_baud.filter(|wanted| self.contact.baud().is_some_and(|baud| baud != *wanted))
    }

    /// All that is told of it; what the framer has lost is added.
    pub fn state(&self, is_running: bool, framer: Lost, clock_jumps: u32) -> LaserState {
        let capped = |count: u64| u32::try_from(count).unwrap_or(u32::MAX);
        LaserState {
            link: self.contact.link as u32,
            laser_on: u32::from(is_running && !self.is_faulty),
            status: self.status,
            connections: self.connections,
            scans: self.scans,
            damaged: self.damaged.saturating_add(capped(framer.messages)),
            skipped_bytes: capped(framer.bytes),
            clock_jumps,
        }
    }
}

/// What a framer has found no sense in.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lost {
    /// Messages whose sum was wrong.
    pub messages: u64,
    /// Bytes between messages.
    pub bytes: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_of_damaged_scans_is_foreign_and_one_of_none_is_silent() {
        let mut talk: Talk<u8> = Talk::new(None, Vec::new());
        let at = Time::from_seconds;
        talk.streams(at(1.0));
        talk.scanned(at(1.1));
        assert!(!talk.fell_silent(at(1.9), 1.0));
        assert_eq!(talk.contact.link, Link::Up);
        assert!(talk.fell_silent(at(2.2), 1.0));
        assert_eq!(talk.contact.link, Link::Silent);
        talk.misfit();
        assert!(talk.fell_silent(at(2.3), 1.0));
        assert_eq!(talk.contact.link, Link::Foreign);
        let state = talk.state(true, Lost { messages: 2, bytes: 9 }, 3);
        assert_eq!((state.connections, state.scans, state.damaged, state.skipped_bytes), (1, 1, 3, 9));
    }

    #[test]
    fn a_question_waits_for_its_answer_from_when_it_is_sent() {
        let mut talk: Talk<u8> = Talk::new(None, Vec::new());
        let at = Time::from_seconds;
        talk.ask(at(1.0), 7, 1.0);
        assert_eq!((talk.asked(), talk.next_request(at(1.5), 1.0)), (None, Some(7)));
        assert_eq!((talk.asked(), talk.next_request(at(1.6), 1.0)), (Some((7, at(1.5))), None));
        assert!(!talk.is_over(at(2.4)) && talk.is_over(at(2.5)));
        talk.wait_on(at(2.4), 3.0);
        assert!(!talk.is_over(at(5.3)) && talk.is_over(at(5.4)));
        talk.ask_again();
        assert_eq!((talk.asked(), talk.next_request(at(6.0), 1.0)), (None, Some(7)));
    }
}
