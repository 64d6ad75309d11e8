//! Requests that have a place: from the step's news to the caller's last word.

use std::sync::Arc;

use super::{CallerNumber, Desk};
use crate::Time;
use crate::calls::stage::{Cancellation, CommandKind, End, News, Sender, Stage};
use crate::calls::wire::Kind;
use crate::calls::{Refusal, RefusalCode};

/// A request that has a place.
pub(super) struct Booking {
    pub caller: CallerNumber,
    pub from: Sender,
    pub id: u64,
    pub stage: usize,
    pub place: usize,
    pub deadline: Option<Time>,
    pub accepted: bool,
    /// The caller has had its last word, or has gone; only the step still has to let go of the place.
    pub settled: bool,
}

impl Desk {
    /// The caller has gone: what it wanted is withdrawn, or cancelled where the step has it.
    pub fn caller_gone(&mut self, caller: CallerNumber) {
        let stages = &self.stages;
        let mut told = false;
        self.bookings.retain_mut(|booking| {
            if booking.caller != caller {
                return true;
            }
            if stages[booking.stage].withdraw(booking.place) {
                return false;
            }
            if !booking.settled {
                booking.settled = true;
                stages[booking.stage].cancel(booking.place, Cancellation::CallerGone);
                told = true;
            }
            true
        });
        self.news_for_step |= told;
    }

    /// Passes on what the step has said, and gives up what is not answered in time.
    pub fn advance(&mut self, now: Time) {
        self.collect();
        self.expire(now);
        self.chronicle.tell(now);
    }

    /// The next instant at which a request will not have been answered in time, or the log has more to be told.
    pub fn next_deadline(&self) -> Option<Time> {
        let waiting = self.bookings.iter().filter(|booking| !booking.accepted && !booking.settled);
        waiting.filter_map(|booking| booking.deadline).chain(self.chronicle.next()).min()
    }

    pub(super) fn cancel(&mut self, caller: CallerNumber, id: u64) {
        let found = self.bookings.iter().position(|booking| booking.caller == caller && booking.id == id);
        // A call that has just ended: its last word is under way.
        let Some(index) = found else { return };
        let booking = &self.bookings[index];
        let stage = &self.stages[booking.stage];
        if stage.withdraw(booking.place) {
            self.bookings.swap_remove(index);
            self.reply(caller, Kind::Cancelled, id, 0, Vec::new());
        } else {
            stage.cancel(booking.place, Cancellation::Asked);
            self.news_for_step = true;
        }
    }

    fn collect(&mut self) {
        let mut index = 0;
        while index < self.bookings.len() {
            let booking = &mut self.bookings[index];
            let stage = Arc::clone(&self.stages[booking.stage]);
            let (caller, from, id, settled) = (booking.caller, booking.from, booking.id, booking.settled);
            let was_accepted = booking.accepted;
            let (mut replies, mut accepted, mut over) = (Vec::new(), was_accepted, false);
            stage.collect(booking.place, was_accepted, |news| match news {
                News::Accepted => {
                    accepted = true;
                    replies.push((Kind::Accepted, 0, Vec::new()));
                }
                News::Progress(body) => {
                    replies.push((Kind::Progress, stage.progress.map_or(0, |shape| shape.hash), body.to_vec()));
                }
                News::Ended(end, body) => {
                    over = true;
                    replies.push(last_word(&stage, end, body));
                }
            });
            booking.accepted = accepted;
            if over {
                self.bookings.swap_remove(index);
            } else {
                index += 1;
            }
            if !settled {
                for (kind, hash, body) in replies {
                    if matches!(kind, Kind::Refused | Kind::Failed) {
                        self.chronicle.note(&from, stage.command, kind, &Refusal::from_bytes(&body).reason);
                    }
                    self.reply(caller, kind, id, hash, body);
                }
            }
        }
    }

    fn expire(&mut self, now: Time) {
        let mut index = 0;
        while index < self.bookings.len() {
            let booking = &mut self.bookings[index];
            let stage = &self.stages[booking.stage];
            let late = booking.deadline.is_some_and(|deadline| deadline <= now);
            // What the step has accepted or ended since the last look is in time; the next look passes it on.
            if !late || booking.settled || booking.accepted || stage.has_news(booking.place) {
                index += 1;
                continue;
            }
            let (caller, from, id) = (booking.caller, booking.from, booking.id);
            let (doing, command) = (self.step.describe(now), stage.command);
            let reason = if stage.withdraw(booking.place) {
                self.bookings.swap_remove(index);
                format!("not answered in time: {doing}; the request was withdrawn")
            } else {
                // Nobody waits any more: a long order must not be worked on for nobody.
                stage.cancel(booking.place, Cancellation::Asked);
                booking.settled = true;
                self.news_for_step = true;
                index += 1;
                format!("not answered in time: the node has taken the request but not answered; {doing}")
            };
            let refusal = Refusal::new(RefusalCode::NotInTime, reason);
            self.chronicle.note(&from, command, Kind::Refused, &refusal.reason);
            self.reply(caller, Kind::Refused, id, 0, refusal.to_bytes());
        }
    }
}

/// The last message to the caller: kind, layout hash and body.
fn last_word(stage: &Stage, end: End, body: &[u8]) -> (Kind, u64, Vec<u8>) {
    match end {
        End::Answered => (Kind::Answer, stage.answer.hash, body.to_vec()),
        End::Refused(reason) => (Kind::Refused, 0, Refusal::new(RefusalCode::ByNode, reason).to_bytes()),
        End::Failed(reason) => (Kind::Failed, 0, Refusal::new(RefusalCode::ByNode, reason).to_bytes()),
        End::Cancelled => (Kind::Cancelled, 0, Vec::new()),
        End::Forgotten => {
            let what = if stage.kind == CommandKind::Call { "request" } else { "order" };
            let reason = format!("the node dropped the {what} without an answer: a defect of the node");
            (Kind::Failed, 0, Refusal::new(RefusalCode::Forgotten, reason).to_bytes())
        }
    }
}
