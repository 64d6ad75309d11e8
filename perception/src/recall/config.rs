//! How long and how far is remembered.

use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`super::Recall`].
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecallConfig {
    /// How long a place that is out of sight is remembered where something stood [s].
    pub keep_s: f64,
    /// The same where something had come only just before [s].
    pub keep_new_s: f64,
    /// What has been seen at a place for so long stands there [s].
    pub stands_after_s: f64,
    /// Places farther away than this from the centre of rotation are forgotten [m].
    pub within_m: f64,
    /// Places are no nearer to one another than this [m].
    pub spacing_m: f64,
    /// Most places; when there are more the farthest are left out.
    pub capacity: usize,
    /// Most beams of the ranger; those behind are left out.
    pub most_beams: usize,
}

impl Default for RecallConfig {
    fn default() -> RecallConfig {
        RecallConfig {
            keep_s: 60.0,
            keep_new_s: 2.0,
            stands_after_s: 0.4,
            within_m: 1.0,
            spacing_m: 0.04,
            capacity: 256,
            most_beams: 1200,
        }
    }
}

impl RecallConfig {
    /// Says which setting is wrong.
    pub fn check(&self) -> Result<(), String> {
        for (key, value) in [
            ("keep_s", self.keep_s),
            ("keep_new_s", self.keep_new_s),
            ("stands_after_s", self.stands_after_s),
            ("within_m", self.within_m),
            ("spacing_m", self.spacing_m),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{key} = {value} must be a number greater than zero"));
            }
        }
        for (key, value) in [("capacity", self.capacity), ("most_beams", self.most_beams)] {
            if !(16..=4096).contains(&value) {
                return Err(format!("{key} = {value} must be 16 to 4096"));
            }
        }
        Ok(())
    }
}
