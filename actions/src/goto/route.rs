//! Via points to drive along, aiming two or three of them ahead (S2, Goto).
//!
//! The law stands still at its target; so along a path it aims at the via point `ahead` after the next one, and at the
//! last one only when no more follow. A via point is passed when the body is near it, or beyond it: past the line
//! through it square to the way towards the point after it.

use crate::place::Place;
use messages::{GotoPath, VIA_POINTS};

/// The via points that are left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Route {
    points: [[f64; 2]; VIA_POINTS],
    count: usize,
    next: usize,
}

/// What a route says to drive to now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// In the map frame [m].
    pub x_m: f64,
    /// In the map frame [m].
    pub y_m: f64,
    /// Whether it is the goal itself.
    pub is_goal: bool,
}

impl Route {
    /// Straight to one point.
    pub fn to(x_m: f64, y_m: f64) -> Route {
        let mut points = [[0.0; 2]; VIA_POINTS];
        points[0] = [x_m, y_m];
        Route { points, count: 1, next: 0 }
    }

    /// Along the points of `path`, or what is wrong with them.
    pub fn along(path: &GotoPath) -> Result<Route, &'static str> {
        let count = match path.count {
            0 => return Err("the path has no points: count is 0"),
            count if count > VIA_POINTS as u64 => {
                return Err("a path has at most 24 points; send longer ones in parts");
            }
            count => count as usize,
        };
        if !path.points_m[..count].iter().flatten().all(|n| n.is_finite()) {
            return Err("a via point is no number: give metres in the map frame");
        }
        Ok(Route { points: path.points_m, count, next: 0 })
    }

    /// The points that are left, the goal last.
    pub fn left(&self) -> &[[f64; 2]] {
        &self.points[self.next..self.count]
    }

    /// The last point [m].
    pub fn goal(&self) -> (f64, f64) {
        let [x_m, y_m] = self.points[self.count - 1];
        (x_m, y_m)
    }

    /// Way that is left from `place` [m].
    pub fn left_m(&self, place: &Place) -> f64 {
        let left = self.left();
        let to_next = left.first().map_or(0.0, |&[x, y]| place.distance_m(x, y));
        let between = |pair: &[[f64; 2]]| runtime::math::hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        to_next + left.windows(2).map(between).sum::<f64>()
    }

    /// Drops the points that have been passed, nearer than `pass_m` or beyond; answers what to aim at.
    pub fn aim(&mut self, place: &Place, pass_m: f64, ahead: usize) -> Aim {
        while self.next + 1 < self.count {
            let [x, y] = self.points[self.next];
            let [after_x, after_y] = self.points[self.next + 1];
            let beyond = (place.x_m - x) * (after_x - x) + (place.y_m - y) * (after_y - y) > 0.0;
            // Being beyond counts only where the point is about as near as the one after it.
            let about = place.distance_m(x, y) <= place.distance_m(after_x, after_y);
            if !(place.distance_m(x, y) <= pass_m || beyond && !about) {
                break;
            }
            self.next += 1;
        }
        let at = (self.next + ahead).min(self.count - 1);
        let [x_m, y_m] = self.points[at];
        Aim { x_m, y_m, is_goal: at + 1 == self.count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(points: &[[f64; 2]]) -> GotoPath {
        let mut points_m = [[0.0; 2]; VIA_POINTS];
        points_m[..points.len()].copy_from_slice(points);
        GotoPath { points_m, count: points.len() as u64, heading_rad: f64::NAN, tolerance_m: 0.0 }
    }

    fn place(x_m: f64, y_m: f64) -> Place {
        Place { x_m, y_m, heading_rad: 0.0 }
    }

    const LINE: [[f64; 2]; 6] = [[1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 0.0], [5.0, 0.0], [6.0, 0.0]];

    #[test]
    fn it_aims_two_points_ahead_and_at_the_goal_in_the_end() {
        let mut route = Route::along(&path(&LINE)).unwrap();
        let aim = route.aim(&place(0.0, 0.0), 0.3, 2);
        assert_eq!((aim.x_m, aim.is_goal), (3.0, false));
        let aim = route.aim(&place(1.8, 0.1), 0.3, 2);
        assert_eq!((aim.x_m, aim.is_goal), (5.0, false), "two points have been passed");
        let aim = route.aim(&place(3.9, 0.0), 0.3, 2);
        assert_eq!((aim.x_m, aim.is_goal), (6.0, true));
        assert!((route.left_m(&place(3.9, 0.0)) - 2.1).abs() < 1e-12);
    }

    #[test]
    fn a_via_point_that_was_driven_around_counts_as_passed() {
        let mut route = Route::along(&path(&LINE)).unwrap();
        assert_eq!(route.aim(&place(2.7, 0.8), 0.3, 0).x_m, 3.0);
    }

    #[test]
    fn a_single_point_is_the_goal_at_once() {
        let mut route = Route::to(1.0, -1.0);
        assert_eq!(route.aim(&place(0.0, 0.0), 0.3, 2), Aim { x_m: 1.0, y_m: -1.0, is_goal: true });
        assert_eq!(route.goal(), (1.0, -1.0));
    }

    #[test]
    fn paths_that_lead_nowhere_are_refused_with_the_reason() {
        assert!(Route::along(&path(&[])).unwrap_err().contains("no points"));
        assert!(Route::along(&GotoPath { count: 25, ..path(&LINE) }).unwrap_err().contains("at most 24"));
        assert!(Route::along(&path(&[[0.0, f64::NAN]])).unwrap_err().contains("no number"));
    }
}
