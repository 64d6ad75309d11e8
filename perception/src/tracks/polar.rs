//! Constant velocity in distance and in bearing, each alone (S2).
//!
//! x = (q, q̇), q = ρ or θ: F = [1 T; 0 1], Q = σ_a²·[T⁴/4 T³/2; T³/2 T²], H = [1 0], S = P₁₁ + R, K = (P₁₁, P₂₁)/S. σ_a is
//! an acceleration for ρ and that over ρ for θ. The polar frame turns and shifts with the body, so before each use the
//! state is carried over into the frame of the new place: the velocity (ρ̇, ρ·θ̇) is one over the ground, turned by the
//! angle δ between the old and the new line of sight; of the covariance, turned likewise, the two filters keep their
//! own blocks and forget what mixes them. A straight walker is not constant-velocity in this form (r̈ up to v²/d): that
//! is what the Cartesian filter beside it is for.

use super::measurement::{Estimate, LEAST_RHO_M, Measurement};
use crate::place::Place;
use runtime::math;

/// One coordinate and its rate, with their covariance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ConstantVelocity {
    /// The coordinate.
    pub value: f64,
    /// Its rate.
    pub rate: f64,
    /// P₁₁, P₁₂, P₂₂.
    pub covariance: [f64; 3],
}

impl ConstantVelocity {
    /// At rest as far as is known: the first difference then gives the rate (P₂₂ = 2R/T² in the limit).
    pub fn start(value: f64, variance: f64, rate_variance: f64) -> ConstantVelocity {
        ConstantVelocity { value, rate: 0.0, covariance: [variance, 0.0, rate_variance] }
    }

    /// `dt_s` later, with random accelerations of `sigma`.
    pub fn predict(&mut self, dt_s: f64, sigma: f64) {
        let [a, b, c] = self.covariance;
        let q = sigma * sigma * dt_s * dt_s;
        self.value += dt_s * self.rate;
        self.covariance =
            [a + dt_s * (2.0 * b + dt_s * c) + 0.25 * q * dt_s * dt_s, b + dt_s * c + 0.5 * q * dt_s, c + q];
    }

    /// Takes in a measurement by its innovation and variance; returns ν²/S.
    pub fn update(&mut self, innovation: f64, variance: f64) -> f64 {
        let [a, b, c] = self.covariance;
        let s = a + variance;
        let (k1, k2) = (a / s, b / s);
        self.value += k1 * innovation;
        self.rate += k2 * innovation;
        self.covariance = [(1.0 - k1) * a, (1.0 - k1) * b, c - k2 * b];
        innovation * innovation / s
    }
}

/// The pair of filters, in the body frame of `place`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Polar {
    rho: ConstantVelocity,
    theta: ConstantVelocity,
    place: Place,
}

impl Polar {
    /// A thing seen for the first time, of which only the greatest likely speed is known.
    pub fn start(seen: &Measurement, place: &Place, speed_sigma_m_s: f64) -> Polar {
        let variance = speed_sigma_m_s * speed_sigma_m_s;
        Polar {
            rho: ConstantVelocity::start(seen.rho_m, seen.rho_variance, variance),
            theta: ConstantVelocity::start(seen.theta_rad, seen.theta_variance, variance / (seen.rho_m * seen.rho_m)),
            place: *place,
        }
    }

    /// `dt_s` later, when the body stands at `place`.
    pub fn predict(&mut self, dt_s: f64, place: &Place, acceleration_m_s2: f64) {
        self.rho.predict(dt_s, acceleration_m_s2);
        // Through the body's origin and out on the other side.
        if self.rho.value < LEAST_RHO_M {
            self.rho.value = LEAST_RHO_M;
            self.rho.rate = self.rho.rate.max(0.0);
        }
        self.theta.predict(dt_s, acceleration_m_s2 / self.rho.value.max(0.3));
        self.carry_to(place);
    }

    /// The squared distance of a measurement, in standard deviations (χ², 2 degrees of freedom).
    pub fn distance(&self, seen: &Measurement) -> f64 {
        let (rho, theta) = self.innovation(seen);
        rho * rho / (self.rho.covariance[0] + seen.rho_variance)
            + theta * theta / (self.theta.covariance[0] + seen.theta_variance)
    }

    /// Takes in a measurement from the place of the last prediction.
    pub fn update(&mut self, seen: &Measurement) {
        let (rho, theta) = self.innovation(seen);
        self.rho.update(rho, seen.rho_variance);
        self.rho.value = self.rho.value.max(LEAST_RHO_M);
        self.theta.update(theta, seen.theta_variance);
        self.theta.value = math::wrap_angle(self.theta.value);
    }

    fn innovation(&self, seen: &Measurement) -> (f64, f64) {
        (seen.rho_m - self.rho.value, math::wrap_angle(seen.theta_rad - self.theta.value))
    }

    fn carry_to(&mut self, place: &Place) {
        if *place == self.place {
            return;
        }
        let rho = self.rho.value;
        let (sin, cos) = math::sin_cos(self.theta.value);
        let (x, y) = self.place.out(rho * cos, rho * sin);
        let (old_x, old_y) = self.place.turned_out(cos, sin);
        let (x, y) = place.inward(x, y);
        let new_rho = math::hypot(x, y).max(LEAST_RHO_M);
        let (new_x, new_y) = place.turned_out(x / new_rho, y / new_rho);
        let (c, s) = (old_x * new_x + old_y * new_y, old_x * new_y - old_y * new_x);
        let (along, across) = (self.rho.rate, rho * self.theta.rate);
        let (r2, n2) = (rho * rho, new_rho * new_rho);
        for k in 0..3 {
            let (radial, tangential) = (self.rho.covariance[k], r2 * self.theta.covariance[k]);
            self.rho.covariance[k] = c * c * radial + s * s * tangential;
            self.theta.covariance[k] = (s * s * radial + c * c * tangential) / n2;
        }
        self.rho.value = new_rho;
        self.rho.rate = c * along + s * across;
        self.theta.value = math::atan2(y, x);
        self.theta.rate = (c * across - s * along) / new_rho;
        self.place = *place;
    }

    /// What is known, in the odometry frame.
    pub fn estimate(&self) -> Estimate {
        let rho = self.rho.value;
        let (sin, cos) = math::sin_cos(self.theta.value);
        let (x_m, y_m) = self.place.out(rho * cos, rho * sin);
        let (u_x, u_y) = self.place.turned_out(cos, sin);
        let (along, across) = (self.rho.rate, rho * self.theta.rate);
        let r2 = rho * rho;
        // Radial and tangential blocks, turned: u·uᵀ and t·tᵀ with t = (−u_y, u_x).
        let turned = |k: usize| {
            let (radial, tangential) = (self.rho.covariance[k], r2 * self.theta.covariance[k]);
            [
                u_x * u_x * radial + u_y * u_y * tangential,
                u_x * u_y * (radial - tangential),
                u_y * u_y * radial + u_x * u_x * tangential,
            ]
        };
        let ([pxx, pxy, pyy], [mxx, mxy, myy], [vxx, vxy, vyy]) = (turned(0), turned(1), turned(2));
        Estimate {
            x_m,
            y_m,
            velocity_x_m_s: along * u_x - across * u_y,
            velocity_y_m_s: along * u_y + across * u_x,
            covariance: [pxx, pxy, mxx, mxy, pyy, mxy, myy, vxx, vxy, vyy],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::circles::Circle;
    use proptest::prelude::*;

    fn at(x_m: f64, y_m: f64, place: &Place) -> Measurement {
        let (x_m, y_m) = place.inward(x_m, y_m);
        let covariance = [[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-4]];
        Measurement::new(&Circle { x_m, y_m, radius_m: 0.1, covariance }, place, 0.0)
    }

    #[test]
    fn the_first_difference_gives_the_rate() {
        let (variance, dt) = (0.01, 0.1);
        let mut filter = ConstantVelocity::start(1.0, variance, 1e6);
        filter.predict(dt, 0.0);
        filter.update(0.2, variance);
        assert!((filter.rate - 2.0).abs() < 1e-3, "{filter:?}");
        assert!((filter.covariance[2] / (2.0 * variance / (dt * dt)) - 1.0).abs() < 1e-3, "{filter:?}");
    }

    #[test]
    fn a_thing_that_stands_keeps_standing_while_the_body_drives_and_turns_past_it() {
        let mut place = Place::new(0.0, 0.0, 0.0);
        let mut filter = Polar::start(&at(3.0, 1.0, &place), &place, 1.0);
        for k in 1..200 {
            place = Place::new(0.02 * f64::from(k), 0.0, 0.01 * f64::from(k));
            filter.predict(0.02, &place, 0.5);
            filter.update(&at(3.0, 1.0, &place));
        }
        let known = filter.estimate();
        assert!(math::hypot(known.velocity_x_m_s, known.velocity_y_m_s) < 0.02, "{known:?}");
        assert!(math::hypot(known.x_m - 3.0, known.y_m - 1.0) < 0.01, "{known:?}");
    }

    proptest! {
        #[test]
        fn carrying_to_another_place_moves_nothing_over_the_ground(
            x in -5.0..5.0f64, y in -5.0..5.0f64, vx in -2.0..2.0f64, vy in -2.0..2.0f64,
            px in -3.0..3.0f64, py in -3.0..3.0f64, heading in -3.1..3.1f64,
        ) {
            let first = Place::new(0.0, 0.0, 0.0);
            let second = Place::new(px, py, heading);
            prop_assume!(math::hypot(x, y) > 0.3 && math::hypot(x - px, y - py) > 0.3);
            let mut filter = Polar::start(&at(x, y, &first), &first, 1.0);
            let rho = math::hypot(x, y);
            filter.rho.rate = (vx * x + vy * y) / rho;
            filter.theta.rate = (vy * x - vx * y) / (rho * rho);
            let before = filter.estimate();
            filter.predict(0.0, &second, 0.0);
            let after = filter.estimate();
            prop_assert!((before.velocity_x_m_s - vx).abs() < 1e-9 && (before.velocity_y_m_s - vy).abs() < 1e-9);
            prop_assert!((after.x_m - x).abs() < 1e-9 && (after.y_m - y).abs() < 1e-9, "{after:?}");
            prop_assert!((after.velocity_x_m_s - vx).abs() < 1e-9 && (after.velocity_y_m_s - vy).abs() < 1e-9, "{after:?}");
        }
    }
}
