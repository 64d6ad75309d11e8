//! What a mission is: places to reach in order, how long it may take, and what counts as success.
//!
//! ```toml
//! timeout_s = 120.0
//! [[goal]]                      # reached in this order; none: the mission lasts until the timeout
//! x_m = 3.0
//! y_m = 2.0
//! within_m = 0.5
//! timeout_s = 60.0              # since the goal before; without it only the mission's
//! [success]
//! max_contacts_caused = 0       # the default; the others do not count unless they are written
//! max_contacts_suffered = 3
//! min_distance_m = 5.0
//! min_clearance_m = 0.02
//! min_mean_speed_m_s = 0.1
//! ```
//!
//! A scenario that cannot end, or cannot end well, is refused before anything runs.

use serde::Deserialize;
use simulator::geometry::Point;
use simulator::world::World;

/// No mission lasts longer [s].
const LONGEST_S: f64 = 86_400.0;

/// See the module's text.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// How long a mission may take [s].
    pub timeout_s: f64,
    /// Places to reach, in order.
    #[serde(default, rename = "goal")]
    pub goals: Vec<Goal>,
    /// What else counts.
    #[serde(default)]
    pub success: Success,
}

/// A place to reach.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// In the world [m].
    pub x_m: f64,
    /// In the world [m].
    pub y_m: f64,
    /// So near is there [m].
    pub within_m: f64,
    /// How long it may take since the goal before; `None`: as long as the mission [s].
    pub timeout_s: Option<f64>,
}

/// Conditions of success beside the goals.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Success {
    /// Contacts that the robot may cause.
    pub max_contacts_caused: u64,
    /// Contacts that it may suffer.
    pub max_contacts_suffered: Option<u64>,
    /// Least way [m].
    pub min_distance_m: Option<f64>,
    /// Least clearance [m].
    pub min_clearance_m: Option<f64>,
    /// Least mean speed while moving [m/s].
    pub min_mean_speed_m_s: Option<f64>,
}

/// Why a scenario is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScenarioError {
    /// No TOML, or other words.
    #[error("{0}")]
    Words(String),
    /// It has no end.
    #[error("timeout_s is {0}: the mission can never end; write a time between 0 and 86400 s")]
    Endless(f64),
    /// A goal is nowhere.
    #[error("goal {number} at ({x_m}, {y_m}) {reason}: the mission can never end well; move the goal")]
    Goal {
        /// Counted from 1.
        number: usize,
        /// Where [m].
        x_m: f64,
        /// Where [m].
        y_m: f64,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The way is too long.
    #[error(
        "the goals lie {way_m:.1} m apart and the robot drives at most {speed_m_s} m/s: {timeout_s} s are too short, \
         the mission can never end well; give it more time"
    )]
    TooShort {
        /// Straight from goal to goal [m].
        way_m: f64,
        /// The robot's greatest speed [m/s].
        speed_m_s: f64,
        /// The mission's timeout [s].
        timeout_s: f64,
    },
    /// A condition is no number.
    #[error("[success] {key} is {value}: no mission can meet it")]
    Condition {
        /// Which.
        key: &'static str,
        /// As written.
        value: f64,
    },
}

impl Scenario {
    /// A mission without goals.
    pub fn of_length(timeout_s: f64) -> Scenario {
        Scenario { timeout_s, goals: Vec::new(), success: Success::default() }
    }

    /// Reads it, and checks it against the world and the robot's greatest speed.
    pub fn parse(text: &str, world: Option<&World>, greatest_m_s: f64) -> Result<Scenario, ScenarioError> {
        let scenario: Scenario = toml::from_str(text).map_err(|e| ScenarioError::Words(e.to_string()))?;
        scenario.check(world, greatest_m_s)?;
        Ok(scenario)
    }

    fn check(&self, world: Option<&World>, greatest_m_s: f64) -> Result<(), ScenarioError> {
        // The negations also refuse NaN.
        if !(self.timeout_s > 0.0 && self.timeout_s <= LONGEST_S) {
            return Err(ScenarioError::Endless(self.timeout_s));
        }
        for (index, goal) in self.goals.iter().enumerate() {
            let fault = |reason| Err(ScenarioError::Goal { number: index + 1, x_m: goal.x_m, y_m: goal.y_m, reason });
            if !(goal.x_m.is_finite() && goal.y_m.is_finite()) {
                return fault("is no place");
            }
            if !(goal.within_m > 0.0 && goal.within_m.is_finite()) {
                return fault("has no within_m above zero");
            }
            if goal.timeout_s.is_some_and(|timeout_s| !(timeout_s > 0.0 && timeout_s <= LONGEST_S)) {
                return fault("has a timeout_s that is no time");
            }
            if let Some(world) = world {
                let place = Point::new(goal.x_m, goal.y_m);
                let (low, high) = world.map.extent();
                let beyond =
                    (low.x_m - goal.x_m).max(goal.x_m - high.x_m).max(low.y_m - goal.y_m).max(goal.y_m - high.y_m);
                if beyond > goal.within_m {
                    return fault("lies outside the world");
                }
                if world.is_solid(place) {
                    return fault("lies inside an obstacle");
                }
            }
        }
        let pairs = self.goals.windows(2);
        let way_m: f64 = pairs
            .map(|pair| {
                let apart = Point::new(pair[1].x_m - pair[0].x_m, pair[1].y_m - pair[0].y_m).norm();
                (apart - pair[0].within_m - pair[1].within_m).max(0.0)
            })
            .sum();
        if way_m > greatest_m_s * self.timeout_s {
            return Err(ScenarioError::TooShort { way_m, speed_m_s: greatest_m_s, timeout_s: self.timeout_s });
        }
        let success = &self.success;
        for (key, value, most) in [
            ("min_distance_m", success.min_distance_m, greatest_m_s * self.timeout_s),
            ("min_clearance_m", success.min_clearance_m, f64::MAX),
            ("min_mean_speed_m_s", success.min_mean_speed_m_s, greatest_m_s),
        ] {
            if let Some(value) = value.filter(|value| !(0.0..=most).contains(value)) {
                return Err(ScenarioError::Condition { key, value });
            }
        }
        Ok(())
    }
}
