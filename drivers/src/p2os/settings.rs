//! The node's settings in the robot file, their bounds, and the model that they make.

use super::dead_reckoning::Drift;
use super::model::{self, Model, SONARS, SonarPose};
use super::power::AfterLoss;
use super::protocol::BAUDS;
use super::session::SessionConfig;
use runtime::OpenError;
use schemars::JsonSchema;
use serde::Deserialize;

/// An array of eight sonars.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SonarArray {
    /// Transducers 0…7.
    Front,
    /// Transducers 8…15.
    Rear,
}

/// Conversion factors that replace the model's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Conversion {
    /// Heading per unit of THPOS [rad].
    pub heading_rad_per_unit: Option<f64>,
    /// Position per unit of XPOS, YPOS [m].
    pub distance_m_per_unit: Option<f64>,
    /// Speed per unit of LVEL, RVEL [m/s].
    pub speed_m_s_per_unit: Option<f64>,
    /// Range per unit of a sonar reading [m].
    pub range_m_per_unit: Option<f64>,
    /// Turn rate per half the difference of the wheel speeds [rad/m].
    pub turn_rad_per_m: Option<f64>,
}

/// Settings of a Pioneer base.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct P2osConfig {
    /// Where the robot is: `/dev/ttyUSB0`, `serial:/dev/ttyUSB0?baud=38400`, `tcp:host:8101`, `pty:/path` or `simulator`.
    pub device: String,
    /// `p3dx-sh`, `p3dx`, `jackal` (a stand-in), or `auto`: what the robot says it is.
    pub model: String,
    /// The sonar arrays that are fitted.
    pub sonar_arrays: Vec<SonarArray>,
    /// Whether the sonars fire from the start.
    pub sonar_on: bool,
    /// Poses of all 16 transducers in place of the model's; empty for the model's.
    pub sonar_poses: Vec<SonarPose>,
    /// Conversion factors in place of the model's.
    pub conversion: Conversion,
    /// Whether wheel ticks are asked for and written as `encoders`.
    pub encoders: bool,
    /// Whether the robot is told the body's speeds and accelerations; otherwise it keeps its own.
    pub sends_limits: bool,
    /// What bumpers stop by themselves: 0 nothing, 1 front, 2 rear, 3 both; absent: as the robot is set.
    pub bumper_stop: Option<u8>,
    /// Who may switch the motors on again after the link was lost.
    pub after_loss: AfterLoss,
    /// Velocities are repeated this often [ms].
    pub repeat_ms: f64,
    /// PULSE is sent after this time without a command [ms].
    pub pulse_ms: f64,
    /// Least time between two commands [ms].
    pub spacing_ms: f64,
    /// The robot counts as silent after this time without a packet [ms].
    pub silence_ms: f64,
    /// Line speeds to try in turn when nothing answers on a serial port; empty for none [baud].
    pub hunt_bauds: Vec<u32>,
    /// How fast the odometry's uncertainty grows.
    pub drift: Drift,
}

impl Default for P2osConfig {
    fn default() -> P2osConfig {
        P2osConfig {
            device: "simulator".into(),
            model: "auto".into(),
            sonar_arrays: vec![SonarArray::Front, SonarArray::Rear],
            sonar_on: true,
            sonar_poses: Vec::new(),
            conversion: Conversion::default(),
            encoders: false,
            sends_limits: true,
            bumper_stop: None,
            after_loss: AfterLoss::Command,
            repeat_ms: 150.0,
            pulse_ms: 600.0,
            spacing_ms: 5.0,
            silence_ms: 1000.0,
            hunt_bauds: Vec::new(),
            drift: Drift::default(),
        }
    }
}

impl P2osConfig {
    /// Checks every setting; says which is wrong, why, and what would be right.
    pub fn check(&self) -> Result<(), OpenError> {
        let wrong = |reason: String| Err(OpenError::config(reason));
        if !self.is_auto() && model::named(&self.model).is_none() {
            let known: Vec<_> = model::MODELS.iter().map(|model| model.subclass).collect();
            return wrong(format!("model \"{}\" is unknown; known: {}, auto", self.model, known.join(", ")));
        }
        if !self.sonar_poses.is_empty() && self.sonar_poses.len() != SONARS {
            return wrong(format!("sonar_poses has {} entries; give all {SONARS} or none", self.sonar_poses.len()));
        }
        for pose in &self.sonar_poses {
            if ![pose.x_m, pose.y_m, pose.bearing_rad].iter().all(|value| value.is_finite() && value.abs() < 10.0) {
                return wrong(format!("sonar_poses: {pose:?} is no place on a robot"));
            }
        }
        let c = &self.conversion;
        for (name, factor) in [
            ("heading_rad_per_unit", c.heading_rad_per_unit),
            ("distance_m_per_unit", c.distance_m_per_unit),
            ("speed_m_s_per_unit", c.speed_m_s_per_unit),
            ("range_m_per_unit", c.range_m_per_unit),
            ("turn_rad_per_m", c.turn_rad_per_m),
        ] {
            if factor.is_some_and(|factor| !(factor.is_finite() && factor > 0.0)) {
                return wrong(format!("conversion.{name} must be a number above 0"));
            }
        }
        for (name, value, least, most) in [
            ("repeat_ms", self.repeat_ms, 20.0, 1000.0),
            ("pulse_ms", self.pulse_ms, 50.0, 1900.0),
            ("spacing_ms", self.spacing_ms, 0.0, 100.0),
            ("silence_ms", self.silence_ms, 300.0, 60_000.0),
        ] {
            if !(least..=most).contains(&value) {
                return wrong(format!("{name} = {value} is out of bounds: {least} to {most}"));
            }
        }
        let d = &self.drift;
        if [d.way_m2_per_m, d.heading_rad2_per_rad, d.heading_rad2_per_m].iter().any(|v| !(0.0..=1.0).contains(v)) {
            return wrong("drift: each variance lies between 0 and 1".into());
        }
        if let Some(baud) = self.hunt_bauds.iter().find(|baud| !BAUDS.contains(baud)) {
            return wrong(format!("hunt_bauds: {baud} is no speed of this robot; known: {BAUDS:?}"));
        }
        if self.bumper_stop.is_some_and(|mode| mode > 3) {
            return wrong("bumper_stop is 0 nothing, 1 front, 2 rear or 3 both".into());
        }
        Ok(())
    }

    /// Whether the robot's identity chooses the model.
    pub fn is_auto(&self) -> bool {
        self.model.eq_ignore_ascii_case("auto")
    }

    /// The named model, or for `auto` the one to begin with, with the settings' own figures.
    pub fn model(&self) -> Model {
        self.adapt(model::named(&self.model).unwrap_or(&model::MODELS[0]))
    }

    /// `model` with the settings' own figures.
    pub fn adapt(&self, model: &Model) -> Model {
        let c = &self.conversion;
        let mut model = Model {
            heading_rad_per_unit: c.heading_rad_per_unit.unwrap_or(model.heading_rad_per_unit),
            distance_m_per_unit: c.distance_m_per_unit.unwrap_or(model.distance_m_per_unit),
            speed_m_s_per_unit: c.speed_m_s_per_unit.unwrap_or(model.speed_m_s_per_unit),
            range_m_per_unit: c.range_m_per_unit.unwrap_or(model.range_m_per_unit),
            turn_rad_per_m: c.turn_rad_per_m.unwrap_or(model.turn_rad_per_m),
            ..*model
        };
        for (pose, own) in model.sonar.iter_mut().zip(&self.sonar_poses) {
            *pose = *own;
        }
        model
    }

    /// The session's times; `line_baud` is the serial line's speed.
    pub fn session(&self, line_baud: Option<u32>) -> SessionConfig {
        SessionConfig {
            silence_s: self.silence_ms * 1e-3,
            pulse_s: self.pulse_ms * 1e-3,
            spacing_s: self.spacing_ms * 1e-3,
            line_baud,
            hunt_bauds: if line_baud.is_some() { self.hunt_bauds.clone() } else { Vec::new() },
            knows: if self.is_auto() {
                |identity| model::find(identity.class.as_str(), identity.subclass.as_str()).is_some()
            } else {
                |_| true
            },
            ..SessionConfig::default()
        }
    }
}
