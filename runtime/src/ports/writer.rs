//! Typed written ports.

use crate::channel::{Claim, Geometry, RawWriter, Tree};
use crate::node::OpenError;
use crate::time::Time;
use messages::{Message, bytemuck};
use std::cell::{Cell, RefCell};
use std::marker::PhantomData;
use std::rc::Rc;

/// A written port without its type.
pub(crate) struct Output {
    pub(crate) path: String,
    /// Number of the path in step records.
    pub(crate) number: u32,
    /// The runtime's own, beside the node's.
    pub(crate) by_runtime: bool,
    pub(crate) geometry: Geometry,
    pub(crate) writer: RefCell<Option<RawWriter>>,
    /// Samples whose tail was longer than the channel's capacity.
    pub(crate) cut: Cell<u64>,
    /// The path has been taken over or damaged: nobody reads what is written here any more.
    pub(crate) lost: Cell<bool>,
}

impl Output {
    pub(crate) fn bind(&self, tree: &Tree, claim: Claim) -> Result<(), OpenError> {
        let writer = tree
            .writer(&self.path, &self.geometry, claim)
            .map_err(|e| OpenError::Port { port: self.path.clone(), reason: e.to_string() })?;
        *self.writer.borrow_mut() = Some(writer);
        Ok(())
    }
}

impl Output {
    /// Generation and newest number of the node's own written port.
    pub(crate) fn position(&self) -> Option<(u64, u64)> {
        let writer = self.writer.borrow();
        let writer = writer.as_ref().filter(|_| !self.by_runtime)?;
        Some((writer.generation(), writer.next_sequence() - 1))
    }
}

/// Publishes samples on the node's own path.
pub struct Writer<M: Message> {
    output: Rc<Output>,
    message: PhantomData<M>,
}

impl<M: Message> Writer<M> {
    pub(super) fn new(output: Rc<Output>) -> Writer<M> {
        Writer { output, message: PhantomData }
    }

    /// Publishes `message`, taken at `stamp`.
    pub fn write(&mut self, stamp: Time, message: &M) {
        self.write_with_tail(stamp, message, &[]);
    }

    /// Publishes `message` with its variable part. A longer tail than the port's capacity is cut, and counted.
    pub fn write_with_tail(&mut self, stamp: Time, message: &M, tail: &[M::Tail]) {
        if let Some(writer) = self.output.writer.borrow_mut().as_mut() {
            let published = writer.publish(stamp.nanos(), bytemuck::bytes_of(message), bytemuck::cast_slice(tail));
            if published.lost {
                self.output.lost.set(true);
            }
            if published.cut {
                self.output.cut.set(self.output.cut.get() + 1);
            }
        }
    }
}
