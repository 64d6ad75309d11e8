//! Where a ring lives: a mapped file, or the heap. Everything above sees `&[AtomicU64]` and one futex word.

use std::fs::File;
use std::io;
use std::ptr::{self, NonNull};

use rustix::mm::{Advice, MapFlags, ProtFlags};

use super::atomic::{AtomicU32, AtomicU64, Ordering};
use super::fault::{self, Watch};
use super::futex;
use super::layout::at;

/// Words that other threads or processes change while they are looked at.
pub(super) struct Memory {
    base: NonNull<AtomicU64>,
    words: usize,
    home: Home,
}

enum Home {
    /// Counts the waiters that may sleep on the wake word, so that a ring which nobody sleeps on costs no system call.
    Heap { sleepers: AtomicU32 },
    /// The watch turns a page that the file no longer has into a fault of this ring alone.
    Map { watch: &'static Watch },
}

// SAFETY: the words are atomics that live until the drop; nothing else in here is tied to a thread.
unsafe impl Send for Memory {}
// SAFETY: as above; `&Memory` gives out atomics only.
unsafe impl Sync for Memory {}

impl Memory {
    /// `words` zeros on the heap.
    pub fn heap(words: usize) -> Memory {
        let zeros: Box<[AtomicU64]> = (0..words).map(|_| AtomicU64::new(0)).collect();
        let base = NonNull::from(Box::leak(zeros)).cast();
        Memory { base, words, home: Home::Heap { sleepers: AtomicU32::new(0) } }
    }

    /// The first `words` words of `file`, which must have them. Prefaulted when `prefault`, so that no page fault is
    /// left for the first use; never inherited by a forked child.
    pub fn map(file: &File, words: usize, writable: bool, prefault: bool) -> io::Result<Memory> {
        let bytes = words * 8;
        let protection = if writable { ProtFlags::READ | ProtFlags::WRITE } else { ProtFlags::READ };
        let flags = if prefault { MapFlags::SHARED | MapFlags::POPULATE } else { MapFlags::SHARED };
        // SAFETY: a fresh mapping at an address of the kernel's choice aliases nothing of ours.
        let start = unsafe { rustix::mm::mmap(ptr::null_mut(), bytes, protection, flags, file, 0)? };
        let (watch, base) = match (fault::watch(start as usize, bytes), NonNull::new(start.cast())) {
            (Ok(watch), Some(base)) => (watch, base),
            (refused, _) => {
                // SAFETY: the mapping just made, which nobody has seen.
                unsafe { rustix::mm::munmap(start, bytes)? };
                return Err(refused.err().unwrap_or_else(|| io::Error::other("mapped at address zero")));
            }
        };
        let memory = Memory { base, words, home: Home::Map { watch } };
        // A child between fork and exec must not keep the ring alive, nor be able to write it.
        // SAFETY: the range is the mapping just made; DONTFORK changes nothing for this process.
        unsafe { rustix::mm::madvise(start, bytes, Advice::LinuxDontFork)? };
        Ok(memory)
    }

    /// All words.
    #[inline]
    pub fn words(&self) -> &[AtomicU64] {
        // SAFETY: `base` points to `words` initialised, 8-aligned words until the drop; others change them through
        // atomics only. A read-only map is only ever loaded from, relaxed and by 8 bytes, which Rust allows there:
        // storing needs a writer, and writers map writable.
        unsafe { std::slice::from_raw_parts(self.base.as_ptr(), self.words) }
    }

    /// The futex word.
    #[inline]
    pub fn wake_word(&self) -> &AtomicU32 {
        let word: *const AtomicU64 = &self.words()[at::WAKE];
        // SAFETY: in bounds, aligned to 8, and never accessed as 8 bytes, so no two sizes of access mix.
        unsafe { &*word.cast() }
    }

    /// Wakes whoever sleeps on the futex word.
    #[inline]
    pub fn wake_sleepers(&self) {
        match &self.home {
            Home::Map { .. } => futex::wake_all(self.wake_word(), futex::Scope::Shared),
            // SeqCst orders the bump before this look and the sleeper's count before its look at the word.
            Home::Heap { sleepers } => {
                super::atomic::fence(Ordering::SeqCst);
                if sleepers.load(Ordering::SeqCst) > 0 {
                    futex::wake_all(self.wake_word(), futex::Scope::Process);
                }
            }
        }
    }

    /// Announces (or with `false` withdraws) one that may sleep on the futex word.
    pub fn count_sleeper(&self, comes: bool) {
        if let Home::Heap { sleepers } = &self.home {
            if comes {
                sleepers.fetch_add(1, Ordering::SeqCst)
            } else {
                sleepers.fetch_sub(1, Ordering::SeqCst)
            };
        }
    }

    /// Who shares the futex word.
    pub fn scope(&self) -> futex::Scope {
        match self.home {
            Home::Heap { .. } => futex::Scope::Process,
            Home::Map { .. } => futex::Scope::Shared,
        }
    }

    /// Whether pages of the file vanished under the map. Sticky; look after the accesses that it shall cover.
    #[inline]
    pub fn faulted(&self) -> bool {
        match &self.home {
            Home::Heap { .. } => false,
            Home::Map { watch } => watch.faulted(),
        }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        match &self.home {
            Home::Heap { .. } => {
                let words = ptr::slice_from_raw_parts_mut(self.base.as_ptr(), self.words);
                // SAFETY: `heap` leaked exactly this box, and `&mut self` means that nobody looks at it any more.
                drop(unsafe { Box::from_raw(words) });
            }
            Home::Map { watch } => {
                fault::release(watch);
                // SAFETY: `map` made exactly this mapping, and `&mut self` means that nobody looks at it any more.
                let unmapped = unsafe { rustix::mm::munmap(self.base.as_ptr().cast(), self.words * 8) };
                debug_assert!(unmapped.is_ok());
            }
        }
    }
}
