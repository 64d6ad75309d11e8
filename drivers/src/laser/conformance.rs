//! What the suites of both laser protocols have in common: the device's end of a byte stream, and a failure.

/// The laser's end of a byte stream, seen from the client.
pub trait Server {
    /// Sends bytes to the laser.
    fn send(&mut self, bytes: &[u8]);
    /// Appends what the laser has sent since the last call.
    fn receive(&mut self, bytes: &mut Vec<u8>);
    /// Lets `seconds` pass, virtual or real.
    fn advance(&mut self, seconds: f64);
}

/// A check that failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{check}: {what}")]
pub struct Failure {
    /// Which check.
    pub check: &'static str,
    /// What was seen and what was expected.
    pub what: String,
}

/// What a check finds.
pub type Outcome = Result<(), String>;

/// Fails with what was seen unless `holds`.
pub fn ensure(holds: bool, what: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(what()) }
}

/// Step of waiting [s].
pub const TICK_S: f64 = 0.01;

/// Lets `seconds` pass and gives all that came.
pub fn listen(server: &mut dyn Server, seconds: f64) -> Vec<u8> {
    let mut bytes = Vec::new();
    for _ in 0..(seconds / TICK_S).round().max(1.0) as usize {
        server.advance(TICK_S);
        server.receive(&mut bytes);
    }
    bytes
}
