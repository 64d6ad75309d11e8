//! One round of arbitration, without ports: hear every proposal, then decide each axis.

use crate::arbiter::{ArbiterConfig, Policy};
use crate::opinion::{Caps, Decision, Opinion, Words};
use crate::priority::priority;
use crate::weighted::weighted;
use messages::{Axis, CoordinatorState, Proposal, Twist};

/// Most opinions on one axis; the caps of further proposals still count.
const CAPACITY: usize = 64;

/// What has been heard in this round.
#[derive(Debug)]
pub struct Arbitration {
    config: ArbiterConfig,
    limits: [Caps; 3],
    opinions: [Vec<Opinion>; 3],
    caps: [Caps; 3],
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
    /// Under `config`, never faster than `limits` (forward, sideways, turn).
    pub fn new(config: ArbiterConfig, limits: [Caps; 3]) -> Arbitration {
        let opinions = [(); 3].map(|()| Vec::with_capacity(CAPACITY));
        let state = CoordinatorState::default();
        Arbitration { config, limits, opinions, caps: limits, state, limp: None, limping: false }
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
        self.limping = limping;
        self.caps = self.limits;
        if let Some(limp) = self.limp.as_ref().filter(|_| limping) {
            for (caps, limp) in self.caps.iter_mut().zip(&limp.limits) {
                *caps = caps.least(limp);
            }
        }
        self.state = CoordinatorState::default();
    }

    /// Takes in what `action` proposed `age_s` ago.
    pub fn hear(&mut self, action: &str, age_s: f64, proposal: &Proposal) {
        // A validity that is no number has passed.
        if !(proposal.valid_for_s.is_finite() && age_s <= proposal.valid_for_s) {
            self.state.stale += 1;
            return;
        }
        self.state.proposals += 1;
        let mode = &self.config.mode;
        let silenced = self.limping && self.limp.as_ref().is_some_and(|limp| !limp.actions.iter().any(|a| a == action));
        let weight = mode.weights.get(action).copied().unwrap_or(mode.other_weight);
        let weight = if silenced { 0.0 } else { weight };
        let (speed, turn): (&Words, &Words) = (&self.config.speed_words_m_s, &self.config.turn_words_rad_s);
        let axes: [(&Axis, &Words); 3] =
            [(&proposal.forward, speed), (&proposal.sideways, speed), (&proposal.turn, turn)];
        for (k, (axis, words)) in axes.into_iter().enumerate() {
            self.caps[k].tighten(axis);
            if let Some(opinion) = Opinion::of(axis, weight, proposal.urgency, words)
                && self.opinions[k].len() < CAPACITY
            {
                self.opinions[k].push(opinion);
            }
        }
    }

    /// The wanted velocity, and how it came about.
    pub fn decide(&mut self) -> (Twist, CoordinatorState) {
        let mut values = [0.0; 3];
        for (k, value) in values.iter_mut().enumerate() {
            let policy = match self.config.mode.policy {
                Policy::Weighted => weighted,
                Policy::Priority => priority,
            };
            let decision = policy(&self.opinions[k]).unwrap_or(Decision { value: 0.0, share: 0.0 });
            *value = self.caps[k].apply(decision.value);
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
    use crate::arbiter::Mode;
    use messages::Wish;
    use proptest::prelude::*;

    fn arbitration(policy: Policy, weights: &[(&str, f64)]) -> Arbitration {
        let weights = weights.iter().map(|&(name, weight)| (name.to_owned(), weight)).collect();
        let config = ArbiterConfig { mode: Mode { policy, weights, ..Mode::default() }, ..ArbiterConfig::default() };
        Arbitration::new(config, [Caps::new(0.3, 0.1), Caps::new(0.0, 0.0), Caps::new(0.8, 0.8)])
    }

    fn proposal(forward: Axis, turn: Axis) -> Proposal {
        Proposal { forward, turn, urgency: 0.5, valid_for_s: 0.3, ..Proposal::default() }
    }

    fn decide(arbitration: &mut Arbitration, proposals: &[(&str, f64, Proposal)]) -> (Twist, CoordinatorState) {
        arbitration.begin(false);
        for (action, age_s, proposal) in proposals {
            arbitration.hear(action, *age_s, proposal);
        }
        arbitration.decide()
    }

    #[test]
    fn no_proposal_is_standing_still() {
        let (twist, state) = decide(&mut arbitration(Policy::Weighted, &[]), &[]);
        assert_eq!(twist, Twist::default());
        assert_eq!(state.proposals, 0);
    }

    #[test]
    fn wander_emerges_because_both_axes_are_obeyed() {
        for policy in [Policy::Weighted, Policy::Priority] {
            let forward = proposal(Axis::exact(0.25), Axis::NONE);
            let steer_clear = proposal(Axis::NONE, Axis::exact(-0.5));
            let all = [("forward", 0.0, forward), ("steer_clear", 0.1, steer_clear)];
            let (twist, _) = decide(&mut arbitration(policy, &[]), &all);
            assert_eq!((twist.linear_x_m_s, twist.angular_z_rad_s), (0.25, -0.5));
        }
    }

    #[test]
    fn an_expired_proposal_counts_as_absent_with_its_caps() {
        let old = proposal(Axis::capped(0.0), Axis::exact(0.5));
        let forward = proposal(Axis::exact(0.25), Axis::NONE);
        let all = [("forward", 0.0, forward), ("old", 0.31, old)];
        let (twist, state) = decide(&mut arbitration(Policy::Weighted, &[]), &all);
        assert_eq!(twist, Twist { linear_x_m_s: 0.25, ..Twist::default() });
        assert_eq!((state.proposals, state.stale), (1, 1));
    }

    #[test]
    fn the_cap_of_an_action_without_weight_still_applies() {
        let all = [
            ("forward", 0.0, proposal(Axis::exact(0.25), Axis::NONE)),
            ("watch", 0.0, proposal(Axis::capped(0.1), Axis::exact(0.7))),
        ];
        let (twist, state) = decide(&mut arbitration(Policy::Weighted, &[("watch", 0.0)]), &all);
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
            axes in prop::collection::vec((any_axis(), any_axis(), any_number()), 0..8), weighted in any::<bool>(),
        ) {
            let policy = if weighted { Policy::Weighted } else { Policy::Priority };
            let mut arbitration = arbitration(policy, &[]);
            arbitration.begin(false);
            let (mut positive, mut negative) = (0.3_f64, 0.1_f64);
            for (forward, turn, urgency) in &axes {
                let proposal = Proposal { urgency: *urgency, ..proposal(*forward, *turn) };
                arbitration.hear("some", 0.0, &proposal);
                positive = positive.min(if forward.cap_positive >= 0.0 { forward.cap_positive } else { 0.0 });
                negative = negative.min(if forward.cap_negative >= 0.0 { forward.cap_negative } else { 0.0 });
            }
            let (twist, _) = arbitration.decide();
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
