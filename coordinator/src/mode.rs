//! Modes: which actions count, by which algorithm, and how fast the body may go.

use crate::fuzzy::fuzzy;
use crate::opinion::Caps;
use crate::priority::priority;
use crate::priority_with_veto::priority_with_veto;
use crate::round::{Decisions, Round};
use crate::switch_80cm::switch_80cm;
use crate::weighted::weighted;
use runtime::Body;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// How the opinions of one round become one velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
pub enum Algorithm {
    /// Mean by weight times urgency, on each axis.
    #[default]
    #[serde(rename = "weighted")]
    Weighted,
    /// The weightiest decides alone, on each axis.
    #[serde(rename = "priority")]
    Priority,
    /// The actions of `takes_over` decide alone while an obstacle is near (S2's baseline).
    #[serde(rename = "switch_80cm")]
    Switch80cm,
    /// Opinions are spread over the words "much" … "a little" and merged there (S4).
    #[serde(rename = "fuzzy")]
    Fuzzy,
    /// The weightiest whose whole proposal nobody forbids.
    #[serde(rename = "priority_with_veto")]
    PriorityWithVeto,
}

impl Algorithm {
    /// Decides a round.
    pub fn decide(self, round: &Round<'_>) -> Decisions {
        match self {
            Algorithm::Weighted => round.by_axis(|axis| weighted(axis.iter())),
            Algorithm::Priority => round.by_axis(|axis| priority(axis.iter())),
            Algorithm::Switch80cm => switch_80cm(round),
            Algorithm::Fuzzy => fuzzy(round),
            Algorithm::PriorityWithVeto => priority_with_veto(round),
        }
    }
}

/// Which actions count, and how fast the body may go.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mode {
    /// The mode's name.
    pub name: String,
    /// How opinions become one.
    pub algorithm: Algorithm,
    /// Weight of each action, by instance name; zero silences its wishes, never its caps.
    pub weights: BTreeMap<String, f64>,
    /// Weight of an action that is not listed.
    pub other_weight: f64,
    /// `switch_80cm`: the actions that take over.
    pub takes_over: Vec<String>,
    /// `switch_80cm`: an obstacle nearer than this to the body's centre hands over to them [m].
    pub switch_m: f64,
    /// Whether local minima are looked for and left.
    pub leaves_minima: bool,
    /// Greatest forward speed; the body's own when left out [m/s].
    pub max_forward_m_s: Option<f64>,
    /// Greatest backward speed; the body's own when left out [m/s].
    pub max_backward_m_s: Option<f64>,
    /// Greatest speed to either side [m/s].
    pub max_sideways_m_s: f64,
    /// Greatest turn rate; the body's own when left out [rad/s].
    pub max_turn_rad_s: Option<f64>,
}

impl Default for Mode {
    fn default() -> Mode {
        Mode {
            name: "default".into(),
            algorithm: Algorithm::Weighted,
            weights: BTreeMap::new(),
            other_weight: 1.0,
            takes_over: vec!["avoid".into()],
            switch_m: 0.8,
            leaves_minima: false,
            max_forward_m_s: None,
            max_backward_m_s: None,
            max_sideways_m_s: 0.0,
            max_turn_rad_s: None,
        }
    }
}

impl Mode {
    /// Weight of `action`.
    pub fn weight(&self, action: &str) -> f64 {
        self.weights.get(action).copied().unwrap_or(self.other_weight)
    }

    /// Greatest velocities (forward, sideways, turn) of `body` in this mode.
    pub fn limits(&self, body: &Body) -> [Caps; 3] {
        let turn = self.max_turn_rad_s.unwrap_or(body.max_turn_rad_s);
        let forward = self.max_forward_m_s.unwrap_or(body.max_forward_m_s);
        let backward = self.max_backward_m_s.unwrap_or(body.max_backward_m_s);
        let aside = self.max_sideways_m_s;
        [Caps::new(forward, backward), Caps::new(aside, aside), Caps::new(turn, turn)]
    }

    /// Says which setting is wrong; `key` is where the mode is written.
    pub fn check(&self, key: &str) -> Result<(), String> {
        let weights = self.weights.iter().map(|(action, weight)| (format!("weights.{action}"), *weight));
        let limits = [
            ("max_forward_m_s", self.max_forward_m_s),
            ("max_backward_m_s", self.max_backward_m_s),
            ("max_turn_rad_s", self.max_turn_rad_s),
            ("max_sideways_m_s", Some(self.max_sideways_m_s)),
            ("other_weight", Some(self.other_weight)),
            ("switch_m", Some(self.switch_m)),
        ];
        let limits = limits.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        for (name, value) in weights.chain(limits) {
            if !value.is_finite() || value < 0.0 {
                return Err(format!("{key}.{name} = {value} must be a number, zero or greater"));
            }
        }
        Ok(())
    }
}
