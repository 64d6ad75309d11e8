//! The node's settings in the robot file, and their bounds.

use super::model;
use super::protocol::BAUDS;
use super::session::SessionConfig;
use crate::laser::Mount;
use crate::laser::settings::{check_bauds, check_bounds, check_model, wanted_model};
use runtime::OpenError;
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of a SCIP 2.0 scanner.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct UrgConfig {
    /// Where the scanner is: `tcp:192.168.0.10:10940`, `/dev/ttyACM0`, `serial:/dev/ttyS0?baud=19200`, `pty:/path` or
    /// `simulator`.
    pub device: String,
    /// Model that must answer, such as `utm-30lx`; `auto` takes any.
    pub model: String,
    /// Where it sits on the body.
    pub mount: Mount,
    /// Rightmost direction to measure, counter-clockwise from the sensor's front [deg].
    pub from_deg: f64,
    /// Leftmost direction to measure [deg].
    pub to_deg: f64,
    /// Steps of which the least distance counts as one beam, 1 to 99.
    pub cluster: u8,
    /// Scans left out between two, 0 to 9.
    pub skip: u8,
    /// Whether intensities are asked for.
    pub intensities: bool,
    /// The scanner counts as silent after this time without a scan [ms].
    pub silence_ms: f64,
    /// Rate to switch a serial line to; absent: it stays [baud].
    pub fast_baud: Option<u32>,
    /// Line rates to try in turn when nothing answers on a serial port; empty for none [baud].
    pub hunt_bauds: Vec<u32>,
}

impl Default for UrgConfig {
    fn default() -> UrgConfig {
        UrgConfig {
            device: "simulator".into(),
            model: "auto".into(),
            mount: Mount::default(),
            from_deg: -180.0,
            to_deg: 180.0,
            cluster: 1,
            skip: 0,
            intensities: false,
            silence_ms: 1000.0,
            fast_baud: None,
            hunt_bauds: Vec::new(),
        }
    }
}

impl crate::laser::Settings for UrgConfig {
    fn check(&self) -> Result<(), OpenError> {
        self.mount.check()?;
        for (name, value, least, most) in [
            ("from_deg", self.from_deg, -180.0, 180.0),
            ("to_deg", self.to_deg, -180.0, 180.0),
            ("silence_ms", self.silence_ms, 100.0, 60_000.0),
            ("cluster", f64::from(self.cluster), 1.0, 99.0),
            ("skip", f64::from(self.skip), 0.0, 9.0),
        ] {
            check_bounds(name, value, least, most)?;
        }
        if self.from_deg >= self.to_deg {
            let text = format!("from_deg = {} must lie right of to_deg = {}", self.from_deg, self.to_deg);
            return Err(OpenError::config(text));
        }
        let known: Vec<&str> = model::MODELS.iter().map(|(name, ..)| *name).collect();
        check_model(&self.model, &known.join(", "))?;
        check_bauds(self.hunt_bauds.iter().chain(&self.fast_baud), &BAUDS)
    }

    fn device(&self) -> &str {
        &self.device
    }

    fn mount(&self) -> Mount {
        self.mount
    }
}

impl UrgConfig {
    /// The session's habits; `line_baud` is the serial line's rate.
    pub fn session(&self, line_baud: Option<u32>) -> SessionConfig {
        SessionConfig {
            silence_s: self.silence_ms * 1e-3,
            model: wanted_model(&self.model),
            between_rad: (self.from_deg.to_radians(), self.to_deg.to_radians()),
            cluster: self.cluster,
            skip: self.skip,
            intensities: self.intensities,
            line_baud,
            fast_baud: self.fast_baud.filter(|_| line_baud.is_some()),
            hunt_bauds: if line_baud.is_some() { self.hunt_bauds.clone() } else { Vec::new() },
            ..SessionConfig::default()
        }
    }
}
