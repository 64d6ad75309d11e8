//! Turns SIGBUS on a mapped ring into a fault of that ring.
//!
//! Anybody who may write a ring's file may cut it off, and the next access to the map would kill the process. The
//! handler puts zeros under the map from the faulting page to its end and marks the ring; its readers report
//! `ReadError::Fault`, its writer `Published::lost`. An address outside the rings goes to the handler that was there before.

use std::io;
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use rustix::mm::{MapFlags, ProtFlags};

/// One mapped ring, as the handler sees it. Lives for ever, because a signal may be looking at it at any moment; used
/// again for the next map.
pub(super) struct Watch {
    start: AtomicUsize,
    end: AtomicUsize,
    faulted: AtomicBool,
    next: AtomicPtr<Watch>,
}

impl Watch {
    #[inline]
    pub fn faulted(&self) -> bool {
        self.faulted.load(Ordering::Relaxed)
    }
}

static FIRST: AtomicPtr<Watch> = AtomicPtr::new(ptr::null_mut());
static UNUSED: Mutex<Vec<&'static Watch>> = Mutex::new(Vec::new());
static PREVIOUS: OnceLock<libc::sigaction> = OnceLock::new();
static INSTALLED: OnceLock<Result<(), i32>> = OnceLock::new();

/// Watches over the map of `bytes` bytes at `start`.
pub(super) fn watch(start: usize, bytes: usize) -> io::Result<&'static Watch> {
    INSTALLED.get_or_init(install).map_err(io::Error::from_raw_os_error)?;
    let mut unused = UNUSED.lock().unwrap_or_else(PoisonError::into_inner);
    let watch = unused.pop().unwrap_or_else(|| {
        let fresh = Box::leak(Box::new(Watch {
            start: AtomicUsize::new(usize::MAX),
            end: AtomicUsize::new(0),
            faulted: AtomicBool::new(false),
            next: AtomicPtr::new(FIRST.load(Ordering::Acquire)),
        }));
        // Only pushed under the lock above, so the head cannot move in between.
        FIRST.store(fresh, Ordering::Release);
        fresh
    });
    watch.faulted.store(false, Ordering::SeqCst);
    watch.end.store(start + bytes.next_multiple_of(page_bytes()), Ordering::SeqCst);
    watch.start.store(start, Ordering::SeqCst);
    Ok(watch)
}

/// Ends the watch; the map must still be there, so that nobody else's map can be under its addresses.
pub(super) fn release(watch: &'static Watch) {
    watch.start.store(usize::MAX, Ordering::SeqCst);
    watch.end.store(0, Ordering::SeqCst);
    UNUSED.lock().unwrap_or_else(PoisonError::into_inner).push(watch);
}

/// Fixed by the first call, which is not the handler's: `watch` asks before any page can fail.
fn page_bytes() -> usize {
    rustix::param::page_size()
}

fn install() -> Result<(), i32> {
    let errno = || io::Error::last_os_error().raw_os_error().unwrap_or(libc::EINVAL);
    // SAFETY: sigaction is plain data for which zero is a value; both pointers are to live locals; the handler is a
    // function of the signature that SA_SIGINFO asks for and keeps to what a signal may do.
    unsafe {
        let mut previous: libc::sigaction = std::mem::zeroed();
        if libc::sigaction(libc::SIGBUS, ptr::null(), &mut previous) != 0 {
            return Err(errno());
        }
        // Before ours is in place: the handler must find it.
        let _ = PREVIOUS.set(previous);
        let mut ours: libc::sigaction = std::mem::zeroed();
        ours.sa_sigaction = on_bus_error as *const () as usize;
        ours.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        libc::sigemptyset(&mut ours.sa_mask);
        if libc::sigaction(libc::SIGBUS, &ours, ptr::null_mut()) != 0 {
            return Err(errno());
        }
    }
    Ok(())
}

extern "C" fn on_bus_error(signal: libc::c_int, info: *mut libc::siginfo_t, context: *mut libc::c_void) {
    // SAFETY: the kernel passes a valid siginfo to an SA_SIGINFO handler; si_addr is set when si_code is positive.
    let (code, address) = unsafe { ((*info).si_code, (*info).si_addr() as usize) };
    if code > 0 && patch(address) {
        return;
    }
    pass_on(signal, info, context, code);
}

/// Puts zeros from the page of `address` to the end of its ring; false when it belongs to no ring. A truncated file
/// has lost all that follows, so one signal is enough.
fn patch(address: usize) -> bool {
    let mut next = FIRST.load(Ordering::Acquire);
    // SAFETY: watches are leaked, so every pointer in the list is valid for ever.
    while let Some(watch) = unsafe { next.as_ref() } {
        let (start, end) = (watch.start.load(Ordering::SeqCst), watch.end.load(Ordering::SeqCst));
        if start <= address && address < end {
            // The mark first: whoever reads a zero of ours must find it.
            watch.faulted.store(true, Ordering::SeqCst);
            let page = address & !(page_bytes() - 1);
            // Writable for readers too: the kernel refuses to sleep on a read-only page that nobody can change, and a
            // waiter would spin.
            let protection = ProtFlags::READ | ProtFlags::WRITE;
            let flags = MapFlags::PRIVATE | MapFlags::FIXED;
            // SAFETY: the range lies within a map of ours, of whose bytes Rust knows nothing but that they are atomics;
            // zeros are as good as any others. mmap is a bare system call here and keeps errno.
            let put = unsafe { rustix::mm::mmap_anonymous(page as *mut _, end - page, protection, flags) };
            return put.is_ok();
        }
        next = watch.next.load(Ordering::Acquire);
    }
    false
}

/// Does what would have been done without this module.
fn pass_on(signal: libc::c_int, info: *mut libc::siginfo_t, context: *mut libc::c_void, code: libc::c_int) {
    let previous = PREVIOUS.get();
    let action = previous.map_or(libc::SIG_DFL, |p| p.sa_sigaction);
    let with_info = previous.is_some_and(|p| p.sa_flags & libc::SA_SIGINFO != 0);
    // SAFETY: the previous action, as the kernel gave it: either one of the two constants or a handler of the signature
    // that its flags tell. Restoring the default lets the faulting instruction, or the raise, end the process.
    unsafe {
        match action {
            libc::SIG_IGN if code <= 0 => {}
            libc::SIG_DFL | libc::SIG_IGN => {
                let mut default: libc::sigaction = std::mem::zeroed();
                default.sa_sigaction = libc::SIG_DFL;
                libc::sigaction(signal, &default, ptr::null_mut());
                if code <= 0 {
                    libc::raise(signal);
                }
            }
            _ if with_info => {
                let handler: extern "C" fn(libc::c_int, *mut libc::siginfo_t, *mut libc::c_void) =
                    std::mem::transmute(action);
                handler(signal, info, context);
            }
            _ => {
                let handler: extern "C" fn(libc::c_int) = std::mem::transmute(action);
                handler(signal);
            }
        }
    }
}
