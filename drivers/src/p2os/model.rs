//! What is known of each model: conversion factors, sonar poses, body, caps. Data only; the robot file may override.
//!
//! Sources: the vendor's client tables as two independent open drivers carry them. Frame: body, x forward, y left,
//! from the centre of rotation.

use std::f64::consts::{PI, TAU};

/// Turn rate per unit of the SIP's ROTVEL, the same for all models [rad/s].
pub const TURN_RATE_RAD_S_PER_UNIT: f64 = PI / 1800.0;
/// Transducers in both arrays.
pub const SONARS: usize = 16;

/// Where a transducer sits and looks.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SonarPose {
    /// Ahead of the centre of rotation [m].
    pub x_m: f64,
    /// To the left of the centre of rotation [m].
    pub y_m: f64,
    /// Direction of the axis [rad].
    pub bearing_rad: f64,
}

/// One model's figures. The vendor's "DiffConvFactor" is `turn_rad_per_m` / 1000.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    /// Class in the identity.
    pub class: &'static str,
    /// Subclass in the identity; the model's name in a robot file.
    pub subclass: &'static str,
    /// Heading per unit of THPOS [rad].
    pub heading_rad_per_unit: f64,
    /// Position per unit of XPOS, YPOS [m].
    pub distance_m_per_unit: f64,
    /// Speed per unit of LVEL, RVEL [m/s].
    pub speed_m_s_per_unit: f64,
    /// Range per unit of a sonar reading [m].
    pub range_m_per_unit: f64,
    /// Turn rate per half the difference of the wheel speeds: (right − left)/2 × this [rad/m].
    pub turn_rad_per_m: f64,
    /// Transducers 0…7 front, 8…15 rear.
    pub sonar: [SonarPose; SONARS],
    /// Shortest distance that a transducer measures [m].
    pub min_range_m: f64,
    /// Reading that means "no echo" [m].
    pub max_range_m: f64,
    /// Full opening angle of a transducer's cone [rad].
    pub beam_width_rad: f64,
    /// Firmware's cap [m/s].
    pub max_speed_m_s: f64,
    /// Firmware's cap [rad/s].
    pub max_turn_rad_s: f64,
    /// Body ahead of the centre of rotation [m].
    pub length_ahead_m: f64,
    /// Body behind the centre of rotation [m].
    pub length_behind_m: f64,
    /// Half of the body's width [m].
    pub half_width_m: f64,
}

/// A transducer from the vendor's table: millimetres and degrees.
const fn sonar(x_mm: i32, y_mm: i32, bearing_deg: i32) -> SonarPose {
    SonarPose { x_m: x_mm as f64 / 1000.0, y_m: y_mm as f64 / 1000.0, bearing_rad: bearing_deg as f64 * PI / 180.0 }
}

/// Pioneer 3-DX with the ARCOS controller.
const P3DX_SH: Model = Model {
    class: "Pioneer",
    subclass: "p3dx-sh",
    // The manual's "degrees" notwithstanding: every client takes 4096 units per turn.
    heading_rad_per_unit: TAU / 4096.0,
    distance_m_per_unit: 0.001,
    speed_m_s_per_unit: 0.001,
    range_m_per_unit: 0.001,
    turn_rad_per_m: 5.6,
    sonar: [
        sonar(69, 136, 90),
        sonar(114, 119, 50),
        sonar(148, 78, 30),
        sonar(166, 27, 10),
        sonar(166, -27, -10),
        sonar(148, -78, -30),
        sonar(114, -119, -50),
        sonar(69, -136, -90),
        sonar(-157, -136, -90),
        sonar(-203, -119, -130),
        sonar(-237, -78, -150),
        sonar(-255, -27, -170),
        sonar(-255, 27, 170),
        sonar(-237, 78, 150),
        sonar(-203, 119, 130),
        sonar(-157, 136, 90),
    ],
    min_range_m: 0.1,
    max_range_m: 5.0,
    beam_width_rad: PI / 6.0,
    max_speed_m_s: 2.2,
    max_turn_rad_s: 500.0 * PI / 180.0,
    length_ahead_m: 0.21,
    length_behind_m: 0.301,
    half_width_m: 0.2125,
};

/// Pioneer 3-DX with the older H8 controller.
const P3DX: Model = Model { subclass: "p3dx", distance_m_per_unit: 0.000_485, ..P3DX_SH };

/// A stand-in for a Clearpath Jackal in simulations: its body and wheels behind a controller that speaks P2OS. No such
/// controller exists, a real Jackal has another protocol; the class says so. It has no sonar: fit no array.
const JACKAL_STAND_IN: Model = Model {
    class: "StandIn",
    subclass: "jackal",
    // Half a millimetre: the 15 bits of a position last for 16 m.
    distance_m_per_unit: 0.000_5,
    // Two over the track of 0.37559 m, without the slip of skid steering.
    turn_rad_per_m: 5.325,
    max_speed_m_s: 2.0,
    max_turn_rad_s: 4.0,
    length_ahead_m: 0.254,
    length_behind_m: 0.254,
    half_width_m: 0.215,
    ..P3DX_SH
};

/// All models that the driver knows.
pub const MODELS: &[Model] = &[P3DX_SH, P3DX, JACKAL_STAND_IN];

/// The model that a robot's identity names, whatever the case.
pub fn find(class: &str, subclass: &str) -> Option<&'static Model> {
    MODELS.iter().find(|model| model.class.eq_ignore_ascii_case(class) && model.subclass.eq_ignore_ascii_case(subclass))
}

/// The model that a robot file names by its subclass, whatever the case.
pub fn named(subclass: &str) -> Option<&'static Model> {
    MODELS.iter().find(|model| model.subclass.eq_ignore_ascii_case(subclass))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn class_and_subclass_choose_the_model_whatever_their_case() {
        assert_eq!(find("PIONEER", "P3dx-SH").unwrap().distance_m_per_unit, 0.001);
        assert_eq!(find("pioneer", "p3dx").unwrap().distance_m_per_unit, 0.000_485);
        assert_eq!(find("AmigoBot", "p3dx"), None);
        assert_eq!(find("Pioneer", "p3at"), None);
        assert_eq!(named("P3DX").unwrap().subclass, "p3dx");
    }

    #[test]
    fn a_stand_in_says_that_it_is_one() {
        let jackal = find("StandIn", "jackal").unwrap();
        assert_eq!((2.0 * jackal.length_ahead_m, 2.0 * jackal.half_width_m), (0.508, 0.430));
        assert_eq!(find("Pioneer", "jackal"), None);
    }

    #[test]
    fn the_sonar_ring_is_symmetric_and_looks_outwards() {
        for model in MODELS {
            for (left, right) in [(0, 7), (1, 6), (2, 5), (3, 4), (15, 8), (14, 9), (13, 10), (12, 11)] {
                let (left, right) = (model.sonar[left], model.sonar[right]);
                assert_eq!((left.x_m, left.y_m, left.bearing_rad), (right.x_m, -right.y_m, -right.bearing_rad));
            }
            assert!(model.sonar[..8].iter().all(|pose| pose.bearing_rad.abs() <= PI / 2.0));
            assert!(model.sonar[8..].iter().all(|pose| pose.bearing_rad.abs() >= PI / 2.0));
        }
    }
}
