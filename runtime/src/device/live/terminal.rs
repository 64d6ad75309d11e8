//! Opening terminals: serial ports and the client's side of pseudo-terminals.

use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;

use rustix::fs::{Mode, OFlags, fstat, major, open};
use rustix::termios::{
    ControlModes, InputModes, OptionalActions, QueueSelector, SpecialCodeIndex, Termios, ioctl_tiocexcl, tcflush,
    tcgetattr, tcsetattr,
};

use crate::device::WhyClosed;

/// Device numbers of the pseudo-terminals' clients' sides (Unix98).
const PTY_MAJORS: std::ops::RangeInclusive<u32> = 136..=143;

/// Opens the terminal at `path`, raw, at `baud` when it has a rate. Never waits for a carrier.
pub(super) fn open_terminal(path: &Path, baud: Option<u32>) -> Result<OwnedFd, WhyClosed> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let port = open(path, flags, Mode::empty()).map_err(WhyClosed::from_errno)?;
    let is_pty = PTY_MAJORS.contains(&major(fstat(&port).map_err(WhyClosed::from_errno)?.st_rdev));
    set_raw(&port, baud)?;
    if !is_pty {
        // Two drivers on one port make each other's nonsense. Not on a pseudo-terminal: its server keeps it, and an
        // exclusive one could not be opened again.
        ioctl_tiocexcl(&port).map_err(WhyClosed::from_errno)?;
        // What the device said to nobody is old. What a server says is not: it may have begun before this side opened.
        tcflush(&port, QueueSelector::IOFlush).map_err(WhyClosed::from_errno)?;
    }
    if let (Some(wanted), false) = (baud, is_pty) {
        check_rate(tcgetattr(&port).map_err(WhyClosed::from_errno)?.output_speed(), wanted)?;
    }
    Ok(port)
}

/// Raw bytes, 8N1, no flow control, no attention to modem lines, at `baud` when given.
pub(super) fn set_raw(port: impl AsFd, baud: Option<u32>) -> Result<(), WhyClosed> {
    let mut settings: Termios = tcgetattr(&port).map_err(WhyClosed::from_errno)?;
    settings.make_raw();
    settings.input_modes.remove(InputModes::IXOFF | InputModes::IXANY);
    settings.control_modes.remove(ControlModes::CSTOPB | ControlModes::CRTSCTS | ControlModes::PARENB);
    settings.control_modes.insert(ControlModes::CLOCAL | ControlModes::CREAD);
    // A read without bytes is then "again", not the end.
    settings.special_codes[SpecialCodeIndex::VMIN] = 1;
    settings.special_codes[SpecialCodeIndex::VTIME] = 0;
    if let Some(baud) = baud {
        settings.set_speed(baud).map_err(|_| WhyClosed::WrongRate)?;
    }
    tcsetattr(&port, OptionalActions::Now, &settings).map_err(WhyClosed::from_errno)
}

/// Ports fall back to another rate in silence; a line at a wrong rate delivers garbage.
fn check_rate(found: u32, wanted: u32) -> Result<(), WhyClosed> {
    match found != 0 && found.abs_diff(wanted) > wanted / 20 {
        true => Err(WhyClosed::WrongRate),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_within_a_twentieth_will_do() {
        assert_eq!(check_rate(115_107, 115_200), Ok(()));
        assert_eq!(check_rate(9_600, 500_000), Err(WhyClosed::WrongRate));
        assert_eq!(check_rate(0, 9_600), Ok(()));
    }

    #[test]
    fn what_is_no_terminal_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert_eq!(open_terminal(file.path(), None).unwrap_err(), WhyClosed::NotATerminal);
        assert_eq!(open_terminal(Path::new("/dev"), None).unwrap_err(), WhyClosed::NotATerminal);
        assert_eq!(open_terminal(Path::new("/dev/no_such_port"), Some(9600)).unwrap_err(), WhyClosed::NoSuchPort);
    }
}
