//! The pace at which a recording is played: when each sample is due, and what changes that.
//!
//! A sample stamped t in the recording is due at b + (t − o) / r, where b is when playing began at the origin o with the
//! rate r; a pause, another rate or another place begin anew with another b and o.

use std::sync::atomic::{AtomicBool, Ordering};

use runtime::{Time, clock};

/// What a viewer asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ask {
    /// Stand still, or go on.
    Pause(bool),
    /// The other of the two.
    TogglePause,
    /// Times as fast as it was.
    Rate(f64),
    /// As many times faster.
    Faster(f64),
    /// To this far into the recording [s].
    Seek(f64),
    /// On by so much, or back [s].
    Skip(f64),
}

/// How waiting for a sample ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turn {
    /// It is due.
    Go,
    /// Playing goes on elsewhere in the recording.
    Elsewhere,
    /// It is to end.
    Stopped,
}

/// The longest sleep, so that a wish is heard [s].
const NAP_S: f64 = 0.05;
/// Slowest and fastest.
const RATES: std::ops::RangeInclusive<f64> = 1e-4..=1e6;

/// Where playing stands, and how fast it goes.
#[derive(Debug, Clone)]
pub(crate) struct Pace {
    /// First and last stamp that can be gone to [ns].
    bounds: (u64, u64),
    rate: f64,
    begun: Time,
    origin_ns: u64,
    /// Where it stands still [ns].
    paused_ns: Option<u64>,
}

impl Pace {
    /// Begins at `from_ns`, at `now`.
    pub fn new(rate: f64, bounds: (u64, u64), from_ns: u64, now: Time) -> Pace {
        Pace { bounds, rate, begun: now, origin_ns: from_ns, paused_ns: None }
    }

    /// Goes to a stamp.
    pub fn seek(&mut self, at_ns: u64, now: Time) {
        self.origin_ns = at_ns.clamp(self.bounds.0, self.bounds.1);
        self.begun = now;
        if self.paused_ns.is_some() {
            self.paused_ns = Some(self.origin_ns);
        }
    }

    /// Where it begins, or began last [ns].
    pub fn at_ns(&self) -> u64 {
        self.origin_ns
    }

    /// Which stamp is due at `now` [ns].
    fn place_ns(&self, now: Time) -> u64 {
        let gone_ns = (now.since(self.begun).max(0.0) * self.rate * 1e9) as u64;
        self.paused_ns.unwrap_or_else(|| self.origin_ns.saturating_add(gone_ns).min(self.bounds.1))
    }

    fn due(&self, at_ns: u64) -> Time {
        self.begun.after_s(at_ns.saturating_sub(self.origin_ns) as f64 * 1e-9 / self.rate)
    }

    /// Obeys; true where the viewer wants to be elsewhere.
    fn obey(&mut self, ask: Ask, now: Time) -> bool {
        let place_ns = self.place_ns(now);
        let rebase = |pace: &mut Pace| (pace.origin_ns, pace.begun) = (place_ns, now);
        match ask {
            Ask::Pause(true) => self.paused_ns = Some(place_ns),
            Ask::Pause(false) if self.paused_ns.is_some() => {
                rebase(self);
                self.paused_ns = None;
            }
            Ask::Pause(false) => {}
            Ask::TogglePause => return self.obey(Ask::Pause(self.paused_ns.is_none()), now),
            Ask::Rate(rate) => {
                rebase(self);
                self.rate = rate.clamp(*RATES.start(), *RATES.end());
            }
            Ask::Faster(times) => return self.obey(Ask::Rate(self.rate * times), now),
            Ask::Seek(into_s) => {
                self.seek(self.bounds.0.saturating_add(Time::from_seconds(into_s.max(0.0)).nanos()), now);
                return true;
            }
            Ask::Skip(by_s) => {
                let by_ns = Time::from_seconds(by_s.abs()).nanos();
                let to = if by_s < 0.0 { place_ns.saturating_sub(by_ns) } else { place_ns.saturating_add(by_ns) };
                self.seek(to, now);
                return true;
            }
        }
        false
    }

    /// Waits until a sample is due, and obeys meanwhile; the stamp that it is played with.
    pub fn wait(&mut self, at_ns: u64, stop: &AtomicBool, asks: &mut dyn FnMut() -> Option<Ask>) -> (Turn, Time) {
        loop {
            let now = clock::now();
            if stop.load(Ordering::Relaxed) {
                return (Turn::Stopped, now);
            }
            while let Some(ask) = asks() {
                if self.obey(ask, now) {
                    return (Turn::Elsewhere, now);
                }
            }
            let due = self.due(at_ns);
            if self.paused_ns.is_none() && now >= due {
                return (Turn::Go, due);
            }
            let nap = now.after_s(NAP_S);
            clock::sleep_until(if self.paused_ns.is_some() { nap } else { due.min(nap) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Time {
        Time::from_seconds(100.0 + seconds)
    }

    fn ns(seconds: f64) -> u64 {
        Time::from_seconds(seconds).nanos()
    }

    #[test]
    fn another_rate_goes_on_from_where_it_stands() {
        let mut pace = Pace::new(2.0, (ns(10.0), ns(20.0)), ns(10.0), at(0.0));
        assert_eq!(pace.due(ns(14.0)), at(2.0));
        assert!(!pace.obey(Ask::Rate(0.5), at(1.0)));
        assert_eq!((pace.place_ns(at(1.0)), pace.due(ns(14.0))), (ns(12.0), at(5.0)));
        assert!(!pace.obey(Ask::Faster(4.0), at(1.0)));
        assert_eq!(pace.due(ns(14.0)), at(2.0));
    }

    #[test]
    fn a_pause_moves_everything_that_follows_by_its_length() {
        let mut pace = Pace::new(1.0, (ns(10.0), ns(20.0)), ns(10.0), at(0.0));
        pace.obey(Ask::TogglePause, at(1.0));
        assert_eq!(pace.place_ns(at(7.0)), ns(11.0));
        pace.obey(Ask::TogglePause, at(7.0));
        assert_eq!(pace.due(ns(12.0)), at(8.0));
        pace.obey(Ask::Pause(false), at(7.5));
        assert_eq!(pace.due(ns(12.0)), at(8.0), "what goes on already goes on");
    }

    #[test]
    fn a_place_beyond_the_recording_is_its_nearest_end() {
        let mut pace = Pace::new(1.0, (ns(10.0), ns(20.0)), ns(10.0), at(0.0));
        for (ask, place) in [(Ask::Seek(4.0), 14.0), (Ask::Skip(-9.0), 10.0), (Ask::Skip(99.0), 20.0)] {
            assert!(pace.obey(ask, at(0.0)));
            assert_eq!(pace.at_ns(), ns(place), "{ask:?}");
        }
    }

    #[test]
    fn whoever_moves_in_a_pause_stays_in_it() {
        let mut pace = Pace::new(1.0, (ns(0.0), ns(20.0)), ns(0.0), at(0.0));
        pace.obey(Ask::Pause(true), at(1.0));
        assert!(pace.obey(Ask::Seek(8.0), at(2.0)));
        assert_eq!(pace.place_ns(at(5.0)), ns(8.0));
        pace.obey(Ask::Pause(false), at(5.0));
        assert_eq!(pace.due(ns(9.0)), at(6.0));
    }
}
