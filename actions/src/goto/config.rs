//! Settings of the action `goto`, and their bounds.

use super::law::Gains;
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`Goto`](super::Goto).
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GotoConfig {
    /// Gains of the law.
    pub gains: Gains,
    /// Greatest speed [m/s].
    pub max_speed_m_s: f64,
    /// Greatest turn rate [rad/s].
    pub max_turn_rad_s: f64,
    /// Least turn rate of the last turn, which a controller that knows whole degrees per second still makes [rad/s].
    pub least_turn_rad_s: f64,
    /// How near to the goal counts as there, where the order says nothing [m].
    pub tolerance_m: f64,
    /// How near to the final heading counts as it [rad].
    pub heading_tolerance_rad: f64,
    /// Whether it may drive backwards to a target behind it.
    pub reverses: bool,
    /// A via point nearer than this has been passed [m].
    pub pass_m: f64,
    /// How many via points after the next one it aims at.
    pub via_points_ahead: usize,
    /// The map, lower left to upper right; goals outside are refused [m].
    pub bounds_m: Option<[f64; 4]>,
    /// An order fails when no pose has come for this long [s].
    pub lost_after_s: f64,
    /// An order fails when the way left has not become less for this long [s].
    pub give_up_s: f64,
    /// An order fails when something has been seen to stand at the goal for this long [s].
    pub occupied_for_s: f64,
    /// Urgency of the proposal, 0…1.
    pub urgency: f64,
    /// How long a proposal counts [s].
    pub valid_for_s: f64,
}

impl Default for GotoConfig {
    fn default() -> GotoConfig {
        GotoConfig {
            gains: Gains::default(),
            max_speed_m_s: 0.5,
            max_turn_rad_s: 0.8,
            least_turn_rad_s: 0.03,
            tolerance_m: 0.02,
            heading_tolerance_rad: 0.02,
            reverses: false,
            pass_m: 0.3,
            via_points_ahead: 2,
            bounds_m: None,
            lost_after_s: 2.0,
            give_up_s: 60.0,
            occupied_for_s: 10.0,
            urgency: 0.5,
            valid_for_s: 0.2,
        }
    }
}

impl GotoConfig {
    /// Says which setting is wrong, and what would be right.
    pub fn check(&self) -> Result<(), String> {
        self.gains.check()?;
        for (key, value) in [
            ("max_speed_m_s", self.max_speed_m_s),
            ("max_turn_rad_s", self.max_turn_rad_s),
            ("tolerance_m", self.tolerance_m),
            ("heading_tolerance_rad", self.heading_tolerance_rad),
            ("lost_after_s", self.lost_after_s),
            ("give_up_s", self.give_up_s),
            ("urgency", self.urgency),
            ("valid_for_s", self.valid_for_s),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(format!("{key} = {value} must be a number above 0"));
            }
        }
        for (key, value) in [
            ("least_turn_rad_s", self.least_turn_rad_s),
            ("pass_m", self.pass_m),
            ("occupied_for_s", self.occupied_for_s),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(format!("{key} = {value} must be a number, zero or greater"));
            }
        }
        if self.via_points_ahead > 8 {
            return Err(format!("via_points_ahead = {} must be 0 to 8; S2 takes two or three", self.via_points_ahead));
        }
        match self.bounds_m {
            Some([x_min, y_min, x_max, y_max]) if !(x_min < x_max && y_min < y_max) => {
                Err(format!("bounds_m = [{x_min}, {y_min}, {x_max}, {y_max}] must be lower left, then upper right"))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_out_of_bounds_is_named() {
        assert_eq!(GotoConfig::default().check(), Ok(()));
        let refusal = |config: GotoConfig| config.check().unwrap_err();
        assert!(refusal(GotoConfig { tolerance_m: 0.0, ..GotoConfig::default() }).contains("tolerance_m = 0"));
        assert!(refusal(GotoConfig { pass_m: f64::NAN, ..GotoConfig::default() }).contains("pass_m = NaN"));
        assert!(
            refusal(GotoConfig { bounds_m: Some([1.0, 0.0, 0.0, 1.0]), ..GotoConfig::default() }).contains("bounds_m")
        );
        let gains = Gains { k_per_s: 1.0, ..Gains::default() };
        assert!(refusal(GotoConfig { gains, ..GotoConfig::default() }).contains("gains.k_per_s"));
    }
}
