//! One read port: its sources, which of them counts, and where the inputs stood when the step began.

use crate::channel::{ChannelError, Expect, Geometry, RawReader, RawSample, ReadError, SampleBuffer, Tree};
use crate::node::OpenError;
use crate::path;
use crate::robot::ReadWire;
use crate::time::Time;
use messages::{InputCursor, path_number};
use std::cell::{Cell, RefCell};

/// A path that the port may read, and how far it has been read.
pub(crate) struct Source {
    pub(crate) path: String,
    /// Number of the path in step records.
    number: u32,
    pub(crate) ring: Option<RawReader>,
    /// Newest sequence number when the step began; 0 for none.
    frozen: u64,
    /// The writer's generation when the step began.
    generation: u64,
    /// Newest sequence number that `next` has handed out.
    read_to: u64,
    /// Newest sequence number that released a step.
    released: u64,
    /// Since when this candidate has been fresh without a break.
    fresh_since: Option<Time>,
}

impl Source {
    fn new(path: String) -> Source {
        Source {
            number: path_number(&path),
            path,
            ring: None,
            frozen: 0,
            generation: 0,
            read_to: 0,
            released: 0,
            fresh_since: None,
        }
    }

    fn open(&mut self, tree: &Tree, expect: &Expect) -> Result<(), OpenError> {
        match tree.reader(&self.path, Some(expect.clone())) {
            Ok(ring) => {
                // A reader begins with what comes after it; what lies in the ring already is history.
                if self.ring.is_none() && self.read_to == 0 {
                    self.read_to = ring.head();
                }
                // A channel that was removed and made anew counts from 1 again.
                let head = ring.head();
                self.read_to = self.read_to.min(head);
                self.released = self.released.min(head);
                self.ring = Some(ring);
                Ok(())
            }
            // Not there yet, gone, or damaged: its writer's restart makes it anew.
            Err(ChannelError::Missing { .. } | ChannelError::NotAChannel { .. }) => {
                self.ring = None;
                self.frozen = 0;
                Ok(())
            }
            Err(e) => Err(OpenError::Port { port: self.path.clone(), reason: e.to_string() }),
        }
    }
}

/// A read port without its type.
pub(crate) struct Input {
    pub(crate) port: &'static str,
    pub(crate) is_set: bool,
    expect: Expect,
    wire: Option<ReadWire>,
    pub(crate) sources: RefCell<Vec<Source>>,
    current: Cell<usize>,
    switches: Cell<u64>,
    /// When it last changed to another candidate, until that is told.
    switched: Cell<Option<Time>>,
    dropped: Cell<u64>,
    lost: Cell<bool>,
    changed: Cell<bool>,
    /// Bytes of the longest tail among the bound rings.
    tail_bytes: Cell<usize>,
    /// Whether buffers were made at all.
    fitted: Cell<bool>,
    /// Buffers for that tail, made between steps; the port takes them over at its next read.
    spare: RefCell<Option<[SampleBuffer; 2]>>,
}

impl Input {
    pub(crate) fn new(port: &'static str, is_set: bool, expect: Expect, wire: Option<ReadWire>) -> Input {
        let sources = match &wire {
            Some(wire) => wire.from.iter().filter(|p| !path::is_pattern(p)).cloned().map(Source::new).collect(),
            None => Vec::new(),
        };
        Input {
            port,
            is_set,
            expect,
            wire,
            sources: RefCell::new(sources),
            current: Cell::new(0),
            switches: Cell::new(0),
            switched: Cell::new(None),
            dropped: Cell::new(0),
            lost: Cell::new(false),
            changed: Cell::new(true),
            tail_bytes: Cell::new(0),
            fitted: Cell::new(false),
            spare: RefCell::new(None),
        }
    }

    /// Larger buffers, if rings with longer tails were bound since the last time of asking.
    pub(crate) fn take_spare(&self) -> Option<[SampleBuffer; 2]> {
        self.spare.borrow_mut().take()
    }

    /// Greatest age of a sample that counts [ns].
    pub(crate) fn max_age_ns(&self) -> u64 {
        self.wire.as_ref().map_or(u64::MAX, |wire| wire.max_age_ns)
    }

    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.get()
    }

    pub(crate) fn switches(&self) -> u64 {
        self.switches.get()
    }

    /// Whether a sample was lost while the step ran; asking clears it.
    pub(crate) fn take_lost(&self) -> bool {
        self.lost.replace(false)
    }

    /// Whether the port's rings are others than at the last time of asking.
    pub(crate) fn take_changed(&self) -> bool {
        self.changed.replace(false)
    }

    /// The path that a reader with candidates uses now.
    pub(crate) fn current_path(&self) -> String {
        self.sources.borrow().get(self.current.get()).map(|s| s.path.clone()).unwrap_or_default()
    }

    /// Opens what can be opened: at the start, and between steps for what was absent, retired or new in a set.
    pub(crate) fn bind(&self, tree: &Tree) -> Result<(), OpenError> {
        let mut sources = self.sources.borrow_mut();
        if let Some(wire) = &self.wire {
            for pattern in wire.from.iter().filter(|p| path::is_pattern(p)) {
                let Ok(members) = tree.members(pattern) else { continue };
                for member in members {
                    if !sources.iter().any(|source| source.path == member) {
                        sources.push(Source::new(member));
                        sources.sort_by(|a, b| a.path.cmp(&b.path));
                    }
                }
            }
        }
        for source in sources.iter_mut() {
            if source.ring.as_ref().is_none_or(|ring| ring.retired() || ring.unlinked()) {
                let had = source.ring.is_some();
                source.open(tree, &self.expect)?;
                if source.ring.is_some() || had {
                    self.changed.set(true);
                }
                if let Some(ring) = &source.ring {
                    self.fit(ring.geometry());
                }
            }
        }
        if let Some(wire) = &self.wire
            && self.is_set
        {
            // A member that is gone leaves the set; a source that the robot file names keeps its place.
            sources.retain(|source| source.ring.is_some() || wire.from.contains(&source.path));
        }
        Ok(())
    }

    /// Provides buffers for the longest tail among the rings.
    fn fit(&self, geometry: &Geometry) {
        let tail = geometry.tail_element_bytes * geometry.tail_capacity;
        if tail >= self.tail_bytes.get() && !self.fitted.replace(true) || tail > self.tail_bytes.get() {
            self.tail_bytes.set(tail);
            let buffer = || SampleBuffer::new(geometry);
            *self.spare.borrow_mut() = Some([buffer(), buffer()]);
        }
    }

    /// Fixes what the coming step can see, and picks the candidate.
    pub(crate) fn freeze(&self, now: Time) {
        self.lost.set(false);
        let mut sources = self.sources.borrow_mut();
        for source in sources.iter_mut() {
            if let Some(ring) = &source.ring {
                source.frozen = ring.head();
                source.generation = ring.generation();
            }
        }
        if !self.is_set && sources.len() > 1 {
            self.pick_candidate(&mut sources, now);
        }
    }

    /// The first fresh candidate; one that is preferred to the current one only after it has been fresh for a while.
    fn pick_candidate(&self, sources: &mut [Source], now: Time) {
        let Some(wire) = &self.wire else { return };
        for source in sources.iter_mut() {
            let fresh = source.ring.as_ref().is_some_and(|ring| {
                source.frozen > 0
                    && ring
                        .stamp(source.frozen)
                        .map_err(|error| self.miss(error))
                        .is_ok_and(|sample| now.nanos_since(Time::from_nanos(sample.stamp_ns)) <= wire.max_age_ns)
            });
            source.fresh_since = if fresh { source.fresh_since.or(Some(now)) } else { None };
        }
        let current = self.current.get();
        let proven =
            |source: &Source| source.fresh_since.is_some_and(|since| now.nanos_since(since) >= wire.return_after_ns);
        let better = sources.iter().take(current).position(proven);
        let stale = sources.get(current).is_none_or(|source| source.fresh_since.is_none());
        let next = match better {
            Some(index) => index,
            None if stale => sources.iter().position(|s| s.fresh_since.is_some()).unwrap_or(current),
            None => current,
        };
        if next != current {
            self.current.set(next);
            self.switches.set(self.switches.get() + 1);
            self.switched.set(Some(now));
        }
    }

    /// When the port last changed to another candidate, and to which; asking forgets it.
    pub(crate) fn take_switched(&self) -> Option<(Time, String)> {
        let at = self.switched.take()?;
        Some((at, self.sources.borrow().get(self.current.get()).map(|source| source.path.clone())?))
    }

    /// The stamp of the newest sample that has not released a step yet, if one has come; asking marks it.
    pub(crate) fn take_arrival(&self) -> Option<Time> {
        let mut arrived = None;
        for source in self.sources.borrow_mut().iter_mut() {
            if let Some(ring) = &source.ring {
                let head = ring.head();
                if head > source.released {
                    source.released = head;
                    let stamp = ring.stamp(head).map_or(0, |sample| sample.stamp_ns);
                    arrived = arrived.max(Some(Time::from_nanos(stamp)));
                }
            }
        }
        arrived
    }

    /// Reads the newest frozen sample of source `index` (the current candidate for `None`).
    pub(crate) fn read_newest(&self, index: Option<usize>, buffer: &mut SampleBuffer) -> Option<RawSample> {
        let sources = self.sources.borrow();
        let source = sources.get(index.unwrap_or(self.current.get()))?;
        self.read_back_from(source, source.frozen, buffer)
    }

    /// The sample `sequence`, or the nearest whole one before it: a writer that died in mid-write leaves a hole.
    fn read_back_from(&self, source: &Source, sequence: u64, buffer: &mut SampleBuffer) -> Option<RawSample> {
        let ring = source.ring.as_ref()?;
        let mut wanted = sequence;
        for _ in 0..4 {
            if wanted == 0 {
                return None;
            }
            match ring.read(wanted, buffer) {
                Ok(raw) => return Some(raw),
                Err(ReadError::Unfinished | ReadError::NotYet) => wanted -= 1,
                Err(ReadError::Overrun) => {
                    self.lost.set(true);
                    self.dropped.set(self.dropped.get() + 1);
                    return None;
                }
                Err(ReadError::Fault | ReadError::Buffer) => return None,
            }
        }
        None
    }

    /// The oldest frozen sample that was not handed out yet.
    pub(crate) fn read_next(&self, buffer: &mut SampleBuffer) -> Option<RawSample> {
        let mut sources = self.sources.borrow_mut();
        let source = sources.get_mut(self.current.get())?;
        let ring = source.ring.as_ref()?;
        while source.read_to < source.frozen {
            let wanted = source.read_to + 1;
            // By what was frozen, not by what has come since: a replay of the step must find the same.
            let oldest = oldest_of(ring, source.frozen);
            if wanted < oldest {
                self.dropped.set(self.dropped.get() + (oldest.min(source.frozen + 1) - wanted));
                source.read_to = oldest.min(source.frozen + 1) - 1;
                continue;
            }
            source.read_to = wanted;
            match ring.read(wanted, buffer) {
                Ok(raw) => return Some(raw),
                Err(ReadError::Overrun) => {
                    self.lost.set(true);
                    self.dropped.set(self.dropped.get() + 1);
                }
                // A hole that a dead writer left: nothing was ever published there.
                Err(ReadError::Unfinished | ReadError::NotYet) => {}
                Err(ReadError::Fault | ReadError::Buffer) => return None,
            }
        }
        None
    }

    /// The newest frozen sample with a stamp at or before `time`.
    pub(crate) fn read_at(&self, time: Time, buffer: &mut SampleBuffer) -> Option<RawSample> {
        let sources = self.sources.borrow();
        let source = sources.get(self.current.get())?;
        let ring = source.ring.as_ref()?;
        let mut sequence = source.frozen;
        while sequence >= oldest_of(ring, source.frozen) && sequence > 0 {
            match ring.stamp(sequence) {
                Ok(sample) if sample.stamp_ns <= time.nanos() => break,
                Ok(_) | Err(ReadError::Unfinished | ReadError::NotYet) => sequence -= 1,
                Err(error) => {
                    self.miss(error);
                    return None;
                }
            }
        }
        (sequence >= oldest_of(ring, source.frozen)).then(|| self.read_back_from(source, sequence, buffer))?
    }

    /// Reads the frozen sample `sequence`.
    pub(crate) fn read_sequence(&self, sequence: u64, buffer: &mut SampleBuffer) -> Option<RawSample> {
        let sources = self.sources.borrow();
        let source = sources.get(self.current.get())?;
        if sequence == 0 || sequence > source.frozen {
            return None;
        }
        source.ring.as_ref()?.read(sequence, buffer).map_err(|error| self.miss(error)).ok()
    }

    /// Remembers that the step saw less than was there when it began.
    fn miss(&self, error: ReadError) {
        if error == ReadError::Overrun {
            self.lost.set(true);
        }
    }

    /// Range of sequence numbers that a step can read: oldest kept, newest frozen.
    pub(crate) fn window(&self) -> (u64, u64) {
        let sources = self.sources.borrow();
        let Some(source) = sources.get(self.current.get()) else { return (1, 0) };
        (source.ring.as_ref().map_or(1, |ring| oldest_of(ring, source.frozen)), source.frozen)
    }

    /// The writer's generation when the step began.
    pub(crate) fn generation(&self) -> u64 {
        self.sources.borrow().get(self.current.get()).map_or(0, |source| source.generation)
    }

    /// Reports where each source stood when the step began.
    pub(crate) fn cursors(&self, port: u32, mut each: impl FnMut(InputCursor)) {
        for source in self.sources.borrow().iter() {
            each(InputCursor {
                port,
                source: source.number,
                generation: source.generation,
                sequence: source.frozen,
                read_to: source.read_to,
            });
        }
    }

    /// Newest stamp of the current source [ns]; 0 for none.
    pub(crate) fn newest_stamp_ns(&self) -> u64 {
        let sources = self.sources.borrow();
        let Some(source) = sources.get(self.current.get()) else { return 0 };
        if source.frozen == 0 {
            return 0;
        }
        let stamp = source.ring.as_ref().map(|ring| ring.stamp(source.frozen));
        stamp.and_then(|stamp| stamp.map_err(|error| self.miss(error)).ok()).map_or(0, |sample| sample.stamp_ns)
    }

    /// Fixes what the coming step can see to what a recorded step saw.
    pub(crate) fn freeze_as(
        &self,
        now: Time,
        tree: &Tree,
        recorded: &[(String, InputCursor)],
    ) -> Result<(), OpenError> {
        self.lost.set(false);
        let mut sources = self.sources.borrow_mut();
        if !sources.iter().map(|source| &source.path).eq(recorded.iter().map(|(path, _)| path)) {
            let mut old = std::mem::take(&mut *sources);
            for (path, _) in recorded {
                let known = old.iter().position(|source| source.path == *path);
                sources.push(known.map_or_else(|| Source::new(path.clone()), |index| old.swap_remove(index)));
            }
        }
        for (source, (_, cursor)) in sources.iter_mut().zip(recorded) {
            if source.ring.is_none() {
                source.open(tree, &self.expect)?;
                if let Some(ring) = &source.ring {
                    self.fit(ring.geometry());
                }
            }
            source.frozen = cursor.sequence;
            source.generation = cursor.generation;
            source.read_to = cursor.read_to;
        }
        if !self.is_set && sources.len() > 1 {
            self.pick_candidate(&mut sources, now);
        }
        Ok(())
    }
}

/// Oldest of the samples that the ring promises when `frozen` is the newest.
fn oldest_of(ring: &RawReader, frozen: u64) -> u64 {
    frozen.saturating_sub(ring.geometry().depth as u64 - 1).max(1)
}
