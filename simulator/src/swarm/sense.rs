//! What a robot's rays read: walls by the map's caster, then the other robots as discs.
//!
//! In the robot's frame a ray from p along the unit vector u meets a disc of radius r about c at
//! t = a − √(r² − b²), with a = (c − p)·u > 0 and b = u × (c − p), |b| ≤ r. A disc lies across a fan's rays from
//! bearing − asin(r/d) to bearing + asin(r/d) only, d being its distance.

use super::{Around, Rays};
use crate::geometry::Point;
use crate::world::View;

/// A disc counts as hidden only where a range is shorter by more than this [m].
const ROUNDING_M: f32 = 1e-4;

impl Around<'_> {
    /// Reads all rays of a robot.
    pub(super) fn sense(&self, robot: usize, ranges_m: &mut [f32]) {
        let centre = Point::new(self.bodies.x_m[robot], self.bodies.y_m[robot]);
        let (cos, sin) = (self.bodies.cos[robot], self.bodies.sin[robot]);
        let (kind, map) = (self.kind, &self.world.map);
        match &kind.rays {
            Rays::Few(few) => {
                let mut farthest_m = 0.0_f32;
                for (range_m, (place, direction)) in ranges_m.iter_mut().zip(&few.rays) {
                    let origin = centre + place.turned(cos, sin);
                    let hit_m = map.cast(origin, direction.turned(cos, sin), kind.reach_m);
                    *range_m = hit_m.unwrap_or(kind.reach_m) as f32;
                    farthest_m = farthest_m.max(*range_m);
                }
                let near_m = f64::from(farthest_m) + kind.radius_m + kind.farthest_mount_m;
                self.neighbours.each_within(robot, centre, near_m, |_, apart| {
                    let disc = apart.turned(cos, -sin);
                    few.each_towards(disc, |ray| {
                        let (place, direction) = few.rays[ray];
                        meet(&mut ranges_m[ray], disc - place, direction, kind.radius_m);
                    });
                });
            }
            Rays::Fan(fan) => {
                ranges_m.fill(kind.reach_m as f32);
                map.sweep(&View { fan, origin: centre + fan.place.turned(cos, sin), cos, sin }, ranges_m);
                let farthest_m = ranges_m.iter().fold(0.0_f32, |most, range_m| most.max(*range_m));
                let near_m = f64::from(farthest_m) + kind.radius_m + kind.farthest_mount_m;
                self.neighbours.each_within(robot, centre, near_m, |_, apart| {
                    let disc = apart.turned(cos, -sin) - fan.place;
                    if fan.is_behind(disc, kind.radius_m) {
                        return;
                    }
                    let nearest_m = (disc.norm() - kind.radius_m) as f32 - ROUNDING_M;
                    fan.across(disc, kind.radius_m, |run| {
                        for (range_m, direction) in ranges_m[run.clone()].iter_mut().zip(&fan.directions[run]) {
                            // Most are hidden by what stands before them.
                            if *range_m > nearest_m {
                                meet(range_m, disc, *direction, kind.radius_m);
                            }
                        }
                    });
                });
            }
        }
    }
}

/// Shortens a range to where the ray from the origin meets a disc about `disc`.
#[inline]
fn meet(range_m: &mut f32, disc: Point, direction: Point, radius_m: f64) {
    let along = disc.dot(direction);
    let beside = direction.cross(disc);
    let under = radius_m * radius_m - beside * beside;
    if along > 0.0 && under >= 0.0 {
        *range_m = range_m.min((along - under.sqrt()).max(0.0) as f32);
    }
}
