//! What a scanner's electronics do: bytes in, bytes out, scans in between.

use super::lms::Lms;
use super::scip::Scip;
use drivers::laser::Sweep;
use runtime::Time;

/// Bytes that may wait for the client; a scan that does not fit is not sent.
pub(super) const OUTBOX: usize = 14 * 1024;

/// The electronics of one scanner.
#[derive(Debug, Clone)]
pub(super) enum Server {
    Scip(Box<Scip>),
    Lms(Box<Lms>),
}

impl Server {
    /// Takes bytes from the client.
    pub fn hear(&mut self, now: Time, bytes: &[u8]) {
        match self {
            Server::Scip(scip) => scip.hear(now, bytes),
            Server::Lms(lms) => lms.hear(bytes),
        }
    }

    /// Takes a whole scan: when its turn began, when its last beam was taken, and its distances.
    pub fn scan(&mut self, begun: Time, taken: Time, ranges_m: &[f64]) {
        match self {
            Server::Scip(scip) => scip.scan(begun, ranges_m),
            Server::Lms(lms) => lms.scan(taken, ranges_m),
        }
    }

    /// Whether anybody wants scans.
    pub fn measures(&self) -> bool {
        match self {
            Server::Scip(scip) => scip.measures(),
            Server::Lms(lms) => lms.measures(),
        }
    }

    /// Other beams, where a command has changed them.
    pub fn take_sweep(&mut self) -> Option<Sweep> {
        match self {
            Server::Scip(_) => None,
            Server::Lms(lms) => lms.take_sweep(),
        }
    }

    /// Bytes for the client.
    pub fn outbox(&mut self) -> &mut Vec<u8> {
        match self {
            Server::Scip(scip) => &mut scip.out,
            Server::Lms(lms) => &mut lms.out,
        }
    }

    /// The rate that the line is to have, where a command has set one [baud].
    pub fn baud(&self) -> Option<u32> {
        match self {
            Server::Scip(scip) => scip.baud,
            Server::Lms(lms) => lms.baud,
        }
    }

    /// Another client: what the one before has set is forgotten.
    pub fn restart(&mut self) {
        match self {
            Server::Scip(scip) => scip.restart(),
            Server::Lms(lms) => lms.restart(),
        }
    }
}
