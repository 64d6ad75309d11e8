//! The step's side of a command that takes longer than a step: accepted, running, then done, failed or cancelled.

use std::marker::PhantomData;
use std::sync::Arc;

use messages::Message;
use messages::bytemuck::bytes_of;

use super::open::Open;
use super::stage::{Cancellation, CommandKind, End, Sender, Shape, Stage};
use crate::Time;
use crate::journal::Note;

/// Long orders `Q` for one command, with progress `P` and result `A`.
#[derive(Debug)]
pub struct OrderPort<Q, P, A> {
    stage: Arc<Stage>,
    note: Option<Note>,
    messages: PhantomData<fn(Q) -> (P, A)>,
}

impl<Q: Message, P: Message, A: Message> OrderPort<Q, P, A> {
    /// A port for `command`, deaf until a pump or a simulated host serves it.
    pub fn detached(command: &'static str) -> OrderPort<Q, P, A> {
        let stage = Stage::new(command, CommandKind::Order, Shape::of::<Q>(), Some(Shape::of::<P>()), Shape::of::<A>());
        OrderPort { stage, note: None, messages: PhantomData }
    }

    /// Has the orders that the step takes written down, or played back.
    pub(crate) fn noted(&mut self, note: Note) {
        self.note = Some(note);
    }

    pub(crate) fn stage(&self) -> &Arc<Stage> {
        &self.stage
    }

    /// The waiting order of the highest priority, the earliest of these. The node keeps it until it is over.
    pub fn take(&mut self) -> Option<Order<Q, P, A>> {
        let (message, particulars, open) = Open::take(&self.stage, self.note.as_ref())?;
        Some(Order {
            message,
            sender: particulars.sender,
            priority: particulars.priority,
            deadline: particulars.deadline,
            open: Some(open),
            messages: PhantomData,
        })
    }
}

/// An order that the node has taken. Dropping it without an end tells the caller so.
#[derive(Debug)]
pub struct Order<Q, P, A> {
    /// What is ordered.
    pub message: Q,
    /// Who orders.
    pub sender: Sender,
    /// 255 first.
    pub priority: u8,
    /// Until when the caller wants to know whether the order is accepted; afterwards it waits as long as it takes.
    pub deadline: Time,
    open: Option<Open>,
    messages: PhantomData<fn() -> (P, A)>,
}

impl<Q, P: Message, A: Message> Order<Q, P, A> {
    /// Tells the caller that the order is under way.
    pub fn accept(&mut self) {
        if let Some(open) = &self.open {
            open.accept();
        }
    }

    /// Tells the caller how far it is. The newest report counts: one that the caller has not been sent is replaced.
    pub fn progress(&mut self, progress: &P) {
        if let Some(open) = &self.open {
            open.report(bytes_of(progress));
        }
    }

    /// Ends the order with its result.
    pub fn done(mut self, result: &A) {
        self.end(End::Answered, bytes_of(result));
    }

    /// Ends an order that was not begun.
    pub fn refuse(mut self, reason: &'static str) {
        self.end(End::Refused(reason), &[]);
    }

    /// Ends an order that was begun and cannot be done.
    pub fn failed(mut self, reason: &'static str) {
        self.end(End::Failed(reason), &[]);
    }

    /// Ends an order that the caller has cancelled.
    pub fn cancelled(mut self) {
        self.end(End::Cancelled, &[]);
    }
}

impl<Q, P, A> Order<Q, P, A> {
    /// Whether the caller has cancelled or gone. The node then stops what it does and calls [`Order::cancelled`].
    pub fn is_cancelled(&self) -> bool {
        self.cancellation().is_some()
    }

    /// Why the caller no longer wants it, if so.
    pub fn cancellation(&self) -> Option<Cancellation> {
        self.open.as_ref().and_then(Open::cancellation)
    }

    fn end(&mut self, end: End, body: &[u8]) {
        if let Some(open) = self.open.take() {
            open.end(end, body);
        }
    }
}

impl<Q, P, A> Drop for Order<Q, P, A> {
    fn drop(&mut self) {
        self.end(End::Forgotten, &[]);
    }
}
