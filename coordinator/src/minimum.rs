//! Finds local minima, and leaves them on the side with more room (S2, Goto + Avoid).
//!
//! A goal that is under way and has come no nearer for a while is in a local minimum: the action that pursues it and the
//! one that avoids hold each other. Then a *detour* begins, on the roomier side: the avoiding action goes around the
//! obstacle on that side. It ends when the goal is nearer than where progress ended and the way towards it is free; so
//! every detour ends nearer than the one before began, and a goal that can be reached is reached. A detour that takes too
//! long is tried on the other side, and so is one that led back to where it began.

use messages::{Detour, GotoProgress, GotoState, Room, Side};
use runtime::Time;
use schemars::JsonSchema;
use serde::Deserialize;

/// When a local minimum begins and a detour ends.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MinimumConfig {
    /// No progress for this long is a local minimum [s].
    pub after_s: f64,
    /// Nearer by this much is progress [m].
    pub progress_m: f64,
    /// A detour ends when the way towards the goal is free for this far, or up to the goal [m].
    pub free_m: f64,
    /// A detour that lasts longer is tried on the other side [s].
    pub other_side_after_s: f64,
}

impl Default for MinimumConfig {
    fn default() -> MinimumConfig {
        MinimumConfig { after_s: 5.0, progress_m: 0.1, free_m: 1.2, other_side_after_s: 60.0 }
    }
}

impl MinimumConfig {
    /// Says which setting is wrong.
    pub fn check(&self) -> Result<(), String> {
        for (key, value) in [
            ("after_s", self.after_s),
            ("progress_m", self.progress_m),
            ("free_m", self.free_m),
            ("other_side_after_s", self.other_side_after_s),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(format!("minimum.{key} = {value} must be a number above 0"));
            }
        }
        Ok(())
    }
}

/// What is known of the goal under way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Minimum {
    order: Option<u32>,
    least_m: f64,
    nearer_at: Time,
    detour: Option<Under>,
    before: Option<Under>,
    minima: u32,
}

/// A detour.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Under {
    side: Side,
    from_m: f64,
    begun: Time,
}

impl Minimum {
    /// Takes in how the goal stands and how much room there is; `waits` while something is waited for. The detour to take.
    pub fn update(
        &mut self,
        now: Time,
        goal: Option<&GotoProgress>,
        room: Option<&Room>,
        waits: bool,
        config: &MinimumConfig,
    ) -> Detour {
        let Some(goal) = goal.filter(|goal| goal.state == GotoState::Driving as u32 && goal.distance_m.is_finite())
        else {
            *self = Minimum { minima: self.minima, ..Minimum::default() };
            return Detour { minima: self.minima, ..Detour::default() };
        };
        if self.order != Some(goal.orders) {
            let (order, least_m) = (Some(goal.orders), goal.distance_m);
            *self = Minimum { order, least_m, nearer_at: now, minima: self.minima, ..Minimum::default() };
        }
        if waits || goal.distance_m < self.least_m - config.progress_m {
            self.least_m = self.least_m.min(goal.distance_m);
            self.nearer_at = now;
        }
        match self.detour {
            None if now.since(self.nearer_at) >= config.after_s => self.begin(now, goal, room, config),
            None => {}
            Some(detour) if leads_on(&detour, goal, room, config) => {
                (self.before, self.detour) = (Some(detour), None);
                (self.least_m, self.nearer_at) = (goal.distance_m, now);
            }
            Some(detour) if now.since(detour.begun) >= config.other_side_after_s => {
                self.detour = Some(Under { side: other(detour.side), begun: now, ..detour });
            }
            Some(_) => {}
        }
        let side = self.detour.map_or(Side::None, |detour| detour.side);
        Detour {
            bearing_rad: goal.bearing_rad,
            distance_m: goal.distance_m,
            from_distance_m: self.detour.map_or(0.0, |detour| detour.from_m),
            side: side as u32,
            minima: self.minima,
        }
    }

    fn begin(&mut self, now: Time, goal: &GotoProgress, room: Option<&Room>, config: &MinimumConfig) {
        self.minima = self.minima.wrapping_add(1);
        let roomier = match room {
            Some(room) if room.left_m < room.right_m => Side::Right,
            _ => Side::Left,
        };
        // Back where the last one began: it was the wrong side.
        let side = match self.before {
            Some(before) if goal.distance_m > before.from_m - 2.0 * config.progress_m => other(before.side),
            _ => roomier,
        };
        self.detour = Some(Under { side, from_m: self.least_m.min(goal.distance_m), begun: now });
    }
}

fn leads_on(detour: &Under, goal: &GotoProgress, room: Option<&Room>, config: &MinimumConfig) -> bool {
    let nearer = goal.distance_m < detour.from_m - config.progress_m;
    nearer && room.is_some_and(|room| room.towards_m >= config.free_m.min(goal.distance_m))
}

fn other(side: Side) -> Side {
    match side {
        Side::Left => Side::Right,
        Side::Right => Side::Left,
        Side::None => Side::None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: MinimumConfig =
        MinimumConfig { after_s: 5.0, progress_m: 0.1, free_m: 1.2, other_side_after_s: 60.0 };

    fn at(seconds: f64) -> Time {
        Time::from_seconds(seconds)
    }

    fn goal(distance_m: f64) -> GotoProgress {
        GotoProgress { distance_m, state: GotoState::Driving as u32, orders: 1, ..GotoProgress::default() }
    }

    fn room(left_m: f64, right_m: f64, towards_m: f64) -> Room {
        Room { left_m, right_m, towards_m, ..Room::default() }
    }

    fn side(minimum: &mut Minimum, s: f64, distance_m: f64, room: Room) -> u32 {
        minimum.update(at(s), Some(&goal(distance_m)), Some(&room), false, &CONFIG).side
    }

    const NARROW: Room = Room { left_m: 1.0, right_m: 2.0, towards_m: 0.4, ..NO_ROOM };
    const NO_ROOM: Room = Room {
        nearest_m: 0.5,
        nearest_bearing_rad: 0.0,
        left_m: 0.0,
        right_m: 0.0,
        towards_m: 0.0,
        direction_rad: 0.0,
        active: 1,
        side: 0,
    };

    #[test]
    fn progress_is_no_minimum_and_standstill_becomes_one_on_the_roomier_side() {
        let mut minimum = Minimum::default();
        for second in 0..20 {
            let s = f64::from(second);
            assert_eq!(side(&mut minimum, s, 5.0 - 0.2 * s, NARROW), Side::None as u32);
        }
        assert_eq!(side(&mut minimum, 23.0, 1.2, NARROW), Side::None as u32);
        assert_eq!(side(&mut minimum, 24.1, 1.25, NARROW), Side::Right as u32);
        assert_eq!(minimum.minima, 1);
    }

    #[test]
    fn a_detour_ends_when_the_goal_is_nearer_and_the_way_to_it_is_free() {
        let mut minimum = Minimum::default();
        side(&mut minimum, 0.0, 3.0, NARROW);
        assert_eq!(side(&mut minimum, 5.0, 3.0, NARROW), Side::Right as u32);
        assert_eq!(side(&mut minimum, 9.0, 3.5, room(1.0, 1.0, 3.0)), Side::Right as u32, "free, but no nearer");
        assert_eq!(side(&mut minimum, 12.0, 2.5, room(1.0, 1.0, 0.5)), Side::Right as u32, "nearer, but not free");
        assert_eq!(side(&mut minimum, 15.0, 2.5, room(1.0, 1.0, 1.5)), Side::None as u32);
        assert_eq!(side(&mut minimum, 16.0, 0.5, room(1.0, 1.0, 0.6)), Side::None as u32);
    }

    #[test]
    fn what_led_back_to_where_it_began_is_tried_on_the_other_side() {
        let mut minimum = Minimum::default();
        side(&mut minimum, 0.0, 3.0, NARROW);
        assert_eq!(side(&mut minimum, 5.0, 3.0, NARROW), Side::Right as u32);
        assert_eq!(side(&mut minimum, 15.0, 2.85, room(1.0, 1.0, 1.5)), Side::None as u32);
        assert_eq!(side(&mut minimum, 20.1, 2.85, NARROW), Side::Left as u32);
        assert_eq!(side(&mut minimum, 81.0, 2.85, NARROW), Side::Right as u32, "too long on one side");
    }

    #[test]
    fn while_something_is_waited_for_there_is_no_minimum() {
        let mut minimum = Minimum::default();
        for second in 0..30 {
            let detour = minimum.update(at(f64::from(second)), Some(&goal(3.0)), Some(&NARROW), true, &CONFIG);
            assert_eq!(detour.side, Side::None as u32);
        }
    }

    #[test]
    fn another_goal_or_none_ends_the_detour() {
        let mut minimum = Minimum::default();
        side(&mut minimum, 0.0, 3.0, NARROW);
        assert_ne!(side(&mut minimum, 5.0, 3.0, NARROW), 0);
        let next = GotoProgress { orders: 2, ..goal(4.0) };
        assert_eq!(minimum.update(at(5.1), Some(&next), Some(&NARROW), false, &CONFIG).side, 0);
        assert_eq!(minimum.update(at(20.0), None, Some(&NARROW), false, &CONFIG).side, 0);
        let turning = GotoProgress { state: GotoState::Turning as u32, ..next };
        assert_eq!(minimum.update(at(40.0), Some(&turning), Some(&NARROW), false, &CONFIG).side, 0);
    }
}
