//! What passes between the supervisor and the program that started the robot: one JSON object per packet.
//!
//! A packet that the other end does not take at once is lost: a slow terminal never holds a supervisor.

use std::os::fd::OwnedFd;

use rustix::net::{RecvFlags, SendFlags, recv, send};
use serde::{Deserialize, Serialize};

use crate::incidents::Record;
use crate::observer::{Guarded, Observer, Outcome, Report, StopCause};
use crate::state::RobotState;

/// Longest packet [byte].
const PACKET_BYTES: usize = 160 << 10;

/// From the robot's side.
#[derive(Debug, Serialize, Deserialize)]
pub enum Telling {
    /// Nothing was started.
    Refused {
        /// Why.
        message: String,
        /// Whether the plan contradicts itself.
        flaw: bool,
    },
    /// As [`Report::Note`].
    Note(String),
    /// As [`Report::Started`].
    Started {
        /// Node.
        instance: String,
        /// Its process.
        pid: i32,
        /// Processes before.
        restarts: u32,
    },
    /// As [`Report::Ready`].
    Ready {
        /// Node.
        instance: String,
    },
    /// As [`Report::Incident`].
    Incident(Box<Record>),
    /// As [`Report::Robot`].
    Robot(RobotState),
    /// The run is over.
    Over(Box<Outcome>),
}

/// From the program that started the robot.
#[derive(Debug, Serialize, Deserialize)]
pub struct Ask {
    /// Why it is to stop.
    pub cause: StopCause,
    /// Without grace.
    pub at_once: bool,
}

impl Telling {
    /// What there is to tell.
    pub fn of(report: Report<'_>) -> Telling {
        match report {
            Report::Note(text) => Telling::Note(text.to_owned()),
            Report::Started { instance, pid, restarts } => {
                Telling::Started { instance: instance.to_owned(), pid, restarts }
            }
            Report::Ready { instance } => Telling::Ready { instance: instance.to_owned() },
            Report::Incident(record) => Telling::Incident(Box::new(record.clone())),
            Report::Robot(state) => Telling::Robot(state),
        }
    }

    /// Tells `observer`, if it is for one.
    pub fn pass_on(&self, observer: &mut Guarded<'_>) {
        match self {
            Telling::Note(text) => observer.report(Report::Note(text)),
            Telling::Started { instance, pid, restarts } => {
                observer.report(Report::Started { instance, pid: *pid, restarts: *restarts });
            }
            Telling::Ready { instance } => observer.report(Report::Ready { instance }),
            Telling::Incident(record) => observer.report(Report::Incident(record)),
            Telling::Robot(state) => observer.report(Report::Robot(*state)),
            Telling::Refused { .. } | Telling::Over(_) => {}
        }
    }
}

/// Sends without waiting.
pub fn tell(socket: &OwnedFd, what: &impl Serialize) {
    if let Ok(bytes) = serde_json::to_vec(what) {
        let _ = send(socket, &bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL);
    }
}

/// What has come.
#[derive(Debug)]
pub enum Heard<T> {
    /// This.
    Some(T),
    /// Nothing now.
    Nothing,
    /// The other end is gone.
    Gone,
}

/// Takes one packet without waiting.
pub fn hear<T: for<'de> Deserialize<'de>>(socket: &OwnedFd) -> Heard<T> {
    let mut packet = vec![0; PACKET_BYTES];
    match recv(socket, &mut packet[..], RecvFlags::DONTWAIT) {
        Ok((0, _)) => Heard::Gone,
        Ok((length, _)) => {
            serde_json::from_slice(&packet[..length.min(PACKET_BYTES)]).map_or(Heard::Nothing, Heard::Some)
        }
        Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => Heard::Nothing,
        Err(_) => Heard::Gone,
    }
}

/// An observer that tells whoever is at the other end.
pub struct Distant<'a>(pub &'a OwnedFd);

impl Observer for Distant<'_> {
    fn report(&mut self, report: Report<'_>) {
        tell(self.0, &Telling::of(report));
    }
}
