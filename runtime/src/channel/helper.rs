//! A thread that sleeps on one channel for a waiter whose kernel can sleep on one word only.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use rustix::thread::Timespec;

use super::futex;
use super::wait::{PrivateWord, WakeWord};

/// Little, because real-time processes lock their stacks in memory.
const STACK_BYTES: usize = 64 * 1024;

/// A thread that sleeps on a file that is cut off sleeps on a page that no longer has an address, and nobody can wake
/// it: so it looks by itself now and then.
const LOOK_S: i64 = 1;

/// Bumps the private word whenever the channel's word changes. Ends when dropped.
pub(super) struct Helper {
    word: WakeWord,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Helper {
    pub fn start(word: WakeWord, private: PrivateWord) -> io::Result<Helper> {
        let stop = Arc::new(AtomicBool::new(false));
        // Read here: a change between the start of the thread and its first look must not be taken for its beginning.
        let first = word.state();
        let thread = std::thread::Builder::new().name("channel-wait".into()).stack_size(STACK_BYTES).spawn({
            let (word, stop) = (word.clone(), stop.clone());
            move || pass_on(&word, first, &private, &stop)
        })?;
        Ok(Helper { word, stop, thread: Some(thread) })
    }
}

fn pass_on(word: &WakeWord, first: (u32, bool), private: &PrivateWord, stop: &AtomicBool) {
    let memory = word.memory();
    let mut last = first;
    while !stop.load(Ordering::Acquire) {
        // Whatever ends the wait, the word itself says whether there is something to pass on.
        let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
        let until = Timespec { tv_sec: now.tv_sec + LOOK_S, ..now };
        let _ = futex::wait(memory.wake_word(), memory.scope(), last.0, Some(&until));
        let now = word.state();
        if now != last {
            last = now;
            private.nudge();
        }
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else { return };
        // The word must not change for this, so a wake that comes before the thread sleeps is lost: until it is gone.
        while !thread.is_finished() {
            // Loads the word, and so finds out about a lost file. Then the thread is left to its next look.
            if self.word.state().1 {
                return;
            }
            futex::wake_all(self.word.memory().wake_word(), self.word.memory().scope());
            std::thread::yield_now();
        }
        let _ = thread.join();
    }
}
