//! The node's settings in the robot file, and their bounds.

use super::model::{Reach, Variant};
use super::protocol::mode;
use super::session::SessionConfig;
use crate::laser::Mount;
use crate::laser::settings::{check_bauds, check_bounds, check_model, wanted_model};
use runtime::OpenError;
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of an LMS 2xx.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Lms200Config {
    /// Where the laser is: `/dev/ttyUSB0`, `serial:/dev/ttyS0?baud=9600`, `tcp:192.168.0.10:8102`, `pty:/path` or `simulator`.
    pub device: String,
    /// What its type must begin with, such as `LMS200`; `auto` takes any LMS.
    pub model: String,
    /// Where it sits on the body.
    pub mount: Mount,
    /// Field: 180 or 100 [deg].
    pub angle_deg: u16,
    /// From one beam to the next: 1, 0.5, or 0.25 in the field of 100° [deg].
    pub resolution_deg: f64,
    /// How far it measures: `8m`, `16m`, `32m` in millimetres, `80m` in centimetres, or `keep` as it is. Another one than the
    /// laser has is written into its memory, once.
    pub reach: Reach,
    /// The laser counts as silent after this time without a scan [ms].
    pub silence_ms: f64,
    /// Rate to switch a serial line to: 9600, 19200, 38400, or 500000 over RS-422; absent: it stays [baud].
    pub fast_baud: Option<u32>,
    /// Line rates to try in turn when nothing answers on a serial port; empty for none [baud].
    pub hunt_bauds: Vec<u32>,
}

impl Default for Lms200Config {
    fn default() -> Lms200Config {
        Lms200Config {
            device: "simulator".into(),
            model: "auto".into(),
            mount: Mount::default(),
            angle_deg: 180,
            resolution_deg: 0.5,
            reach: Reach::Keep,
            silence_ms: 2000.0,
            fast_baud: Some(38_400),
            hunt_bauds: vec![9_600, 38_400, 19_200, 500_000],
        }
    }
}

impl crate::laser::Settings for Lms200Config {
    fn check(&self) -> Result<(), OpenError> {
        self.mount.check()?;
        check_bounds("silence_ms", self.silence_ms, 500.0, 60_000.0)?;
        if self.variant().is_none() {
            return Err(OpenError::config(format!(
                "angle_deg = {} at resolution_deg = {} is no mode of this laser; it has 180 at 1 or 0.5, and 100 at 1, 0.5 or 0.25",
                self.angle_deg, self.resolution_deg
            )));
        }
        check_model(&self.model, "LMS200")?;
        check_bauds(self.hunt_bauds.iter().chain(&self.fast_baud), &mode::BAUDS.map(|(_, baud)| baud))
    }

    fn device(&self) -> &str {
        &self.device
    }

    fn mount(&self) -> Mount {
        self.mount
    }
}

impl Lms200Config {
    /// The variant, if there is such a one.
    pub fn variant(&self) -> Option<Variant> {
        // 25, 50 and 100 are exact; whatever else is no variant.
        let resolution_cdeg = self.resolution_deg * 100.0;
        (resolution_cdeg.fract() == 0.0).then(|| Variant::of(self.angle_deg, resolution_cdeg as u16)).flatten()
    }

    /// The session's habits; `line_baud` is the serial line's rate.
    pub fn session(&self, line_baud: Option<u32>) -> SessionConfig {
        SessionConfig {
            silence_s: self.silence_ms * 1e-3,
            model: wanted_model(&self.model),
            variant: self.variant(),
            reach: self.reach,
            line_baud,
            fast_baud: self.fast_baud.filter(|_| line_baud.is_some()),
            hunt_bauds: if line_baud.is_some() { self.hunt_bauds.clone() } else { Vec::new() },
            ..SessionConfig::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laser::Settings;

    #[test]
    fn wrong_settings_are_refused_by_name() {
        let reason = |change: fn(&mut Lms200Config)| {
            let mut config = Lms200Config::default();
            change(&mut config);
            config.check().map_or_else(|e| e.to_string(), |()| String::new())
        };
        assert_eq!(reason(|_| {}), "");
        assert!(reason(|c| c.resolution_deg = 0.25).contains("no mode of this laser"));
        assert!(reason(|c| c.resolution_deg = f64::NAN).contains("no mode of this laser"));
        assert!(reason(|c| c.angle_deg = 90).contains("no mode of this laser"));
        assert!(reason(|c| c.silence_ms = f64::NAN).contains("silence_ms"));
        assert!(reason(|c| c.fast_baud = Some(115_200)).contains("no rate"));
        assert!(reason(|c| c.hunt_bauds.push(1)).contains("no rate"));
        assert!(reason(|c| c.model.clear()).contains("no name"));
        assert!(reason(|c| c.mount.x_m = f64::INFINITY).contains("mount.x_m"));
    }
}
