//! Distances to whatever is around the body.

use crate::Message;

/// What a beam says: a distance, or the reason that there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Echo {
    /// Never measured since the driver started.
    None = 0,
    /// `range_m` is a measured distance.
    Value = 1,
    /// The beam was fired and nothing answered within `max_range_m`.
    Clear = 2,
    /// Something is nearer than `min_range_m`.
    TooNear = 3,
    /// The device is switched off, or this transducer is.
    Off = 4,
    /// The link to the device is down.
    LinkLost = 5,
    /// The device reported a fault of this beam.
    Fault = 6,
}

/// One beam in the body frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Beam {
    /// Where the beam starts, ahead of the body's origin [m].
    pub origin_x_m: f32,
    /// Where the beam starts, to the left of the body's origin [m].
    pub origin_y_m: f32,
    /// Direction of the beam's axis in the body frame, counter-clockwise [rad].
    pub bearing_rad: f32,
    /// Distance along the beam; meaningful only when `echo` is `value` [m].
    pub range_m: f32,
    /// How long before the sample's stamp this beam was taken [s].
    pub age_s: f32,
    /// A value, or the reason that there is none; see [`Echo`].
    #[message(values = "none value clear too_near off link_lost fault")]
    pub echo: u32,
}

/// Distances by any ranger (sonar, laser, infrared), all beams in one sample; the tail holds the [`Beam`]s.
///
/// Frame: body (x forward, y left). Stamp: when the newest beam was taken. The nearest ROS 2 relatives are
/// sensor_msgs/Range (one beam) and sensor_msgs/LaserScan.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(tail = Beam)]
pub struct Ranges {
    /// Shortest distance that a beam can report [m].
    pub min_range_m: f32,
    /// Longest distance that a beam can report [m].
    pub max_range_m: f32,
    /// Full opening angle of each beam's cone; 0 for a laser [rad].
    pub beam_width_rad: f32,
    /// Time between the oldest and the newest beam of this sample [s].
    pub span_s: f32,
}

/// What became of a cross-check of several rangers; the tail says in words who is left out, and why (UTF-8).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Message)]
#[repr(C)]
#[message(tail = u8)]
pub struct RangerVerdict {
    /// The ranger whose ranges are passed on: the number of its path, as [`path_number`](crate::path_number) counts it; 0
    /// for none.
    pub used: u32,
    /// Rangers whose samples are fresh.
    pub rangers: u32,
    /// Rangers that are left out.
    pub left_out: u32,
    /// Comparisons of the used one with the others that have a vote.
    pub compared: u32,
    /// Of them, those that are not equal.
    pub unequal: u32,
    /// Rangers that have a place: named ones, and those that were ever seen.
    pub places: u32,
}
