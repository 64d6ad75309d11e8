//! Settings of the planner in the robot file, and their bounds. The body's size and limits come from `[body]`.

use super::guide::Price;
use super::planner::Setup;
use super::rollout::{Limits, Outline, Weights};
use runtime::Body;
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of `follow_gap`.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FollowGapConfig {
    /// How long what nobody looks at is remembered; 0 makes it purely reactive: only the newest scan counts [s].
    pub memory_s: f64,
    /// Whether what moves is met where it will be; otherwise it counts as standing where it is.
    pub tracking: bool,
    /// Before it sets off for the first time it has watched for so long what moves, where tracks are wired [s].
    pub watch_s: f64,
    /// Beams are used up to here [m].
    pub horizon_m: f64,
    /// Greatest speed that is planned; the body's own when left out [m/s].
    pub max_forward_m_s: Option<f64>,
    /// Greatest turn rate that is planned; the body's own when left out [rad/s].
    pub max_turn_rad_s: Option<f64>,
    /// Share of the body's accelerations that plans use.
    pub acceleration_share: f64,
    /// From a scan to the wheels' answer [s].
    pub delay_s: f64,
    /// The goal counts as reached within this, unless the order says another [m].
    pub tolerance_m: f64,
    /// Length of a plan's step [s].
    pub step_s: f64,
    /// Steps of a plan.
    pub steps: usize,
    /// A smaller gap beside the body is a collision [m].
    pub margin_m: f64,
    /// Added to the margin per speed [m per m/s].
    pub margin_per_speed_s: f64,
    /// A smaller gap costs [m].
    pub near_m: f64,
    /// Added to that per speed [m per m/s].
    pub near_per_speed_s: f64,
    /// What the least gap costs per second [m of way].
    pub near_weight: f64,
    /// A smaller gap to what moves is a collision [m].
    pub mover_margin_m: f64,
    /// A smaller gap to what moves costs [m].
    pub mover_near_m: f64,
    /// What the least gap to what moves costs per second [m of way].
    pub mover_weight: f64,
    /// What moves grows by this per second of prediction [m/s].
    pub mover_growth_m_s: f64,
    /// What a change of the turn rate by 1 rad/s costs [m of way].
    pub turn_change_weight: f64,
    /// What a metre backwards costs [m of way].
    pub backward_weight: f64,
    /// How far ahead of a plan's end the cost to go is looked up as well [m].
    pub look_ahead_m: f64,
    /// Clearance of the robot's centre from which on a metre of way costs one [m].
    pub free_m: f64,
    /// Clearance below which the robot's centre cannot be [m].
    pub blocked_m: f64,
    /// What a metre costs just before that.
    pub narrow_price: f64,
    /// What a metre costs where the robot does not fit.
    pub blocked_price: f64,
    /// Room that is left when the robot has come to rest along the wanted arc [m].
    pub stop_margin_m: f64,
    /// Time in which nothing slows yet, for the same [s].
    pub stop_delay_s: f64,
    /// Random changes of the best plan in each of the two refinements.
    pub changes: usize,
    /// Seed of these changes: the same seed, the same wishes.
    pub seed: u64,
    /// Urgency of the proposal, 0…1.
    pub urgency: f64,
    /// How long a proposal counts [s].
    pub valid_for_s: f64,
}

impl Default for FollowGapConfig {
    fn default() -> FollowGapConfig {
        FollowGapConfig {
            memory_s: 20.0,
            tracking: true,
            watch_s: 1.0,
            horizon_m: 8.0,
            max_forward_m_s: None,
            max_turn_rad_s: None,
            acceleration_share: 0.8,
            delay_s: 0.06,
            tolerance_m: 0.3,
            step_s: 0.1,
            steps: 18,
            margin_m: 0.03,
            margin_per_speed_s: 0.02,
            near_m: 0.12,
            near_per_speed_s: 0.12,
            near_weight: 3.0,
            mover_margin_m: 0.1,
            mover_near_m: 0.6,
            mover_weight: 3.0,
            mover_growth_m_s: 0.1,
            turn_change_weight: 0.01,
            backward_weight: 3.0,
            look_ahead_m: 0.4,
            free_m: 0.5,
            blocked_m: 0.28,
            narrow_price: 8.0,
            blocked_price: 40.0,
            stop_margin_m: 0.06,
            stop_delay_s: 0.1,
            changes: 96,
            seed: 1,
            urgency: 0.6,
            valid_for_s: 0.2,
        }
    }
}

impl FollowGapConfig {
    /// What is out of bounds, if anything is.
    pub fn fault(&self) -> Option<String> {
        let c = self;
        let bounds = [
            ("memory_s", c.memory_s, 0.0, 600.0),
            ("watch_s", c.watch_s, 0.0, 10.0),
            ("horizon_m", c.horizon_m, 0.5, 100.0),
            ("max_forward_m_s", c.max_forward_m_s.unwrap_or(1.0), 0.01, 20.0),
            ("max_turn_rad_s", c.max_turn_rad_s.unwrap_or(1.0), 0.01, 20.0),
            ("acceleration_share", c.acceleration_share, 0.05, 1.0),
            ("delay_s", c.delay_s, 0.0, 1.0),
            ("tolerance_m", c.tolerance_m, 0.01, 10.0),
            ("step_s", c.step_s, 0.02, 0.5),
            ("margin_m", c.margin_m, 0.0, 1.0),
            ("margin_per_speed_s", c.margin_per_speed_s, 0.0, 1.0),
            ("near_m", c.near_m, 0.01, 5.0),
            ("near_per_speed_s", c.near_per_speed_s, 0.0, 5.0),
            ("near_weight", c.near_weight, 0.0, 1e3),
            ("mover_margin_m", c.mover_margin_m, 0.0, 5.0),
            ("mover_near_m", c.mover_near_m, 0.01, 10.0),
            ("mover_weight", c.mover_weight, 0.0, 1e3),
            ("mover_growth_m_s", c.mover_growth_m_s, 0.0, 5.0),
            ("turn_change_weight", c.turn_change_weight, 0.0, 10.0),
            ("backward_weight", c.backward_weight, 0.0, 1e3),
            ("look_ahead_m", c.look_ahead_m, 0.0, 2.0),
            ("free_m", c.free_m, c.blocked_m + 0.01, 5.0),
            ("blocked_m", c.blocked_m, 0.01, 5.0),
            ("narrow_price", c.narrow_price, 1.0, 100.0),
            ("blocked_price", c.blocked_price, 1.0, 200.0),
            ("stop_margin_m", c.stop_margin_m, 0.0, 1.0),
            ("stop_delay_s", c.stop_delay_s, 0.0, 1.0),
            ("urgency", c.urgency, 0.0, 1.0),
            ("valid_for_s", c.valid_for_s, 0.02, 5.0),
        ];
        // The negation also refuses NaN.
        let wrong = bounds.iter().find(|(_, value, least, most)| !(*value >= *least && *value <= *most));
        if let Some((key, value, least, most)) = wrong {
            return Some(format!("{key} = {value} is out of bounds: {least} to {most}"));
        }
        if !(6..=60).contains(&c.steps) {
            return Some(format!("steps = {} is out of bounds: 6 to 60", c.steps));
        }
        if c.changes > 1000 {
            return Some(format!("changes = {} is out of bounds: 0 to 1000", c.changes));
        }
        None
    }

    /// The planner's setup for a body.
    pub fn setup(&self, body: &Body) -> Setup {
        let share = self.acceleration_share;
        Setup {
            outline: Outline {
                ahead_m: body.length_ahead_m,
                behind_m: body.length_behind_m,
                half_width_m: body.half_width_m,
            },
            limits: Limits {
                forward_m_s: self.max_forward_m_s.unwrap_or(body.max_forward_m_s).min(body.max_forward_m_s),
                backward_m_s: body.max_backward_m_s,
                turn_rad_s: self.max_turn_rad_s.unwrap_or(body.max_turn_rad_s).min(body.max_turn_rad_s),
                acceleration_m_s2: share * body.acceleration_m_s2,
                deceleration_m_s2: share * body.deceleration_m_s2,
                turn_acceleration_rad_s2: share * body.turn_acceleration_rad_s2,
            },
            weights: Weights {
                steps: self.steps,
                step_s: self.step_s,
                margin_m: self.margin_m,
                margin_per_speed_s: self.margin_per_speed_s,
                near_m: self.near_m,
                near_per_speed_s: self.near_per_speed_s,
                near_weight: self.near_weight,
                mover_weight: self.mover_weight,
                mover_near_m: self.mover_near_m,
                mover_margin_m: self.mover_margin_m,
                mover_growth_m_s: self.mover_growth_m_s,
                turn_change_weight: self.turn_change_weight,
                backward_weight: self.backward_weight,
                look_ahead_m: self.look_ahead_m,
            },
            price: Price {
                free_m: self.free_m,
                blocked_m: self.blocked_m,
                narrow: self.narrow_price,
                blocked: self.blocked_price,
            },
            memory_s: self.memory_s,
            horizon_m: self.horizon_m,
            delay_s: self.delay_s,
            period_s: 0.02,
            stop_margin_m: self.stop_margin_m,
            stop_delay_s: self.stop_delay_s,
            changes: self.changes,
            seed: self.seed,
        }
    }
}
