//! The algorithm `fuzzy` (S4's linguistic commands): opinions are spread over words, merged there, and read back.
//!
//! The terms of an axis are 0, ± the three words, and ± the mode's limit where it is greater; their triangles overlap so
//! that memberships sum to one. A wish x between the terms c_i and c_{i+1} belongs to them by μ_i = (c_{i+1} − x)/(c_{i+1} − c_i)
//! and 1 − μ_i. Each term's strength is the greatest μ·weight·urgency of all opinions (the union of fuzzy sets), and the
//! result is the mean of the terms by their strengths. So one opinion alone is obeyed exactly, two that say the same count
//! once, and two that contradict each other meet in the middle. What must be obeyed is merged among itself.

use crate::opinion::{Caps, Decision, Opinion, Words};
use crate::round::{Decisions, Round};

/// Terms of an axis.
const TERMS: usize = 9;

/// Decides a round.
pub fn fuzzy(round: &Round<'_>) -> Decisions {
    let axis = |k: usize| merge(round.opinions[k], &terms(&round.words[k], &round.limits[k]));
    [axis(0), axis(1), axis(2)]
}

/// The terms' centres, from the least to the greatest.
fn terms(words: &Words, limit: &Caps) -> [f64; TERMS] {
    let [little, some, much] = *words;
    let most = much.max(limit.apply(f64::MAX)).max(-limit.apply(f64::MIN));
    [-most, -much, -some, -little, 0.0, little, some, much, most]
}

fn merge(opinions: &[Opinion], terms: &[f64; TERMS]) -> Option<Decision> {
    let must = opinions.iter().any(Opinion::must);
    let (mut strengths, mut total, mut greatest) = ([0.0_f64; TERMS], 0.0, 0.0_f64);
    for opinion in opinions.iter().filter(|opinion| opinion.must() == must) {
        let strength = opinion.weight * opinion.urgency;
        total += strength;
        greatest = greatest.max(strength);
        for (term, membership) in memberships(opinion.value, terms) {
            strengths[term] = strengths[term].max(strength * membership);
        }
    }
    let all: f64 = strengths.iter().sum();
    let value = strengths.iter().zip(terms).map(|(strength, centre)| strength * centre).sum::<f64>() / all;
    (all > 0.0 && value.is_finite() && total.is_finite()).then(|| Decision { value, share: greatest / total })
}

/// The two terms that a value belongs to, and how much; beyond the outermost it belongs to that one.
fn memberships(value: f64, terms: &[f64; TERMS]) -> [(usize, f64); 2] {
    let value = value.clamp(terms[0], terms[TERMS - 1]);
    // The last term whose centre is not beyond the value: words may coincide.
    let below = terms.iter().rposition(|centre| *centre <= value).unwrap_or(0);
    let above = (below + 1).min(TERMS - 1);
    let width = terms[above] - terms[below];
    let part = if width > 0.0 { (value - terms[below]) / width } else { 0.0 };
    [(below, 1.0 - part), (above, part)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::round::tests::{opinion, round};
    use proptest::prelude::*;

    fn value(forward: &[Opinion]) -> Option<f64> {
        fuzzy(&round(forward, &[]))[0].map(|decision| decision.value)
    }

    #[test]
    fn two_that_say_the_same_count_once_and_two_that_contradict_meet() {
        assert_eq!(value(&[]), None);
        let (left, right) = (opinion(0, 0.3, 1.0, 0.5), opinion(1, -0.3, 1.0, 0.5));
        assert!(value(&[left, right]).unwrap().abs() < 1e-12);
        assert!(value(&[left, left, right]).unwrap().abs() < 1e-12, "a mean would lean to the left");
        assert!(value(&[Opinion { weight: 2.0, ..left }, right]).unwrap() > 0.09);
    }

    #[test]
    fn what_must_be_obeyed_is_merged_among_itself() {
        assert_eq!(value(&[opinion(0, 0.3, 9.0, 0.5), opinion(1, -0.1, 1.0, 1.0)]), Some(-0.1));
    }

    #[test]
    fn words_that_coincide_do_no_harm() {
        let words = [0.2, 0.2, 0.2];
        let terms = terms(&words, &Caps::new(0.2, 0.2));
        assert_eq!(merge(&[opinion(0, 0.2, 1.0, 0.5)], &terms).map(|d| d.value), Some(0.2));
        assert_eq!(merge(&[opinion(0, -0.9, 1.0, 0.5)], &terms).map(|d| d.value), Some(-0.2));
    }

    proptest! {
        #[test]
        fn one_opinion_alone_is_obeyed_up_to_the_limit(x in -0.7..0.7f64) {
            let got = value(&[opinion(0, x, 1.0, 0.5)]).unwrap();
            prop_assert!((got - x.clamp(-0.5, 0.5)).abs() < 1e-12);
        }

        #[test]
        fn the_result_lies_between_the_least_and_the_greatest_term(
            opinions in prop::collection::vec((-0.5..0.5f64, 0.01..10.0f64, 0.01..0.99f64), 1..8),
        ) {
            let opinions: Vec<Opinion> = opinions.into_iter().map(|(v, w, u)| opinion(0, v, w, u)).collect();
            let got = value(&opinions).unwrap();
            prop_assert!(got.abs() <= 0.5 + 1e-12);
        }
    }
}
