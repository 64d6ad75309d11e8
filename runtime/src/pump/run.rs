//! The pump's thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use rustix::event::{PollFd, PollFlags, poll};
use rustix::time::{ClockId, Timespec, clock_gettime};

use super::{Part, Waker};
use crate::Time;

/// How long a stopping pump goes on sending a device its last bytes and callers their last answers.
const FAREWELL_S: f64 = 1.0;

/// A running pump. Dropping it stops it.
#[derive(Debug)]
pub struct Pump {
    thread: Option<JoinHandle<()>>,
    stop: Arc<AtomicBool>,
    waker: Waker,
}

impl Pump {
    pub(super) fn spawn(
        name: String,
        stack_bytes: usize,
        waker: Waker,
        parts: Vec<Box<dyn Part>>,
        on_start: Option<Box<dyn FnOnce() + Send>>,
    ) -> std::io::Result<Pump> {
        let stop = Arc::new(AtomicBool::new(false));
        let (stop_seen, wakes) = (Arc::clone(&stop), waker.clone());
        let thread = std::thread::Builder::new().name(name).stack_size(stack_bytes).spawn(move || {
            if let Some(on_start) = on_start {
                on_start();
            }
            run(parts, &wakes, &stop_seen);
        })?;
        Ok(Pump { thread: Some(thread), stop, waker })
    }

    /// Sends what is pending, closes everything and ends the thread.
    pub fn stop(mut self) {
        self.end();
    }

    /// Whether the thread has ended by itself: a defect, after which the node is deaf.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Release);
        self.waker.wake();
        if let Some(thread) = self.thread.take() {
            // A pump that panicked has said so already.
            let _ = thread.join();
        }
    }
}

impl Drop for Pump {
    fn drop(&mut self) {
        self.end();
    }
}

fn run(mut parts: Vec<Box<dyn Part>>, waker: &Waker, stop: &AtomicBool) {
    while !stop.load(Ordering::Acquire) {
        let now = monotonic();
        let next = parts.iter_mut().filter_map(|part| part.advance(now)).min();
        wait(&mut parts, waker, next);
    }
    let until = monotonic().after_s(FAREWELL_S);
    while !close(&mut parts) && monotonic() < until {
        wait(&mut parts, waker, Some(until));
    }
}

/// Closes every part, even when one before it is not done; whether all are.
fn close(parts: &mut [Box<dyn Part>]) -> bool {
    let unfinished = parts.iter_mut().map(|part| part.close()).filter(|done| !done).count();
    unfinished == 0
}

/// Waits until a descriptor is ready, the waker is used or `until` comes, and hands the parts what has happened.
fn wait(parts: &mut [Box<dyn Part>], waker: &Waker, until: Option<Time>) {
    let mut events: Vec<PollFlags> = Vec::new();
    let mut counts: Vec<usize> = Vec::new();
    {
        let mut descriptors = vec![PollFd::new(waker, PollFlags::IN)];
        for part in parts.iter() {
            let before = descriptors.len();
            part.watch(&mut descriptors);
            counts.push(descriptors.len() - before);
        }
        let timeout = until.map(|until| span(until.nanos_since(monotonic())));
        if poll(&mut descriptors, timeout.as_ref()).is_err() {
            // Interrupted: the parts look at their timers and come back.
            return;
        }
        events.extend(descriptors.iter().map(PollFd::revents));
    }
    // Before the parts look, so that a wake during their look is not lost.
    if !events[0].is_empty() {
        waker.clear();
    }
    let now = monotonic();
    let mut rest = &events[1..];
    for (part, count) in parts.iter_mut().zip(counts) {
        let (own, others) = rest.split_at(count);
        rest = others;
        if own.iter().any(|event| !event.is_empty()) {
            part.ready(now, own);
        }
    }
}

fn span(nanos: u64) -> Timespec {
    Timespec { tv_sec: (nanos / 1_000_000_000) as i64, tv_nsec: (nanos % 1_000_000_000) as i64 }
}

/// The robot's clock.
pub(crate) fn monotonic() -> Time {
    let now = clock_gettime(ClockId::Monotonic);
    Time::from_nanos(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
}

#[cfg(test)]
mod tests {
    use crate::pump::PumpBuilder;
    use std::sync::mpsc::channel;

    #[test]
    fn the_host_is_called_first_on_a_thread_that_bears_the_nodes_name() {
        let root = tempfile::tempdir().unwrap();
        let (told, tells) = channel();
        let mut builder = PumpBuilder::new("/drivers/base");
        builder.on_start(move || told.send(std::thread::current().name().map(str::to_owned)).unwrap());
        let pump = builder.spawn(root.path()).unwrap();
        assert_eq!(tells.recv().unwrap().as_deref(), Some("base.pump"));
        assert!(!pump.has_ended());
        pump.stop();
        assert!(std::fs::read_dir(root.path().join("drivers/base")).unwrap().next().is_none());
    }

    #[test]
    fn a_pump_that_has_panicked_is_known_to_have_ended() {
        let root = tempfile::tempdir().unwrap();
        let mut builder = PumpBuilder::new("/drivers/base");
        builder.on_start(|| panic!("on purpose, by a test"));
        let pump = builder.spawn(root.path()).unwrap();
        while !pump.has_ended() {
            std::thread::yield_now();
        }
    }
}
