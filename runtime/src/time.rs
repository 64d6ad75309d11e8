//! Instants and spans on the robot's clock.

/// An instant on the robot's clock, in nanoseconds: CLOCK_MONOTONIC on a live robot, virtual in the simulated host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(transparent)]
pub struct Time(u64);

impl Time {
    /// The clock's own zero.
    pub const ZERO: Time = Time(0);

    /// The instant `nanos` nanoseconds after the clock's zero.
    pub const fn from_nanos(nanos: u64) -> Time {
        Time(nanos)
    }

    /// Nanoseconds since the clock's zero.
    pub const fn nanos(self) -> u64 {
        self.0
    }

    /// The instant `seconds` after the clock's zero; negative and NaN count as zero.
    pub fn from_seconds(seconds: f64) -> Time {
        Time(span_ns(seconds))
    }

    /// Seconds since the clock's zero.
    pub fn seconds(self) -> f64 {
        self.0 as f64 / 1e9
    }

    /// Seconds from `earlier` to `self`; zero when `earlier` is the later one.
    pub fn since(self, earlier: Time) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 / 1e9
    }

    /// Nanoseconds from `earlier` to `self`; zero when `earlier` is the later one.
    pub const fn nanos_since(self, earlier: Time) -> u64 {
        self.0.saturating_sub(earlier.0)
    }

    /// The instant `seconds` later; negative and NaN count as zero.
    pub fn after_s(self, seconds: f64) -> Time {
        Time(self.0.saturating_add(span_ns(seconds)))
    }

    /// The instant `nanos` nanoseconds later.
    pub const fn after_ns(self, nanos: u64) -> Time {
        Time(self.0.saturating_add(nanos))
    }

    /// The instant `seconds` earlier, not before the clock's zero.
    pub fn before_s(self, seconds: f64) -> Time {
        Time(self.0.saturating_sub(span_ns(seconds)))
    }
}

/// `seconds` as whole nanoseconds; negative and NaN become zero, too large ones saturate.
fn span_ns(seconds: f64) -> u64 {
    // A cast from float to integer saturates and maps NaN to zero.
    (seconds * 1e9).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_saturate_instead_of_wrapping() {
        let early = Time::from_seconds(1.0);
        let late = Time::from_seconds(2.5);
        assert_eq!(late.since(early), 1.5);
        assert_eq!(early.since(late), 0.0);
        assert_eq!(early.before_s(3.0), Time::ZERO);
        assert_eq!(Time::from_seconds(f64::NAN), Time::ZERO);
        assert_eq!(Time::from_nanos(u64::MAX).after_s(1.0).nanos(), u64::MAX);
    }
}
