//! What the step and the pump share of one caller.
//!
//! The step only ever tries the lock, and comes back; the pump holds it for a copy.

use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use super::caller::{CallId, Loss};
use super::refusal::Reason;
use super::stage::Shape;
use super::target::Target;
use crate::Time;
use crate::pump::Waker;

/// What the step and the pump share of one caller.
#[derive(Debug)]
pub(crate) struct CallLine {
    pub target: Target,
    pub request: Shape,
    pub answer: Shape,
    desk: Mutex<CallDesk>,
    waker: OnceLock<Waker>,
}

/// What a call is beside its message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CallHead {
    pub id: CallId,
    pub priority: u8,
    pub deadline: Time,
}

/// How a call ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CallEnd {
    Answered,
    Refused(Reason),
    Failed(Reason),
    Cancelled,
    Lost(Loss),
    TimedOut,
}

#[derive(Debug)]
pub(super) struct CallDesk {
    pub request: Option<CallHead>,
    pub body: Box<[u8]>,
    pub cancel: Option<CallId>,
    pub news: CallNews,
}

#[derive(Debug)]
pub(super) struct CallNews {
    pub id: CallId,
    pub accepted: bool,
    pub reported: bool,
    pub progress_hash: u64,
    pub progress: Vec<u8>,
    pub end: Option<CallEnd>,
    pub answer: Box<[u8]>,
}

impl CallNews {
    pub fn begin(&mut self, id: CallId) {
        self.id = id;
        self.accepted = false;
        self.reported = false;
        self.end = None;
    }
}

impl CallLine {
    pub fn new(target: Target, request: Shape, answer: Shape) -> CallLine {
        let news = CallNews {
            id: 0,
            accepted: false,
            reported: false,
            progress_hash: 0,
            progress: Vec::new(),
            end: None,
            answer: vec![0; answer.bytes].into(),
        };
        let desk = CallDesk { request: None, body: vec![0; request.bytes].into(), cancel: None, news };
        CallLine { target, request, answer, desk: Mutex::new(desk), waker: OnceLock::new() }
    }

    /// How the step wakes the pump. False when a pump has it already.
    pub fn attach(&self, waker: Waker) -> bool {
        self.waker.set(waker).is_ok()
    }

    pub fn wake_pump(&self) {
        if let Some(waker) = self.waker.get() {
            waker.wake();
        }
    }

    /// Step: the desk, unless the pump is at it.
    pub(super) fn try_desk(&self) -> Option<MutexGuard<'_, CallDesk>> {
        self.desk.try_lock().ok()
    }

    fn desk(&self) -> MutexGuard<'_, CallDesk> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Pump: the call that the step wants, with its body, once.
    pub fn fetch(&self) -> Option<(CallHead, Vec<u8>)> {
        let mut desk = self.desk();
        let head = desk.request.take()?;
        Some((head, desk.body.to_vec()))
    }

    /// Pump: the call that the step no longer wants, once.
    pub fn fetch_cancel(&self) -> Option<CallId> {
        self.desk().cancel.take()
    }

    /// Pump: the order has been accepted.
    pub fn accepted(&self, id: CallId) {
        let mut desk = self.desk();
        if desk.news.id == id {
            desk.news.accepted = true;
        }
    }

    /// Pump: the newest progress.
    pub fn progress(&self, id: CallId, hash: u64, body: &[u8]) {
        let news = &mut self.desk().news;
        if news.id == id {
            news.progress.clear();
            news.progress.extend_from_slice(body);
            news.progress_hash = hash;
            news.reported = true;
        }
    }

    /// Pump: the call is over; `body` is the answer message when it was answered.
    pub fn ended(&self, id: CallId, end: CallEnd, body: &[u8]) {
        let news = &mut self.desk().news;
        if news.id == id && news.end.is_none() {
            let length = body.len().min(news.answer.len());
            news.answer[..length].copy_from_slice(&body[..length]);
            news.end = Some(end);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calls::Caller;
    use messages::Odometry;

    #[test]
    fn news_of_an_older_call_do_not_touch_the_newer_one() {
        let target: Target = "/drivers/base enable".parse().unwrap();
        let mut caller: Caller<Odometry, Odometry> = Caller::detached(target);
        let line = std::sync::Arc::clone(caller.line());
        let old = caller.start(Time::ZERO, &Odometry::default(), 0, 1.0);
        assert_eq!(line.fetch().unwrap().0.id, old);
        // The step calls anew while the pump has the old call's last word in its hands.
        let new = caller.start(Time::ZERO, &Odometry::default(), 0, 1.0);
        line.accepted(old);
        line.ended(old, CallEnd::Cancelled, &[]);
        assert_eq!(caller.poll(Time::ZERO), crate::calls::CallState::Pending);
        line.ended(new, CallEnd::Lost(Loss::Died), &[]);
        // A call has one last word.
        line.ended(new, CallEnd::Cancelled, &[]);
        assert_eq!(caller.poll(Time::ZERO), crate::calls::CallState::Lost(Loss::Died));
    }
}
