//! The system calls behind waking and sleeping. None of them allocates; waking is async-signal-safe.

use std::num::NonZeroU32;
use std::sync::OnceLock;

use rustix::io::Errno;
use rustix::thread::futex::{Flags, Wait, WaitFlags, WaitvFlags, wait_bitset, waitv, wake};
use rustix::thread::{ClockId, Timespec};

use super::atomic::AtomicU32;

/// Who shares a futex word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scope {
    /// Threads of this process: cheaper.
    Process,
    /// Every process that maps the file.
    Shared,
}

impl Scope {
    fn flags(self) -> Flags {
        match self {
            Scope::Process => Flags::PRIVATE,
            Scope::Shared => Flags::empty(),
        }
    }

    pub fn wait_flags(self) -> WaitFlags {
        match self {
            Scope::Process => WaitFlags::SIZE_U32 | WaitFlags::PRIVATE,
            Scope::Shared => WaitFlags::SIZE_U32,
        }
    }
}

/// Wakes every sleeper. An error can only mean that the word's page is gone, and then nobody sleeps there.
#[inline]
pub(super) fn wake_all(word: &AtomicU32, scope: Scope) {
    let _ = wake(word, scope.flags(), i32::MAX as u32);
}

/// Sleeps while `word` is `value`, until CLOCK_MONOTONIC reaches `until`.
pub(super) fn wait(word: &AtomicU32, scope: Scope, value: u32, until: Option<&Timespec>) -> Result<(), Errno> {
    // Unlike plain FUTEX_WAIT the bitset form takes an absolute time.
    wait_bitset(word, scope.flags(), value, until, NonZeroU32::MAX)
}

/// Sleeps while every entry's word has its value.
pub(super) fn wait_any(entries: &[Wait], until: Option<&Timespec>) -> Result<(), Errno> {
    waitv(entries, WaitvFlags::empty(), until, ClockId::Monotonic).map(drop)
}

/// Whether the kernel has `futex_waitv` (Linux 5.16) and lets this process use it.
pub(super) fn has_wait_any() -> bool {
    static HAS: OnceLock<bool> = OnceLock::new();
    // No entries at all is an invalid argument where the call exists; seccomp filters answer ENOSYS or EPERM.
    *HAS.get_or_init(|| wait_any(&[], None) == Err(Errno::INVAL))
}

/// `ns` on CLOCK_MONOTONIC, as the kernel takes it.
pub(super) fn timespec(ns: u64) -> Timespec {
    Timespec { tv_sec: (ns / 1_000_000_000) as i64, tv_nsec: (ns % 1_000_000_000) as i64 }
}
