//! When to try again.

use crate::Time;

const SHORTEST_NS: u64 = 50_000_000;
const LONGEST_NS: u64 = 2_000_000_000;

/// Exponential back-off: 50 ms, 100 ms … 2 s.
#[derive(Debug)]
pub(super) struct BackOff {
    wait_ns: u64,
    retry_at: Option<Time>,
}

impl BackOff {
    /// Due at once.
    pub fn new() -> BackOff {
        BackOff { wait_ns: SHORTEST_NS, retry_at: Some(Time::ZERO) }
    }

    /// Waits longer than the last time.
    pub fn failed(&mut self, now: Time) {
        self.retry_at = Some(now.after_ns(self.wait_ns));
        self.wait_ns = (self.wait_ns * 2).min(LONGEST_NS);
    }

    /// Something answers: the next failure is a first one.
    pub fn succeeded(&mut self) {
        self.wait_ns = SHORTEST_NS;
    }

    /// Due at once.
    pub fn hurry(&mut self) {
        self.retry_at = Some(Time::ZERO);
    }

    /// Not due until it fails again.
    pub fn rest(&mut self) {
        self.retry_at = None;
    }

    /// Whether a try is due.
    pub fn is_due(&self, now: Time) -> bool {
        self.retry_at.is_some_and(|at| at <= now)
    }

    /// When the next try is due.
    pub fn next(&self) -> Option<Time> {
        self.retry_at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_two_seconds_and_begin_anew_after_success() {
        let mut back_off = BackOff::new();
        assert!(back_off.is_due(Time::ZERO));
        let mut waits = Vec::new();
        for _ in 0..8 {
            back_off.failed(Time::ZERO);
            waits.push(back_off.next().unwrap().seconds());
        }
        assert_eq!(waits, [0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 2.0, 2.0]);
        back_off.succeeded();
        back_off.failed(Time::ZERO);
        assert_eq!(back_off.next().unwrap().seconds(), 0.05);
    }
}
