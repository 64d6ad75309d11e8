//! Typed written ports.

use crate::channel::{Claim, Death, Geometry, RawWriter, Tree};
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
    pub(crate) doom: Rc<Doom>,
}

/// The moment at which a simulated node dies, shared by all its outputs.
#[derive(Debug)]
pub(crate) struct Doom {
    /// Samples that it still publishes; none is due where it is greatest.
    left: Cell<u32>,
    when: Cell<Death>,
    dead: Cell<bool>,
}

impl Default for Doom {
    fn default() -> Doom {
        Doom { left: Cell::new(u32::MAX), when: Cell::new(Death::BeforeHead), dead: Cell::new(false) }
    }
}

impl Doom {
    /// The node dies while it publishes its `writes`-th sample from now on, counted from 0.
    pub(crate) fn arm(&self, writes: u32, when: Death) {
        self.left.set(writes);
        self.when.set(when);
    }

    /// Whether the sample that is to be published now is the fatal one.
    fn strikes(&self) -> bool {
        match self.left.get() {
            u32::MAX => false,
            0 => true,
            left => {
                self.left.set(left - 1);
                false
            }
        }
    }
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
        let doom = &self.output.doom;
        if doom.dead.get() {
            return;
        }
        if doom.strikes() {
            doom.dead.set(true);
            if let Some(writer) = self.output.writer.borrow_mut().take() {
                let (fixed, tail) = (bytemuck::bytes_of(message), bytemuck::cast_slice(tail));
                writer.die_publishing(doom.when.get(), stamp.nanos(), fixed, tail);
            }
            return;
        }
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
