//! The mirror as a clock: it turns evenly, 75 times a second, whatever the line does to the telegrams.
//!
//! A scan cannot arrive before its last beam was taken, so the least delayed of many arrivals tells when scans begin; later
//! ones are placed a whole number of scans after it. Where arrivals creep away from that, the mirror is a little slower than it
//! should be, and the estimate follows by a hundredth.

use runtime::Time;

/// Part of a scan's lateness that is taken for drift of the mirror.
const DRIFT_SHARE: f64 = 0.01;

/// See the module's text.
#[derive(Debug, Clone, Default)]
pub struct MirrorClock {
    /// When the last scan began [ns of our time].
    last_ns: Option<i64>,
    jumps: u32,
}

impl MirrorClock {
    /// Forgets all but the count of jumps: another session.
    pub fn restart(&mut self) {
        self.last_ns = None;
    }

    /// Times that arrivals went back.
    pub fn jumps(&self) -> u32 {
        self.jumps
    }

    /// When a scan began whose telegram's last byte came at `arrived`, `after_s` after the first beam at least; one begins
    /// every `scan_s`.
    pub fn scan(&mut self, arrived: Time, after_s: f64, scan_s: f64) -> Time {
        let scan_ns = (scan_s * 1e9).max(1.0);
        let measured = arrived.nanos().min(i64::MAX as u64) as i64 - (after_s * 1e9) as i64;
        let begun = match self.last_ns {
            None => measured,
            Some(last) => {
                let gone = (measured - last) as f64;
                if gone < -0.5 * scan_ns {
                    self.jumps = self.jumps.saturating_add(1);
                    measured
                } else {
                    let expected = last + ((gone / scan_ns).round().max(1.0) * scan_ns) as i64;
                    let late = measured - expected;
                    if late < 0 { measured } else { expected + (late as f64 * DRIFT_SHARE) as i64 }
                }
            }
        };
        self.last_ns = Some(begun);
        Time::from_nanos(begun.max(0) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN_S: f64 = 2.0 / 75.0;

    #[test]
    fn late_arrivals_lost_scans_and_a_slow_mirror_do_not_move_the_stamps() {
        for slow in [0.0, 2e-4, -2e-4] {
            let mut clock = MirrorClock::default();
            let mut worst = 0.0_f64;
            for k in (0..20_000_u64).filter(|k| k % 17 != 3) {
                let begun_s = 10.0 + k as f64 * SCAN_S * (1.0 + slow);
                let late_s = 0.0001 + 0.00005 * (k * 7919 % 100) as f64;
                let at = clock.scan(Time::from_seconds(begun_s + 0.02 + late_s), 0.02, SCAN_S);
                if k > 200 {
                    worst = worst.max((at.seconds() - begun_s).abs());
                }
            }
            assert!(worst < 0.003, "{worst} s off, slow by {slow}");
            assert_eq!(clock.jumps(), 0);
        }
    }

    #[test]
    fn arrivals_that_go_back_are_counted_and_followed_and_a_repeated_one_gets_no_newer_stamp() {
        let mut clock = MirrorClock::default();
        let at = Time::from_seconds;
        let first = clock.scan(at(5.0), 0.02, SCAN_S);
        assert_eq!(clock.scan(at(5.0), 0.02, SCAN_S), first);
        assert_eq!(clock.scan(at(4.0), 0.02, SCAN_S), at(3.98));
        assert_eq!(clock.jumps(), 1);
    }
}
