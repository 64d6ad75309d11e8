//! Seeded chance. Every purpose has a generator of its own, so that switching one noise off leaves the others as they
//! were.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// What a generator is for; part of its seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    Start = 1,
    Person = 2,
    Wheels = 3,
    Sonar = 4,
    Line = 5,
    Laser = 6,
    Crowd = 7,
    Layout = 20,
    Swarm = 21,
}

/// A seeded generator.
#[derive(Debug, Clone)]
pub(crate) struct Chance(Pcg32);

impl Chance {
    /// The generator for `purpose` of the `index`-th body or person under `seed`.
    pub fn new(seed: u64, purpose: Purpose, index: usize) -> Chance {
        // A multiplier with well spread bits keeps neighbouring seeds and purposes apart; the generator mixes on.
        let apart = ((purpose as u64) << 32 | index as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        Chance(Pcg32::seed_from_u64(seed ^ apart))
    }

    /// Evenly distributed in [0, 1).
    pub fn share(&mut self) -> f64 {
        f64::from(self.0.next_u32()) * (1.0 / 4_294_967_296.0)
    }

    /// Evenly distributed in [−1, 1).
    pub fn either_way(&mut self) -> f64 {
        2.0 * self.share() - 1.0
    }

    /// Whether something of this probability happens.
    pub fn happens(&mut self, probability: f64) -> bool {
        probability > 0.0 && self.share() < probability
    }

    /// Mean 0, variance 1, nearly normal, at most 3.46 from the mean: the sum of four even numbers.
    ///
    /// It needs no logarithm and bounds the worst case, which a true normal distribution does not.
    pub fn normal(&mut self) -> f64 {
        let sum: u64 = [self.0.next_u32(), self.0.next_u32()]
            .into_iter()
            .map(|bits| u64::from(bits & 0xFFFF) + u64::from(bits >> 16))
            .sum();
        // Each of the four has mean 1/2 and variance 1/12.
        (sum as f64 / 65_536.0 - 2.0) * 1.732_050_807_568_877_2
    }

    /// A random byte.
    pub fn byte(&mut self) -> u8 {
        self.0.next_u32() as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_numbers_have_mean_zero_and_variance_one() {
        let mut chance = Chance::new(1, Purpose::Sonar, 0);
        let numbers: Vec<f64> = (0..100_000).map(|_| chance.normal()).collect();
        let mean = numbers.iter().sum::<f64>() / 1e5;
        let variance = numbers.iter().map(|number| number * number).sum::<f64>() / 1e5;
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.01, "{mean} {variance}");
        assert!(numbers.iter().all(|number| number.abs() < 3.47));
    }

    #[test]
    fn seeds_purposes_and_bodies_give_other_numbers() {
        let first = |seed, purpose, index| Chance::new(seed, purpose, index).share();
        let base = first(1, Purpose::Sonar, 0);
        assert_eq!(base, first(1, Purpose::Sonar, 0));
        assert_ne!(base, first(2, Purpose::Sonar, 0));
        assert_ne!(base, first(1, Purpose::Wheels, 0));
        assert_ne!(base, first(1, Purpose::Sonar, 1));
    }
}
