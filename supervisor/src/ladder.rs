//! The causes that hold the robot back, and the rung on which they put it.
//!
//! The highest rung of any cause counts. A cause leaves when its clear condition says so. An emergency stop is latched
//! here beside its causes: it outlives them, and only a reset after the last of them ends it.

use runtime::Time;

use crate::severity::{Cause, CauseKind, Clear, Severity};

/// The causes, and the latch.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ladder {
    causes: Vec<Cause>,
    latched: bool,
}

impl Ladder {
    /// A cause begins, comes back, or gets worse. True: it was not counted on this rung before.
    pub fn begin(&mut self, now: Time, node: usize, kind: CauseKind, severity: Severity, clear: Clear) -> bool {
        if severity == Severity::None {
            return false;
        }
        self.latched |= severity == Severity::Stop;
        if let Some(cause) = self.causes.iter_mut().find(|cause| cause.node == node && cause.kind == kind) {
            cause.gone = None;
            let worse = severity > cause.severity;
            cause.severity = cause.severity.max(severity);
            return worse;
        }
        self.causes.push(Cause { node, kind, severity, clear, since: now, gone: None });
        true
    }

    /// What caused it is over.
    pub fn gone(&mut self, now: Time, node: usize, of: impl Fn(CauseKind) -> bool) {
        for cause in self.causes.iter_mut().filter(|cause| cause.node == node && of(cause.kind)) {
            cause.gone.get_or_insert(now);
        }
    }

    /// The next cause that has ended by itself.
    pub fn take_ended(&mut self, now: Time) -> Option<Cause> {
        let ended = self.causes.iter().position(|cause| cause.ends_at().is_some_and(|at| at <= now))?;
        Some(self.causes.remove(ended))
    }

    /// When the next cause ends by itself.
    pub fn timer(&self) -> Option<Time> {
        self.causes.iter().filter_map(Cause::ends_at).min()
    }

    /// Whether a reset would be heard: no cause of an emergency stop is still there.
    pub fn may_reset(&self) -> bool {
        self.causes.iter().all(|cause| cause.severity < Severity::Stop || cause.resettable())
    }

    /// A person's reset: ends what waits for it, and the latch. Only if `may_reset`.
    pub fn reset(&mut self) -> Vec<Cause> {
        self.latched = false;
        let (ended, stay) = self.causes.iter().partition(|cause| cause.resettable());
        self.causes = stay;
        ended
    }

    /// The rung.
    pub fn level(&self) -> Severity {
        let highest = self.causes.iter().map(|cause| cause.severity).max().unwrap_or_default();
        if self.latched { Severity::Stop } else { highest }
    }

    /// Whether an emergency stop is latched.
    pub fn latched(&self) -> bool {
        self.latched
    }

    /// What a supervisor before this one knew.
    pub fn adopt(&mut self, causes: impl Iterator<Item = Cause>, latched: bool) {
        self.causes.extend(causes);
        self.latched |= latched;
    }

    /// The causes that count now.
    pub fn causes(&self) -> &[Cause] {
        &self.causes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GONE: Clear = Clear::Gone { after_s: 2.0 };

    fn at(s: f64) -> Time {
        Time::from_seconds(s)
    }

    #[test]
    fn the_highest_rung_counts_and_a_cause_leaves_after_it_has_been_gone_for_a_while() {
        let mut ladder = Ladder::default();
        assert!(ladder.begin(at(0.0), 0, CauseKind::Silent, Severity::Limp, GONE));
        assert!(ladder.begin(at(0.0), 1, CauseKind::Absent, Severity::Hold, GONE));
        assert_eq!(ladder.level(), Severity::Hold);
        ladder.gone(at(1.0), 1, |kind| kind == CauseKind::Absent);
        assert_eq!((ladder.timer(), ladder.take_ended(at(2.9))), (Some(at(3.0)), None));
        assert!(ladder.take_ended(at(3.0)).is_some_and(|cause| cause.node == 1));
        assert_eq!(ladder.level(), Severity::Limp);
    }

    #[test]
    fn a_cause_that_comes_back_waits_anew() {
        let mut ladder = Ladder::default();
        ladder.begin(at(0.0), 0, CauseKind::Silent, Severity::Hold, GONE);
        ladder.gone(at(1.0), 0, |_| true);
        assert!(!ladder.begin(at(2.0), 0, CauseKind::Silent, Severity::Hold, GONE));
        assert_eq!(ladder.timer(), None);
    }

    #[test]
    fn a_stop_outlives_its_cause_and_waits_for_a_reset_that_comes_after_it() {
        let mut ladder = Ladder::default();
        ladder.begin(at(0.0), 0, CauseKind::Hung, Severity::Stop, GONE);
        assert!(!ladder.may_reset());
        ladder.gone(at(1.0), 0, |_| true);
        assert_eq!((ladder.take_ended(at(1e6)), ladder.level()), (None, Severity::Stop));
        assert!(ladder.may_reset());
        assert_eq!(ladder.reset().len(), 1);
        assert_eq!(ladder.level(), Severity::None);
    }

    #[test]
    fn what_never_clears_keeps_the_robot_on_its_rung() {
        let mut ladder = Ladder::default();
        ladder.begin(at(0.0), 0, CauseKind::Absent, Severity::Limp, Clear::Never);
        ladder.gone(at(1.0), 0, |_| true);
        assert!(ladder.reset().is_empty() && ladder.take_ended(at(1e9)).is_none());
        assert_eq!(ladder.level(), Severity::Limp);
    }
}
