//! One round of arbitration, without ports: hear every proposal, then decide by the mode's algorithm.

use crate::mode::Mode;
use crate::opinion::{Caps, Decision, Opinion, Words};
use crate::round::Round;
use messages::{Axis, CoordinatorState, Proposal, Twist};
use runtime::Body;

/// Most opinions on one axis; the caps of further proposals still count.
const CAPACITY: usize = 64;

/// What has been heard in this round.
#[derive(Debug)]
pub struct Arbitration {
    modes: Vec<Mode>,
    /// Each mode's own limits (forward, sideways, turn).
    limits: Vec<[Caps; 3]>,
    words: [Words; 3],
    mode: usize,
    opinions: [Vec<Opinion>; 3],
    vetoes: [Caps; 3],
    state: CoordinatorState,
    limp: Option<LimpMode>,
    limping: bool,
}

/// What limp mode leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct LimpMode {
    /// Actions whose wishes still count.
    pub actions: Vec<String>,
    /// Never faster than this (forward, sideways, turn).
    pub limits: [Caps; 3],
}

impl Arbitration {
    /// With `modes` (at least one) for `body`; words as numbers for each axis. The first mode counts.
    pub fn new(modes: Vec<Mode>, body: &Body, words: [Words; 3]) -> Arbitration {
        let limits = modes.iter().map(|mode| mode.limits(body)).collect();
        let opinions = [(); 3].map(|()| Vec::with_capacity(CAPACITY));
        let state = CoordinatorState::default();
        Arbitration {
            modes,
            limits,
            words,
            mode: 0,
            opinions,
            vetoes: [Caps::FREE; 3],
            state,
            limp: None,
            limping: false,
        }
    }

    /// The mode.
    pub fn mode(&self) -> &Mode {
        &self.modes[self.mode]
    }

    /// The mode's index, and how many there are.
    pub fn mode_index(&self) -> (usize, usize) {
        (self.mode, self.modes.len())
    }

    /// Changes the mode; false when there is none with this index.
    pub fn set_mode(&mut self, index: u64) -> bool {
        match usize::try_from(index) {
            Ok(index) if index < self.modes.len() => {
                self.mode = index;
                true
            }
            _ => false,
        }
    }

    /// Changes to the mode whose name has this number; false when there is none.
    pub fn set_mode_by_name(&mut self, number: u32) -> bool {
        match self.modes.iter().position(|mode| messages::path_number(&mode.name) == number) {
            Some(index) => {
                self.mode = index;
                true
            }
            None => false,
        }
    }

    /// The same with a limp mode.
    #[must_use]
    pub fn with_limp(mut self, limp: Option<LimpMode>) -> Arbitration {
        self.limp = limp;
        self
    }

    /// Forgets the last round. In limp mode only what remains of it counts from now on.
    pub fn begin(&mut self, limping: bool) {
        self.opinions.iter_mut().for_each(Vec::clear);
        self.vetoes = [Caps::FREE; 3];
        self.limping = limping;
        self.state = CoordinatorState { mode: self.mode as u32, ..CoordinatorState::default() };
    }

    /// Takes in what `action` proposed `age_s` ago.
    pub fn hear(&mut self, action: &str, age_s: f64, proposal: &Proposal) {
        // A validity that is no number has passed.
        if !(proposal.valid_for_s.is_finite() && age_s <= proposal.valid_for_s) {
            self.state.stale += 1;
            return;
        }
        self.state.proposals += 1;
        let mode = &self.modes[self.mode];
        let silenced = self.limping && self.limp.as_ref().is_some_and(|limp| !limp.actions.iter().any(|a| a == action));
        let weight = if silenced { 0.0 } else { mode.weight(action) };
        let takes_over = mode.takes_over.iter().any(|name| name == action);
        let axes: [&Axis; 3] = [&proposal.forward, &proposal.sideways, &proposal.turn];
        for (k, axis) in axes.into_iter().enumerate() {
            self.vetoes[k].tighten(axis);
            if let Some(opinion) = Opinion::of(axis, weight, proposal.urgency, &self.words[k])
                && self.opinions[k].len() < CAPACITY
            {
                self.opinions[k].push(Opinion { action: self.state.proposals as usize, takes_over, ..opinion });
            }
        }
    }

    /// The mode's own limits, and in limp mode those that it leaves.
    fn limits(&self) -> [Caps; 3] {
        let own = self.limits[self.mode];
        match self.limp.as_ref().filter(|_| self.limping) {
            Some(limp) => std::array::from_fn(|k| own[k].and(&limp.limits[k])),
            None => own,
        }
    }

    /// The wanted velocity, and how it came about. `near`: an obstacle is nearer than the mode's switching distance.
    pub fn decide(&mut self, near: bool) -> (Twist, CoordinatorState) {
        let round = Round {
            opinions: [&self.opinions[0], &self.opinions[1], &self.opinions[2]],
            vetoes: self.vetoes,
            limits: self.limits(),
            words: self.words,
            near,
        };
        let decisions = self.modes[self.mode].algorithm.decide(&round);
        let mut values = [0.0; 3];
        for (k, value) in values.iter_mut().enumerate() {
            let decision = decisions[k].unwrap_or(Decision { value: 0.0, share: 0.0 });
            *value = round.limits[k].and(&round.vetoes[k]).apply(decision.value);
            self.state.share[k] = decision.share;
            if *value != decision.value {
                self.state.capped |= 1 << k;
            }
        }
        let [linear_x_m_s, linear_y_m_s, angular_z_rad_s] = values;
        (Twist { linear_x_m_s, linear_y_m_s, angular_z_rad_s }, self.state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mode::Algorithm;
    use messages::Wish;
    use proptest::prelude::*;

    const ALL: [Algorithm; 5] = [
        Algorithm::Weighted,
        Algorithm::Priority,
        Algorithm::Switch80cm,
        Algorithm::Fuzzy,
        Algorithm::PriorityWithVeto,
    ];

    fn arbitration(algorithm: Algorithm, weights: &[(&str, f64)]) -> Arbitration {
        let weights = weights.iter().map(|&(name, weight)| (name.to_owned(), weight)).collect();
        let mode = Mode { algorithm, weights, ..Mode::default() };
        let body = Body { max_forward_m_s: 0.3, max_backward_m_s: 0.1, max_turn_rad_s: 0.8, ..Body::default() };
        Arbitration::new(vec![mode], &body, [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0.15, 0.35, 0.7]])
    }

    fn proposal(forward: Axis, turn: Axis) -> Proposal {
        Proposal { forward, turn, urgency: 0.5, valid_for_s: 0.3, ..Proposal::default() }
    }

    fn decide(arbitration: &mut Arbitration, proposals: &[(&str, f64, Proposal)]) -> (Twist, CoordinatorState) {
        arbitration.begin(false);
        for (action, age_s, proposal) in proposals {
            arbitration.hear(action, *age_s, proposal);
        }
        arbitration.decide(true)
    }

    #[test]
    fn no_proposal_is_standing_still() {
        let (twist, state) = decide(&mut arbitration(Algorithm::Weighted, &[]), &[]);
        assert_eq!(twist, Twist::default());
        assert_eq!(state.proposals, 0);
    }

    #[test]
    fn wander_emerges_because_both_axes_are_obeyed() {
        for algorithm in ALL {
            let forward = proposal(Axis::exact(0.25), Axis::NONE);
            let steer_clear = proposal(Axis::NONE, Axis::exact(-0.5));
            let all = [("forward", 0.0, forward), ("steer_clear", 0.1, steer_clear)];
            let (twist, _) = decide(&mut arbitration(algorithm, &[]), &all);
            let (v, w) = (twist.linear_x_m_s, twist.angular_z_rad_s);
            assert!((v - 0.25).abs() < 1e-12 && (w + 0.5).abs() < 1e-12, "{algorithm:?}: {twist:?}");
        }
    }

    #[test]
    fn an_expired_proposal_counts_as_absent_with_its_caps() {
        let old = proposal(Axis::capped(0.0), Axis::exact(0.5));
        let forward = proposal(Axis::exact(0.25), Axis::NONE);
        let all = [("forward", 0.0, forward), ("old", 0.31, old)];
        let (twist, state) = decide(&mut arbitration(Algorithm::Weighted, &[]), &all);
        assert_eq!(twist, Twist { linear_x_m_s: 0.25, ..Twist::default() });
        assert_eq!((state.proposals, state.stale), (1, 1));
    }

    #[test]
    fn the_cap_of_an_action_without_weight_still_applies() {
        let all = [
            ("forward", 0.0, proposal(Axis::exact(0.25), Axis::NONE)),
            ("watch", 0.0, proposal(Axis::capped(0.1), Axis::exact(0.7))),
        ];
        let (twist, state) = decide(&mut arbitration(Algorithm::Weighted, &[("watch", 0.0)]), &all);
        assert_eq!(twist, Twist { linear_x_m_s: 0.1, ..Twist::default() });
        assert_eq!(state.capped, 1);
    }

    fn any_number() -> impl Strategy<Value = f64> {
        prop_oneof![4 => -2.0..2.0f64, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(f64::MIN)]
    }

    fn any_axis() -> impl Strategy<Value = Axis> {
        (any_number(), any_number(), any_number(), 0..4u32, -5..5i32).prop_map(
            |(value, cap_positive, cap_negative, wish, word)| Axis { value, cap_positive, cap_negative, wish, word },
        )
    }

    proptest! {
        #[test]
        fn caps_are_never_exceeded_and_no_output_is_ever_no_number(
            axes in prop::collection::vec((any_axis(), any_axis(), any_number()), 0..8), algorithm in 0..5usize, near in any::<bool>(),
        ) {
            let mut arbitration = arbitration(ALL[algorithm], &[]);
            arbitration.begin(false);
            let (mut positive, mut negative) = (0.3_f64, 0.1_f64);
            for (forward, turn, urgency) in &axes {
                let proposal = Proposal { urgency: *urgency, ..proposal(*forward, *turn) };
                arbitration.hear(if *urgency > 0.0 { "avoid" } else { "some" }, 0.0, &proposal);
                positive = positive.min(if forward.cap_positive >= 0.0 { forward.cap_positive } else { 0.0 });
                negative = negative.min(if forward.cap_negative >= 0.0 { forward.cap_negative } else { 0.0 });
            }
            let (twist, _) = arbitration.decide(near);
            prop_assert!(twist.linear_x_m_s <= positive && twist.linear_x_m_s >= -negative);
            prop_assert!(twist.angular_z_rad_s.abs() <= 0.8);
            prop_assert_eq!(twist.linear_y_m_s, 0.0);
            let any_wish = axes.iter().any(|(forward, _, _)| forward.wish != Wish::Abstain as u32);
            if !any_wish {
                prop_assert_eq!(twist.linear_x_m_s, 0.0);
            }
        }
    }
}
