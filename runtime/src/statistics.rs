//! How a node keeps time: unfiltered histograms, two significant digits from 1 ns to 100 s.

use hdrhistogram::Histogram;
use messages::NodeStatistics;

/// Longest time that is told apart [ns].
const LONGEST_NS: u64 = 100_000_000_000;

/// Counters and histograms of one node's steps. Recording does not allocate.
#[derive(Debug, Clone)]
pub struct Statistics {
    lateness: Histogram<u32>,
    execution: Histogram<u32>,
    response: Histogram<u32>,
    /// Counters; the percentiles in here are filled by [`Statistics::summary`].
    counts: NodeStatistics,
    busy_ns: u64,
}

/// One step, timed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepTimes {
    /// From the release to the beginning of the step [ns].
    pub lateness_ns: u64,
    /// From its beginning to its end [ns].
    pub execution_ns: u64,
    /// Whether it ended after its deadline.
    pub missed_deadline: bool,
    /// Whether it returned a fault.
    pub fault: bool,
}

impl Default for Statistics {
    fn default() -> Statistics {
        let histogram = || Histogram::new_with_bounds(1, LONGEST_NS, 2).expect("constant bounds are valid");
        Statistics {
            lateness: histogram(),
            execution: histogram(),
            response: histogram(),
            counts: NodeStatistics::default(),
            busy_ns: 0,
        }
    }
}

impl Statistics {
    /// Counts a step.
    pub fn record(&mut self, step: StepTimes) {
        self.lateness.saturating_record(step.lateness_ns.max(1));
        self.execution.saturating_record(step.execution_ns.max(1));
        self.response.saturating_record((step.lateness_ns + step.execution_ns).max(1));
        self.busy_ns += step.execution_ns;
        self.counts.steps += 1;
        self.counts.missed_deadlines += u64::from(step.missed_deadline);
        self.counts.faults += u64::from(step.fault);
    }

    /// Counts releases that passed without a step.
    pub fn skip(&mut self, releases: u64) {
        self.counts.skipped += releases;
    }

    /// Steps so far.
    pub fn steps(&self) -> u64 {
        self.counts.steps
    }

    /// Steps so far that ended after their deadline.
    pub fn missed_deadlines(&self) -> u64 {
        self.counts.missed_deadlines
    }

    /// What there is to tell in the heartbeat.
    pub fn work(&self) -> guard::Work {
        let NodeStatistics { steps, missed_deadlines, .. } = self.counts;
        guard::Work { steps, busy_ns: self.busy_ns, missed_deadlines }
    }

    /// Everything so far; `dropped` is the inputs' count of lost samples.
    pub fn summary(&self, dropped: u64) -> NodeStatistics {
        let four = |histogram: &Histogram<u32>| {
            let [p50, p99, p999] = [0.5, 0.99, 0.999].map(|q| histogram.value_at_quantile(q));
            [p50, p99, p999, histogram.max()].map(|ns| ns as f64 * 1e-9)
        };
        NodeStatistics {
            dropped,
            lateness_s: four(&self.lateness),
            execution_s: four(&self.execution),
            response_s: four(&self.response),
            busy_s: self.busy_ns as f64 * 1e-9,
            ..self.counts
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tells_the_median_from_the_tail() {
        let mut statistics = Statistics::default();
        for n in 0..1000 {
            let lateness_ns = if n % 100 == 0 { 5_000_000 } else { 50_000 };
            statistics.record(StepTimes {
                lateness_ns,
                execution_ns: 10_000,
                missed_deadline: n % 100 == 0,
                fault: false,
            });
        }
        let summary = statistics.summary(3);
        assert!((summary.lateness_s[0] - 50e-6).abs() < 1e-6, "{summary:?}");
        assert!((summary.lateness_s[3] - 5e-3).abs() < 1e-4, "{summary:?}");
        assert_eq!((summary.steps, summary.missed_deadlines, summary.dropped), (1000, 10, 3));
    }
}
