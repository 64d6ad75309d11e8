//! The open line of a live device: bytes in and out, and what the step is told about it.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use rustix::event::PollFlags;
use rustix::io::Errno;

use crate::Time;
use crate::device::wire::Line;
use crate::device::{DeviceLink, WhyClosed, Wire};
use crate::pump::Log;

/// Reads of one look at a line, so that a fast one does not starve the others.
const READS_PER_LOOK: usize = 8;

/// The open line of a live device.
pub(super) struct Stream {
    pub wire: Arc<Wire>,
    pub line: Option<Line>,
    notify: Box<dyn Fn() + Send>,
    log: Log,
    generation: u64,
    /// Whether this line has brought a byte yet.
    pub alive: bool,
}

impl Stream {
    pub fn new(wire: Arc<Wire>, notify: Box<dyn Fn() + Send>, log: Log) -> Stream {
        Stream { wire, line: None, notify, log, generation: 0, alive: false }
    }

    /// Bytes may flow over `descriptor` from now on.
    pub fn open(&mut self, descriptor: OwnedFd, socket: bool) {
        let line = Line { descriptor: Arc::new(descriptor), socket };
        self.wire.set_line(Some(line.clone()));
        self.line = Some(line);
        self.generation += 1;
        self.alive = false;
        self.tell(DeviceLink::Open { generation: self.generation });
    }

    /// Closes the line, if one is open, and says why none is.
    pub fn close(&mut self, why: WhyClosed) {
        self.tell(DeviceLink::Closed { why });
        self.release();
    }

    /// Closes the line, if one is open, because another is on its way.
    pub fn opening(&mut self) {
        self.tell(DeviceLink::Opening);
        self.release();
    }

    /// Tells the step about the link, when that is news.
    fn tell(&self, link: DeviceLink) {
        if self.wire.link.get() != link {
            self.wire.link.set(link);
            // The way there and an ordered end are no news to people.
            if !matches!(link, DeviceLink::Opening | DeviceLink::Closed { why: WhyClosed::Stopped }) {
                (self.log)(&self.wire.explain(link));
            }
            (self.notify)();
        }
    }

    fn release(&mut self) {
        self.wire.set_line(None);
        self.line = None;
    }

    /// What to wait for on the open line.
    pub fn interest(&self) -> PollFlags {
        let mut interest = PollFlags::empty();
        if self.wire.has_room() {
            interest |= PollFlags::IN;
        }
        if !self.wire.outgoing.is_empty() {
            interest |= PollFlags::OUT;
        }
        interest
    }

    /// Reads what has come at `now`. An error says how the line ended.
    pub fn read(&mut self, now: Time) -> Result<(), WhyClosed> {
        let Some(line) = self.line.clone() else { return Ok(()) };
        let mut chunk = [0; 2048];
        let mut came = false;
        let mut ended = Ok(());
        for _ in 0..READS_PER_LOOK {
            let room = self.wire.incoming.free().min(chunk.len());
            if room == 0 {
                break;
            }
            match rustix::io::read(&line.descriptor, &mut chunk[..room]) {
                Ok(0) => ended = Err(WhyClosed::HungUp),
                Ok(count) => {
                    // The time first: the step must not see bytes younger than it.
                    self.wire.arrived_ns.store(now.nanos(), Ordering::Release);
                    self.wire.incoming.push(&chunk[..count]);
                    came = true;
                    self.alive = true;
                    if count < room {
                        break;
                    }
                    continue;
                }
                Err(Errno::INTR) => continue,
                Err(Errno::AGAIN) => {}
                Err(error) => ended = Err(WhyClosed::from_errno(error)),
            }
            break;
        }
        if came {
            (self.notify)();
        }
        ended
    }

    /// Sends what the kernel would not take before. An error says how the line ended.
    pub fn flush(&self) -> Result<(), WhyClosed> {
        match self.line.is_some() && !self.wire.outgoing.is_empty() {
            true => self.wire.flush().map_err(WhyClosed::from_errno),
            false => Ok(()),
        }
    }

    /// Takes what poll says about the open line. An error says how the line ended.
    pub fn ready(&mut self, now: Time, events: PollFlags) -> Result<(), WhyClosed> {
        if events.contains(PollFlags::OUT) {
            self.flush()?;
        }
        let hung_up = events.intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL);
        if events.contains(PollFlags::IN) || hung_up {
            self.read(now)?;
        }
        // Where the ring is full the rest cannot be fetched, and waiting for room would spin on the hang-up.
        match hung_up && self.wire.incoming.free() == 0 {
            true => Err(WhyClosed::HungUp),
            false => Ok(()),
        }
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        // Also when the pump's thread dies of a defect: the step must not take a dead line for a silent one.
        self.wire.link.set(DeviceLink::Closed { why: WhyClosed::Stopped });
        self.release();
    }
}
