//! What one reading says of places: something on an arc, nothing nearer.

use super::reading::Reading;
use runtime::{Time, math};

/// A place where an echo may have come from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    /// Unit vector of the line of sight that it was last seen along.
    pub(super) look_x: f64,
    pub(super) look_y: f64,
    /// The reading that it came from, or that confirmed it last.
    pub(super) arc: Arc,
    pub(super) seen: Time,
    pub(super) confirmations: u8,
}

/// Where something is, by one reading: on this arc.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arc {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) axis_x: f64,
    pub(super) axis_y: f64,
    pub(super) cos_half: f64,
    pub(super) radius_m: f64,
}

impl Arc {
    pub(super) fn of(reading: &Reading, radius_m: f64) -> Arc {
        Arc {
            x_m: reading.x_m,
            y_m: reading.y_m,
            axis_x: reading.axis_x,
            axis_y: reading.axis_y,
            cos_half: math::cos(reading.half_width_rad),
            radius_m,
        }
    }

    /// Where two arcs cross, the place nearer to `at`; `None` where they run too much alike to say.
    pub(super) fn crossing(&self, other: &Arc, at: (f64, f64)) -> Option<(f64, f64)> {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        let apart_sq = dx * dx + dy * dy;
        if apart_sq < 1e-6 {
            return None;
        }
        // Along the line of the centres, and to its side.
        let along = 0.5 + 0.5 * (self.radius_m * self.radius_m - other.radius_m * other.radius_m) / apart_sq;
        let side_sq = self.radius_m * self.radius_m / apart_sq - along * along;
        if side_sq <= 0.0 {
            return None;
        }
        let side = side_sq.sqrt();
        let place = |side: f64| (self.x_m + along * dx - side * dy, self.y_m + along * dy + side * dx);
        let (a, b) = (place(side), place(-side));
        let far_sq = |p: (f64, f64)| (p.0 - at.0) * (p.0 - at.0) + (p.1 - at.1) * (p.1 - at.1);
        let p = if far_sq(a) <= far_sq(b) { a } else { b };
        let (ux, uy) = (p.0 - self.x_m, p.1 - self.y_m);
        let (vx, vy) = (p.0 - other.x_m, p.1 - other.y_m);
        let sine = (ux * vy - uy * vx).abs() / (self.radius_m * other.radius_m).max(1e-9);
        (sine >= LEAST_CROSSING).then_some(p)
    }

    /// Whether the arc passes through a place.
    pub(super) fn meets(&self, x_m: f64, y_m: f64, within_m: f64) -> bool {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        let along_m = dx * self.axis_x + dy * self.axis_y;
        if along_m <= 0.0 || along_m > self.radius_m + within_m {
            return false;
        }
        let away_m = math::hypot(dx, dy);
        (away_m - self.radius_m).abs() <= within_m && along_m >= self.cos_half * away_m
    }
}

/// What one reading said to be free: nothing nearer than `reach_m` well inside its cone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Free {
    pub(super) time: Time,
    pub(super) x_m: f64,
    pub(super) y_m: f64,
    pub(super) axis_x: f64,
    pub(super) axis_y: f64,
    pub(super) cos_sure: f64,
    pub(super) reach_m: f64,
}

impl Free {
    /// Whether it can deny anything within `room_m` of a place; true more often than need be.
    pub(super) fn sees_into(&self, x_m: f64, y_m: f64, room_m: f64) -> bool {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        let along_m = dx * self.axis_x + dy * self.axis_y;
        let most_m = self.reach_m + room_m;
        let away_sq = dx * dx + dy * dy;
        // The nearest edge of the disc to the axis: along + room ≥ cos·(away − room), without a root.
        let slack_m = along_m + room_m * (1.0 + self.cos_sure);
        let abreast = self.cos_sure > 0.0 && slack_m * slack_m < self.cos_sure * self.cos_sure * away_sq;
        along_m > -room_m && away_sq < most_m * most_m && !abreast
    }

    /// Whether it can deny a place, whatever the look; true more often than need be.
    pub(super) fn may_deny(&self, x_m: f64, y_m: f64) -> bool {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        let along_m = dx * self.axis_x + dy * self.axis_y;
        // A little less than the cone's cosine, squared; a cone of more than half a turn denies all around.
        let cos = (self.cos_sure - 1e-9).max(0.0);
        (along_m > 0.0) & (along_m <= self.reach_m) & (along_m * along_m >= cos * cos * (dx * dx + dy * dy))
    }

    /// Whether a place is said to be free by somebody who looked along about the unit vector (`look_x`, `look_y`).
    pub(super) fn denies(&self, x_m: f64, y_m: f64, look_x: f64, look_y: f64, cos_askance: f64) -> bool {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        let along_m = dx * self.axis_x + dy * self.axis_y;
        if along_m <= 0.0 || along_m > self.reach_m {
            return false;
        }
        let away_m = math::hypot(dx, dy);
        away_m < self.reach_m && along_m >= self.cos_sure * away_m && dx * look_x + dy * look_y >= cos_askance * away_m
    }
}

/// Sine of the least angle at which two arcs cross rather than run alongside.
const LEAST_CROSSING: f64 = 0.1;

pub(super) fn near(a: (f64, f64), b: (f64, f64), within_m: f64) -> bool {
    let (dx, dy) = (a.0 - b.0, a.1 - b.1);
    dx * dx + dy * dy <= within_m * within_m
}
