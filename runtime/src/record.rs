//! Publishes what each step of a node depended on, where the robot file asks for it (`record_inputs`).
//!
//! `/<layer>/<instance>/inputs` carries a [`StepInputs`] per step; `…/events` a [`StepEvents`] per step in which the node
//! heard or told something other than samples. The events of a step come first: who sees its inputs sees all.

use crate::journal::{CALL_BYTES, DEVICE_BYTES, Journal};
use crate::ports::{Ports, Writer};
use crate::time::Time;
use messages::{InputCursor, StepEvents, StepInputs, StepKind, WRITTEN};

/// Where the runtime publishes what each step read.
pub(crate) const INPUTS: &str = "inputs";
/// Where the runtime publishes what each step heard and told otherwise.
pub(crate) const EVENTS: &str = "events";
/// Sources and written ports that a step record can hold.
pub(crate) const INPUTS_CAPACITY: usize = 64;
/// Step records in the ring: they must outlast a recorder that is kept waiting.
const INPUTS_DEPTH: usize = 512;
/// Events in the ring.
const EVENTS_DEPTH: usize = 128;

/// The recording of one node's steps.
pub(crate) struct Record {
    inputs: Writer<StepInputs>,
    events: Option<Writer<StepEvents>>,
    journal: Journal,
    cursors: Vec<InputCursor>,
    overfull: bool,
}

impl Record {
    /// Adds the paths of the recording to those of an opened node.
    pub fn declare(ports: &mut Ports, journal: Journal) -> Record {
        let inputs = ports.own_writer::<StepInputs>(INPUTS, INPUTS_CAPACITY, INPUTS_DEPTH);
        let bytes = ports.event_sources().map(|has_device| if has_device { DEVICE_BYTES } else { CALL_BYTES });
        let events = bytes.map(|bytes| {
            journal.reserve(bytes);
            ports.own_writer::<StepEvents>(EVENTS, bytes, EVENTS_DEPTH)
        });
        Record { inputs, events, journal, cursors: Vec::with_capacity(INPUTS_CAPACITY), overfull: false }
    }

    /// Notes where everything stands; call it when the inputs are frozen.
    pub fn begin(&mut self, ports: &Ports) {
        self.journal.begin(&[]);
        self.cursors.clear();
        self.overfull = false;
        let Record { cursors, overfull, .. } = self;
        let mut add = |cursor| match cursors.len() < cursors.capacity() {
            true => cursors.push(cursor),
            false => *overfull = true,
        };
        for (port, input) in ports.inputs().iter().enumerate() {
            input.cursors(port as u32, &mut add);
        }
        for (port, output) in ports.outputs().iter().enumerate() {
            let Some((generation, sequence)) = output.position() else { continue };
            add(InputCursor { port: WRITTEN + port as u32, source: output.number, generation, sequence, read_to: 0 });
        }
    }

    /// Publishes what the step depended on.
    pub fn end(&mut self, ports: &Ports, kind: StepKind, step: u64, now: Time, fault: bool) {
        let mut lost = self.overfull;
        for input in ports.inputs() {
            lost |= input.take_lost();
        }
        let Record { events, journal, cursors, inputs, .. } = self;
        let event_bytes = journal.read(|entries, entry_lost| {
            lost |= entry_lost;
            if let (Some(events), false) = (events, entries.is_empty()) {
                events.write_with_tail(now, &StepEvents { step, now_ns: now.nanos() }, entries);
            }
            entries.len() as u32
        });
        let step = StepInputs {
            step,
            now_ns: now.nanos(),
            kind: kind as u32,
            lost: u32::from(lost),
            fault: u32::from(fault),
            event_bytes,
            latch: u64::from(ports.latch.seen().0),
        };
        inputs.write_with_tail(now, &step, cursors);
    }
}
