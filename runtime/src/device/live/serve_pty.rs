//! The server's side of a pseudo-terminal: makes one, links it to the address's path, and notices clients.
//!
//! While no client has the terminal open, its master says "hung up" to every poll: it is left out of the poll, and the
//! kernel's file notifications say when a client opens it. So an idle server uses no processor.

use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::inotify::{self, CreateFlags, WatchFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, ioctl_tiocgptpeer, openpt, ptsname, unlockpt};
use rustix::termios::{QueueSelector, tcflush};

use super::backoff::BackOff;
use super::stream::Stream;
use super::terminal::set_raw;
use crate::Time;
use crate::device::{Address, WhyClosed};

/// How often to look for a client where the kernel gives no notifications.
const LOOK_S: f64 = 0.1;

/// Makes a pseudo-terminal and notices who opens it.
pub(super) struct ServePty {
    back_off: BackOff,
    terminal: Option<Terminal>,
}

struct Terminal {
    master: OwnedFd,
    /// Says when somebody opens the client's side; none where the kernel refuses.
    opens: Option<OwnedFd>,
    /// The client's side.
    name: PathBuf,
    /// The symbolic link to it.
    link: PathBuf,
}

impl ServePty {
    pub fn new() -> ServePty {
        ServePty { back_off: BackOff::new(), terminal: None }
    }

    pub fn advance(&mut self, now: Time, stream: &mut Stream) -> Option<Time> {
        if stream.wire.reopen.swap(false, Ordering::AcqRel) {
            // A client cannot be sent away; a new terminal leaves it with the old one, hung up.
            stream.close(WhyClosed::NoClient);
            self.terminal = None;
            self.back_off.hurry();
        }
        if let Err(_gone) = stream.flush() {
            self.client_gone(stream);
        }
        if self.terminal.is_none() && self.back_off.is_due(now) {
            match Terminal::make(&stream.wire.address) {
                Ok(terminal) => {
                    self.terminal = Some(terminal);
                    self.back_off.rest();
                    stream.close(WhyClosed::NoClient);
                }
                Err(why) => {
                    stream.close(why);
                    self.back_off.failed(now);
                }
            }
        }
        self.look_for_client(now, stream);
        match (&self.terminal, &stream.line) {
            // Somebody came while the last client was seen off, and that notification has been taken.
            (Some(terminal), None) if terminal.has_client() => Some(now),
            (Some(Terminal { opens: None, .. }), None) => Some(now.after_s(LOOK_S)),
            _ => self.back_off.next(),
        }
    }

    fn look_for_client(&mut self, now: Time, stream: &mut Stream) {
        let Some(terminal) = self.terminal.as_ref().filter(|_| stream.line.is_none()) else { return };
        if !terminal.has_client() {
            return;
        }
        // The stream gets a descriptor of its own, so that the terminal outlives the client.
        if let Ok(descriptor) = rustix::io::fcntl_dupfd_cloexec(&terminal.master, 0) {
            stream.open(descriptor, false);
            if stream.read(now).is_err() {
                self.client_gone(stream);
            }
        }
    }

    fn client_gone(&mut self, stream: &mut Stream) {
        stream.close(WhyClosed::NoClient);
        if let Some(terminal) = &self.terminal {
            terminal.tidy();
        }
    }

    pub fn watch<'a>(&'a self, stream: &'a Stream, descriptors: &mut Vec<PollFd<'a>>) {
        if let Some(line) = &stream.line {
            descriptors.push(PollFd::from_borrowed_fd(line.descriptor.as_fd(), stream.interest()));
        } else if let Some(opens) = self.terminal.as_ref().and_then(|terminal| terminal.opens.as_ref()) {
            descriptors.push(PollFd::from_borrowed_fd(opens.as_fd(), PollFlags::IN));
        }
    }

    pub fn ready(&mut self, now: Time, stream: &mut Stream, events: &[PollFlags]) {
        let Some(events) = events.first().copied().filter(|events| !events.is_empty()) else { return };
        if stream.line.is_some() {
            if stream.ready(now, events).is_err() {
                self.client_gone(stream);
            }
        } else if let Some(terminal) = &self.terminal {
            // The next advance looks who is there.
            terminal.forget_notifications();
        }
    }

    pub fn close(&mut self) {
        self.terminal = None;
    }
}

impl Terminal {
    fn make(address: &Address) -> Result<Terminal, WhyClosed> {
        let Address::Pty { path: link } = address else { return Err(WhyClosed::NotPossible) };
        let (master, name) = make_pty().map_err(WhyClosed::from_errno)?;
        let terminal = Terminal { opens: watch_opens(&name).ok(), master, name, link: link.clone() };
        terminal.tidy();
        share(&terminal.name, link);
        place_link(&terminal.name, link).map_err(WhyClosed::from_errno)?;
        Ok(terminal)
    }

    /// Whether somebody has the client's side open, or has left bytes.
    fn has_client(&self) -> bool {
        let mut master = [PollFd::new(&self.master, PollFlags::IN)];
        let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
        let looked = poll(&mut master, Some(&at_once)).is_ok();
        let events = master[0].revents();
        looked && (events.contains(PollFlags::IN) || !events.contains(PollFlags::HUP))
    }

    /// Makes the terminal as the next client expects it: raw, whatever the last one set, and without bytes for that one.
    /// Opening and closing the client's side also lets the master say "hung up" from the first.
    fn tidy(&self) {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        if let Ok(client) = ioctl_tiocgptpeer(&self.master, flags) {
            // Neither can be refused on a terminal of our own; a client sets what it needs anyhow.
            let _ = set_raw(&client, None);
            let _ = tcflush(&client, QueueSelector::IFlush);
        }
        self.forget_notifications();
    }

    fn forget_notifications(&self) {
        let mut buffer = [0; 1024];
        while let Some(Ok(1..)) = self.opens.as_ref().map(|opens| rustix::io::read(opens, &mut buffer)) {}
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // Unless a successor's link stands there already.
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.name) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}

fn make_pty() -> Result<(OwnedFd, PathBuf), Errno> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    rustix::io::ioctl_fionbio(&master, true)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let name = ptsname(&master, Vec::new())?;
    Ok((master, PathBuf::from(std::ffi::OsStr::from_bytes(name.as_bytes()))))
}

/// Whoever the link's folder is shared with may open the terminal: the folder's group, where that is not this process's.
fn share(name: &Path, link: &Path) {
    let Some(folder) = link.parent().and_then(|folder| rustix::fs::stat(folder).ok()) else { return };
    if folder.st_gid == rustix::process::getegid().as_raw() {
        return;
    }
    let group = rustix::fs::Gid::from_raw(folder.st_gid);
    // Not a member of the group: then the terminal stays this user's alone.
    if rustix::fs::chownat(rustix::fs::CWD, name, None, Some(group), rustix::fs::AtFlags::empty()).is_ok() {
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR | rustix::fs::Mode::RGRP | rustix::fs::Mode::WGRP;
        let _ = rustix::fs::chmod(name, mode);
    }
}

fn watch_opens(name: &Path) -> Result<OwnedFd, Errno> {
    let opens = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
    inotify::add_watch(&opens, name, WatchFlags::OPEN)?;
    Ok(opens)
}

/// Puts a symbolic link to `target` at `link`. A link that is there is replaced (a killed server leaves one); anything
/// else is somebody's.
fn place_link(target: &Path, link: &Path) -> Result<(), Errno> {
    let kernel = |error: std::io::Error| Errno::from_io_error(&error).unwrap_or(Errno::IO);
    match std::fs::symlink_metadata(link) {
        Ok(found) if !found.is_symlink() => return Err(Errno::EXIST),
        _ => {}
    }
    let mut aside = link.as_os_str().to_owned();
    aside.push(format!(".{}", std::process::id()));
    let _ = std::fs::remove_file(&aside);
    std::os::unix::fs::symlink(target, &aside).map_err(kernel)?;
    std::fs::rename(&aside, link).map_err(kernel)
}
