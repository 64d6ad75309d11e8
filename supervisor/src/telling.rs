//! What passes between the supervisor and the program that started the robot: one JSON object per packet.
//!
//! A packet that the other end does not take at once is lost: a slow terminal never holds a supervisor.

use std::os::fd::OwnedFd;

use rustix::net::{RecvFlags, SendFlags, recv, send};
use serde::{Deserialize, Serialize};

use crate::news::News;
use crate::observer::{Observer, Outcome, Report, StopCause};

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
    /// What the supervisor reports.
    News(News),
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
        tell(self.0, &Telling::News(News::of(report)));
    }
}
