//! The algorithm `weighted`: the mean of all opinions, each by its weight times its urgency.
//!
//! Opinions that must be obeyed are averaged among themselves, and the others do not count beside them.

use crate::opinion::{Decision, Opinion};

/// Σ wᵢuᵢxᵢ / Σ wᵢuᵢ; `None` without opinions.
pub fn weighted<'a>(opinions: impl Iterator<Item = &'a Opinion> + Clone) -> Option<Decision> {
    let must = opinions.clone().any(Opinion::must);
    let (mut sum, mut total, mut greatest) = (0.0, 0.0, 0.0_f64);
    for opinion in opinions.filter(|opinion| opinion.must() == must) {
        let weight = opinion.weight * opinion.urgency;
        sum += weight * opinion.value;
        total += weight;
        greatest = greatest.max(weight);
    }
    // Weights so small that they vanish, or so large that they overflow, decide nothing.
    (total > 0.0 && sum.is_finite() && total.is_finite())
        .then(|| Decision { value: sum / total, share: greatest / total })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::round::tests::opinion;
    use proptest::prelude::*;

    #[test]
    fn nobody_decides_nothing() {
        assert_eq!(weighted([].iter()), None);
    }

    #[test]
    fn twice_the_weight_pulls_twice_as_hard() {
        let decision = weighted([opinion(0, 0.0, 1.0, 0.5), opinion(1, 0.3, 2.0, 0.5)].iter()).unwrap();
        assert!((decision.value - 0.2).abs() < 1e-12);
        assert!((decision.share - 2.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn what_must_be_obeyed_is_not_watered_down() {
        let decision = weighted([opinion(0, 0.3, 9.0, 0.9), opinion(1, -0.1, 1.0, 1.0)].iter()).unwrap();
        assert_eq!(decision, Decision { value: -0.1, share: 1.0 });
    }

    proptest! {
        #[test]
        fn the_mean_lies_between_the_least_and_the_greatest(
            opinions in prop::collection::vec((-2.0..2.0f64, 0.01..10.0f64, 0.01..0.99f64), 1..10),
        ) {
            let opinions: Vec<Opinion> = opinions.into_iter().map(|(v, w, u)| opinion(0, v, w, u)).collect();
            let value = weighted(opinions.iter()).unwrap().value;
            let least = opinions.iter().map(|o| o.value).fold(f64::INFINITY, f64::min);
            let greatest = opinions.iter().map(|o| o.value).fold(f64::NEG_INFINITY, f64::max);
            prop_assert!(value >= least - 1e-12 && value <= greatest + 1e-12);
        }
    }
}
