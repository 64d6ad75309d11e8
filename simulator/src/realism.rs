//! How imperfect wheels and sonar are: numbers and switches, each deterministic from the seed.

use schemars::JsonSchema;
use serde::Deserialize;

/// All imperfections. Switch one off with zero or `false`; `Realism::none()` has none.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Realism {
    /// Wheels and encoders.
    pub wheels: WheelRealism,
    /// Sonar.
    pub sonar: SonarRealism,
    /// Faults of the line to the client.
    pub line: LineFaults,
}

/// What keeps the odometry from the truth.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WheelRealism {
    /// Greatest error of calibration of distances; one value per run is drawn within ± this [share].
    pub distance_error: f64,
    /// The odometry reads this many times the true way, in every run; 1 is right.
    pub odometry_scale: f64,
    /// Greatest error of calibration of turns; one value per run is drawn within ± this [share].
    pub turn_error: f64,
    /// Greatest drift of the heading with the way (unequal wheels); one value per run within ± this [rad/m].
    pub drift_rad_per_m: f64,
    /// Random slip of each wheel: standard deviation after one metre; it grows with the root of the way [m].
    pub slip_m: f64,
    /// Standard deviation of an encoder's count in each step that its wheel turns [tick].
    pub encoder_ticks: f64,
}

/// What keeps a sonar reading from the distance of the nearest surface.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SonarRealism {
    /// Half opening angle of a disc's cone [deg].
    pub half_angle_deg: f64,
    /// A smooth surface met at a greater angle from its normal reflects the sound away; 90 switches this off [deg].
    pub specular_deg: f64,
    /// Standard deviation of a reading, constant part [m].
    pub noise_m: f64,
    /// Standard deviation of a reading, part that grows with the distance [share].
    pub noise_share: f64,
    /// Probability that a reading is lost (no echo).
    pub lost: f64,
    /// Probability that a disc hears the disc of the other array that fires with it: a reading too short.
    pub crosstalk: f64,
}

/// Faults of the bytes between controller and client, either way.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LineFaults {
    /// Probability that a byte is lost.
    pub lose_byte: f64,
    /// Probability that a byte is replaced by a random one.
    pub corrupt_byte: f64,
    /// What the client sends takes so long to reach the controller, in whole steps of 10 ms [ms].
    pub delay_ms: f64,
}

impl Default for WheelRealism {
    fn default() -> WheelRealism {
        WheelRealism {
            distance_error: 0.0075,
            odometry_scale: 1.0,
            turn_error: 0.005,
            drift_rad_per_m: 0.0075,
            slip_m: 0.002,
            encoder_ticks: 0.5,
        }
    }
}

impl Default for SonarRealism {
    fn default() -> SonarRealism {
        SonarRealism {
            half_angle_deg: 15.0,
            specular_deg: 50.0,
            noise_m: 0.003,
            noise_share: 0.003,
            lost: 0.002,
            crosstalk: 0.002,
        }
    }
}

impl Realism {
    /// Perfect wheels, ears and lines. The cone keeps its width.
    pub fn none() -> Realism {
        Realism {
            wheels: WheelRealism {
                distance_error: 0.0,
                odometry_scale: 1.0,
                turn_error: 0.0,
                drift_rad_per_m: 0.0,
                slip_m: 0.0,
                encoder_ticks: 0.0,
            },
            sonar: SonarRealism {
                specular_deg: 90.0,
                noise_m: 0.0,
                noise_share: 0.0,
                lost: 0.0,
                crosstalk: 0.0,
                ..SonarRealism::default()
            },
            line: LineFaults::default(),
        }
    }

    /// What is out of bounds, if anything is.
    pub fn fault(&self) -> Option<String> {
        let Realism { wheels, sonar, line } = self;
        let not_negative = [
            ("wheels.distance_error", wheels.distance_error),
            ("wheels.turn_error", wheels.turn_error),
            ("wheels.drift_rad_per_m", wheels.drift_rad_per_m),
            ("wheels.slip_m", wheels.slip_m),
            ("wheels.encoder_ticks", wheels.encoder_ticks),
            ("sonar.noise_m", sonar.noise_m),
            ("sonar.noise_share", sonar.noise_share),
        ];
        let shares = [
            ("sonar.lost", sonar.lost),
            ("sonar.crosstalk", sonar.crosstalk),
            ("line.lose_byte", line.lose_byte),
            ("line.corrupt_byte", line.corrupt_byte),
        ];
        let negative = not_negative.iter().find(|(_, value)| !(*value >= 0.0 && value.is_finite()));
        let no_share = shares.iter().find(|(_, value)| !(0.0..=1.0).contains(value));
        if let Some((key, value)) = negative {
            return Some(format!("{key} = {value} must not be negative; 0 switches it off"));
        }
        if let Some((key, value)) = no_share {
            return Some(format!("{key} = {value} is no probability; write 0 to 1"));
        }
        if !(0.5..=2.0).contains(&wheels.odometry_scale) {
            let value = wheels.odometry_scale;
            return Some(format!("wheels.odometry_scale = {value} is no calibration; write 0.5 to 2, 1 is right"));
        }
        if !(line.delay_ms >= 0.0 && line.delay_ms <= 1000.0) {
            return Some(format!("line.delay_ms = {} is out of bounds; write 0 to 1000", line.delay_ms));
        }
        if !(sonar.half_angle_deg > 0.0 && sonar.half_angle_deg < 60.0) {
            return Some(format!(
                "sonar.half_angle_deg = {} is no cone; write above 0 and below 60",
                sonar.half_angle_deg
            ));
        }
        if !(0.0..=90.0).contains(&sonar.specular_deg) {
            return Some(format!("sonar.specular_deg = {} is no incidence; write 0 to 90", sonar.specular_deg));
        }
        None
    }
}
