//! The guard zone for what moves: a velocity is allowed only if its time to collision is longer than it takes to stop.
//!
//! Seen from the body, a track at p with velocity u over the ground comes along p + (u − v)·t (turning on the spot
//! changes no distance); the time to collision is when its circle first touches the circle around the body. Of v and ω scaled by 1, 3/4, 1/2, 1/4 and 0 the fastest is
//! taken whose time to collision is at least τ + |v|/a + margin. Standing is always allowed: more cannot be done here.

use crate::footprint::{Point, Velocity};
use messages::Track;
use schemars::JsonSchema;
use serde::Deserialize;

/// How much time moving things are given.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GuardZoneConfig {
    /// Time that is left when the body has come to rest [s].
    pub margin_s: f64,
    /// Moving things are taken to be at least this big (radius) [m].
    pub least_radius_m: f64,
    /// Added to the circle around the body [m].
    pub margin_m: f64,
}

impl Default for GuardZoneConfig {
    fn default() -> GuardZoneConfig {
        GuardZoneConfig { margin_s: 0.5, least_radius_m: 0.2, margin_m: 0.05 }
    }
}

impl GuardZoneConfig {
    /// Says which figure is wrong.
    pub fn check(&self) -> Result<(), String> {
        for (key, value) in
            [("margin_s", self.margin_s), ("least_radius_m", self.least_radius_m), ("margin_m", self.margin_m)]
        {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(format!("guard_zone.{key} = {value} must be a number, zero or greater"));
            }
        }
        Ok(())
    }
}

/// A thing that moves, in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mover {
    /// Centre [m].
    pub at: Point,
    /// Velocity over the ground [m/s].
    pub velocity: Point,
    /// Radius [m].
    pub radius_m: f64,
}

/// What the body is and needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GuardZone {
    /// Settings.
    pub config: GuardZoneConfig,
    /// Radius of the circle around the body [m].
    pub radius_m: f64,
    /// From an obstacle's appearance to the wheels' first slowing [s].
    pub delay_s: f64,
    /// Of the forward speed [m/s²].
    pub deceleration_m_s2: f64,
}

/// Most things that are watched at once.
pub const MOVERS: usize = 64;

/// Takes the things that move out of a sample of age `age_s`, carried on to now; `own` is the body's velocity.
pub fn take_movers(movers: &mut Vec<Mover>, tracks: &[Track], age_s: f64, own: Velocity) {
    movers.clear();
    for track in tracks.iter().filter(|track| track.moves()) {
        if movers.len() == movers.capacity() {
            return;
        }
        let (x, y) = track.predicted(age_s);
        let at = Point { x_m: x - (own.forward_m_s - own.turn_rad_s * y) * age_s, y_m: y - own.turn_rad_s * x * age_s };
        let velocity = Point { x_m: track.velocity_x_m_s, y_m: track.velocity_y_m_s };
        let numbers = [at.x_m, at.y_m, velocity.x_m, velocity.y_m, track.radius_m];
        if numbers.iter().all(|n| n.is_finite()) {
            movers.push(Mover { at, velocity, radius_m: track.radius_m });
        }
    }
}

impl GuardZone {
    /// The fastest share of `velocity` that leaves time to stop for every mover.
    pub fn allow(&self, movers: &[Mover], velocity: Velocity) -> Velocity {
        for quarters in (1..=4).rev() {
            let slower = velocity.scaled(0.25 * f64::from(quarters));
            let needed_s = self.delay_s + slower.forward_m_s.abs() / self.deceleration_m_s2 + self.config.margin_s;
            if movers.iter().all(|mover| self.collision_s(mover, slower) >= needed_s) {
                return slower;
            }
        }
        Velocity::ZERO
    }

    /// Time until the mover touches the circle around the body; +∞ when it never does, or comes no nearer [s].
    pub fn collision_s(&self, mover: &Mover, own: Velocity) -> f64 {
        let p = mover.at;
        let u = Point { x_m: mover.velocity.x_m - own.forward_m_s, y_m: mover.velocity.y_m };
        let touch_m = self.radius_m + self.config.margin_m + mover.radius_m.max(self.config.least_radius_m);
        let (pp, pu, uu) = (dot(p, p), dot(p, u), dot(u, u));
        let gap = pp - touch_m * touch_m;
        // Comes no nearer; one that overlaps already and goes away may.
        if pu >= 0.0 {
            return f64::INFINITY;
        }
        if gap <= 0.0 {
            return 0.0;
        }
        let discriminant = pu * pu - uu * gap;
        if discriminant < 0.0 { f64::INFINITY } else { gap / (-pu + discriminant.sqrt()) }
    }
}

fn dot(a: Point, b: Point) -> f64 {
    a.x_m * b.x_m + a.y_m * b.y_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{TrackMotion, TrackState};
    use proptest::prelude::*;

    const ZONE: GuardZone = GuardZone {
        config: GuardZoneConfig { margin_s: 0.5, least_radius_m: 0.2, margin_m: 0.05 },
        radius_m: 0.25,
        delay_s: 0.3,
        deceleration_m_s2: 0.5,
    };

    fn mover(x_m: f64, y_m: f64, velocity_x_m_s: f64, velocity_y_m_s: f64) -> Mover {
        let velocity = Point { x_m: velocity_x_m_s, y_m: velocity_y_m_s };
        Mover { at: Point { x_m, y_m }, velocity, radius_m: 0.1 }
    }

    #[test]
    fn the_time_to_collision_is_the_gap_over_the_speed_of_approach() {
        // 2.5 m less 0.5 m of radii, at 0.5 + 0.5 m/s.
        let s = ZONE.collision_s(&mover(2.5, 0.0, -0.5, 0.0), Velocity::new(0.5, 0.0));
        assert!((s - 2.0).abs() < 1e-9, "{s}");
        assert_eq!(ZONE.collision_s(&mover(2.5, 0.0, 0.6, 0.0), Velocity::new(0.5, 0.0)), f64::INFINITY);
        assert_eq!(ZONE.collision_s(&mover(2.5, 2.0, 0.0, 0.5), Velocity::new(0.5, 0.0)), f64::INFINITY);
    }

    #[test]
    fn somebody_who_comes_head_on_makes_it_slower_and_then_stop() {
        let fast = Velocity::new(0.5, 0.2);
        let at = |x_m: f64| ZONE.allow(&[mover(x_m, 0.0, -0.8, 0.0)], fast).forward_m_s;
        assert_eq!(at(6.0), 0.5);
        assert!(at(2.0) < 0.5 && at(2.0) > 0.0, "{}", at(2.0));
        assert_eq!(at(0.9), 0.0);
        let cut = ZONE.allow(&[mover(2.0, 0.0, -0.8, 0.0)], fast);
        assert!((cut.turn_rad_s / cut.forward_m_s - 0.4).abs() < 1e-12, "the path stays");
    }

    #[test]
    fn somebody_who_walks_away_or_past_is_no_reason_to_slow() {
        let fast = Velocity::new(0.5, 0.0);
        assert_eq!(ZONE.allow(&[mover(1.0, 0.0, 0.8, 0.0)], fast), fast);
        assert_eq!(ZONE.allow(&[mover(1.5, 1.0, 0.8, 0.0)], fast), fast);
        assert_eq!(ZONE.allow(&[], fast), fast);
    }

    #[test]
    fn only_what_moves_is_taken_and_carried_to_now() {
        let moving = Track {
            state: TrackState::Confirmed as u32,
            motion: TrackMotion::Moving as u32,
            x_m: 2.0,
            velocity_x_m_s: -1.0,
            ..Track::default()
        };
        let still = Track { motion: TrackMotion::Still as u32, ..moving };
        let wrong = Track { x_m: f64::NAN, ..moving };
        let mut movers = Vec::with_capacity(MOVERS);
        take_movers(&mut movers, &[moving, still, wrong], 0.1, Velocity::new(0.5, 0.0));
        assert_eq!(movers.len(), 1);
        assert!((movers[0].at.x_m - 1.85).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn another_mover_never_makes_it_faster(
            movers in prop::collection::vec((-3.0..3.0f64, -3.0..3.0f64, -1.0..1.0f64, -1.0..1.0f64), 1..6),
            v in -0.5..0.5f64, w in -0.8..0.8f64,
        ) {
            let movers: Vec<Mover> = movers.into_iter().map(|(x, y, vx, vy)| mover(x, y, vx, vy)).collect();
            let fewer = ZONE.allow(&movers[1..], Velocity::new(v, w));
            let more = ZONE.allow(&movers, Velocity::new(v, w));
            prop_assert!(more.forward_m_s.abs() <= fewer.forward_m_s.abs());
            prop_assert!(more.forward_m_s.is_finite() && more.turn_rad_s.is_finite());
        }
    }
}
