//! How soon a dead node is started again, and when to give it up.
//!
//! Delays run first, step, 2·step, 4·step … longest; a node that has been healthy for `healthy_s` begins anew.

use std::collections::VecDeque;

use runtime::Time;

/// Delays between a death and the next start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Backoff {
    /// Delay before the first restart, s: zero starts the node at once.
    pub first_s: f64,
    /// Delay before the second restart, s; doubles with each further one.
    pub step_s: f64,
    /// Longest delay, s.
    pub longest_s: f64,
    /// A node that was ready for so long, s, starts again with `first_s`.
    pub healthy_s: f64,
}

impl Default for Backoff {
    fn default() -> Self {
        Backoff { first_s: 0.0, step_s: 0.1, longest_s: 5.0, healthy_s: 2.0 }
    }
}

impl Backoff {
    /// Delay in seconds before the restart that follows `restarts` earlier ones without a healthy spell.
    pub fn delay_s(&self, restarts: u32) -> f64 {
        let Some(doublings) = restarts.checked_sub(1) else { return self.first_s };
        // 2^30 steps are longer than any sane limit; the cap keeps the shift defined.
        let factor = f64::from(1u32 << doublings.min(30));
        (self.step_s * factor).min(self.longest_s)
    }
}

/// More than `restarts` restarts within `window_s`, and the node is given up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intensity {
    /// Restarts allowed in any window.
    pub restarts: u32,
    /// Length of the window, s.
    pub window_s: f64,
}

impl Default for Intensity {
    fn default() -> Self {
        Intensity { restarts: 10, window_s: 60.0 }
    }
}

/// The restarts of one node that still lie in its window.
#[derive(Debug, Clone)]
pub struct RecentRestarts {
    intensity: Intensity,
    at: VecDeque<Time>,
}

impl RecentRestarts {
    /// None yet; memory for all that can lie in a window is taken now.
    pub fn new(intensity: Intensity) -> Self {
        RecentRestarts { intensity, at: VecDeque::with_capacity(intensity.restarts as usize + 1) }
    }

    /// Whether one more restart at `now` or later stays within the intensity.
    pub fn allows_another(&mut self, now: Time) -> bool {
        while self.at.front().is_some_and(|&at| now.since(at) >= self.intensity.window_s) {
            self.at.pop_front();
        }
        self.at.len() < self.intensity.restarts as usize
    }

    /// Those that count, oldest first.
    pub fn times(&self) -> impl Iterator<Item = Time> {
        self.at.iter().copied()
    }

    /// Counts a restart at `now`.
    pub fn count(&mut self, now: Time) {
        self.at.push_back(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_double_from_the_second_restart_up_to_the_longest() {
        let backoff = Backoff::default();
        let delays: Vec<f64> = (0..9).map(|n| backoff.delay_s(n)).collect();
        assert_eq!(delays, [0.0, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0]);
        assert_eq!(backoff.delay_s(u32::MAX), 5.0);
    }

    #[test]
    fn restarts_count_until_they_leave_the_window() {
        let mut recent = RecentRestarts::new(Intensity { restarts: 2, window_s: 10.0 });
        let at = Time::from_seconds;
        for second in [0.0, 4.0] {
            assert!(recent.allows_another(at(second)));
            recent.count(at(second));
        }
        assert!(!recent.allows_another(at(9.9)));
        assert!(recent.allows_another(at(10.0)));
    }
}
