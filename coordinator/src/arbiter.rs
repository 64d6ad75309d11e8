//! Combines the proposals of all actions, axis by axis, into one wanted velocity.
//!
//! Reads `proposals` (a set, `/actions/*/proposal`); writes `velocity` and `state`. Each axis is decided on its own by
//! the mode's policy ([`crate::weighted`], [`crate::priority`]); the caps of every proposal that has not expired apply afterwards,
//! whatever its weight, and then the mode's own limits. An axis on which all abstain is zero. In limp mode (`[limp]`, the
//! supervisor says when) only the wishes of the actions that it names count, and its limits apply.

use crate::arbitration::{Arbitration, LimpMode};
use crate::opinion::Caps;
use messages::{CoordinatorState, Proposal, SupervisorState, Twist};
use runtime::{Fault, Layer, Node, OpenError, Ports, Reader, Set, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// How the opinions on one axis become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// Mean by weight times urgency.
    #[default]
    Weighted,
    /// The weightiest decides alone.
    Priority,
}

/// Which actions count, and how fast the body may go.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mode {
    /// The mode's name.
    pub name: String,
    /// How opinions on one axis become one.
    pub policy: Policy,
    /// Weight of each action, by instance name; zero silences its wishes, never its caps.
    pub weights: BTreeMap<String, f64>,
    /// Weight of an action that is not listed.
    pub other_weight: f64,
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
            policy: Policy::Weighted,
            weights: BTreeMap::new(),
            other_weight: 1.0,
            max_forward_m_s: None,
            max_backward_m_s: None,
            max_sideways_m_s: 0.0,
            max_turn_rad_s: None,
        }
    }
}

/// Settings of [`Arbiter`].
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ArbiterConfig {
    /// The mode.
    pub mode: Mode,
    /// Speeds for the words 1, 2, 3 along x and y [m/s].
    pub speed_words_m_s: [f64; 3],
    /// Turn rates for the words 1, 2, 3 [rad/s].
    pub turn_words_rad_s: [f64; 3],
}

impl Default for ArbiterConfig {
    fn default() -> ArbiterConfig {
        ArbiterConfig { mode: Mode::default(), speed_words_m_s: [0.1, 0.2, 0.3], turn_words_rad_s: [0.15, 0.35, 0.7] }
    }
}

/// The node.
pub struct Arbiter {
    supervision: Reader<SupervisorState>,
    proposals: Set<Proposal>,
    velocity: Writer<Twist>,
    state: Writer<CoordinatorState>,
    arbitration: Arbitration,
}

impl Node for Arbiter {
    const TYPE: &'static str = "arbiter";
    const LAYER: Layer = Layer::Coordinator;
    type Config = ArbiterConfig;

    fn open(ports: &mut Ports, config: ArbiterConfig) -> Result<Arbiter, OpenError> {
        check(&config).map_err(OpenError::config)?;
        let body = ports.body();
        let mode = &config.mode;
        let limits = [
            Caps::new(
                mode.max_forward_m_s.unwrap_or(body.max_forward_m_s),
                mode.max_backward_m_s.unwrap_or(body.max_backward_m_s),
            ),
            Caps::new(mode.max_sideways_m_s, mode.max_sideways_m_s),
            {
                let turn = mode.max_turn_rad_s.unwrap_or(body.max_turn_rad_s);
                Caps::new(turn, turn)
            },
        ];
        let limp = ports.limp().map(|limp| {
            let (speed, turn) = (limp.max_speed_m_s, limp.max_turn_rad_s.unwrap_or(f64::INFINITY));
            let limits = [Caps::new(speed, speed), Caps::new(speed, speed), Caps::new(turn, turn)];
            LimpMode { actions: limp.actions.clone(), limits }
        });
        Ok(Arbiter {
            supervision: ports.supervision(),
            proposals: ports.set("proposals")?,
            velocity: ports.writer("velocity")?,
            state: ports.writer("state")?,
            arbitration: Arbitration::new(config, limits).with_limp(limp),
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let limping = self.supervision.latest().is_some_and(|state| state.limp != 0);
        let arbitration = &mut self.arbitration;
        arbitration.begin(limping);
        self.proposals.each(|path, sample| arbitration.hear(instance(path), now.since(sample.stamp), sample.message));
        let (velocity, state) = arbitration.decide();
        self.velocity.write(now, &velocity);
        self.state.write(now, &state);
        Ok(())
    }
}

/// The instance that writes `path`: `forward` for `/actions/forward/proposal`.
fn instance(path: &str) -> &str {
    path.rsplit('/').nth(1).unwrap_or("")
}

fn check(config: &ArbiterConfig) -> Result<(), String> {
    let mode = &config.mode;
    let weights = mode.weights.iter().map(|(action, weight)| (format!("mode.weights.{action}"), *weight));
    let limits = [
        ("mode.max_forward_m_s", mode.max_forward_m_s),
        ("mode.max_backward_m_s", mode.max_backward_m_s),
        ("mode.max_turn_rad_s", mode.max_turn_rad_s),
        ("mode.max_sideways_m_s", Some(mode.max_sideways_m_s)),
        ("mode.other_weight", Some(mode.other_weight)),
    ];
    let limits = limits.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
    for (key, value) in weights.chain(limits) {
        if !value.is_finite() || value < 0.0 {
            return Err(format!("{key} = {value} must be a number, zero or greater"));
        }
    }
    for (key, words) in [("speed_words_m_s", &config.speed_words_m_s), ("turn_words_rad_s", &config.turn_words_rad_s)] {
        if !(words[0] >= 0.0 && words[0] <= words[1] && words[1] <= words[2] && words[2].is_finite()) {
            return Err(format!(
                "{key} = {words:?} must be three numbers, zero or greater, none smaller than the one before"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_instance_is_the_folder_of_the_path() {
        assert_eq!(instance("/actions/forward/proposal"), "forward");
        assert_eq!(instance("/actions/group/steer_clear/proposal"), "steer_clear");
    }

    #[test]
    fn a_setting_out_of_bounds_is_named() {
        let mut config = ArbiterConfig::default();
        config.mode.weights.insert("forward".into(), -1.0);
        assert!(check(&config).unwrap_err().starts_with("mode.weights.forward = -1"));
        let config = ArbiterConfig { turn_words_rad_s: [0.3, 0.2, 0.1], ..ArbiterConfig::default() };
        assert!(check(&config).unwrap_err().starts_with("turn_words_rad_s"));
        assert_eq!(check(&ArbiterConfig::default()), Ok(()));
    }
}
