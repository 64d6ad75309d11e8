//! Measured times: recorded one by one, summed up in HDR histograms, never filtered. Samples during which a stall
//! witness was held up are counted, and percentiles without them stand beside the raw ones.

use super::report::Row;
use super::witness::Testimony;
use hdrhistogram::Histogram;
use runtime::Time;

/// Longest time that is told apart [ns].
const LONGEST_NS: u64 = 100_000_000_000;
/// A row of which more was held up says nothing.
const MOST_HELD_UP: f64 = 0.02;

/// Times in the order in which they were taken.
#[derive(Debug, Clone, Default)]
pub struct Times {
    /// Begin and length [ns].
    all: Vec<(u64, u64)>,
}

impl Times {
    /// Room for `count` times, so that taking one does not allocate.
    pub fn with_room_for(count: usize) -> Times {
        Times { all: Vec::with_capacity(count) }
    }

    /// Takes one.
    #[inline]
    pub fn push(&mut self, begin: Time, end: Time) {
        self.all.push((begin.nanos(), end.nanos().saturating_sub(begin.nanos())));
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// How many are at most as long as each of the ascending `edges_ns` but longer than the one before; last, how many
    /// are longer than all.
    pub fn counts(&self, edges_ns: &[u64]) -> Vec<u64> {
        let mut counts = vec![0; edges_ns.len() + 1];
        for (_, length) in &self.all {
            counts[edges_ns.partition_point(|edge| edge < length)] += 1;
        }
        counts
    }

    /// The row of these times.
    pub fn row(&self, name: &str, size_bytes: usize, seen: &Testimony) -> Row {
        let mut raw = histogram();
        let mut calm = histogram();
        let mut held_up = 0;
        for &(begin, length) in &self.all {
            raw.saturating_record(length.max(1));
            if held(begin, begin + length, seen) {
                held_up += 1;
            } else {
                calm.saturating_record(length.max(1));
            }
        }
        let us = |histogram: &Histogram<u32>, q: f64| histogram.value_at_quantile(q) as f64 / 1000.0;
        let n = self.all.len() as u64;
        let mut row = Row::new(name, size_bytes, [us(&raw, 0.5), us(&raw, 0.99), us(&raw, 1.0)], n);
        row.note("p999_us", us(&raw, 0.999));
        row.note("held_up", held_up);
        row.note("calm_p50_us", us(&calm, 0.5));
        row.note("calm_p99_us", us(&calm, 0.99));
        row.note("calm_p999_us", us(&calm, 0.999));
        row.note("calm_max_us", us(&calm, 1.0));
        row.note("valid", n > 0 && held_up as f64 <= MOST_HELD_UP * n as f64);
        row
    }
}

/// Whether some gap overlaps `from..to`; gaps are sorted by their beginning but may overlap each other.
fn held(from_ns: u64, to_ns: u64, seen: &Testimony) -> bool {
    let begun = seen.gaps.partition_point(|gap| gap.from_ns < to_ns);
    seen.gaps[..begun].iter().any(|gap| gap.to_ns > from_ns)
}

fn histogram() -> Histogram<u32> {
    Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("constant bounds are valid")
}

#[cfg(test)]
mod tests {
    use super::super::witness::Gap;
    use super::*;

    #[test]
    fn a_time_in_a_gap_stays_in_the_raw_figures_and_is_left_out_of_the_calm_ones() {
        let mut times = Times::with_room_for(100);
        for n in 0..100 {
            let begin = Time::from_nanos(n * 1_000_000);
            let length = if n == 40 { 900_000 } else { 5_000 };
            times.push(begin, Time::from_nanos(begin.nanos() + length));
        }
        let seen = Testimony { gaps: vec![Gap { from_ns: 40_500_000, to_ns: 40_600_000 }], scheduler: String::new() };
        let row = times.row("x", 64, &seen);
        assert_eq!((row.n, row.p50_us.round(), row.max_us.round()), (100, 5.0, 900.0));
        assert_eq!(row.extra["held_up"], 1);
        assert_eq!(row.extra["calm_max_us"].as_f64().map(f64::round), Some(5.0));
        assert_eq!(row.extra["valid"], true);
    }

    #[test]
    fn every_time_is_counted_between_two_edges() {
        let mut times = Times::default();
        for length in [5, 10, 11, 500] {
            times.push(Time::ZERO, Time::from_nanos(length));
        }
        assert_eq!(times.counts(&[10, 20, 100]), [2, 1, 0, 1]);
        assert!(!times.is_empty() && Times::default().is_empty());
    }

    #[test]
    fn a_row_of_which_too_much_was_held_up_is_not_valid() {
        let mut times = Times::default();
        (0..10).for_each(|n| times.push(Time::from_nanos(n * 100), Time::from_nanos(n * 100 + 50)));
        let seen = Testimony { gaps: vec![Gap { from_ns: 120, to_ns: 130 }], scheduler: String::new() };
        assert_eq!(times.row("x", 1, &seen).extra["valid"], false);
    }
}
