//! A fault that lasts is said once.

use runtime::Fault;

/// Remembers what was said last.
#[derive(Debug, Clone, Copy, Default)]
pub struct SaidOnce {
    last: Option<Fault>,
}

impl SaidOnce {
    /// What is wrong now: an error where that is new.
    pub fn now(&mut self, fault: Option<Fault>) -> Result<(), Fault> {
        let before = std::mem::replace(&mut self.last, fault);
        if before == fault { Ok(()) } else { fault.map_or(Ok(()), Err) }
    }
}
