//! Whether the node is in a step, and since when: what the pump can say while the step cannot.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::Time;

/// Whether the node is in a step, and since when. The host tells it; the pump answers by it.
#[derive(Debug, Default)]
pub struct StepWatch {
    /// Begin of the current step [ns]; 0: in none.
    begun_ns: AtomicU64,
    /// End of the last step [ns]; 0: none yet.
    ended_ns: AtomicU64,
}

impl StepWatch {
    /// A step begins.
    pub fn begin(&self, now: Time) {
        self.begun_ns.store(now.nanos().max(1), Ordering::Release);
    }

    /// The step has ended.
    pub fn end(&self, now: Time) {
        self.ended_ns.store(now.nanos().max(1), Ordering::Relaxed);
        self.begun_ns.store(0, Ordering::Release);
    }

    /// How long the current step has lasted at `now` [s]; none outside a step.
    pub fn in_step_s(&self, now: Time) -> Option<f64> {
        let begun_ns = self.begun_ns.load(Ordering::Acquire);
        (begun_ns != 0).then(|| now.since(Time::from_nanos(begun_ns)))
    }

    /// What the node does, in words.
    pub(super) fn describe(&self, now: Time) -> String {
        match (self.in_step_s(now), self.ended_ns.load(Ordering::Relaxed)) {
            (Some(since_s), _) => format!("the node is in a step since {:.0} ms", since_s * 1e3),
            (None, 0) => "the node has made no step yet".into(),
            (None, ended_ns) => {
                let since_s = now.since(Time::from_nanos(ended_ns));
                format!("the node waits for its next step; the last one ended {:.0} ms ago", since_s * 1e3)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_watch_says_how_long_a_step_has_lasted() {
        let watch = StepWatch::default();
        assert_eq!(watch.in_step_s(Time::from_seconds(1.0)), None);
        assert!(watch.describe(Time::ZERO).contains("no step yet"));
        watch.begin(Time::from_seconds(1.0));
        assert_eq!(watch.in_step_s(Time::from_seconds(3.0)), Some(2.0));
        assert_eq!(watch.describe(Time::from_seconds(3.0)), "the node is in a step since 2000 ms");
        watch.end(Time::from_seconds(3.0));
        assert!(watch.describe(Time::from_seconds(3.5)).contains("500 ms ago"));
    }
}
