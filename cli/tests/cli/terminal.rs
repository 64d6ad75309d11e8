//! A terminal of the test's own: a pseudo-terminal that answers what programs ask of terminals.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::fs::OpenOptions;
use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};

/// What the terminal tells of keys.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Keys {
    /// Presses and repeats.
    Plain,
    /// Releases too (kitty keyboard protocol).
    Kitty,
}

/// A program on a terminal.
pub struct Terminal {
    master: OwnedFd,
    pub child: Child,
    keys: Keys,
    pub screen: String,
}

impl Terminal {
    pub fn run(mut command: Command, keys: Keys) -> Terminal {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        tcsetwinsize(&master, Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let side = || Stdio::from(OpenOptions::new().read(true).write(true).open(&name).unwrap());
        let child = command.env("TERM", "xterm-256color").stdin(side()).stdout(side()).stderr(side()).spawn().unwrap();
        Terminal { master, child, keys, screen: String::new() }
    }

    /// Takes the terminal away, as a window that is closed does.
    pub fn hang_up(&mut self) {
        self.master = OpenOptions::new().read(true).open("/dev/null").unwrap().into();
    }

    pub fn press(&self, keys: &str) {
        rustix::io::write(&self.master, keys.as_bytes()).unwrap();
    }

    /// Reads what the program has drawn, and answers its questions; `answer` says whether it still may.
    pub fn serve(&mut self, answer: bool) {
        let mut buffer = [0; 4096];
        let now = Timespec { tv_sec: 0, tv_nsec: 1_000_000 };
        while poll(&mut [PollFd::new(&self.master, PollFlags::IN)], Some(&now)).unwrap() > 0 {
            // The other side closed: nothing more will come.
            let Ok(count @ 1..) = rustix::io::read(&self.master, &mut buffer) else { return };
            let text = String::from_utf8_lossy(&buffer[..count]).into_owned();
            if answer {
                if text.contains("\x1b[?u") && self.keys == Keys::Kitty {
                    self.press("\x1b[?0u");
                }
                (0..text.matches("\x1b[c").count()).for_each(|_| self.press("\x1b[?62c"));
                (0..text.matches("\x1b[6n").count()).for_each(|_| self.press("\x1b[1;1R"));
            }
            self.screen += &text;
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
