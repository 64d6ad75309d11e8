//! The scanner's clock on ours.
//!
//! The offset comes from questions and answers (TM1) where the device takes them: an answer was given between sending
//! and arrival, so the quickest one bounds the error best. Then scans keep it: a scan cannot arrive before its last beam was
//! taken, and where the least delay of a window of scans differs from that of the window before, the clocks have
//! drifted. Without TM the least delay counts as none: stamps are late by the shortest transfer.

use super::protocol::STAMP_BITS;
use runtime::Time;

/// Scans whose least delay is taken together.
const WINDOW: u32 = 64;
/// More drift than this from window to window is a jump [ns].
const DRIFT_NS: i64 = 5_000_000;
/// A stamp that is off by more than this is a jump of the device's clock [ns].
const JUMP_NS: i64 = 500_000_000;
const MS: i64 = 1_000_000;

/// See the module's text.
#[derive(Debug, Clone, Default)]
pub struct SensorClock {
    last: Option<u32>,
    /// The device's time without wrapping [ms].
    device_ms: i64,
    /// Our time less the device's [ns].
    offset_ns: Option<i64>,
    /// Least time between question and answer so far [ns].
    round_ns: Option<i64>,
    window: (u32, i64),
    window_before: Option<i64>,
    jumps: u32,
}

impl SensorClock {
    /// Forgets all but the count of jumps: another session.
    pub fn restart(&mut self) {
        *self = SensorClock { jumps: self.jumps, ..SensorClock::default() };
    }

    /// Times that the device's clock went back or jumped.
    pub fn jumps(&self) -> u32 {
        self.jumps
    }

    /// An answer of the device: its clock was read between `asked` and `answered`.
    pub fn synchronise(&mut self, stamp: u32, asked: Time, answered: Time) {
        let device_ns = self.unwrap(stamp);
        let (asked, answered) = (nanos(asked), nanos(answered));
        let round_ns = answered - asked;
        if round_ns >= 0 && self.round_ns.is_none_or(|least| round_ns < least) {
            self.round_ns = Some(round_ns);
            // The stamp's milliseconds are whole: half of one on average is missing.
            self.offset_ns = Some(asked + round_ns / 2 - device_ns - MS / 2);
        }
    }

    /// When a scan's turn began, and the device's own time of it [s]: `span_s` before its last beam was taken.
    pub fn scan(&mut self, stamp: u32, arrived: Time, span_s: f64) -> (Time, f64) {
        let device_ns = self.unwrap(stamp);
        // What the transfer took beside the clocks' offset.
        let delay_ns = nanos(arrived) - device_ns - (span_s * 1e9) as i64;
        let offset_ns = match self.offset_ns {
            Some(offset_ns) if (delay_ns - offset_ns).abs() < JUMP_NS => offset_ns.min(delay_ns),
            Some(_) => {
                self.jumped();
                delay_ns
            }
            None => delay_ns,
        };
        self.offset_ns = Some(offset_ns);
        self.follow_drift(delay_ns);
        let begun_ns = self.offset_ns.unwrap_or(delay_ns) + device_ns;
        (Time::from_nanos(begun_ns.max(0) as u64), device_ns as f64 * 1e-9)
    }

    fn follow_drift(&mut self, delay_ns: i64) {
        let (count, least) = self.window;
        self.window = (count + 1, if count == 0 { delay_ns } else { least.min(delay_ns) });
        if self.window.0 < WINDOW {
            return;
        }
        let (_, least) = std::mem::take(&mut self.window);
        if let Some(before) = self.window_before.replace(least)
            && (least - before).abs() <= DRIFT_NS
            && let Some(offset_ns) = &mut self.offset_ns
        {
            *offset_ns = (*offset_ns + least - before).min(least);
        }
    }

    fn unwrap(&mut self, stamp: u32) -> i64 {
        let mask = (1 << STAMP_BITS) - 1;
        let stamp = stamp & mask;
        let ahead = self.last.map(|last| stamp.wrapping_sub(last) & mask);
        self.last = Some(stamp);
        let Some(ahead) = ahead else {
            self.device_ms = i64::from(stamp);
            return self.device_ms * MS;
        };
        if ahead > mask / 2 {
            // It went back: what is known of it is void.
            self.jumped();
            self.device_ms = i64::from(stamp);
        } else {
            self.device_ms += i64::from(ahead);
        }
        self.device_ms * MS
    }

    fn jumped(&mut self) {
        self.jumps = self.jumps.saturating_add(1);
        (self.offset_ns, self.round_ns, self.window, self.window_before) = (None, None, (0, 0), None);
    }
}

fn nanos(time: Time) -> i64 {
    time.nanos().min(i64::MAX as u64) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN_S: f64 = 0.02;

    /// A device whose clock begins at 16,777,000 ms (it wraps after 216 ms) when ours reads 100 s, and drifts.
    fn stamp_at(our_s: f64, drift: f64) -> u32 {
        let ms = (our_s - 100.0) * 1000.0 * (1.0 + drift) + 16_777_000.0;
        (ms as u64 & 0xFF_FFFF) as u32
    }

    #[test]
    fn stamps_are_mapped_through_wrapping_drift_and_late_arrivals() {
        for drift in [0.0, 1e-4, -1e-4] {
            let mut clock = SensorClock::default();
            for k in 0..5 {
                let asked = 100.0 + 0.01 * k as f64;
                // The slower the answer, the more of the way lies behind the reading.
                let late_s = 0.001 * (1 + k % 3) as f64;
                let stamp = stamp_at(asked + 0.0005, drift);
                clock.synchronise(stamp, Time::from_seconds(asked), Time::from_seconds(asked + late_s));
            }
            let mut worst = 0.0_f64;
            for k in 0..40_000 {
                let begun_s = 100.2 + 0.025 * k as f64;
                let late_s = 0.002 + 0.0001 * (k * 7919 % 100) as f64;
                let arrived = Time::from_seconds(begun_s + SPAN_S + late_s);
                let (mapped, _) = clock.scan(stamp_at(begun_s, drift), arrived, SPAN_S);
                worst = worst.max((mapped.seconds() - begun_s).abs());
            }
            assert!(worst < 0.002, "{worst} s off with a drift of {drift}");
            assert_eq!(clock.jumps(), 0);
        }
    }

    #[test]
    fn a_clock_that_goes_back_is_counted_and_followed() {
        let mut clock = SensorClock::default();
        let at = |seconds: f64| Time::from_seconds(seconds);
        clock.scan(900_000, at(50.0), SPAN_S);
        let (mapped, _) = clock.scan(5, at(50.1), SPAN_S);
        assert_eq!(clock.jumps(), 1);
        assert!((mapped.seconds() - 50.08).abs() < 1e-6);
        // A leap ahead of minutes is as wrong.
        let (mapped, _) = clock.scan(300_000, at(50.2), SPAN_S);
        assert_eq!(clock.jumps(), 2);
        assert!((mapped.seconds() - 50.18).abs() < 1e-6);
    }

    #[test]
    fn a_repeated_stamp_stays_where_it_was() {
        let mut clock = SensorClock::default();
        let first = clock.scan(1000, Time::from_seconds(7.0), SPAN_S);
        let again = clock.scan(1000, Time::from_seconds(7.01), SPAN_S);
        assert_eq!(first, again);
    }
}
