//! Leaving a local minimum: around the obstacle on one side, as near to the goal's direction as there is room.
//!
//! Starting from the goal's direction (or from the edge of what is seen, when the goal lies behind) the first direction
//! towards the chosen side is taken along which the body has room. So it keeps beside the obstacle until the goal's own
//! direction is free again, and turns with it where it bends away. Where nothing is free it turns to that side.

use super::horizon::Horizon;
use messages::Side;
use std::f64::consts::FRAC_PI_2;

/// From one direction that is tried to the next [rad].
const STEP_RAD: f64 = 0.04;

/// A direction, and how far it is free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// 0 straight ahead, counter-clockwise [rad].
    pub direction_rad: f64,
    /// Free distance along it [m].
    pub free_m: f64,
}

/// The way around on `side`, towards the goal at `bearing_rad`. A direction is free when the body, `half_width_m` to
/// either side, can go `free_m` along it.
pub fn around(horizon: &Horizon, side: Side, bearing_rad: f64, half_width_m: f64, free_m: f64) -> Way {
    let towards = if side == Side::Right { -1.0 } else { 1.0 };
    // A goal behind the body on the detour's own side is reached by going on around, not by turning on.
    let from = match bearing_rad {
        bearing if bearing.abs() <= FRAC_PI_2 => bearing,
        _ => -towards * FRAC_PI_2,
    };
    let steps = ((towards * FRAC_PI_2 - from).abs() / STEP_RAD).floor() as i32;
    for step in 0..=steps {
        let direction_rad = from + towards * STEP_RAD * f64::from(step);
        let free = horizon.free_m(direction_rad, half_width_m, 2.0 * free_m);
        if free >= free_m {
            return Way { direction_rad, free_m: free };
        }
    }
    Way { direction_rad: towards * FRAC_PI_2, free_m: 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(from_y: f64, to_y: f64, x: f64) -> Horizon {
        let mut horizon = Horizon::default();
        let mut y = from_y;
        while y <= to_y {
            horizon.add_disc(x, y, 0.02);
            y += 0.03;
        }
        horizon
    }

    #[test]
    fn a_free_goal_is_driven_to_straight() {
        let way = around(&Horizon::default(), Side::Left, 0.3, 0.35, 0.8);
        assert!((way.direction_rad - 0.3).abs() < 1e-12 && way.free_m >= 0.8);
    }

    #[test]
    fn a_wall_ahead_is_passed_on_the_side_that_was_chosen() {
        let horizon = wall(-0.6, 0.6, 0.6);
        let left = around(&horizon, Side::Left, 0.0, 0.35, 0.8);
        let right = around(&horizon, Side::Right, 0.0, 0.35, 0.8);
        assert!(left.direction_rad > 0.7 && left.free_m >= 0.8, "{left:?}");
        assert!((left.direction_rad + right.direction_rad).abs() < 0.05, "{right:?}");
    }

    #[test]
    fn beside_a_wall_it_goes_along_it() {
        // The wall is on the right, 0.4 m away; the goal lies behind it.
        let mut horizon = Horizon::default();
        (0..60).for_each(|k| horizon.add_disc(0.05 * f64::from(k), -0.4, 0.02));
        let way = around(&horizon, Side::Left, -1.2, 0.35, 0.8);
        assert!(way.direction_rad.abs() < 0.15, "{way:?}");
    }

    #[test]
    fn in_a_dead_end_it_turns_to_its_side_on_the_spot() {
        let mut horizon = Horizon::default();
        (0..180).for_each(|k| {
            let (sin, cos) = runtime::math::sin_cos(f64::from(k) * 0.0175 - FRAC_PI_2);
            horizon.add_disc(0.5 * cos, 0.5 * sin, 0.02);
        });
        assert_eq!(around(&horizon, Side::Right, 0.0, 0.35, 0.8), Way { direction_rad: -FRAC_PI_2, free_m: 0.0 });
    }

    #[test]
    fn a_goal_behind_is_sought_along_the_obstacle() {
        let way = around(&Horizon::default(), Side::Left, 2.5, 0.35, 0.8);
        assert!((way.direction_rad + FRAC_PI_2).abs() < 1e-12, "the obstacle is on the right: it bends away there");
    }
}
