//! The system calls that no library wraps safely.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString};
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, FromRawFd, OwnedFd, RawFd};
use std::ptr;
use std::sync::atomic::{AtomicU32, AtomicU64};

use rustix::mm::{MapFlags, ProtFlags};
use rustix::process::Pid;

/// Maps `count` words of `memfd` for as long as the process lives.
pub fn map_words(memfd: BorrowedFd<'_>, count: usize, writable: bool) -> io::Result<&'static [AtomicU64]> {
    let protection = if writable { ProtFlags::READ | ProtFlags::WRITE } else { ProtFlags::READ };
    let flags = MapFlags::SHARED | MapFlags::POPULATE;
    // SAFETY: a fresh mapping at an address of the kernel's choice aliases nothing of ours.
    let start = unsafe { rustix::mm::mmap(ptr::null_mut(), count * 8, protection, flags, memfd, 0)? };
    // SAFETY: the mapping is page-aligned, holds `count` words, cannot shrink (the caller looked at the seals) and is
    // never unmapped; others change it through atomics only. A read-only map is loaded from only: storing needs a writer.
    Ok(unsafe { std::slice::from_raw_parts(start.cast::<AtomicU64>(), count) })
}

/// The low half of a word; the word itself is then never accessed as a whole.
pub fn low_half(word: &'static AtomicU64) -> &'static AtomicU32 {
    let word: *const AtomicU64 = word;
    // SAFETY: aligned to 8, alive for ever, and only ever accessed by this half.
    unsafe { &*word.cast() }
}

/// Adopts a descriptor that this process was started with.
pub fn inherited(number: RawFd) -> io::Result<OwnedFd> {
    // SAFETY: the number is only looked at.
    if unsafe { libc::fcntl(number, libc::F_GETFD) } < 0 {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: it is open, and each number is adopted once, at the start of the program that it was meant for.
    Ok(unsafe { OwnedFd::from_raw_fd(number) })
}

/// Closes, at the next exec, every descriptor from 3 on but those in `kept`.
pub fn close_on_exec_but(kept: std::ops::RangeInclusive<RawFd>) {
    for number in (3..1024).filter(|number| !kept.contains(number)) {
        // SAFETY: setting a flag of a number that is not open fails and does nothing.
        unsafe { libc::fcntl(number, libc::F_SETFD, libc::FD_CLOEXEC) };
    }
}

/// SCHED_FIFO at `priority` for this thread and none of its children; refused without the privilege, and then it goes on.
pub fn ask_for_priority(priority: i32) -> bool {
    let parameters = libc::sched_param { sched_priority: priority };
    // SAFETY: 0 names the calling thread; the structure lives across the call.
    unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, &parameters) == 0 }
}

/// Locks what is touched into memory.
pub fn lock_memory() {
    // SAFETY: no memory is passed; a refusal leaves things as they are.
    unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE | libc::MCL_ONFAULT) };
}

/// The signals that the root waits for, blocked.
pub struct Waiting(libc::sigset_t);

impl Waiting {
    /// Blocks them: from now on they are only ever taken by `next`.
    pub fn for_signals(signals: &[i32]) -> Waiting {
        // SAFETY: an all-zero set is valid, and the calls fill it in.
        unsafe {
            let mut set: libc::sigset_t = std::mem::zeroed();
            libc::sigemptyset(&mut set);
            for signal in signals {
                libc::sigaddset(&mut set, *signal);
            }
            libc::sigprocmask(libc::SIG_BLOCK, &set, ptr::null_mut());
            Waiting(set)
        }
    }

    /// Sleeps until one comes.
    pub fn next(&self) -> i32 {
        // SAFETY: the set lives across the call; no information is asked for.
        unsafe { libc::sigwaitinfo(&self.0, ptr::null_mut()) }
    }
}

/// A program and its arguments, ready to be started again and again.
pub struct Program {
    path: CString,
    _arguments: Vec<CString>,
    pointers: Vec<*mut libc::c_char>,
}

impl Program {
    /// `path` with all its arguments, the program's name first.
    pub fn new(path: CString, arguments: Vec<CString>) -> Program {
        let pointers = arguments.iter().map(|argument| argument.as_ptr().cast_mut()).chain([ptr::null_mut()]).collect();
        Program { path, _arguments: arguments, pointers }
    }

    /// Starts it with this process' environment, default signals and the descriptors that are not close-on-exec.
    pub fn start(&self) -> io::Result<Pid> {
        unsafe extern "C" {
            static environ: *const *mut libc::c_char;
        }
        let mut pid = 0;
        // SAFETY: attributes are initialised before use and destroyed after; path, arguments and environment are
        // NUL-terminated and outlive the call.
        let status = unsafe {
            let mut attributes: libc::posix_spawnattr_t = std::mem::zeroed();
            let mut set: libc::sigset_t = std::mem::zeroed();
            libc::posix_spawnattr_init(&mut attributes);
            libc::sigemptyset(&mut set);
            libc::posix_spawnattr_setsigmask(&mut attributes, &set);
            libc::sigfillset(&mut set);
            libc::posix_spawnattr_setsigdefault(&mut attributes, &set);
            let flags = libc::POSIX_SPAWN_SETSIGMASK | libc::POSIX_SPAWN_SETSIGDEF;
            libc::posix_spawnattr_setflags(&mut attributes, flags as libc::c_short);
            let status = libc::posix_spawn(
                &mut pid,
                self.path.as_ptr(),
                ptr::null(),
                &attributes,
                self.pointers.as_ptr(),
                environ,
            );
            libc::posix_spawnattr_destroy(&mut attributes);
            status
        };
        match (status, Pid::from_raw(pid)) {
            (0, Some(pid)) => Ok(pid),
            _ => Err(io::Error::from_raw_os_error(status)),
        }
    }
}

/// Becomes the program `path`; returns only why not.
pub fn become_program(path: &CStr, arguments: &[CString]) -> io::Error {
    let mut pointers: Vec<*const libc::c_char> = arguments.iter().map(|argument| argument.as_ptr()).collect();
    pointers.push(ptr::null());
    // SAFETY: path and arguments are NUL-terminated and outlive the call.
    unsafe { libc::execv(path.as_ptr(), pointers.as_ptr()) };
    io::Error::last_os_error()
}

/// Puts `descriptor` at `number`, to be inherited.
pub fn place(descriptor: BorrowedFd<'_>, number: RawFd) -> io::Result<()> {
    // SAFETY: both are numbers; what was at `number` is closed, and this process keeps nothing there.
    match unsafe { libc::dup2(descriptor.as_raw_fd(), number) } {
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

fn information(process: impl AsFd) -> Option<libc::pidfd_info> {
    // SAFETY: all-zero is a valid value of a structure of numbers; the kernel writes at most its size.
    unsafe {
        let mut info: libc::pidfd_info = std::mem::zeroed();
        info.mask = u64::from(libc::PIDFD_INFO_EXIT);
        let got = libc::ioctl(process.as_fd().as_raw_fd(), libc::PIDFD_GET_INFO, &mut info);
        (got == 0 && info.mask & u64::from(libc::PIDFD_INFO_EXIT) != 0).then_some(info)
    }
}

/// The wait status of a process that somebody else has reaped (Linux 6.15; `None` before, or while it is not reaped).
pub fn exit_of(process: impl AsFd) -> Option<i32> {
    information(process).map(|info| info.exit_code)
}

/// Whether the process has been reaped.
pub fn is_reaped(process: impl AsFd) -> bool {
    information(process).is_some()
}
