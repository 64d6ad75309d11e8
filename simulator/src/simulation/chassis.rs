//! What a body is made of: outline, wheels and the controller's cycle, as data. Each left out is its model's.

use crate::geometry::Footprint;
use crate::mcu::Tops;
use drivers::p2os::model::Model;
use schemars::JsonSchema;
use serde::Deserialize;

/// Half of a Pioneer's width over the wheels, as another simulator has it; the vendor's table is 12 mm wider [m].
const PIONEER_HALF_WIDTH_M: f64 = 0.2;
/// Corners cut off a Pioneer's rectangle: its plan is an octagon [m].
const PIONEER_CUT_CORNERS_M: f64 = 0.1;
/// Fastest wheel of a Pioneer [m/s].
const PIONEER_MAX_WHEEL_M_S: f64 = 1.2;
/// Time between a Pioneer's SIPs [ms].
const PIONEER_SIP_CYCLE_MS: u8 = 100;

/// A body's outline, wheels and controller. What is left out is the model's own.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Chassis {
    /// From the centre of rotation to the front edge [m].
    pub length_ahead_m: Option<f64>,
    /// From the centre of rotation to the rear edge [m].
    pub length_behind_m: Option<f64>,
    /// From the centre line to either side [m].
    pub half_width_m: Option<f64>,
    /// What is cut off each corner along both edges; 0 leaves a rectangle, more makes an octagon [m].
    pub cut_corners_m: Option<f64>,
    /// Speed that no wheel exceeds, whatever it is told [m/s].
    pub max_wheel_m_s: Option<f64>,
    /// Greatest acceleration and deceleration that the controller can be set to [m/s²].
    pub max_acceleration_m_s2: Option<f64>,
    /// Greatest turn acceleration that the controller can be set to [rad/s²].
    pub max_turn_acceleration_rad_s2: Option<f64>,
    /// Time between SIPs, 10 to 250 [ms].
    pub sip_cycle_ms: Option<u8>,
}

/// A chassis with every figure decided.
#[derive(Debug, Clone, Copy)]
pub(super) struct Built {
    pub outline: Footprint,
    pub max_wheel_m_s: f64,
    pub tops: Tops,
    pub sip_cycle_ms: u8,
}

impl Chassis {
    /// The chassis of a body of `model`, or what is wrong with it.
    pub(super) fn built(&self, model: &Model) -> Result<Built, String> {
        let is_pioneer = model.class == "Pioneer";
        let of = |pioneer: f64, other: f64| if is_pioneer { pioneer } else { other };
        let number = |key: &str, given: Option<f64>, own: f64, least: f64, most: f64| {
            let value = given.unwrap_or(own);
            let fits = value >= least && value <= most;
            if fits { Ok(value) } else { Err(format!("chassis.{key} = {value} is out of bounds: {least} to {most}")) }
        };
        let ahead_m = number("length_ahead_m", self.length_ahead_m, model.length_ahead_m, 0.01, 10.0)?;
        let behind_m = number("length_behind_m", self.length_behind_m, model.length_behind_m, 0.01, 10.0)?;
        let own_half_width_m = of(PIONEER_HALF_WIDTH_M, model.half_width_m);
        let half_width_m = number("half_width_m", self.half_width_m, own_half_width_m, 0.01, 10.0)?;
        let shortest_m = half_width_m.min(0.5 * (ahead_m + behind_m));
        let own_cut_m = of(PIONEER_CUT_CORNERS_M, 0.0).min(0.9 * shortest_m);
        let cut_m = number("cut_corners_m", self.cut_corners_m, own_cut_m, 0.0, 0.95 * shortest_m)?;
        let outline = Footprint::cut_rectangle(ahead_m, behind_m, half_width_m, cut_m)
            .ok_or_else(|| "chassis: the outline is not convex".to_owned())?;
        let own_wheel_m_s =
            of(PIONEER_MAX_WHEEL_M_S, model.max_speed_m_s + model.max_turn_rad_s / model.turn_rad_per_m);
        let max_wheel_m_s = number("max_wheel_m_s", self.max_wheel_m_s, own_wheel_m_s, 0.01, 20.0)?;
        let pioneer = Tops::PIONEER;
        let own = f64::from(pioneer.translation_acceleration_mm_s2) * 1e-3;
        let acceleration_m_s2 = number("max_acceleration_m_s2", self.max_acceleration_m_s2, own, 0.01, 32.0)?;
        let own = f64::from(pioneer.rotation_acceleration_deg_s2).to_radians();
        let key = "max_turn_acceleration_rad_s2";
        let turn_acceleration_rad_s2 = number(key, self.max_turn_acceleration_rad_s2, own, 0.02, 570.0)?;
        let sip_cycle_ms = self.sip_cycle_ms.unwrap_or(PIONEER_SIP_CYCLE_MS);
        if !(10..=250).contains(&sip_cycle_ms) {
            return Err(format!("chassis.sip_cycle_ms = {sip_cycle_ms} is out of bounds: 10 to 250"));
        }
        let tops = Tops {
            translation_acceleration_mm_s2: (acceleration_m_s2 * 1e3).round() as u16,
            rotation_acceleration_deg_s2: turn_acceleration_rad_s2.to_degrees().round() as u16,
            ..pioneer
        };
        Ok(Built { outline, max_wheel_m_s, tops, sip_cycle_ms })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivers::p2os::model::named;

    #[test]
    fn a_pioneer_is_an_octagon_and_a_jackal_a_rectangle() {
        let pioneer = Chassis::default().built(named("p3dx-sh").unwrap()).unwrap();
        assert_eq!((pioneer.outline.corners().len(), pioneer.sip_cycle_ms), (8, 100));
        let jackal = Chassis::default().built(named("jackal").unwrap()).unwrap();
        let corner = jackal.outline.corners()[1];
        assert_eq!((jackal.outline.corners().len(), corner.x_m, corner.y_m), (4, 0.254, 0.215));
    }

    #[test]
    fn every_figure_can_be_given_and_a_wrong_one_is_named() {
        let model = named("jackal").unwrap();
        let given = Chassis {
            cut_corners_m: Some(0.05),
            max_wheel_m_s: Some(2.5),
            max_acceleration_m_s2: Some(4.0),
            sip_cycle_ms: Some(20),
            ..Chassis::default()
        };
        let built = given.built(model).unwrap();
        assert_eq!(built.outline.corners().len(), 8);
        assert_eq!(built.tops.translation_acceleration_mm_s2, 4000);
        assert_eq!((built.max_wheel_m_s, built.sip_cycle_ms), (2.5, 20));
        let wide = Chassis { half_width_m: Some(f64::NAN), ..Chassis::default() };
        assert!(wide.built(model).unwrap_err().contains("chassis.half_width_m"));
        let quick = Chassis { sip_cycle_ms: Some(2), ..Chassis::default() };
        assert!(quick.built(model).unwrap_err().contains("sip_cycle_ms"));
    }
}
