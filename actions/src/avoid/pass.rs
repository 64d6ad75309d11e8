//! Passing one obstacle, by S2's geometry.
//!
//! With d_min, θ_min the nearest point of the obstacle inside the safe boundary and θ_r, θ_l the obstacle's first and
//! last angle (counter-clockwise from the robot's right), D = 2(r_robot + d_emg), β = atan(D/d_min):
//!
//! ```text
//! case 1, obstacle on the right (θ_min < π/2):  γ = β + |θ_min − θ_l|,  φ = θ_min + γ − π/2  within [0, π/2]
//! case 2, obstacle on the left  (θ_min > π/2):  γ = β + |θ_min − θ_r|,  φ = θ_min − γ − π/2  within [−π/2, 0]
//! v = (d_min/d_safe)·(1 − |φ|/(π/2))·v_max      ω = φ/(π/2)·ω_max
//! ```
//!
//! In the source both branches of φ are damaged; these are the standard ones, and the bounds keep φ from pointing
//! at the obstacle. An obstacle dead ahead belongs to no case there: it is passed on the roomier side, and on the same
//! one as long as it stays dead ahead.

use super::horizon::{DIRECTIONS, Horizon, bearing_rad};
use messages::Side;
use runtime::math;
use std::f64::consts::FRAC_PI_2;

/// Distances and speeds by which an obstacle is passed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passing {
    /// r_robot [m].
    pub radius_m: f64,
    /// d_emg: nothing comes nearer to the body [m].
    pub danger_m: f64,
    /// d_safe: nothing farther away, from the centre, is avoided [m].
    pub safe_m: f64,
    /// An obstacle within this angle of straight ahead is dead ahead [rad].
    pub dead_ahead_rad: f64,
    /// Ranges count up to this in the judgement of the roomier side [m].
    pub room_m: f64,
}

/// The obstacle to pass, in S2's angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Obstacle {
    /// d_min, from the body's centre [m].
    pub nearest_m: f64,
    /// θ_min [rad].
    pub nearest_rad: f64,
    /// θ_r [rad].
    pub first_rad: f64,
    /// θ_l [rad].
    pub last_rad: f64,
}

impl Passing {
    /// Half the width of the region of interest ahead, in which obstacles are avoided [m].
    pub fn half_width_m(&self) -> f64 {
        self.radius_m + self.danger_m
    }

    /// The obstacle with the nearest point in the region of interest; `None` when the region is empty.
    pub fn obstacle(&self, horizon: &Horizon) -> Option<Obstacle> {
        let is_near = |index: usize| horizon.distance_m(index) < self.safe_m;
        let in_region = |&(index, x, y): &(usize, f64, f64)| x > 0.0 && y.abs() < self.half_width_m() && is_near(index);
        let nearer = |a: (usize, f64, f64), b: (usize, f64, f64)| {
            if horizon.distance_m(b.0) < horizon.distance_m(a.0) { b } else { a }
        };
        let (nearest, ..) = horizon.points().filter(in_region).reduce(nearer)?;
        // What leaves no room to pass between belongs together.
        let width_m = 2.0 * self.half_width_m();
        let end = |indices: &mut dyn Iterator<Item = usize>| {
            let (mut end, mut at) = (nearest, horizon.point(nearest).unwrap_or_default());
            for index in indices.filter(|&index| is_near(index)) {
                let Some(point) = horizon.point(index) else { continue };
                if math::hypot(point.0 - at.0, point.1 - at.1) > width_m {
                    break;
                }
                (end, at) = (index, point);
            }
            bearing_rad(end) + FRAC_PI_2
        };
        Some(Obstacle {
            nearest_m: horizon.distance_m(nearest),
            nearest_rad: bearing_rad(nearest) + FRAC_PI_2,
            first_rad: end(&mut (0..nearest).rev()),
            last_rad: end(&mut (nearest + 1..DIRECTIONS)),
        })
    }

    /// The side on which to pass; `before` is the side of the step before.
    pub fn side(&self, obstacle: &Obstacle, horizon: &Horizon, before: Side) -> Side {
        let aside_rad = obstacle.nearest_rad - FRAC_PI_2;
        if aside_rad.abs() > self.dead_ahead_rad {
            return if aside_rad < 0.0 { Side::Left } else { Side::Right };
        }
        if before != Side::None {
            return before;
        }
        let (right_m, left_m) = horizon.room_m(self.room_m);
        if right_m > left_m { Side::Right } else { Side::Left }
    }

    /// φ: the direction to take, 0 straight ahead, counter-clockwise [rad].
    pub fn direction_rad(&self, obstacle: &Obstacle, side: Side) -> f64 {
        let Obstacle { nearest_m, nearest_rad, first_rad, last_rad } = *obstacle;
        let beta = math::atan2(2.0 * self.half_width_m(), nearest_m);
        match side {
            Side::Left | Side::None => {
                let gamma = beta + (nearest_rad - last_rad).abs();
                (nearest_rad + gamma - FRAC_PI_2).clamp(0.0, FRAC_PI_2)
            }
            Side::Right => {
                let gamma = beta + (nearest_rad - first_rad).abs();
                (nearest_rad - gamma - FRAC_PI_2).clamp(-FRAC_PI_2, 0.0)
            }
        }
    }
}

/// Share of the greatest speed, and share of the greatest turn rate, for a direction and a share of the safe distance.
pub fn velocity_shares(direction_rad: f64, distance_share: f64) -> (f64, f64) {
    let aside = (direction_rad / FRAC_PI_2).clamp(-1.0, 1.0);
    (distance_share.clamp(0.0, 1.0) * (1.0 - aside.abs()), aside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    const PASSING: Passing = Passing { radius_m: 0.25, danger_m: 0.1, safe_m: 0.8, dead_ahead_rad: 0.1, room_m: 3.0 };

    fn horizon(discs: &[(f64, f64, f64)]) -> Horizon {
        let mut horizon = Horizon::default();
        discs.iter().for_each(|&(x, y, radius)| horizon.add_disc(x, y, radius));
        horizon
    }

    fn direction(horizon: &Horizon) -> Option<f64> {
        let obstacle = PASSING.obstacle(horizon)?;
        Some(PASSING.direction_rad(&obstacle, PASSING.side(&obstacle, horizon, Side::None)))
    }

    #[test]
    fn an_obstacle_on_the_right_is_passed_on_its_left() {
        let right = direction(&horizon(&[(0.6, -0.25, 0.1)])).unwrap();
        assert!(right > 0.1, "{right}");
    }

    #[test]
    fn the_mirrored_obstacle_is_passed_the_mirrored_way() {
        for (x, y) in [(0.6, 0.25), (0.5, 0.1), (0.4, 0.3)] {
            let left = direction(&horizon(&[(x, y, 0.1)])).unwrap();
            let right = direction(&horizon(&[(x, -y, 0.1)])).unwrap();
            assert!((left + right).abs() < 1e-9, "({x}, {y}): {left} {right}");
        }
    }

    #[test]
    fn the_direction_is_that_of_the_source_s_geometry() {
        // A single point at 0.5 m, 30° to the right: θ_min = θ_l = 60°.
        let theta = PI / 3.0;
        let obstacle = Obstacle { nearest_m: 0.5, nearest_rad: theta, first_rad: theta - 0.1, last_rad: theta };
        let beta = math::atan(0.7 / 0.5);
        let phi = PASSING.direction_rad(&obstacle, Side::Left);
        assert!((phi - (theta + beta - FRAC_PI_2)).abs() < 1e-12);
        // Wider to the left: further around it, up to square to the body.
        let wide = Obstacle { last_rad: theta + 0.2, ..obstacle };
        assert!((PASSING.direction_rad(&wide, Side::Left) - phi - 0.2).abs() < 1e-12);
        let wall = Obstacle { last_rad: PI, ..obstacle };
        assert_eq!(PASSING.direction_rad(&wall, Side::Left), FRAC_PI_2);
    }

    #[test]
    fn what_is_far_away_or_beside_the_way_is_left_alone() {
        assert_eq!(direction(&horizon(&[])), None);
        assert_eq!(direction(&horizon(&[(1.5, 0.0, 0.2)])), None, "farther than d_safe");
        assert_eq!(direction(&horizon(&[(0.5, 0.6, 0.2)])), None, "beside");
    }

    #[test]
    fn an_obstacle_dead_ahead_is_passed_on_the_roomier_side_and_no_other() {
        let roomier_right = horizon(&[(0.6, 0.0, 0.1), (0.2, 1.2, 0.3)]);
        let obstacle = PASSING.obstacle(&roomier_right).unwrap();
        assert_eq!(PASSING.side(&obstacle, &roomier_right, Side::None), Side::Right);
        assert!(PASSING.direction_rad(&obstacle, Side::Right) < -0.3);
        assert_eq!(
            PASSING.side(&obstacle, &roomier_right, Side::Left),
            Side::Left,
            "it keeps to the side that it took"
        );
        let roomier_left = horizon(&[(0.6, 0.0, 0.1), (0.2, -1.2, 0.3)]);
        let obstacle = PASSING.obstacle(&roomier_left).unwrap();
        assert_eq!(PASSING.side(&obstacle, &roomier_left, Side::None), Side::Left);
    }

    #[test]
    fn two_things_with_no_way_between_them_are_one_obstacle() {
        let posts = horizon(&[(0.5, -0.2, 0.05), (0.5, 0.35, 0.05)]);
        let obstacle = PASSING.obstacle(&posts).unwrap();
        assert!(obstacle.last_rad > FRAC_PI_2 + 0.5, "the left post belongs to it: {obstacle:?}");
        let far_apart = horizon(&[(0.5, -0.2, 0.05), (0.1, 0.7, 0.05)]);
        assert!(PASSING.obstacle(&far_apart).unwrap().last_rad < FRAC_PI_2);
    }

    #[test]
    fn it_is_slower_the_nearer_the_obstacle_and_the_sharper_the_turn() {
        assert_eq!(velocity_shares(0.0, 1.0), (1.0, 0.0));
        let (v, w) = velocity_shares(-FRAC_PI_2 / 2.0, 0.5);
        assert!((v - 0.25).abs() < 1e-12 && (w + 0.5).abs() < 1e-12);
        assert_eq!(velocity_shares(FRAC_PI_2, 1.0), (0.0, 1.0));
    }

    proptest! {
        #[test]
        fn the_direction_never_points_to_the_obstacle_s_side(
            x in 0.1..0.9f64, y in -0.5..0.5f64, radius in 0.01..0.09f64,
        ) {
            let horizon = horizon(&[(x, y, radius)]);
            if let Some(obstacle) = PASSING.obstacle(&horizon) {
                for side in [Side::Left, Side::Right] {
                    let phi = PASSING.direction_rad(&obstacle, side);
                    let bounds = if side == Side::Left { 0.0..=FRAC_PI_2 } else { -FRAC_PI_2..=0.0 };
                    prop_assert!(bounds.contains(&phi));
                }
                let (v, _) = velocity_shares(0.3, obstacle.nearest_m / PASSING.safe_m);
                prop_assert!((0.0..=1.0).contains(&v));
            }
        }
    }
}
