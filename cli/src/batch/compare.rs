//! Two batches on the same seeds: by how much they differ, and how sure that is.
//!
//! Missions are paired by seed. For each metric the mean difference d = B − A with its 95 % interval d ± t·s/√n (paired t,
//! n − 1 degrees of freedom; the quantile by Cornish and Fisher's expansion, exact to 1 % from n = 5 on). Successes are
//! compared by the seeds on which the two disagree: the exact two-sided sign test.

use super::figures::{METRICS, mean_and_deviation, wilson};
use super::mission::Mission;
use serde::Serialize;
use std::collections::BTreeMap;

/// What a comparison found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Seeds that both have.
    pub seeds: usize,
    /// Seeds that only one has; they do not count.
    pub unpaired: usize,
    /// Runs that agree to the last bit.
    pub identical: usize,
    /// Share of successes of A and B.
    pub success: [f64; 2],
    /// Their 95 % intervals.
    pub success_interval: [[f64; 2]; 2],
    /// Seeds on which only A, and only B, succeeded.
    pub only: [Vec<u64>; 2],
    /// Chance of so unequal a split if neither were better.
    pub p: f64,
    /// Each metric.
    pub metrics: Vec<Difference>,
}

/// One metric of both.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Which.
    pub metric: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Means of A and B.
    pub mean: [f64; 2],
    /// Mean of B − A.
    pub difference: f64,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// Whether the interval leaves zero out.
    pub significant: bool,
}

/// Compares two batches.
pub fn compare(a: &[Mission], b: &[Mission]) -> Comparison {
    let of_b: BTreeMap<u64, &Mission> = b.iter().map(|mission| (mission.seed, mission)).collect();
    let of_a: BTreeMap<u64, &Mission> = a.iter().map(|mission| (mission.seed, mission)).collect();
    let pairs: Vec<(&Mission, &Mission)> =
        of_a.iter().filter_map(|(seed, mission)| Some((*mission, *of_b.get(seed)?))).collect();
    let n = pairs.len();
    let hits = [pairs.iter().filter(|p| p.0.succeeded()).count(), pairs.iter().filter(|p| p.1.succeeded()).count()];
    let only = |first: bool| {
        let differs = |p: &&(&Mission, &Mission)| p.0.succeeded() == first && p.1.succeeded() != first;
        pairs.iter().filter(differs).map(|p| p.0.seed).collect::<Vec<u64>>()
    };
    let only = [only(true), only(false)];
    Comparison {
        seeds: n,
        unpaired: of_a.len() + of_b.len() - 2 * n,
        identical: pairs.iter().filter(|p| p.0.hash == p.1.hash).count(),
        success: hits.map(|hits| hits as f64 / n.max(1) as f64),
        success_interval: hits.map(|hits| wilson(hits as u64, n as u64)),
        p: sign_test(only[0].len(), only[1].len()),
        only,
        metrics: METRICS.iter().map(|(metric, unit, value)| difference(metric, unit, &pairs, *value)).collect(),
    }
}

fn difference(
    metric: &'static str,
    unit: &'static str,
    pairs: &[(&Mission, &Mission)],
    value: super::figures::Metric,
) -> Difference {
    let values: Vec<[f64; 2]> =
        pairs.iter().map(|(a, b)| [value(a), value(b)]).filter(|pair| pair.iter().all(|v| v.is_finite())).collect();
    let apart: Vec<f64> = values.iter().map(|[a, b]| b - a).collect();
    let (difference, deviation) = mean_and_deviation(&apart);
    let half = match apart.len() {
        0 | 1 => f64::INFINITY,
        n => t_quantile(n as f64 - 1.0) * deviation / (n as f64).sqrt(),
    };
    let mean = [0, 1].map(|side| values.iter().map(|pair| pair[side]).sum::<f64>() / values.len() as f64);
    let interval = [difference - half, difference + half];
    Difference { metric, unit, mean, difference, interval, significant: interval[0] > 0.0 || interval[1] < 0.0 }
}

/// 97.5 % quantile of Student's t with `nu` degrees of freedom (Abramowitz and Stegun 26.7.5).
fn t_quantile(nu: f64) -> f64 {
    let z: f64 = 1.959_964;
    let z2 = z * z;
    let g1 = z * (z2 + 1.0) / 4.0;
    let g2 = z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0;
    let g3 = z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0;
    z + g1 / nu + g2 / (nu * nu) + g3 / (nu * nu * nu)
}

/// Chance that `a + b` fair coins fall at least so unequally.
fn sign_test(a: usize, b: usize) -> f64 {
    let (n, few) = (a + b, a.min(b));
    // P(k) of the fair binomial, from one k to the next; very many disagreements underflow to 0, which is what they say.
    let mut chance = (0..n).fold(1.0_f64, |p, _| p * 0.5);
    let mut tail = 0.0;
    for k in 0..=few {
        tail += chance;
        chance *= (n - k) as f64 / (k + 1) as f64;
    }
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_the_sign_test_agree_with_the_tables() {
        for (nu, wanted) in [(5.0, 2.5706), (10.0, 2.2281), (30.0, 2.0423), (1000.0, 1.9623)] {
            assert!((t_quantile(nu) / wanted - 1.0).abs() < 0.01, "{nu}: {}", t_quantile(nu));
        }
        assert_eq!(sign_test(0, 0), 1.0);
        assert!((sign_test(0, 5) - 0.0625).abs() < 1e-12);
        assert!((sign_test(2, 8) - 0.109_375).abs() < 1e-12);
    }
}
