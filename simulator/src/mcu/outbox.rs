//! Bytes that wait for the line; whole packets or nothing.

/// Room for ten seconds of SIPs that nobody fetches [byte].
const CAPACITY: usize = 8192;

/// The queue. It never grows.
#[derive(Debug, Clone)]
pub(super) struct Outbox {
    bytes: Vec<u8>,
}

impl Outbox {
    pub fn new() -> Outbox {
        Outbox { bytes: Vec::with_capacity(CAPACITY) }
    }

    /// Appends a packet; one that does not fit is lost, as on a line that nobody reads.
    pub fn push(&mut self, packet: &[u8]) {
        if self.bytes.len() + packet.len() <= CAPACITY {
            self.bytes.extend_from_slice(packet);
        }
    }

    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    pub fn drop_front(&mut self, count: usize) {
        self.bytes.drain(..count.min(self.bytes.len()));
    }
}
