//! One turn of a laser scanner's mirror, as the device measured it.

use crate::Message;

/// One beam of a [`LaserScan`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct ScanBeam {
    /// Distance along the beam; meaningful only when `echo` is `value` [m].
    pub range_m: f32,
    /// Strength of the echo in the device's own units; 0 where the device does not say.
    pub intensity: u16,
    /// A value, or the reason that there is none; see [`Echo`](crate::Echo).
    #[message(values = "none value clear too_near off link_lost fault")]
    pub echo: u16,
}

/// One scan of a planar laser; the tail holds the [`ScanBeam`]s in the order in which they were taken.
///
/// After sensor_msgs/LaserScan. Stamp: when the first beam was taken, in our time. Beam k was taken at
/// stamp + k · `time_increment_s`, in the direction [`LaserScan::bearing_rad`] from the sensor's place in the body frame.
/// While the device is silent, scans come whose beams all say why.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(tail = ScanBeam)]
pub struct LaserScan {
    /// The device's own time of the first beam since it was switched on; NaN when it has no clock [s].
    pub sensor_time_s: f64,
    /// Direction of the first beam in the sensor's frame [rad].
    pub angle_min_rad: f32,
    /// From one beam to the next, counter-clockwise in the sensor's frame [rad].
    pub angle_increment_rad: f32,
    /// Time from one beam to the next [s].
    pub time_increment_s: f32,
    /// Time from one scan to the next; 0 when not known [s].
    pub scan_time_s: f32,
    /// Shortest distance that the device can report [m].
    pub range_min_m: f32,
    /// Longest distance that the device can report [m].
    pub range_max_m: f32,
    /// Where the sensor sits, ahead of the body's origin [m].
    pub x_m: f32,
    /// Where the sensor sits, to the left of the body's origin [m].
    pub y_m: f32,
    /// Where the sensor looks in the body frame [rad].
    pub heading_rad: f32,
    /// Mounted with its top down, so that angles run clockwise in the body frame: 1.
    pub upside_down: u32,
}

/// How a laser scanner and the link to it are.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct LaserState {
    /// The link; see [`Link`](crate::Link).
    #[message(values = "connecting up no_port silent lost foreign")]
    pub link: u32,
    /// The device measures: 1.
    pub laser_on: u32,
    /// The device's own last word that was not "all well": a byte (LMS), two characters (SCIP); 0 for none.
    pub status: u32,
    /// Times the link came up.
    pub connections: u32,
    /// Scans received whole.
    pub scans: u32,
    /// Messages dropped for a wrong sum, or for saying what they cannot say.
    pub damaged: u32,
    /// Bytes skipped while hunting for a message [byte].
    pub skipped_bytes: u32,
    /// Times the device's clock went back or jumped.
    pub clock_jumps: u32,
}

impl LaserScan {
    /// Direction of beam `index` in the body frame, counter-clockwise, not wrapped [rad].
    pub fn bearing_rad(&self, index: usize) -> f64 {
        let angle_rad = f64::from(self.angle_min_rad) + index as f64 * f64::from(self.angle_increment_rad);
        f64::from(self.heading_rad) + if self.upside_down == 0 { angle_rad } else { -angle_rad }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_upside_down_sees_its_left_on_the_right() {
        let mut scan =
            LaserScan { angle_min_rad: -1.0, angle_increment_rad: 0.5, heading_rad: 0.25, ..LaserScan::default() };
        assert_eq!((scan.bearing_rad(0), scan.bearing_rad(4)), (-0.75, 1.25));
        scan.upside_down = 1;
        assert_eq!((scan.bearing_rad(0), scan.bearing_rad(4)), (1.25, -0.75));
    }
}
