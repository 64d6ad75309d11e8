//! The few system calls that no library wraps safely: scheduling class, memory locks, signal handlers.
#![allow(unsafe_code)]

use rustix::io::Errno;
use std::sync::atomic::{AtomicBool, Ordering};

/// Puts the calling thread under SCHED_FIFO at `priority` (1–99).
pub fn set_fifo(priority: u8) -> Result<(), Errno> {
    let parameters = libc::sched_param { sched_priority: i32::from(priority) };
    // SAFETY: 0 names the calling thread; the structure lives across the call.
    let status = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, &parameters) };
    if status == 0 { Ok(()) } else { Err(last_error()) }
}

/// Shifts the real-time priority of thread `tid` of any process by `by`, within 1 to 94; a thread without one is left
/// alone.
pub fn shift_fifo(tid: i32, by: i32) -> Result<(), Errno> {
    // SAFETY: a number goes in, a number comes out.
    let class = unsafe { libc::sched_getscheduler(tid) };
    if class < 0 {
        return Err(last_error());
    }
    if class & !libc::SCHED_RESET_ON_FORK != libc::SCHED_FIFO {
        return Ok(());
    }
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: the structure lives across the call.
    if unsafe { libc::sched_getparam(tid, &mut parameters) } != 0 {
        return Err(last_error());
    }
    parameters.sched_priority = (parameters.sched_priority + by).clamp(1, 94);
    // SAFETY: the structure lives across the call.
    let status = unsafe { libc::sched_setparam(tid, &parameters) };
    if status == 0 { Ok(()) } else { Err(last_error()) }
}

/// Gives back the pages of files that only the start has needed: code, tables and texts of parsing, opening, help.
/// Whatever runs from now on comes back page by page from the page cache, and stays. A process that has less mapped is
/// also dead sooner.
pub fn forget_startup_code() {
    let Ok(maps) = std::fs::read_to_string("/proc/self/smaps") else { return };
    let mut range = None;
    for line in maps.lines() {
        let mut words = line.split_ascii_whitespace();
        let (Some(first), second) = (words.next(), words.next()) else { continue };
        match (first, second) {
            // None of its pages was ever written (proc_pid_smaps(5)): relocated tables were.
            ("Anonymous:", Some("0")) => {
                if let Some((from, to)) = range.take() {
                    // SAFETY: the kernel has just named this range as a private, read-only map of a file of which no byte
                    // differs from the file: what is dropped is what the file holds, and the next access brings it back.
                    unsafe { libc::madvise(from as *mut libc::c_void, to - from, libc::MADV_DONTNEED_LOCKED) };
                }
            }
            (bounds, Some("r-xp" | "r--p")) => {
                let number = |hex: &str| usize::from_str_radix(hex, 16).ok();
                let both = bounds.split_once('-').and_then(|(from, to)| Some((number(from)?, number(to)?)));
                range = both.filter(|_| words.last().is_some_and(|file| file.starts_with('/')));
            }
            (bounds, Some(access)) if bounds.contains('-') && access.len() == 4 => range = None,
            _ => {}
        }
    }
}

/// Gives freed memory back to the kernel: before it is locked, for afterwards the kernel does not take it.
pub fn trim_heap() {
    #[cfg(target_env = "gnu")]
    // SAFETY: no memory is passed; the allocator takes its own lock.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Locks what is mapped and what will be touched into memory, page by page as it is touched.
pub fn lock_memory() -> Result<(), Errno> {
    // SAFETY: no memory is passed.
    let status = unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE | libc::MCL_ONFAULT) };
    if status == 0 { Ok(()) } else { Err(last_error()) }
}

/// Makes timers of the calling thread fire without the default slack of 50 µs.
pub fn no_timer_slack() {
    // SAFETY: PR_SET_TIMERSLACK takes a number.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64, 0_u64, 0_u64, 0_u64) };
}

/// Kills a real-time thread that computes longer than this without sleeping: SIGXCPU at `soft_us`, SIGKILL at twice that.
pub fn limit_runaway(soft_us: u64) -> Result<(), Errno> {
    let limit = libc::rlimit { rlim_cur: soft_us, rlim_max: soft_us * 2 };
    // SAFETY: the structure lives across the call.
    let status = unsafe { libc::setrlimit(libc::RLIMIT_RTTIME, &limit) };
    if status == 0 { Ok(()) } else { Err(last_error()) }
}

/// Touches `BYTES` of the calling thread's stack, so that no step pays for its pages.
#[inline(never)]
pub fn prefault_stack<const BYTES: usize>() {
    let mut pages = [0_u8; BYTES];
    for offset in (0..BYTES).step_by(4096) {
        // SAFETY: offset lies inside the array; a volatile write cannot be left out.
        unsafe { pages.as_mut_ptr().add(offset).write_volatile(1) };
    }
}

static STOP: AtomicBool = AtomicBool::new(false);
static ON_STOP: std::sync::OnceLock<fn()> = std::sync::OnceLock::new();

extern "C" fn on_stop_signal(_signal: libc::c_int) {
    STOP.store(true, Ordering::SeqCst);
    if let Some(wake) = ON_STOP.get() {
        wake();
    }
}

/// Lets SIGTERM and SIGINT set the stop flag and call `wake`, which must be async-signal-safe.
pub fn catch_stop_signals(wake: fn()) {
    let _ = ON_STOP.set(wake);
    for signal in [libc::SIGTERM, libc::SIGINT] {
        // SAFETY: an all-zero sigaction is a valid one; the handler stores an atomic and calls `wake`.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = on_stop_signal as extern "C" fn(libc::c_int) as usize;
            action.sa_flags = libc::SA_RESTART;
            libc::sigaction(signal, &action, std::ptr::null_mut());
        }
    }
}

/// Whether a stop has been asked for.
pub fn stop_requested() -> bool {
    STOP.load(Ordering::SeqCst)
}

/// Asks this process to stop, as SIGTERM does.
pub fn request_stop() {
    on_stop_signal(0);
}

/// Writes one byte to the descriptor that this process inherited for saying that it is ready, and closes it.
pub fn report_ready(descriptor: i32) -> Result<(), Errno> {
    use std::os::fd::{FromRawFd, OwnedFd};
    if descriptor < 3 {
        return Err(Errno::BADF);
    }
    // SAFETY: the supervisor handed this number over for this one use; nothing else in the process owns it. A number
    // that is open for something else would be the starter's error.
    let ready = unsafe { OwnedFd::from_raw_fd(descriptor) };
    rustix::io::write(&ready, &[1]).map(|_| ())
}

/// Says the same on a descriptor that is needed again: this process is ready to become ready.
pub fn report_waiting(descriptor: i32) -> Result<(), Errno> {
    if descriptor < 3 {
        return Err(Errno::BADF);
    }
    // SAFETY: the supervisor handed this number over, and it stays open until `report_ready`.
    let ready = unsafe { std::os::fd::BorrowedFd::borrow_raw(descriptor) };
    rustix::io::write(ready, &[1]).map(|_| ())
}

/// Waits for the word to go on descriptor `descriptor`: true when it came, false when its writer is gone or this
/// process is asked to stop. The descriptor is closed.
pub fn wait_for_go(descriptor: i32) -> bool {
    use std::os::fd::{FromRawFd, OwnedFd};
    if descriptor < 3 {
        return false;
    }
    // SAFETY: the supervisor handed this number over for this one use; nothing else in the process owns it.
    let go = unsafe { OwnedFd::from_raw_fd(descriptor) };
    // A signal ends the read; one that comes just before it is seen at the next turn.
    let turn = rustix::event::Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
    while !stop_requested() {
        let mut polled = [rustix::event::PollFd::new(&go, rustix::event::PollFlags::IN)];
        match rustix::event::poll(&mut polled, Some(&turn)) {
            Ok(0) | Err(Errno::INTR) => {}
            Ok(_) => return matches!(rustix::io::read(&go, &mut [0_u8; 1]), Ok(1)),
            Err(_) => return false,
        }
    }
    false
}

fn last_error() -> Errno {
    Errno::from_io_error(&std::io::Error::last_os_error()).unwrap_or(Errno::INVAL)
}
