//! The robot's end of a pseudo-terminal.

use runtime::Time;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::io;
use std::os::fd::OwnedFd;

/// Robot's end and name of the client's.
pub struct Pty {
    robot: OwnedFd,
    /// Kept open, so that the robot's end never reads an error while no client is there.
    _client: OwnedFd,
    name: String,
}

impl Pty {
    /// A pair in raw mode.
    pub fn open() -> io::Result<Pty> {
        let robot = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&robot)?;
        unlockpt(&robot)?;
        let name = ptsname(&robot, Vec::new())?.into_string().map_err(io::Error::other)?;
        let client = rustix::fs::open(&name, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut mode = tcgetattr(&client)?;
        mode.make_raw();
        tcsetattr(&client, OptionalActions::Now, &mode)?;
        rustix::io::ioctl_fionbio(&robot, true)?;
        Ok(Pty { robot, _client: client, name })
    }

    /// Path of the client's end.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Writes all of `bytes`; an error when the client does not read.
    pub fn write(&self, bytes: &[u8]) -> io::Result<()> {
        match rustix::io::write(&self.robot, bytes)? {
            count if count == bytes.len() => Ok(()),
            _ => Err(io::Error::other("the client does not read its end of the terminal")),
        }
    }

    /// Bytes from the client into `buffer`; sleeps until some come or until `until`, then 0.
    pub fn read(&self, buffer: &mut [u8], now: Time, until: Time) -> io::Result<usize> {
        let wait_ns = until.nanos().saturating_sub(now.nanos());
        let wait = Timespec { tv_sec: (wait_ns / 1_000_000_000) as i64, tv_nsec: (wait_ns % 1_000_000_000) as i64 };
        match poll(&mut [PollFd::new(&self.robot, PollFlags::IN)], Some(&wait)) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(e) => return Err(e.into()),
        }
        match rustix::io::read(&self.robot, buffer) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(e) => Err(e.into()),
        }
    }
}
