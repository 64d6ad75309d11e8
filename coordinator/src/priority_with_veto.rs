//! The algorithm `priority_with_veto`: the weightiest whose whole proposal nobody forbids.
//!
//! As [`crate::priority`], but an action one of whose wishes is beyond a cap of another is passed over as a whole: its
//! turn belongs to its speed, and half of a proposal would be another path. Where every wish is forbidden, the axis
//! stands still. The mode's own limits cut, they do not forbid.

use crate::opinion::Opinion;
use crate::priority::priority;
use crate::round::{Decisions, Round};

/// Decides a round.
pub fn priority_with_veto(round: &Round<'_>) -> Decisions {
    let is_forbidden = |action: usize| {
        round.opinions.iter().zip(&round.vetoes).zip(&round.limits).any(|((axis, veto), limit)| {
            let beyond = |opinion: &Opinion| {
                let wanted = limit.apply(opinion.value);
                veto.apply(wanted) != wanted
            };
            axis.iter().any(|opinion| opinion.action == action && beyond(opinion))
        })
    };
    round.by_axis(|axis| priority(axis.iter().filter(|opinion| !is_forbidden(opinion.action))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::opinion::Caps;
    use crate::round::tests::{opinion, round};

    #[test]
    fn a_forbidden_proposal_is_passed_over_with_all_its_axes() {
        let forward = [opinion(0, 0.4, 2.0, 0.5), opinion(1, 0.1, 1.0, 0.5)];
        let turn = [opinion(0, 0.5, 2.0, 0.5), opinion(1, -0.2, 1.0, 0.5)];
        let mut round = round(&forward, &turn);
        assert_eq!(priority_with_veto(&round).map(|d| d.map(|d| d.value)), [Some(0.4), None, Some(0.5)]);
        round.vetoes[0] = Caps::new(0.2, 0.2);
        assert_eq!(priority_with_veto(&round).map(|d| d.map(|d| d.value)), [Some(0.1), None, Some(-0.2)]);
        round.vetoes[0] = Caps::new(0.0, 0.0);
        assert_eq!(priority_with_veto(&round), [None; 3]);
    }

    #[test]
    fn the_mode_s_limits_cut_and_do_not_forbid() {
        let forward = [opinion(0, 0.9, 1.0, 0.5)];
        assert_eq!(priority_with_veto(&round(&forward, &[]))[0].unwrap().value, 0.9);
    }

    #[test]
    fn actions_on_different_axes_are_both_obeyed() {
        let (forward, turn) = ([opinion(0, 0.2, 1.0, 0.5)], [opinion(1, 0.3, 1.0, 0.5)]);
        assert_eq!(
            priority_with_veto(&round(&forward, &turn)).map(|d| d.map(|d| d.value)),
            [Some(0.2), None, Some(0.3)]
        );
    }
}
