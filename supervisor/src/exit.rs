//! How a process ended, in words that a person can act on.

use std::fmt;

/// The end of a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// It left by itself with this exit code.
    Code(i32),
    /// A signal ended it.
    Signal {
        /// Number of the signal.
        signal: i32,
        /// Whether the kernel wrote a core dump.
        core: bool,
    },
    /// It never ran: the operating system's error number.
    NotStarted(i32),
    /// It is gone, but somebody else in this process has taken its exit status.
    Unknown,
}

impl Exit {
    /// What a wait status says.
    pub(crate) fn of_status(status: i32) -> Exit {
        match libc::WIFSIGNALED(status) {
            true => Exit::Signal { signal: libc::WTERMSIG(status), core: libc::WCOREDUMP(status) },
            false => Exit::Code(libc::WEXITSTATUS(status)),
        }
    }

    /// Whether the process ended as a program does that has finished its work.
    pub fn is_success(self) -> bool {
        self == Exit::Code(0)
    }

    /// Whether this is how a process ends that was asked to stop: by itself, or by SIGTERM or SIGINT.
    pub fn is_obedient(self) -> bool {
        matches!(self, Exit::Code(0) | Exit::Signal { signal: libc::SIGTERM | libc::SIGINT, .. })
    }
}

impl fmt::Display for Exit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Exit::Code(code) => write!(f, "exited with code {code}"),
            Exit::Signal { signal, core } => {
                let core = if core { ", core dumped" } else { "" };
                write!(f, "killed by {}{core}", signal_name(signal))
            }
            Exit::Unknown => f.write_str("ended; its exit status was taken by somebody else"),
            Exit::NotStarted(error) => {
                write!(f, "could not be started: {}", std::io::Error::from_raw_os_error(error))
            }
        }
    }
}

/// Name of a signal as the manual spells it; real-time signals by number.
pub fn signal_name(signal: i32) -> String {
    let name = match signal {
        libc::SIGHUP => "SIGHUP",
        libc::SIGINT => "SIGINT",
        libc::SIGQUIT => "SIGQUIT",
        libc::SIGILL => "SIGILL",
        libc::SIGTRAP => "SIGTRAP",
        libc::SIGABRT => "SIGABRT",
        libc::SIGBUS => "SIGBUS",
        libc::SIGFPE => "SIGFPE",
        libc::SIGKILL => "SIGKILL",
        libc::SIGUSR1 => "SIGUSR1",
        libc::SIGSEGV => "SIGSEGV",
        libc::SIGUSR2 => "SIGUSR2",
        libc::SIGPIPE => "SIGPIPE",
        libc::SIGALRM => "SIGALRM",
        libc::SIGTERM => "SIGTERM",
        libc::SIGXCPU => "SIGXCPU",
        libc::SIGXFSZ => "SIGXFSZ",
        libc::SIGSYS => "SIGSYS",
        other => return format!("signal {other}"),
    };
    name.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_is_told_in_words() {
        assert_eq!(Exit::Code(3).to_string(), "exited with code 3");
        assert_eq!(Exit::Signal { signal: 9, core: false }.to_string(), "killed by SIGKILL");
        assert_eq!(Exit::Signal { signal: 11, core: true }.to_string(), "killed by SIGSEGV, core dumped");
        assert_eq!(Exit::Signal { signal: 40, core: false }.to_string(), "killed by signal 40");
        assert!(Exit::NotStarted(libc::ENOENT).to_string().contains("No such file"));
    }

    #[test]
    fn only_a_requested_end_counts_as_obedient() {
        assert!(Exit::Code(0).is_obedient() && Exit::Signal { signal: 15, core: false }.is_obedient());
        assert!(!Exit::Signal { signal: 9, core: false }.is_obedient() && !Exit::Code(1).is_obedient());
    }
}
