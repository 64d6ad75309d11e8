//! The swarm's controller: a plain wander.
//!
//! Onwards while the rays ahead are free; slower the nearer something is; where it is near, a turn towards the freer
//! side, kept up until the way is free. On an open way it drifts a little, by chance.

use super::Kind;
use crate::noise::Chance;

/// Which way a robot is turning until its way is free: −1 right, 0 not at all, 1 left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Mood {
    turning: i8,
}

/// The way is free beyond so many radii ...
const FREE_RADII: f64 = 4.0;
/// ... and blocked within so many.
const BLOCKED_RADII: f64 = 1.6;
/// Greatest drift on an open way, of the greatest turn.
const DRIFT: f64 = 0.2;

/// Speed [m/s] and turn [rad/s] for what the rays read.
pub(super) fn wander(kind: &Kind, ranges_m: &[f32], mood: &mut Mood, chance: &mut Chance) -> (f64, f64) {
    let nearest = |rays: &[u32]| {
        let least = rays.iter().map(|ray| ranges_m[*ray as usize]).fold(kind.reach_m as f32, f32::min);
        f64::from(least)
    };
    let [left_m, right_m] = [nearest(&kind.ahead[0]), nearest(&kind.ahead[1])];
    let free_m = FREE_RADII * kind.radius_m;
    let blocked_m = BLOCKED_RADII * kind.radius_m;
    let ahead_m = left_m.min(right_m);
    if ahead_m >= free_m {
        mood.turning = 0;
        return (kind.speed_m_s, DRIFT * kind.turn_rad_s * chance.either_way());
    }
    if mood.turning == 0 {
        mood.turning = if left_m >= right_m { 1 } else { -1 };
    }
    let share = ((ahead_m - blocked_m) / (free_m - blocked_m)).clamp(0.0, 1.0);
    (kind.speed_m_s * share, kind.turn_rad_s * f64::from(mood.turning))
}
