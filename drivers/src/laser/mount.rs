//! Where a scanner sits on its body.

use runtime::OpenError;
use schemars::JsonSchema;
use serde::Deserialize;

/// A scanner's place in the body frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Mount {
    /// Ahead of the body's origin [m].
    pub x_m: f64,
    /// To the left of the body's origin [m].
    pub y_m: f64,
    /// Where it looks, counter-clockwise from ahead [deg].
    pub heading_deg: f64,
    /// Mounted with its top down.
    pub upside_down: bool,
}

impl Mount {
    /// Checks the figures; says which is wrong, why, and what would be right.
    pub fn check(&self) -> Result<(), OpenError> {
        for (name, value, most) in
            [("x_m", self.x_m, 10.0), ("y_m", self.y_m, 10.0), ("heading_deg", self.heading_deg, 360.0)]
        {
            if !(value.is_finite() && value.abs() <= most) {
                return Err(OpenError::config(format!("mount.{name} = {value} is out of bounds: -{most} to {most}")));
            }
        }
        Ok(())
    }
}
