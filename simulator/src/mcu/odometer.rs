//! Where the robot believes to be: the encoders' ticks summed up, drift and all.

use crate::geometry::Pose;

/// Dead reckoning from wheel ticks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Odometer {
    /// Position since the last reset [m]; the heading is not wrapped, so that a set-point may lie turns ahead [rad].
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
    /// Way along the body since power-on, backwards counted negative [m].
    pub way_m: f64,
    /// Ticks at the last update.
    pub left_ticks: i64,
    pub right_ticks: i64,
    /// Wheel speeds over the last update [m/s].
    pub left_m_s: f64,
    pub right_m_s: f64,
}

impl Odometer {
    /// Takes over the encoders' counts after `dt_s`.
    pub fn update(&mut self, left: i64, right: i64, ticks_per_m: f64, turn_rad_per_m: f64, dt_s: f64) {
        let left_m = (left - self.left_ticks) as f64 / ticks_per_m;
        let right_m = (right - self.right_ticks) as f64 / ticks_per_m;
        (self.left_ticks, self.right_ticks) = (left, right);
        (self.left_m_s, self.right_m_s) = (left_m / dt_s, right_m / dt_s);
        if left_m == 0.0 && right_m == 0.0 {
            return;
        }
        let way_m = 0.5 * (left_m + right_m);
        let turn_rad = 0.5 * (right_m - left_m) * turn_rad_per_m;
        let after = Pose::new(self.x_m, self.y_m, self.heading_rad).after_arc(way_m, turn_rad);
        (self.x_m, self.y_m) = (after.x_m, after.y_m);
        self.heading_rad += turn_rad;
        self.way_m += way_m;
    }

    /// SETO.
    pub fn reset(&mut self) {
        (self.x_m, self.y_m, self.heading_rad) = (0.0, 0.0, 0.0);
    }
}
