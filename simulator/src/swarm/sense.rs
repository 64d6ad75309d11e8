//! What a robot's rays read: walls by the map's caster, then the other robots as discs.
//!
//! In the robot's frame a ray from p along the unit vector u meets a disc of radius r about c at
//! t = a − √(r² − b²), with a = (c − p)·u > 0 and b = u × (c − p), |b| ≤ r. A disc lies across a fan's rays from
//! bearing − asin(r/d) to bearing + asin(r/d) only, d being its distance.

use super::{Around, Rays};
use crate::geometry::Point;
use runtime::math;
use std::f64::consts::TAU;

impl Around<'_> {
    /// Reads all rays of a robot.
    pub(super) fn sense(&self, robot: usize, ranges_m: &mut [f32]) {
        let centre = Point::new(self.bodies.x_m[robot], self.bodies.y_m[robot]);
        let (cos, sin) = (self.bodies.cos[robot], self.bodies.sin[robot]);
        let (kind, map) = (self.kind, &self.world.map);
        let reach_m = kind.reach_m;
        let mut farthest_m = 0.0_f32;
        let mut cast = |origin: Point, direction: Point| {
            let range_m = map.cast(origin, direction, reach_m).map_or(reach_m as f32, |range_m| range_m as f32);
            farthest_m = farthest_m.max(range_m);
            range_m
        };
        match &kind.rays {
            Rays::Few(rays) => {
                for (range_m, (place, direction)) in ranges_m.iter_mut().zip(rays) {
                    *range_m = cast(centre + place.turned(cos, sin), direction.turned(cos, sin));
                }
                let near_m = f64::from(farthest_m) + kind.radius_m + kind.farthest_mount_m();
                self.neighbours.each_within(robot, centre, near_m, |_, apart| {
                    let disc = apart.turned(cos, -sin);
                    for (range_m, (place, direction)) in ranges_m.iter_mut().zip(rays) {
                        meet(range_m, disc - *place, *direction, kind.radius_m);
                    }
                });
            }
            Rays::Fan { place, first_rad, step_rad, directions } => {
                let origin = centre + place.turned(cos, sin);
                for (range_m, direction) in ranges_m.iter_mut().zip(directions) {
                    *range_m = cast(origin, direction.turned(cos, sin));
                }
                let near_m = f64::from(farthest_m) + kind.radius_m + place.norm();
                self.neighbours.each_within(robot, centre, near_m, |_, apart| {
                    let disc = apart.turned(cos, -sin) - *place;
                    let (first, last) = across(disc, kind.radius_m, *first_rad, *step_rad);
                    for turn in [-TAU, 0.0, TAU] {
                        let shift = turn / step_rad;
                        let from = (first + shift).ceil().max(0.0) as usize;
                        let to = ((last + shift).floor() + 1.0).max(0.0) as usize;
                        let to = to.min(directions.len());
                        for ray in from..to {
                            meet(&mut ranges_m[ray], disc, directions[ray], kind.radius_m);
                        }
                    }
                });
            }
        }
    }
}

/// Shortens a range to where the ray from the origin meets a disc about `disc`.
fn meet(range_m: &mut f32, disc: Point, direction: Point, radius_m: f64) {
    let along = disc.dot(direction);
    let beside = direction.cross(disc);
    let under = radius_m * radius_m - beside * beside;
    if along > 0.0 && under >= 0.0 {
        *range_m = range_m.min((along - under.sqrt()).max(0.0) as f32);
    }
}

/// Numbers of the first and the last ray of a fan that a disc may lie across, fractions and a little room included.
fn across(disc: Point, radius_m: f64, first_rad: f64, step_rad: f64) -> (f64, f64) {
    const ROOM: f64 = 1e-6;
    let share = radius_m / disc.norm().max(radius_m);
    let half_rad = math::asin(share.min(1.0));
    let middle_rad = disc.angle() - first_rad;
    ((middle_rad - half_rad) / step_rad - ROOM, (middle_rad + half_rad) / step_rad + ROOM)
}
