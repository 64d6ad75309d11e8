//! Sleeping on several channels and one private word at once.
//!
//! The order that loses nothing: [`Waiter::snapshot`], look at everything, [`Waiter::wait`]. Whatever changes after the
//! snapshot ends the wait at once. A return says where to look first and no more than that: look at all. Anybody who
//! can read a channel can cause a wake, so a wait may also end for nothing.
//!
//! With `futex_waitv` (Linux 5.16) one system call waits for up to 128 words. Without it a helper thread sleeps on each
//! channel and bumps the private word; helpers inherit the scheduling of the thread that makes the waiter.

use std::io;
use std::sync::Arc;

use rustix::thread::futex::{Wait, WaitPtr};

use super::atomic::{AtomicU32, Ordering};
use super::futex::{self, Scope};
use super::helper::Helper;
use super::memory::Memory;
use super::ring::{self, Whole};

/// Words that one call to `futex_waitv` takes.
const MOST_WORDS: usize = 128;

/// The futex word of a channel; keeps the ring mapped.
#[derive(Clone)]
pub struct WakeWord(Arc<Memory>);

impl WakeWord {
    pub(super) fn new(memory: Arc<Memory>) -> WakeWord {
        WakeWord(memory)
    }

    /// The word and whether its page is lost. The load comes first: it is what finds out.
    #[inline]
    pub(super) fn state(&self) -> (u32, bool) {
        let value = ring::look::<Whole>(self.0.wake_word());
        (value, self.0.faulted())
    }

    pub(super) fn memory(&self) -> &Memory {
        &self.0
    }
}

/// A word of one's own: for control, calls, devices, signals.
#[derive(Clone, Default)]
pub struct PrivateWord(Arc<Bell>);

#[derive(Default)]
struct Bell {
    /// What the thread sleeps on; helpers change it too.
    word: AtomicU32,
    /// Counts `bump`s alone.
    bumps: AtomicU32,
}

impl PrivateWord {
    /// A word that nobody has bumped.
    pub fn new() -> PrivateWord {
        PrivateWord::default()
    }

    /// Ends the wait of whoever sleeps on the word, or its next one. Async-signal-safe.
    pub fn bump(&self) {
        self.0.bumps.fetch_add(1, Ordering::Release);
        self.nudge();
    }

    /// Ends a wait on behalf of a channel.
    pub(super) fn nudge(&self) {
        ring::bump::<Whole>(&self.0.word);
        futex::wake_all(&self.0.word, Scope::Process);
    }
}

/// How a waiter waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// One call to `futex_waitv`.
    Vector,
    /// A helper thread per channel.
    Helpers,
}

/// Where to look first after a wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Woken {
    /// The private word was bumped.
    Private,
    /// The channel of this index, in the order given to the waiter, changed or faulted.
    Word(usize),
    /// The time came.
    Timeout,
    /// A signal, a stranger's wake, or something that had happened before the snapshot.
    Spurious,
}

/// Waits for a private word and any number of channels. Never allocates after it was made.
pub struct Waiter {
    private: PrivateWord,
    words: Vec<WakeWord>,
    /// A word in memory that lives as long as the process, and what it was.
    fixed: Option<(&'static AtomicU32, u32)>,
    seen_private: (u32, u32),
    seen: Vec<(u32, bool)>,
    entries: Vec<Wait>,
    helpers: Vec<Helper>,
    method: Method,
}

// SAFETY: the only things in here that are not Send are the addresses in `entries`; they point into the memories and the
// bell that `words` and `private` keep alive wherever the waiter goes.
unsafe impl Send for Waiter {}

impl Waiter {
    /// A waiter that waits in the best way that the kernel has. Fails only when helper threads are needed and refused.
    pub fn new(private: &PrivateWord, words: Vec<WakeWord>) -> io::Result<Waiter> {
        let vector = futex::has_wait_any() && words.len() < MOST_WORDS;
        Waiter::with_method(private, words, if vector { Method::Vector } else { Method::Helpers })
    }

    /// A waiter that waits in the given way.
    pub fn with_method(private: &PrivateWord, words: Vec<WakeWord>, method: Method) -> io::Result<Waiter> {
        let mut waiter = Waiter {
            private: private.clone(),
            fixed: None,
            seen_private: (0, 0),
            seen: vec![(0, false); words.len()],
            entries: Vec::new(),
            helpers: Vec::new(),
            method,
            words,
        };
        waiter.words.iter().for_each(|word| word.memory().count_sleeper(true));
        match method {
            Method::Vector => {
                let private = (&raw const waiter.private.0.word, Scope::Process);
                let channels = waiter.words.iter().map(|w| (&raw const *w.memory().wake_word(), w.memory().scope()));
                waiter.entries =
                    std::iter::once(private).chain(channels).map(|(word, scope)| entry(word, scope)).collect();
            }
            Method::Helpers => {
                for word in &waiter.words {
                    waiter.helpers.push(Helper::start(word.clone(), private.clone())?);
                }
            }
        }
        waiter.snapshot();
        Ok(waiter)
    }

    /// Waits for changes of `word`, too, which other processes share. Without `futex_waitv` it is looked at only when
    /// something else ends a wait.
    pub fn also(&mut self, word: &'static AtomicU32) {
        self.fixed = Some((word, word.load(Ordering::Relaxed)));
        if self.method == Method::Vector && self.entries.len() < MOST_WORDS {
            self.entries.push(entry(word, Scope::Shared));
        }
    }

    /// How it waits.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Remembers all words as they are now. Take it before looking at the channels.
    pub fn snapshot(&mut self) {
        // The word before the count, as `bump` does it the other way round: a bump seen here is one that is counted.
        let word = ring::look::<Whole>(&self.private.0.word);
        self.seen_private = (word, self.private.0.bumps.load(Ordering::Acquire));
        for (seen, word) in self.seen.iter_mut().zip(&self.words) {
            *seen = word.state();
        }
        if let Some((word, seen)) = &mut self.fixed {
            *seen = word.load(Ordering::Relaxed);
        }
    }

    /// Sleeps until a word differs from its snapshot or CLOCK_MONOTONIC reaches `until_ns`.
    pub fn wait(&mut self, until_ns: Option<u64>) -> Woken {
        let until = until_ns.map(futex::timespec);
        let ended = match self.method {
            Method::Vector => {
                let values = std::iter::once(self.seen_private.0).chain(self.seen.iter().map(|seen| seen.0));
                let values = values.chain(self.fixed.map(|(_, seen)| seen));
                self.entries.iter_mut().zip(values).for_each(|(entry, value)| entry.val = u64::from(value));
                futex::wait_any(&self.entries, until.as_ref())
            }
            Method::Helpers => match self.changed() {
                // What changed before this call may have been told to an earlier snapshot of the private word.
                Some(woken) => return woken,
                None => futex::wait(&self.private.0.word, Scope::Process, self.seen_private.0, until.as_ref()),
            },
        };
        match (self.changed(), ended) {
            (Some(woken), _) => woken,
            (None, Err(rustix::io::Errno::TIMEDOUT)) => Woken::Timeout,
            (None, _) => Woken::Spurious,
        }
    }

    fn changed(&self) -> Option<Woken> {
        if self.private.0.bumps.load(Ordering::Acquire) != self.seen_private.1 {
            return Some(Woken::Private);
        }
        if self.fixed.is_some_and(|(word, seen)| word.load(Ordering::Relaxed) != seen) {
            return Some(Woken::Private);
        }
        let changed = self.words.iter().zip(&self.seen).position(|(word, seen)| word.state() != *seen);
        changed.map(Woken::Word)
    }
}

impl Drop for Waiter {
    fn drop(&mut self) {
        self.helpers.clear();
        self.words.iter().for_each(|word| word.memory().count_sleeper(false));
    }
}

fn entry(word: *const AtomicU32, scope: Scope) -> Wait {
    let mut entry = Wait::new();
    entry.uaddr = WaitPtr::new(word.cast_mut().cast());
    entry.flags = scope.wait_flags();
    entry
}

/// Lets the calling thread's timed waits end within a nanosecond of their time instead of the usual 50 µs; real-time
/// scheduling implies it.
pub fn tighten_timer_slack() -> io::Result<()> {
    Ok(rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1))?)
}
