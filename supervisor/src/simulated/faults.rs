//! Faults from a seed: what goes wrong, when, and for how long.
//!
//! Each kind is a Poisson process of its own rate: the time to the next fault is −ln(u)/λ with u uniform in (0, 1]. One
//! generator draws them all in the order of their times, so that a seed replays exactly.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use runtime::{Time, math};
use serde::Deserialize;

/// How often what goes wrong. Rates are per minute of the whole robot; all are zero where nothing is said.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FaultRates {
    /// Deaths of a process, anywhere.
    pub deaths: f64,
    /// Share of the deaths that fall into a step, possibly between two writes, 0…1.
    pub in_step: f64,
    /// Hangs of a process.
    pub hangs: f64,
    /// Longest hang [s]; most are found out before.
    pub hang_s: f64,
    /// Slow-downs of a process.
    pub slowdowns: f64,
    /// Steps take up to so many times as long.
    pub slower: f64,
    /// Longest slow-down [s].
    pub slow_s: f64,
    /// Bursts in which the lines to devices lose bytes.
    pub bursts: f64,
    /// Share of the bytes that a burst loses, 0…1.
    pub lost_bytes: f64,
    /// Longest burst [s].
    pub burst_s: f64,
    /// Emergency stops, each with its cause that goes away and a person who resets it, sometimes too early.
    pub stops: f64,
    /// Deaths of the supervisor: the policy's events wait until the next one has taken over.
    pub supervisor: f64,
}

impl Default for FaultRates {
    fn default() -> FaultRates {
        FaultRates {
            deaths: 0.0,
            in_step: 0.5,
            hangs: 0.0,
            hang_s: 5.0,
            slowdowns: 0.0,
            slower: 200.0,
            slow_s: 2.0,
            bursts: 0.0,
            lost_bytes: 0.02,
            burst_s: 2.0,
            stops: 0.0,
            supervisor: 0.0,
        }
    }
}

impl FaultRates {
    /// About one fault every two seconds, of every kind.
    pub const CHAOS: FaultRates = FaultRates {
        deaths: 14.0,
        in_step: 0.5,
        hangs: 5.0,
        hang_s: 5.0,
        slowdowns: 5.0,
        slower: 200.0,
        slow_s: 2.0,
        bursts: 4.0,
        lost_bytes: 0.02,
        burst_s: 2.0,
        stops: 1.0,
        supervisor: 2.0,
    };

    /// What contradicts itself, if anything.
    pub fn flaw(&self) -> Option<String> {
        let shares = [("in_step", self.in_step), ("lost_bytes", self.lost_bytes)];
        if let Some((key, value)) = shares.into_iter().find(|(_, value)| !(0.0..=1.0).contains(value)) {
            return Some(format!("{key} is {value}: it is a share and must lie between 0 and 1"));
        }
        let others = [
            ("deaths", self.deaths),
            ("hangs", self.hangs),
            ("hang_s", self.hang_s),
            ("slowdowns", self.slowdowns),
            ("slower", self.slower),
            ("slow_s", self.slow_s),
            ("bursts", self.bursts),
            ("burst_s", self.burst_s),
            ("stops", self.stops),
            ("supervisor", self.supervisor),
        ];
        let wrong = others.into_iter().find(|(_, value)| !(0.0..=1e6).contains(value));
        wrong.map(|(key, value)| format!("{key} is {value}: it must be a number, zero or greater"))
    }

    fn rates(&self) -> [f64; 6] {
        [self.deaths, self.hangs, self.slowdowns, self.bursts, self.stops, self.supervisor]
    }
}

/// One thing that goes wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fault {
    Death { in_step: bool },
    Hang { seconds: f64 },
    Slowdown { factor: f64, seconds: f64 },
    Burst { seconds: f64 },
    Stop,
    Supervisor,
}

/// Draws one fault after another.
#[derive(Debug, Clone)]
pub(super) struct Faults {
    rates: FaultRates,
    pub random: Pcg64Mcg,
    next: Option<Time>,
}

impl Faults {
    pub fn new(rates: FaultRates, seed: u64, start: Time) -> Faults {
        let random = Pcg64Mcg::seed_from_u64(seed ^ 0x6661_756c_7473_0a01);
        let mut faults = Faults { rates, random, next: None };
        faults.draw_time(start);
        faults
    }

    pub fn next(&self) -> Option<Time> {
        self.next
    }

    /// The fault that is due, if one is.
    pub fn take(&mut self, now: Time) -> Option<Fault> {
        self.next.filter(|&at| at <= now)?;
        self.draw_time(now);
        let rates = self.rates.rates();
        let mut left = self.uniform() * rates.iter().sum::<f64>();
        let kind = rates.iter().position(|&rate| {
            left -= rate;
            left < 0.0
        });
        let part = self.uniform();
        let r = self.rates;
        Some(match kind.unwrap_or(0) {
            0 => Fault::Death { in_step: part < r.in_step },
            1 => Fault::Hang { seconds: part * r.hang_s },
            2 => Fault::Slowdown { factor: 1.0 + part * (r.slower - 1.0).max(0.0), seconds: self.uniform() * r.slow_s },
            3 => Fault::Burst { seconds: part * r.burst_s },
            4 => Fault::Stop,
            _ => Fault::Supervisor,
        })
    }

    fn draw_time(&mut self, now: Time) {
        let per_s = self.rates.rates().iter().sum::<f64>() / 60.0;
        let u = 1.0 - self.uniform();
        self.next = (per_s > 0.0).then(|| now.after_s(-math::ln(u) / per_s).max(now.after_ns(1)));
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform between two bounds.
    pub fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.uniform()
    }

    /// One of `count`.
    pub fn choose(&mut self, count: usize) -> usize {
        ((self.uniform() * count as f64) as usize).min(count.saturating_sub(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_come_as_often_as_their_rates_say_and_the_same_from_the_same_seed() {
        let mut faults = Faults::new(FaultRates::CHAOS, 7, Time::ZERO);
        let mut again = Faults::new(FaultRates::CHAOS, 7, Time::ZERO);
        let (mut count, mut deaths) = (0, 0);
        while let Some(at) = faults.next().filter(|at| *at < Time::from_seconds(6000.0)) {
            let fault = faults.take(at);
            assert_eq!((again.next(), again.take(at)), (Some(at), fault));
            count += 1;
            deaths += u32::from(matches!(fault, Some(Fault::Death { .. })));
        }
        // 31 a minute for 100 minutes: 3100 ± 4·√3100.
        assert!((2880..3320).contains(&count), "{count}");
        assert!((1250..1550).contains(&deaths), "{deaths}");
    }

    #[test]
    fn without_rates_nothing_ever_goes_wrong() {
        assert_eq!(Faults::new(FaultRates::default(), 1, Time::ZERO).next(), None);
        assert!(
            FaultRates { lost_bytes: 2.0, ..FaultRates::default() }.flaw().is_some_and(|f| f.contains("lost_bytes"))
        );
        assert!(FaultRates { deaths: f64::NAN, ..FaultRates::default() }.flaw().is_some());
    }
}
