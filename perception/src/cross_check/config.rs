//! The settings of the cross-check, and their bounds.

use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`super::CrossCheck`].
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CrossCheckConfig {
    /// Paths of the rangers, the most trusted first; those that are not named come last, by their paths.
    pub trust: Vec<String>,
    /// Samples older than this do not count [ms].
    pub max_age_ms: f64,
    /// Two distances are equal within this [m] …
    pub tolerance_m: f64,
    /// … and this share of the smaller one.
    pub tolerance_share: f64,
    /// Two rangers disagree when more than this share of the comparisons are unequal, 0…1.
    pub disagreeing_share: f64,
    /// Fewer comparisons say nothing.
    pub least_compared: u32,
    /// How long a ranger must be contradicted before it is left out [s].
    pub after_s: f64,
    /// How long it must agree before it counts again [s].
    pub return_after_s: f64,
    /// Most beams of a ranger; those behind are cut off.
    pub most_beams: usize,
}

impl Default for CrossCheckConfig {
    fn default() -> CrossCheckConfig {
        CrossCheckConfig {
            trust: Vec::new(),
            max_age_ms: 300.0,
            tolerance_m: 0.25,
            tolerance_share: 0.1,
            disagreeing_share: 0.5,
            least_compared: 4,
            after_s: 0.5,
            return_after_s: 2.0,
            most_beams: 1200,
        }
    }
}

impl CrossCheckConfig {
    pub(super) fn check(&self) -> Result<(), String> {
        for (key, value, most) in [
            ("max_age_ms", self.max_age_ms, 60_000.0),
            ("tolerance_m", self.tolerance_m, 100.0),
            ("tolerance_share", self.tolerance_share, 10.0),
            ("disagreeing_share", self.disagreeing_share, 1.0),
            ("after_s", self.after_s, 3600.0),
            ("return_after_s", self.return_after_s, 3600.0),
        ] {
            if !(0.0..=most).contains(&value) {
                return Err(format!("{key} = {value} must be a number, 0 to {most}"));
            }
        }
        if self.least_compared == 0 {
            return Err("least_compared = 0 would let two rangers disagree about nothing: write 1 or more".to_owned());
        }
        if !(1..=8192).contains(&self.most_beams) {
            return Err(format!("most_beams = {} must be 1 to 8192", self.most_beams));
        }
        if let Some(path) = self.trust.iter().enumerate().find(|(k, path)| self.trust[..*k].contains(path)) {
            return Err(format!("trust names {} twice: write it once", path.1));
        }
        if self.trust.len() > super::judge::MOST {
            return Err(format!(
                "trust names {} rangers: {} are compared at most",
                self.trust.len(),
                super::judge::MOST
            ));
        }
        Ok(())
    }
}
