//! The law that brings a body to a pose (Aicardi, Casalino, Bicchi, Balestrino, IEEE RAM 2(1), 1995; S2, Goto).
//!
//! e is the distance to the target, α the line of sight less the body's heading, θ the line of sight less the final
//! heading: ė = −v cos α, α̇ = −ω + v sin α/e, θ̇ = v sin α/e. With
//!
//! ```text
//! v = γ·min(e, L)·c(α)        ω = k·α + (v/e)·(sin α/α)·(α + h·θ)
//! ```
//!
//! V = ½λe² + ½(α² + hθ²) never rises, V̇ = −λ·e·v·cos α − k·α², as long as v·cos α ≥ 0. Within the distance L (where
//! min(e, L) = e) and with c = cos α this is the published law; beyond it, the law for a target at the distance L on the
//! line of sight. A body that must not reverse takes c = max(cos α, 0). Without a final heading h·θ = 0. Near the target
//! the path is straight (its curvature ω/v vanishes) only if h > 1 and 2γ < k < γ(h + 1). e = 0 is singular: who uses
//! the law stops inside a tolerance. Both velocities are cut by one common factor, so that the path stays.

use runtime::math;
use schemars::JsonSchema;
use serde::Deserialize;

/// Gains of the law: S2's k₃, k₄ and k₂.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Gains {
    /// γ (S2's k₃): speed per distance [1/s].
    pub gamma_per_s: f64,
    /// k (S2's k₄): turn rate per heading error; more than 2γ and less than γ(h + 1) [1/s].
    pub k_per_s: f64,
    /// h (S2's k₂): weight of the final heading; more than 1.
    pub h: f64,
    /// L: a target farther away counts as this far [m].
    pub far_m: f64,
}

impl Default for Gains {
    fn default() -> Gains {
        Gains { gamma_per_s: 1.0, k_per_s: 3.0, h: 2.5, far_m: 1.0 }
    }
}

impl Gains {
    /// Says which gain is wrong, and why.
    pub fn check(&self) -> Result<(), String> {
        let Gains { gamma_per_s: gamma, k_per_s: k, h, far_m } = *self;
        for (key, value) in [("gamma_per_s", gamma), ("k_per_s", k), ("h", h), ("far_m", far_m)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(format!("gains.{key} = {value} must be a number above 0"));
            }
        }
        if h <= 1.0 {
            return Err(format!("gains.h = {h} must be above 1, or the path ends in a bend"));
        }
        if !(2.0 * gamma < k && k < gamma * (h + 1.0)) {
            let (least, most) = (2.0 * gamma, gamma * (h + 1.0));
            return Err(format!(
                "gains.k_per_s = {k} must be above 2·gamma_per_s = {least} and below gamma_per_s·(h + 1) = {most}, or the path ends in a bend"
            ));
        }
        Ok(())
    }
}

/// Where the target is, seen from the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// e: distance [m].
    pub distance_m: f64,
    /// α: line of sight less heading, in (−π, π] [rad].
    pub alpha_rad: f64,
    /// θ: line of sight less final heading, in (−π, π]; `None` where any heading will do [rad].
    pub theta_rad: Option<f64>,
}

/// Forward speed and turn rate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pace {
    /// Forward [m/s].
    pub forward_m_s: f64,
    /// Counter-clockwise [rad/s].
    pub turn_rad_s: f64,
}

impl Pace {
    /// The same path, no faster than the limits.
    pub fn within(self, max_speed_m_s: f64, max_turn_rad_s: f64) -> Pace {
        let over = (self.forward_m_s.abs() / max_speed_m_s).max(self.turn_rad_s.abs() / max_turn_rad_s);
        let share = if over > 1.0 { 1.0 / over } else { 1.0 };
        Pace { forward_m_s: self.forward_m_s * share, turn_rad_s: self.turn_rad_s * share }
    }
}

/// The law; `reverses` says whether the body may drive backwards to a target behind it.
pub fn approach(target: &Target, gains: &Gains, reverses: bool) -> Pace {
    let Target { distance_m: e, alpha_rad: alpha, theta_rad } = *target;
    let (sin, cos) = math::sin_cos(alpha);
    let share = if reverses { cos } else { cos.max(0.0) };
    let forward_m_s = gains.gamma_per_s * e.min(gains.far_m) * share;
    // v/e, which is finite at e = 0.
    let rate = gains.gamma_per_s * (gains.far_m / e).min(1.0) * share;
    let sinc = if alpha.abs() < 1e-6 { 1.0 } else { sin / alpha };
    let bend = alpha + theta_rad.map_or(0.0, |theta| gains.h * theta);
    Pace { forward_m_s, turn_rad_s: gains.k_per_s * alpha + rate * sinc * bend }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::place::Place;
    use proptest::prelude::*;
    use std::f64::consts::{PI, TAU};

    /// The target (0, 0, 0) seen from `place`.
    fn origin_from(place: &Place) -> Target {
        let sight = math::atan2(-place.y_m, -place.x_m);
        Target {
            distance_m: math::hypot(place.x_m, place.y_m),
            alpha_rad: math::wrap_angle(sight - place.heading_rad),
            theta_rad: Some(math::wrap_angle(sight)),
        }
    }

    fn lyapunov(target: &Target, gains: &Gains) -> f64 {
        let theta = target.theta_rad.unwrap_or(0.0);
        0.5 * (target.distance_m * target.distance_m + target.alpha_rad * target.alpha_rad + gains.h * theta * theta)
    }

    /// Euler steps of `dt` for `seconds`; answers the end and in how many steps V rose by more than Euler's error.
    fn drive(mut place: Place, reverses: bool, seconds: f64, dt: f64) -> (Place, usize) {
        let gains = Gains::default();
        let mut rises = 0;
        let mut before = lyapunov(&origin_from(&place), &gains);
        for _ in 0..(seconds / dt) as usize {
            let target = origin_from(&place);
            // As the node does: nothing is asked of the law inside a tolerance.
            if target.distance_m < 1e-4 {
                break;
            }
            let pace = approach(&target, &gains, reverses);
            let (sin, cos) = math::sin_cos(place.heading_rad);
            place.x_m += pace.forward_m_s * cos * dt;
            place.y_m += pace.forward_m_s * sin * dt;
            place.heading_rad = math::wrap_angle(place.heading_rad + pace.turn_rad_s * dt);
            let v = lyapunov(&origin_from(&place), &gains);
            // Where an angle passes ±π, V jumps by nature.
            rises += usize::from(v > before + 1e-5 && v - before < 0.5);
            before = v;
        }
        (place, rises)
    }

    #[test]
    fn every_start_within_two_metres_ends_at_the_target_with_its_heading() {
        // The yardstick's grid, thinned: 7 × 7 positions, 8 headings; both kinds of bodies.
        for reverses in [true, false] {
            for (column, row, turn) in (0..7 * 7 * 8).map(|n| (n % 7, n / 7 % 7, n / 49)) {
                let at = |k: i32| -2.0 + 4.0 * (f64::from(k) + 0.5) / 7.3;
                let heading_rad = math::wrap_angle(TAU * f64::from(turn) / 8.0 + 0.1);
                let start = Place { x_m: at(column), y_m: at(row), heading_rad };
                let (end, rises) = drive(start, reverses, 20.0, 0.002);
                let away_m = math::hypot(end.x_m, end.y_m);
                assert!(away_m < 1e-3 && end.heading_rad.abs() < 1e-2, "{reverses} {start:?} → {end:?}");
                assert_eq!(rises, 0, "V rose on the way from {start:?}");
            }
        }
    }

    #[test]
    fn a_body_that_does_not_reverse_turns_first_to_what_is_behind_it() {
        let behind = Target { distance_m: 1.0, alpha_rad: 3.0, theta_rad: None };
        let pace = approach(&behind, &Gains::default(), false);
        assert_eq!((pace.forward_m_s, pace.turn_rad_s), (0.0, 9.0));
        assert!(approach(&behind, &Gains::default(), true).forward_m_s < 0.0);
    }

    #[test]
    fn nothing_is_singular_about_a_target_straight_ahead_or_underfoot() {
        let ahead = Target { distance_m: 0.5, alpha_rad: 0.0, theta_rad: Some(0.0) };
        assert_eq!(approach(&ahead, &Gains::default(), false), Pace { forward_m_s: 0.5, turn_rad_s: 0.0 });
        let here = Target { distance_m: 0.0, alpha_rad: 0.4, theta_rad: Some(0.2) };
        let pace = approach(&here, &Gains::default(), false);
        assert!(pace.forward_m_s == 0.0 && pace.turn_rad_s.is_finite());
    }

    #[test]
    fn gains_that_end_in_a_bend_are_refused_with_their_bounds() {
        assert_eq!(Gains::default().check(), Ok(()));
        let bent = Gains { k_per_s: 4.0, ..Gains::default() };
        let reason = bent.check().unwrap_err();
        assert!(reason.contains("above 2·gamma_per_s = 2") && reason.contains("= 3.5"), "{reason}");
        assert!(Gains { h: 1.0, ..Gains::default() }.check().unwrap_err().contains("gains.h = 1"));
        assert!(Gains { gamma_per_s: f64::NAN, ..Gains::default() }.check().unwrap_err().contains("gamma_per_s"));
    }

    proptest! {
        #[test]
        fn saturation_keeps_the_path(v in -3.0..3.0f64, w in -9.0..9.0f64, top in 0.1..1.0f64, turn in 0.1..2.0f64) {
            let cut = Pace { forward_m_s: v, turn_rad_s: w }.within(top, turn);
            prop_assert!(cut.forward_m_s.abs() <= top + 1e-12 && cut.turn_rad_s.abs() <= turn + 1e-12);
            prop_assert!((cut.forward_m_s * w - cut.turn_rad_s * v).abs() < 1e-9, "another curvature");
            let is_free = v.abs() <= top && w.abs() <= turn;
            prop_assert!(!is_free || (cut.forward_m_s, cut.turn_rad_s) == (v, w));
        }

        #[test]
        fn the_law_never_drives_away_from_what_is_ahead(e in 0.0..20.0f64, alpha in -PI..PI, theta in -PI..PI) {
            let target = Target { distance_m: e, alpha_rad: alpha, theta_rad: Some(theta) };
            for reverses in [true, false] {
                let pace = approach(&target, &Gains::default(), reverses);
                prop_assert!(pace.forward_m_s * math::cos(alpha) >= 0.0);
                prop_assert!(pace.forward_m_s.is_finite() && pace.turn_rad_s.is_finite());
            }
        }
    }
}
