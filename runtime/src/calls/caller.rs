//! Calls that a node makes: a step starts one, later steps look how it stands.

use std::marker::PhantomData;
use std::sync::Arc;

use messages::Message;
use messages::bytemuck::{bytes_of, bytes_of_mut};

use super::call_line::{CallEnd, CallHead, CallLine};
use super::refusal::{Reason, Refusal, RefusalCode};
use super::stage::Shape;
use super::target::Target;
use crate::Time;
use crate::journal::{EntryKind, Note, PolledState};

/// Number of a call, from 1, counted by its caller.
pub type CallId = u64;

/// How a call stands. The last state of a call is given once; afterwards the caller is `Idle`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CallState<A> {
    /// No call is under way.
    Idle,
    /// Under way: no word from the node yet.
    Pending,
    /// The node has accepted the long order and works on it; the timeout no longer counts.
    Running,
    /// Done.
    Answered(A),
    /// Not begun; the reason says why.
    Refused(Reason),
    /// The order was begun and could not be done.
    Failed(Reason),
    /// Cancelled.
    Cancelled,
    /// The node is not there.
    Lost(Loss),
    /// No answer within the timeout.
    TimedOut,
}

/// How a node can be missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Loss {
    /// It does not run.
    #[error("the node does not run")]
    NotRunning,
    /// It ended during the call: whether it did what was asked is not known.
    #[error("the node ended during the call")]
    Died,
}

/// One call at a time from this node to one command of another, wired by the robot file.
///
/// Nothing here waits or allocates: the pump does the talking. So two nodes may call each other.
#[derive(Debug)]
pub struct Caller<Q, A> {
    line: Arc<CallLine>,
    last: CallId,
    current: Option<Current>,
    next: Option<Next<Q>>,
    cancel: bool,
    /// Layout hash of the progress messages that are wanted; 0: none.
    progress_hash: u64,
    note: Option<Note>,
    messages: PhantomData<fn(Q) -> A>,
}

#[derive(Debug, Clone, Copy)]
struct Current {
    id: CallId,
    deadline: Time,
    running: bool,
}

/// A call that the pump has not been handed yet.
#[derive(Debug, Clone, Copy)]
struct Next<Q> {
    head: CallHead,
    message: Q,
}

impl<Q: Message, A: Message> Caller<Q, A> {
    /// A caller of `target`, mute until a pump or a simulated host serves it.
    pub fn detached(target: Target) -> Caller<Q, A> {
        let line = Arc::new(CallLine::new(target, Shape::of::<Q>(), Shape::of::<A>()));
        Caller {
            line,
            last: 0,
            current: None,
            next: None,
            cancel: false,
            progress_hash: 0,
            note: None,
            messages: PhantomData,
        }
    }

    /// The same caller, for an order whose progress messages `P` are wanted. For `open`: it allocates.
    #[must_use]
    pub fn with_progress<P: Message>(mut self) -> Caller<Q, A> {
        self.progress_hash = P::layout_hash();
        self
    }

    /// Has the calls and what becomes of them written down, or played back.
    pub(crate) fn noted(&mut self, note: Note) {
        self.note = Some(note);
    }

    pub(crate) fn line(&self) -> &Arc<CallLine> {
        &self.line
    }

    /// Calls; the node has `timeout_s` to answer (to accept, if it is a long order). A call that is still under way
    /// is cancelled.
    pub fn start(&mut self, now: Time, request: &Q, priority: u8, timeout_s: f64) -> CallId {
        self.last += 1;
        if let Some(note) = &self.note {
            let deadline = now.after_s(timeout_s).nanos().to_le_bytes();
            note.say(EntryKind::Called, &[&self.last.to_le_bytes(), &deadline, &[priority], bytes_of(request)]);
        }
        let head = CallHead { id: self.last, priority, deadline: now.after_s(timeout_s) };
        self.current = Some(Current { id: head.id, deadline: head.deadline, running: false });
        self.next = Some(Next { head, message: *request });
        self.cancel = false;
        self.hand_over();
        self.last
    }

    /// Asks the node to stop what was ordered; `poll` goes on until it has said how it ended.
    pub fn cancel(&mut self) {
        if self.current.is_some() {
            if let Some(note) = &self.note {
                note.say(EntryKind::CallCancelled, &[]);
            }
            self.cancel = true;
            self.hand_over();
        }
    }

    /// How the call stands at `now`.
    pub fn poll(&mut self, now: Time) -> CallState<A> {
        let was_running = self.current.is_some_and(|current| current.running);
        if let Some(note) = self.note.as_ref().filter(|note| note.plays()) {
            let played = note.played(EntryKind::Polled);
            return self.play(played.as_deref(), was_running);
        }
        let state = self.look(now);
        if let Some(note) = &self.note {
            write(note, &state, was_running);
        }
        state
    }

    /// Playback: the call's state as it was then; without an entry it is what it was before.
    fn play(&mut self, played: Option<&[u8]>, was_running: bool) -> CallState<A> {
        let Some(current) = &mut self.current else { return CallState::Idle };
        let Some(([state, code], rest)) = played.and_then(|payload| payload.split_first_chunk::<2>()) else {
            return if was_running { CallState::Running } else { CallState::Pending };
        };
        let reason = || Reason::new(&Refusal::new(RefusalCode::of(*code), String::from_utf8_lossy(rest)));
        let state = match *state {
            1 => {
                current.running = true;
                return CallState::Running;
            }
            2 => {
                let mut answer = A::zeroed();
                let bytes = bytes_of_mut(&mut answer);
                let length = bytes.len().min(rest.len());
                bytes[..length].copy_from_slice(&rest[..length]);
                CallState::Answered(answer)
            }
            3 => CallState::Refused(reason()),
            4 => CallState::Failed(reason()),
            5 => CallState::Cancelled,
            6 => CallState::Lost(Loss::NotRunning),
            7 => CallState::Lost(Loss::Died),
            _ => CallState::TimedOut,
        };
        self.current = None;
        state
    }

    fn look(&mut self, now: Time) -> CallState<A> {
        self.hand_over();
        let Some(current) = &mut self.current else { return CallState::Idle };
        let mut answer = A::zeroed();
        let mut end = None;
        if let Some(mut desk) = self.line.try_desk()
            && desk.news.id == current.id
        {
            current.running |= desk.news.accepted;
            end = desk.news.end.take();
            if end == Some(CallEnd::Answered) {
                let bytes = bytes_of_mut(&mut answer);
                let length = bytes.len().min(desk.news.answer.len());
                bytes[..length].copy_from_slice(&desk.news.answer[..length]);
            }
        }
        let state = match end {
            Some(CallEnd::Answered) => CallState::Answered(answer),
            Some(CallEnd::Refused(reason)) => CallState::Refused(reason),
            Some(CallEnd::Failed(reason)) => CallState::Failed(reason),
            Some(CallEnd::Cancelled) => CallState::Cancelled,
            Some(CallEnd::Lost(loss)) => CallState::Lost(loss),
            Some(CallEnd::TimedOut) => CallState::TimedOut,
            None if current.running => return CallState::Running,
            None if now < current.deadline => return CallState::Pending,
            None => {
                // The node may still accept in this moment: it must not work for nobody.
                self.cancel = true;
                self.hand_over();
                CallState::TimedOut
            }
        };
        self.current = None;
        state
    }

    /// The newest progress message of the running order, if one has come since the last time. Needs
    /// [`with_progress`](Caller::with_progress) for the same `P`.
    pub fn progress<P: Message>(&mut self) -> Option<P> {
        let Some(note) = self.note.clone() else { return self.reported() };
        if note.plays() {
            let payload = note.played(EntryKind::Progress)?;
            let mut progress = P::zeroed();
            let bytes = bytes_of_mut(&mut progress);
            if bytes.len() != payload.len() {
                return None;
            }
            bytes.copy_from_slice(&payload);
            return Some(progress);
        }
        let progress = self.reported::<P>();
        match &progress {
            Some(progress) => note.say(EntryKind::Progress, &[bytes_of(progress)]),
            None => note.nothing(EntryKind::Progress),
        }
        progress
    }

    fn reported<P: Message>(&mut self) -> Option<P> {
        let current = self.current?;
        let mut desk = self.line.try_desk()?;
        let news = &mut desk.news;
        if news.id != current.id
            || !news.reported
            || news.progress_hash != self.progress_hash
            || news.progress.len() != size_of::<P>()
        {
            return None;
        }
        news.reported = false;
        let mut progress = P::zeroed();
        bytes_of_mut(&mut progress).copy_from_slice(&news.progress);
        Some(progress)
    }

    /// Gives the pump what it has not been given yet, unless it is busy with the line: then the next poll does.
    fn hand_over(&mut self) {
        if self.note.as_ref().is_some_and(Note::plays) || (self.next.is_none() && !self.cancel) {
            return;
        }
        let Some(mut desk) = self.line.try_desk() else { return };
        if let Some(next) = self.next.take() {
            desk.request = Some(next.head);
            desk.body.copy_from_slice(bytes_of(&next.message));
            desk.news.begin(next.head.id);
        }
        if std::mem::take(&mut self.cancel) {
            desk.cancel = Some(self.last);
        }
        drop(desk);
        self.line.wake_pump();
    }
}

/// Writes down what a poll said, where it is news.
fn write<A: Message>(note: &Note, state: &CallState<A>, was_running: bool) {
    let say = |state: PolledState, code: u8, rest: &[u8]| note.say(EntryKind::Polled, &[&[state as u8, code], rest]);
    match state {
        CallState::Idle => {}
        CallState::Pending => note.nothing(EntryKind::Polled),
        CallState::Running if was_running => note.nothing(EntryKind::Polled),
        CallState::Running => say(PolledState::Running, 0, &[]),
        CallState::Answered(answer) => say(PolledState::Answered, 0, bytes_of(answer)),
        CallState::Refused(why) => say(PolledState::Refused, why.code as u8, why.as_str().as_bytes()),
        CallState::Failed(why) => say(PolledState::Failed, why.code as u8, why.as_str().as_bytes()),
        CallState::Cancelled => say(PolledState::Cancelled, 0, &[]),
        CallState::Lost(Loss::NotRunning) => say(PolledState::NotRunning, 0, &[]),
        CallState::Lost(Loss::Died) => say(PolledState::Died, 0, &[]),
        CallState::TimedOut => say(PolledState::TimedOut, 0, &[]),
    }
}
