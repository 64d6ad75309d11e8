//! The signals that a person or the system sends to the supervisor.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;

use signal_hook::iterator::backend::SignalDelivery;
use signal_hook::iterator::exfiltrator::SignalOnly;

/// SIGINT, SIGTERM and SIGHUP, caught in whatever thread they arrive; and SIGTSTP, because a stopped supervisor would
/// leave its robot driving unattended. They stay caught, without effect, after the run: the program is about to end.
#[derive(Debug)]
pub struct Signals(SignalDelivery<UnixStream, SignalOnly>);

impl Signals {
    /// Catches them from now on.
    pub fn catch() -> io::Result<Signals> {
        let (read, write) = UnixStream::pair()?;
        let signals = [libc::SIGINT, libc::SIGTERM, libc::SIGHUP, libc::SIGTSTP];
        Ok(Signals(SignalDelivery::with_pipe(read, write, SignalOnly, signals)?))
    }

    /// Becomes readable when one has come.
    pub fn arrival(&self) -> BorrowedFd<'_> {
        self.0.get_read().as_fd()
    }

    /// Those that have come since the last look.
    pub fn take(&mut self) -> Vec<i32> {
        self.0.pending().collect()
    }
}
