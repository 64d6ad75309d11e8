//! What a scanner's electronics do: bytes in, bytes out, scans in between.

use super::scip::Scip;
use drivers::laser::Sweep;
use runtime::Time;

/// Bytes that may wait for the client; a scan that does not fit is not sent.
pub(super) const OUTBOX: usize = 14 * 1024;

/// The electronics of one scanner.
#[derive(Debug, Clone)]
pub(super) enum Server {
    Scip(Box<Scip>),
}

impl Server {
    /// Takes bytes from the client.
    pub fn hear(&mut self, now: Time, bytes: &[u8]) {
        match self {
            Server::Scip(scip) => scip.hear(now, bytes),
        }
    }

    /// Takes a whole scan: when its turn began, and its distances.
    pub fn scan(&mut self, begun: Time, ranges_m: &[f64]) {
        match self {
            Server::Scip(scip) => scip.scan(begun, ranges_m),
        }
    }

    /// Whether anybody wants scans.
    pub fn measures(&self) -> bool {
        match self {
            Server::Scip(scip) => scip.measures(),
        }
    }

    /// Other beams, where a command has changed them.
    pub fn take_sweep(&mut self) -> Option<Sweep> {
        match self {
            Server::Scip(_) => None,
        }
    }

    /// Bytes for the client.
    pub fn outbox(&mut self) -> &mut Vec<u8> {
        match self {
            Server::Scip(scip) => &mut scip.out,
        }
    }

    /// The rate that the line is to have, where a command has set one [baud].
    pub fn baud(&self) -> Option<u32> {
        match self {
            Server::Scip(scip) => scip.baud,
        }
    }

    /// Another client: what the one before has set is forgotten.
    pub fn restart(&mut self) {
        match self {
            Server::Scip(scip) => scip.restart(),
        }
    }
}
