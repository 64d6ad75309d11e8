//! The policy `priority`: one opinion wins and decides alone.
//!
//! Opinions that must be obeyed come first; then weight decides, then urgency, then the order of the paths.

use crate::opinion::{Decision, Opinion};

/// The winner's value; `None` without opinions.
pub fn priority(opinions: &[Opinion]) -> Option<Decision> {
    let rank = |opinion: &Opinion| (opinion.must(), opinion.weight, opinion.urgency);
    // The first of equals wins: opinions come in the order of their paths.
    let winner = opinions.iter().reduce(|best, next| if rank(next) > rank(best) { next } else { best })?;
    Some(Decision { value: winner.value, share: 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opinion(value: f64, weight: f64, urgency: f64) -> Opinion {
        Opinion { value, weight, urgency }
    }

    #[test]
    fn nobody_decides_nothing() {
        assert_eq!(priority(&[]), None);
    }

    #[test]
    fn the_weightiest_action_decides_alone() {
        let decision = priority(&[opinion(0.3, 1.0, 0.9), opinion(-0.1, 2.0, 0.1)]);
        assert_eq!(decision, Some(Decision { value: -0.1, share: 1.0 }));
    }

    #[test]
    fn what_must_be_obeyed_comes_before_any_weight() {
        let decision = priority(&[opinion(0.3, 9.0, 0.9), opinion(-0.1, 1.0, 1.0)]);
        assert_eq!(decision.map(|d| d.value), Some(-0.1));
    }

    #[test]
    fn among_equals_the_first_path_wins() {
        assert_eq!(priority(&[opinion(1.0, 1.0, 0.5), opinion(2.0, 1.0, 0.5)]).map(|d| d.value), Some(1.0));
    }
}
