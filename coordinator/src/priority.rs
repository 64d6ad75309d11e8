//! The algorithm `priority`: one opinion wins and decides alone.
//!
//! Opinions that must be obeyed come first; then weight decides, then urgency, then the order of the paths.

use crate::opinion::{Decision, Opinion};

/// The winner's value; `None` without opinions.
pub fn priority<'a>(opinions: impl Iterator<Item = &'a Opinion>) -> Option<Decision> {
    let rank = |opinion: &Opinion| (opinion.must(), opinion.weight, opinion.urgency);
    // The first of equals wins: opinions come in the order of their paths.
    let winner = opinions.reduce(|best, next| if rank(next) > rank(best) { next } else { best })?;
    Some(Decision { value: winner.value, share: 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::round::tests::opinion;

    #[test]
    fn nobody_decides_nothing() {
        assert_eq!(priority([].iter()), None);
    }

    #[test]
    fn the_weightiest_action_decides_alone() {
        let decision = priority([opinion(0, 0.3, 1.0, 0.9), opinion(1, -0.1, 2.0, 0.1)].iter());
        assert_eq!(decision, Some(Decision { value: -0.1, share: 1.0 }));
    }

    #[test]
    fn what_must_be_obeyed_comes_before_any_weight() {
        let decision = priority([opinion(0, 0.3, 9.0, 0.9), opinion(1, -0.1, 1.0, 1.0)].iter());
        assert_eq!(decision.map(|d| d.value), Some(-0.1));
    }

    #[test]
    fn among_equals_the_first_path_wins() {
        let equals = [opinion(0, 1.0, 1.0, 0.5), opinion(1, 2.0, 1.0, 0.5)];
        assert_eq!(priority(equals.iter()).map(|d| d.value), Some(1.0));
    }
}
