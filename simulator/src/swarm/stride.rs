//! How far a robot gets in a step.
//!
//! Every thing near limits the way to its side of a line: for a wall the line through its nearest point c, square to
//! c − p; for another robot at q the line half-way, square to q − p, because q moves at the same time. A disc of radius
//! r that goes from p along the unit vector u and stays at r from each line goes at most
//!
//! s = (h − r) / (u·n)   for every line with u·n > 0,
//!
//! n being the direction to the thing and h the distance of the line. All robots can so move at once without two of them
//! ever overlapping (buffered Voronoi cells: Zhou, Wang, Bandyopadhyay, Schwager, RA-L 2017), and a wall is never
//! entered. The distance to the nearest wall is known from below; a step that stays within it asks the map nothing.

use super::{Around, Own};
use crate::geometry::{Point, Pose};
use runtime::math;

/// How far around itself a robot looks for walls when it must, beyond its radius [m].
const PROBE_M: f64 = 0.5;
/// The known distance is kept so much smaller than it is: it is kept with seven digits [m].
const ROUNDING_M: f32 = 1e-4;

impl Around<'_> {
    pub(super) fn stride(&self, robot: usize, own: &mut Own, speed_m_s: f64, turn_rad_s: f64) {
        let from = own.pose;
        let centre = from.place();
        let turn_rad = turn_rad_s * self.step_s;
        let wanted_m = speed_m_s * self.step_s;
        let direction = Point::unit(from.heading_rad + 0.5 * turn_rad) * if wanted_m < 0.0 { -1.0 } else { 1.0 };
        let radius_m = self.kind.radius_m;
        let mut way_m = wanted_m.abs();
        let mut limit = |to: Point, line_m: f64, away_m: f64| {
            // `to` has the length `away_m`.
            let towards = direction.dot(to);
            if towards > 0.0 {
                way_m = way_m.min(((line_m - radius_m) * away_m / towards).max(0.0));
            }
        };
        if wanted_m != 0.0 {
            let near_m = 2.0 * (radius_m + wanted_m.abs());
            self.neighbours.each_within(robot, centre, near_m, |_, apart| {
                let away_m = apart.norm();
                limit(apart, 0.5 * away_m, away_m);
            });
            if f64::from(own.wall_m) < radius_m + wanted_m.abs() {
                let mut nearest_m = radius_m + PROBE_M;
                self.world.map.near(centre, nearest_m, |to| {
                    let away_m = to.norm();
                    nearest_m = nearest_m.min(away_m);
                    limit(to, away_m, away_m);
                });
                own.wall_m = nearest_m as f32 - ROUNDING_M;
            }
        }
        let blocked = way_m < wanted_m.abs();
        own.contacts += u64::from(blocked && !own.blocked);
        own.blocked = blocked;
        own.way_m += way_m;
        own.wall_m -= way_m as f32;
        let place = centre + direction * way_m;
        own.pose = Pose::new(place.x_m, place.y_m, math::wrap_angle(from.heading_rad + turn_rad));
    }
}
