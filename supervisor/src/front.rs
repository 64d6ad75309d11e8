//! The program that a person started: it starts the tree, tells what it hears, and passes wishes on.

use std::ffi::OsString;
use std::io::{self, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::net::{AddressFamily, SocketFlags, SocketType, socketpair};
use rustix::process::{Pid, PidfdFlags, pidfd_open};

use crate::control::StopHandle;
use crate::observer::{Guarded, Observer, Outcome, Report, StopCause};
use crate::run::{SuperviseError, system};
use crate::signals::Signals;
use crate::telling::{Ask, Heard, Telling, hear, tell};

/// A robot to be started as a tree of processes.
#[derive(Debug)]
pub struct Front {
    /// The program that calls `prepare`, and its arguments.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
    /// What it reads from its standard input.
    pub input: Vec<u8>,
    /// Ends the run from another thread.
    pub stop: Option<StopHandle>,
}

/// Runs the robot until it is stopped; returns when nothing of it is left.
pub fn run_tree(front: Front, observer: &mut dyn Observer) -> Result<Outcome, SuperviseError> {
    let mut signals = Signals::catch().map_err(system("catch signals"))?;
    let (own, theirs) = socketpair(AddressFamily::UNIX, SocketType::SEQPACKET, SocketFlags::CLOEXEC, None)
        .map_err(|error| system("make a socket")(error.into()))?;
    let mut child = start(&front, &theirs).map_err(system("start the process tree"))?;
    drop(theirs);
    let root = Pid::from_raw(child.id() as i32).map(|pid| pidfd_open(pid, PidfdFlags::empty()));
    let Some(Ok(root)) = root else {
        let _ = child.kill();
        return Err(system("watch the process tree")(io::ErrorKind::NotFound.into()));
    };
    let mut observer = Guarded::new(observer);
    let mut told = Told { outcome: None, refused: None, interrupts: 0, stops: 0 };
    loop {
        let stop_handle = front.stop.as_ref().map(StopHandle::requested);
        let mut polled = vec![
            PollFd::new(&own, PollFlags::IN),
            PollFd::new(&root, PollFlags::IN),
            PollFd::from_borrowed_fd(signals.arrival(), PollFlags::IN),
        ];
        polled.extend(stop_handle.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)));
        let _ = poll(&mut polled, None);
        let ended = !polled[1].revents().is_empty();
        told.listen(&own, &mut observer);
        told.pass_signals(&own, &mut signals, &mut observer);
        if let Some(stop) = &front.stop {
            for _ in 0..stop.take() {
                told.stops += 1;
                tell(&own, &Ask { cause: StopCause::Program, at_once: told.stops > 1 });
            }
        }
        if observer.has_panicked() && told.stops == 0 {
            told.stops = 1;
            tell(&own, &Ask { cause: StopCause::Program, at_once: false });
        }
        if ended {
            break;
        }
    }
    let status = child.wait();
    told.listen(&own, &mut observer);
    observer.resume();
    match (told.outcome, told.refused) {
        (Some(outcome), _) => Ok(outcome),
        (None, Some(refused)) => Err(refused),
        (None, None) => Err(SuperviseError::Lost(match status {
            Ok(status) => status.to_string(),
            Err(error) => error.to_string(),
        })),
    }
}

struct Told {
    outcome: Option<Outcome>,
    refused: Option<SuperviseError>,
    interrupts: u32,
    stops: u32,
}

impl Told {
    fn listen(&mut self, own: &OwnedFd, observer: &mut Guarded<'_>) {
        loop {
            match hear::<Telling>(own) {
                Heard::Some(Telling::Over(outcome)) => self.outcome = Some(*outcome),
                Heard::Some(Telling::Refused { message, flaw }) => {
                    self.refused = Some(match flaw {
                        true => SuperviseError::Plan(message),
                        false => SuperviseError::Fill(message),
                    });
                }
                Heard::Some(Telling::News(news)) => observer.report(news.report()),
                Heard::Nothing | Heard::Gone => return,
            }
        }
    }

    fn pass_signals(&mut self, own: &OwnedFd, signals: &mut Signals, observer: &mut Guarded<'_>) {
        for signal in signals.take() {
            if signal == libc::SIGTSTP {
                observer.report(Report::Note("not suspended: a robot must not drive unattended; Ctrl-C ends it"));
                continue;
            }
            self.interrupts += u32::from(signal == libc::SIGINT);
            let at_once = signal == libc::SIGINT && self.interrupts > 1;
            tell(own, &Ask { cause: StopCause::Signal(signal), at_once });
        }
    }
}

fn start(front: &Front, theirs: &OwnedFd) -> io::Result<Child> {
    // Through the standard output: the one descriptor that the standard library hands on under a known number.
    let mut child = Command::new(&front.program)
        .args(&front.arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::from(theirs.try_clone()?))
        .spawn()?;
    if let Some(mut input) = child.stdin.take() {
        // One that has ended already says why by its socket.
        let _ = input.write_all(&front.input);
    }
    Ok(child)
}

/// The preparing program's connection to the front: its standard output.
pub fn front_connection() -> io::Result<OwnedFd> {
    std::io::stdout().as_fd().try_clone_to_owned()
}

/// Tells the front why nothing was started.
pub fn refuse(front: &OwnedFd, error: &SuperviseError) {
    tell(front, &Telling::Refused { message: error.to_string(), flaw: matches!(error, SuperviseError::Plan(_)) });
}
