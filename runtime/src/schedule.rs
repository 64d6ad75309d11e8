//! Releases on an absolute grid, and what becomes of periods that were missed.

use crate::robot::Missed;
use crate::time::Time;

/// At most this many missed steps are done one after another.
const CATCH_UP: u64 = 10;

/// An absolute grid of releases: start, start + period, start + 2·period …
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    next: Time,
    period_ns: u64,
}

impl Grid {
    /// A grid whose first release is at `start`.
    pub fn new(start: Time, period_ns: u64) -> Grid {
        Grid { next: start, period_ns: period_ns.max(1) }
    }

    /// The next release.
    pub fn next(&self) -> Time {
        self.next
    }

    /// Another period: the next release stays where it is, the ones after it follow at the new distance.
    pub fn set_period(&mut self, period_ns: u64) {
        self.period_ns = period_ns.max(1);
    }

    /// The present distance of releases [ns].
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Passes over the releases before `now`, unserved: for a node that was suspended. Returns how many.
    pub fn pass_over(&mut self, now: Time) -> u64 {
        if self.next >= now {
            return 0;
        }
        let passed = now.nanos_since(self.next).div_ceil(self.period_ns);
        self.next = self.next.after_ns(passed * self.period_ns);
        passed
    }

    /// Whether a release is due at `now`.
    pub fn due(&self, now: Time) -> bool {
        self.next <= now
    }

    /// Goes on to the release after the one just served; `now` is the end of its step. Returns the releases skipped.
    pub fn advance(&mut self, now: Time, missed: Missed) -> u64 {
        self.next = self.next.after_ns(self.period_ns);
        if self.next > now {
            return 0;
        }
        // `behind` releases, the next one included, lie at or before now.
        let behind = now.nanos_since(self.next) / self.period_ns + 1;
        let keep = match missed {
            Missed::Skip => 0,
            Missed::CatchUp => CATCH_UP,
        };
        let skipped = behind.saturating_sub(keep);
        self.next = self.next.after_ns(skipped * self.period_ns);
        skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(ms: u64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn a_step_in_time_skips_nothing() {
        let mut grid = Grid::new(at(100), 10_000_000);
        assert_eq!(grid.advance(at(103), Missed::Skip), 0);
        assert_eq!(grid.next(), at(110));
    }

    #[test]
    fn a_long_step_skips_to_the_next_point_of_the_grid() {
        let mut grid = Grid::new(at(100), 10_000_000);
        assert_eq!(grid.advance(at(135), Missed::Skip), 3);
        assert_eq!(grid.next(), at(140));
    }

    #[test]
    fn catching_up_serves_the_missed_releases_but_not_endlessly() {
        let mut grid = Grid::new(at(100), 10_000_000);
        assert_eq!(grid.advance(at(135), Missed::CatchUp), 0);
        assert_eq!(grid.next(), at(110));
        let mut grid = Grid::new(at(0), 1_000_000);
        assert_eq!(grid.advance(at(1000), Missed::CatchUp), 990);
    }

    #[test]
    fn another_period_counts_from_the_next_release_and_the_suspended_wake_on_the_grid() {
        let mut grid = Grid::new(at(100), 10_000_000);
        grid.set_period(25_000_000);
        assert_eq!(grid.next(), at(100));
        grid.advance(at(101), Missed::Skip);
        assert_eq!(grid.next(), at(125));
        assert_eq!(grid.pass_over(at(180)), 3);
        assert_eq!((grid.next(), grid.pass_over(at(200))), (at(200), 0));
    }

    proptest! {
        #[test]
        fn releases_stay_on_the_grid_and_are_never_served_twice(
            period in 1_u64..50_000_000, ends in prop::collection::vec(0_u64..200_000_000, 1..50), catch in any::<bool>(),
        ) {
            let mut grid = Grid::new(Time::ZERO, period);
            let missed = if catch { Missed::CatchUp } else { Missed::Skip };
            let mut now = 0;
            for spent in ends {
                let before = grid.next();
                now = now.max(before.nanos()) + spent;
                let skipped = grid.advance(Time::from_nanos(now), missed);
                prop_assert_eq!(grid.next().nanos() % period, 0);
                prop_assert_eq!(grid.next().nanos(), before.nanos() + (skipped + 1) * period);
                if !catch {
                    prop_assert!(grid.next().nanos() > now);
                }
            }
        }
    }
}
