//! Faults from a seed: how often what goes wrong, drawn as a list ([`PlannedFault`]).
//!
//! Each kind is a Poisson process of its own rate: the time to the next fault is −ln(u)/λ with u uniform in (0, 1]. Each
//! kind draws from a random stream of its own, and each fault draws the same number of times: without one kind, or with
//! one fault taken out of the list, all others stay what they are.

use super::planned::{PlannedFault, When};
use crate::robot_plan::RobotPlan;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use runtime::robot::Robot;
use runtime::{Layer, math};
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
        let wrong = others.into_iter().find(|(_, value)| !(0.0..=MOST).contains(value));
        wrong.map(|(key, value)| format!("{key} is {value}: it must be a number between 0 and {MOST}"))
    }

    /// The faults of `robot`'s first `seconds` from `seed`, by time.
    pub fn draw(&self, robot: &Robot, seed: u64, seconds: f64) -> Vec<PlannedFault> {
        self.draw_for(&mortal(robot), seed, seconds)
    }

    /// The same for processes of these nodes.
    fn draw_for(&self, targets: &[Vec<String>], seed: u64, seconds: f64) -> Vec<PlannedFault> {
        let rates = [self.deaths, self.hangs, self.slowdowns, self.bursts, self.stops, self.supervisor];
        let mut faults = Vec::new();
        for (kind, rate) in rates.into_iter().enumerate().filter(|(_, rate)| *rate > 0.0) {
            let mut stream = Stream::new(seed, kind as u64);
            let mut at_s = 0.0;
            loop {
                at_s += -math::ln(1.0 - stream.uniform()) * 60.0 / rate;
                if at_s >= seconds {
                    break;
                }
                // Always as many draws, whatever the kind makes of them.
                let draws = [(); 5].map(|()| stream.uniform());
                faults.extend(self.fault(kind, neat(at_s), draws, targets));
            }
        }
        faults.sort_by(|a, b| a.at_s().total_cmp(&b.at_s()));
        faults
    }

    /// One fault; `None` where the robot has nothing that could have it.
    fn fault(&self, kind: usize, at_s: f64, draws: [f64; 5], targets: &[Vec<String>]) -> Option<PlannedFault> {
        let [who, which, a, b, c] = draws;
        let node = |which: f64| Some(one_of(one_of(targets, who)?, which)?.clone());
        Some(match kind {
            0 => {
                let in_step = a < self.in_step;
                let when = *one_of(&[When::MidWrite, When::BeforeHead, When::BeforeWake], b)?;
                let (when, writes) = if in_step { (when, (c * 4.0) as u32) } else { (When::AtOnce, 0) };
                PlannedFault::Death { at_s, node: node(which)?, when, writes }
            }
            1 => PlannedFault::Hang { at_s, node: node(which)?, for_s: neat(a * self.hang_s) },
            2 => {
                let factor = neat(1.0 + a * (self.slower - 1.0).max(0.0));
                PlannedFault::Slowdown { at_s, node: node(which)?, factor, for_s: neat(b * self.slow_s) }
            }
            3 => {
                let (for_s, seed) = (neat(a * self.burst_s), (b * f64::from(u32::MAX)) as u32);
                PlannedFault::Burst { at_s, share: self.lost_bytes, for_s, seed }
            }
            4 => {
                // An impatient person; a patient one comes when the cause has gone.
                let (gone_after_s, reset_after_s) = (neat(0.2 + 1.8 * a), neat(0.1 + 2.9 * b));
                PlannedFault::Stop { at_s, node: node(which)?, gone_after_s, reset_after_s }
            }
            _ => PlannedFault::Supervisor { at_s, for_s: neat(0.3e-3 + 19.7e-3 * a) },
        })
    }
}

/// Greatest rate, factor and duration: more is no fault but another robot.
const MOST: f64 = 1e4;

/// The processes that can die, as the paths of their nodes. The world is what the robot is in: it does not die.
pub(super) fn mortal(robot: &Robot) -> Vec<Vec<String>> {
    let of_world = |node: &usize| robot.nodes[*node].kind.layer == Layer::Simulator;
    let crews = RobotPlan::of(robot).crews.into_iter().filter(|crew| !crew.nodes.iter().any(of_world));
    crews.map(|crew| crew.nodes.iter().map(|&node| robot.nodes[node].path()).collect()).collect()
}

fn one_of<T>(all: &[T], draw: f64) -> Option<&T> {
    all.get(((draw * all.len() as f64) as usize).min(all.len().saturating_sub(1)))
}

/// To the microsecond: what a file says is then exactly what was drawn.
fn neat(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// A random stream of its own for every number.
#[derive(Debug, Clone)]
pub(super) struct Stream(Pcg64Mcg);

impl Stream {
    pub fn new(seed: u64, number: u64) -> Stream {
        // Pcg64Mcg spreads seeds that differ in one bit.
        let number = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Stream(Pcg64Mcg::seed_from_u64(seed ^ 0x6661_756c_7473_0a01 ^ number))
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(rates: FaultRates, seed: u64) -> Vec<PlannedFault> {
        let targets = vec![vec!["/drivers/base".to_owned()], vec!["/actions/a".to_owned(), "/actions/b".to_owned()]];
        rates.draw_for(&targets, seed, 6000.0)
    }

    #[test]
    fn faults_come_as_often_as_their_rates_say_and_the_same_from_the_same_seed() {
        let faults = draw(FaultRates::CHAOS, 7);
        assert_eq!(faults, draw(FaultRates::CHAOS, 7));
        assert_ne!(faults, draw(FaultRates::CHAOS, 8));
        let deaths = faults.iter().filter(|fault| matches!(fault, PlannedFault::Death { .. })).count();
        // 31 a minute for 100 minutes: 3100 ± 4·√3100.
        assert!((2880..3320).contains(&faults.len()), "{}", faults.len());
        assert!((1250..1550).contains(&deaths), "{deaths}");
        assert!(faults.windows(2).all(|pair| pair[0].at_s() <= pair[1].at_s()), "by time");
    }

    #[test]
    fn one_kind_less_leaves_the_others_unchanged() {
        let all = draw(FaultRates::CHAOS, 3);
        let fewer = draw(FaultRates { deaths: 0.0, bursts: 0.0, ..FaultRates::CHAOS }, 3);
        let gone = |fault: &&PlannedFault| matches!(fault, PlannedFault::Death { .. } | PlannedFault::Burst { .. });
        let rest: Vec<PlannedFault> = all.iter().filter(|fault| !gone(fault)).cloned().collect();
        assert!(!rest.is_empty() && rest.len() < all.len());
        assert_eq!(fewer, rest);
    }

    #[test]
    fn without_rates_nothing_ever_goes_wrong() {
        assert!(draw(FaultRates::default(), 1).is_empty());
        assert!(
            FaultRates { lost_bytes: 2.0, ..FaultRates::default() }.flaw().is_some_and(|f| f.contains("lost_bytes"))
        );
        assert!(FaultRates { deaths: f64::NAN, ..FaultRates::default() }.flaw().is_some());
    }
}
