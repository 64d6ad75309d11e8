//! The step's side of a command that is answered within a step.

use std::marker::PhantomData;
use std::sync::Arc;

use messages::Message;
use messages::bytemuck::bytes_of;

use super::open::Open;
use super::stage::{Cancellation, CommandKind, End, Sender, Shape, Stage};
use crate::Time;
use crate::journal::Note;

/// Requests `Q` for one command, each to be answered with an `A` or refused.
///
/// A step takes all that is there: `while let Some(request) = port.take() { … }`. Nothing here waits or allocates.
#[derive(Debug)]
pub struct CallPort<Q, A> {
    stage: Arc<Stage>,
    note: Option<Note>,
    messages: PhantomData<fn(Q) -> A>,
}

impl<Q: Message, A: Message> CallPort<Q, A> {
    /// A port for `command`, deaf until a pump or a simulated host serves it.
    pub fn detached(command: &'static str) -> CallPort<Q, A> {
        let stage = Stage::new(command, CommandKind::Call, Shape::of::<Q>(), None, Shape::of::<A>());
        CallPort { stage, note: None, messages: PhantomData }
    }

    /// Has the requests that the step takes written down, or played back.
    pub(crate) fn noted(&mut self, note: Note) {
        self.note = Some(note);
    }

    pub(crate) fn stage(&self) -> &Arc<Stage> {
        &self.stage
    }

    /// The waiting request of the highest priority, the earliest of these.
    pub fn take(&mut self) -> Option<Request<Q>> {
        let (message, particulars, open) = Open::take(&self.stage, self.note.as_ref())?;
        Some(Request {
            message,
            sender: particulars.sender,
            priority: particulars.priority,
            deadline: particulars.deadline,
            open: Some(open),
        })
    }

    /// Answers `request`. An answer after the deadline reaches nobody.
    pub fn answer(&mut self, mut request: Request<Q>, answer: &A) {
        request.end(End::Answered, bytes_of(answer));
    }

    /// Refuses `request`: say what to do about it.
    pub fn refuse(&mut self, mut request: Request<Q>, reason: &'static str) {
        request.end(End::Refused(reason), &[]);
    }
}

/// A request that this step has taken. Dropping it unanswered tells the caller so.
#[derive(Debug)]
pub struct Request<Q> {
    /// What is asked.
    pub message: Q,
    /// Who asks.
    pub sender: Sender,
    /// 255 first.
    pub priority: u8,
    /// When the caller stops waiting.
    pub deadline: Time,
    open: Option<Open>,
}

impl<Q> Request<Q> {
    /// Whether the caller has cancelled or gone.
    pub fn is_cancelled(&self) -> bool {
        self.cancellation().is_some()
    }

    /// Why the caller no longer wants an answer, if so.
    pub fn cancellation(&self) -> Option<Cancellation> {
        self.open.as_ref().and_then(Open::cancellation)
    }

    fn end(&mut self, end: End, body: &[u8]) {
        if let Some(open) = self.open.take() {
            open.end(end, body);
        }
    }
}

impl<Q> Drop for Request<Q> {
    fn drop(&mut self) {
        self.end(End::Forgotten, &[]);
    }
}
