//! Settings of tracking.

use crate::scan::segments::SegmentsConfig;
use schemars::JsonSchema;
use serde::Deserialize;

/// In what coordinates a track is filtered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FilterKind {
    /// Distance and bearing from the body, each alone (S2).
    Polar,
    /// x and y of the odometry frame.
    #[default]
    Cartesian,
}

/// How things are followed.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TracksConfig {
    /// How scans are taken apart.
    pub segments: SegmentsConfig,
    /// In what coordinates.
    pub filter: FilterKind,
    /// Standard deviation of random accelerations that last 0.1 s each [m/s²].
    pub acceleration_m_s2: f64,
    /// Standard deviation of the velocity of something just seen [m/s].
    pub speed_sigma_m_s: f64,
    /// A thing's centre is no better defined than this, however well it is measured [m].
    pub shape_sigma_m: f64,
    /// Greatest squared distance, in standard deviations, between a track and what is taken for it (χ², 2 degrees of
    /// freedom: 9.21 is 99 %).
    pub gate: f64,
    /// Greatest distance between a track and what is taken for it [m].
    pub most_jump_m: f64,
    /// What has fewer points begins no track.
    pub least_points: u32,
    /// What is farther away begins no track [m].
    pub within_m: f64,
    /// Sightings that confirm a track.
    pub confirm_after: u32,
    /// An unconfirmed track that is not seen for this long is forgotten [s] …
    pub forget_tentative_s: f64,
    /// … a confirmed one through whose place the ranger sees [s] …
    pub forget_visible_s: f64,
    /// … and a confirmed one whose place is hidden or out of sight [s].
    pub forget_hidden_s: f64,
    /// What is slower counts as standing [m/s].
    pub moving_above_m_s: f64,
    /// Most tracks at a time; the farthest make room for nearer ones.
    pub most_tracks: usize,
    /// Time between two points of a predicted path [s].
    pub path_step_s: f64,
}

impl Default for TracksConfig {
    fn default() -> TracksConfig {
        TracksConfig {
            segments: SegmentsConfig::default(),
            filter: FilterKind::default(),
            acceleration_m_s2: 2.0,
            speed_sigma_m_s: 1.5,
            shape_sigma_m: 0.02,
            gate: 9.21,
            most_jump_m: 1.0,
            least_points: 3,
            within_m: 30.0,
            confirm_after: 3,
            forget_tentative_s: 0.25,
            forget_visible_s: 0.4,
            forget_hidden_s: 2.0,
            moving_above_m_s: 0.15,
            most_tracks: 128,
            path_step_s: 0.5,
        }
    }
}

impl TracksConfig {
    /// Whether every setting is within its bounds; else which is not.
    pub fn check(&self) -> Result<(), String> {
        self.segments.check().map_err(|reason| format!("segments.{reason}"))?;
        for (key, value) in [
            ("acceleration_m_s2", self.acceleration_m_s2),
            ("speed_sigma_m_s", self.speed_sigma_m_s),
            ("shape_sigma_m", self.shape_sigma_m),
            ("gate", self.gate),
            ("most_jump_m", self.most_jump_m),
            ("within_m", self.within_m),
            ("forget_tentative_s", self.forget_tentative_s),
            ("forget_visible_s", self.forget_visible_s),
            ("forget_hidden_s", self.forget_hidden_s),
            ("moving_above_m_s", self.moving_above_m_s),
            ("path_step_s", self.path_step_s),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{key} = {value} must be a number greater than zero"));
            }
        }
        if self.confirm_after == 0 {
            return Err("confirm_after = 0 would confirm what was never seen; write 1 or more".into());
        }
        if !(1..=1024).contains(&self.most_tracks) {
            return Err(format!("most_tracks = {} must be 1 to 1024", self.most_tracks));
        }
        Ok(())
    }
}
