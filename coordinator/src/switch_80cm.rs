//! The algorithm `switch_80cm` (S2's baseline): Avoid takes over when an obstacle comes within 80 cm.
//!
//! While something is near, the actions that take over decide alone on all axes, if they have any opinion; otherwise all
//! the others do. Among those who decide it is the weighted mean. An opinion that must be obeyed counts always.

use crate::opinion::Opinion;
use crate::round::{Decisions, Round};
use crate::weighted::weighted;

/// Decides a round.
pub fn switch_80cm(round: &Round<'_>) -> Decisions {
    let taken_over = round.near && round.opinions.iter().any(|axis| axis.iter().any(|opinion| opinion.takes_over));
    let decides = |opinion: &&Opinion| opinion.takes_over == taken_over || opinion.must();
    round.by_axis(|axis| weighted(axis.iter().filter(decides)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::round::tests::{opinion, round};

    fn avoid(value: f64) -> Opinion {
        Opinion { takes_over: true, ..opinion(1, value, 1.0, 0.5) }
    }

    #[test]
    fn avoid_takes_over_on_all_axes_when_an_obstacle_is_near() {
        let (forward, turn) = ([opinion(0, 0.5, 1.0, 0.5), avoid(0.1)], [opinion(0, -0.3, 1.0, 0.5), avoid(0.4)]);
        let near = switch_80cm(&Round { near: true, ..round(&forward, &turn) });
        assert_eq!(near.map(|axis| axis.map(|d| d.value)), [Some(0.1), None, Some(0.4)]);
        let far = switch_80cm(&round(&forward, &turn));
        assert_eq!(far.map(|axis| axis.map(|d| d.value)), [Some(0.5), None, Some(-0.3)]);
    }

    #[test]
    fn an_axis_on_which_it_abstains_stands_still_meanwhile() {
        let (forward, turn) = ([opinion(0, 0.5, 1.0, 0.5)], [avoid(0.4)]);
        let near = switch_80cm(&Round { near: true, ..round(&forward, &turn) });
        assert_eq!(near[0], None, "the other's speed belongs to another path");
    }

    #[test]
    fn near_an_obstacle_that_nobody_avoids_all_goes_on() {
        let forward = [opinion(0, 0.5, 1.0, 0.5)];
        assert_eq!(switch_80cm(&Round { near: true, ..round(&forward, &[]) })[0].unwrap().value, 0.5);
    }

    #[test]
    fn a_person_at_the_keyboard_is_obeyed_all_the_same() {
        let forward = [opinion(0, -0.1, 1.0, 1.0), avoid(0.2)];
        assert_eq!(switch_80cm(&Round { near: true, ..round(&forward, &[]) })[0].unwrap().value, -0.1);
    }
}
