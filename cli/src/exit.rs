//! Exit codes, the same for every command.

/// Done.
pub const OK: u8 = 0;
/// It did not work; the message says why.
pub const FAILED: u8 = 1;
/// The arguments make no sense.
pub const USAGE: u8 = 2;
/// No such robot is running, or its node is not.
pub const NOT_RUNNING: u8 = 3;
/// A check failed: a robot file has errors, a run touched something, a doctor found an ailment.
pub const CHECK: u8 = 4;

/// An error with the exit code that it ends the program with.
#[derive(Debug)]
pub struct Failure {
    /// Exit code.
    pub code: u8,
    /// Where, why, what to do.
    pub message: String,
}

impl Failure {
    /// A failure with exit code `code`.
    pub fn new(code: u8, message: impl Into<String>) -> Failure {
        Failure { code, message: message.into() }
    }
}

impl<E: std::fmt::Display> From<E> for Failure {
    fn from(error: E) -> Failure {
        Failure { code: FAILED, message: error.to_string() }
    }
}
