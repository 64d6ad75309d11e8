//! Constant velocity in x and y of the odometry frame, one filter of four states.
//!
//! x = (x, y, ẋ, ẏ), F and Q as in [`super::polar`] for each axis with the same σ_a, H = [I 0], R the measured circle's own
//! covariance, correlation included: along the line of sight the centre is known worse than across. The odometry frame
//! stands still, so the body's motion needs no more than taking the measurement out into it.

use super::measurement::{Estimate, Measurement};

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cartesian {
    state: [f64; 4],
    covariance: [[f64; 4]; 4],
}

impl Cartesian {
    /// A thing seen for the first time, of which only the greatest likely speed is known.
    pub fn start(seen: &Measurement, speed_sigma_m_s: f64) -> Cartesian {
        let [xx, xy, yy] = seen.covariance;
        let v = speed_sigma_m_s * speed_sigma_m_s;
        Cartesian {
            state: [seen.x_m, seen.y_m, 0.0, 0.0],
            covariance: [[xx, xy, 0.0, 0.0], [xy, yy, 0.0, 0.0], [0.0, 0.0, v, 0.0], [0.0, 0.0, 0.0, v]],
        }
    }

    /// `dt_s` later.
    pub fn predict(&mut self, dt_s: f64, acceleration_m_s2: f64) {
        let p = &mut self.covariance;
        let q = acceleration_m_s2 * acceleration_m_s2 * dt_s * dt_s;
        // F·P·Fᵀ in place: first rows, then columns.
        let (places, rates) = p.split_at_mut(2);
        for (place, rate) in places.iter_mut().zip(rates) {
            for (of_place, of_rate) in place.iter_mut().zip(rate) {
                *of_place += dt_s * *of_rate;
            }
        }
        for row in p.iter_mut() {
            row[0] += dt_s * row[2];
            row[1] += dt_s * row[3];
        }
        for k in 0..2 {
            p[k][k] += 0.25 * q * dt_s * dt_s;
            p[k][k + 2] += 0.5 * q * dt_s;
            p[k + 2][k] += 0.5 * q * dt_s;
            p[k + 2][k + 2] += q;
        }
        self.state[0] += dt_s * self.state[2];
        self.state[1] += dt_s * self.state[3];
    }

    /// The squared distance of a measurement, in standard deviations (χ², 2 degrees of freedom).
    pub fn distance(&self, seen: &Measurement) -> f64 {
        let (nx, ny) = (seen.x_m - self.state[0], seen.y_m - self.state[1]);
        let [xx, xy, yy] = self.inverse_innovation(seen);
        nx * nx * xx + 2.0 * nx * ny * xy + ny * ny * yy
    }

    /// Takes in a measurement.
    pub fn update(&mut self, seen: &Measurement) {
        let (nx, ny) = (seen.x_m - self.state[0], seen.y_m - self.state[1]);
        let [xx, xy, yy] = self.inverse_innovation(seen);
        let p = self.covariance;
        for r in 0..4 {
            let gain = [p[r][0] * xx + p[r][1] * xy, p[r][0] * xy + p[r][1] * yy];
            self.state[r] += gain[0] * nx + gain[1] * ny;
            for (c, entry) in self.covariance[r].iter_mut().enumerate() {
                *entry -= gain[0] * p[0][c] + gain[1] * p[1][c];
            }
        }
        // Rounding must not pull the two halves apart.
        for r in 0..4 {
            for c in 0..r {
                let mean = 0.5 * (self.covariance[r][c] + self.covariance[c][r]);
                self.covariance[r][c] = mean;
                self.covariance[c][r] = mean;
            }
        }
    }

    /// (H·P·Hᵀ + R)⁻¹: xx, xy, yy.
    fn inverse_innovation(&self, seen: &Measurement) -> [f64; 3] {
        let p = &self.covariance;
        let (xx, xy, yy) = (p[0][0] + seen.covariance[0], p[0][1] + seen.covariance[1], p[1][1] + seen.covariance[2]);
        let n = 1.0 / (xx * yy - xy * xy).max(1e-18);
        [yy * n, -xy * n, xx * n]
    }

    /// What is known.
    pub fn estimate(&self) -> Estimate {
        let [x_m, y_m, velocity_x_m_s, velocity_y_m_s] = self.state;
        let p = &self.covariance;
        Estimate {
            x_m,
            y_m,
            velocity_x_m_s,
            velocity_y_m_s,
            covariance: [p[0][0], p[0][1], p[0][2], p[0][3], p[1][1], p[1][2], p[1][3], p[2][2], p[2][3], p[3][3]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn seen(x_m: f64, y_m: f64, covariance: [f64; 3]) -> Measurement {
        Measurement { x_m, y_m, covariance, ..Measurement::default() }
    }

    #[test]
    fn it_learns_a_constant_velocity_and_how_well_it_knows_it() {
        let mut filter = Cartesian::start(&seen(0.0, 0.0, [1e-4, 0.0, 1e-4]), 1.0);
        for k in 1..=50 {
            filter.predict(0.1, 0.1);
            let t = 0.1 * f64::from(k);
            filter.update(&seen(0.5 * t, -0.8 * t, [1e-4, 0.0, 1e-4]));
        }
        let known = filter.estimate();
        assert!((known.velocity_x_m_s - 0.5).abs() < 0.005 && (known.velocity_y_m_s + 0.8).abs() < 0.005, "{known:?}");
        assert!(known.covariance[7] < 0.01, "{known:?}");
    }

    #[test]
    fn with_noise_on_one_axis_each_it_is_two_filters_of_one_coordinate() {
        use super::super::polar::ConstantVelocity;
        let mut both = Cartesian::start(&seen(1.0, 2.0, [0.01, 0.0, 0.04]), 1.5);
        let mut x = ConstantVelocity::start(1.0, 0.01, 2.25);
        let mut y = ConstantVelocity::start(2.0, 0.04, 2.25);
        for k in 0..30 {
            let z = [1.0 + 0.1 * f64::from(k % 7), 2.0 - 0.05 * f64::from(k % 5)];
            both.predict(0.1, 0.7);
            x.predict(0.1, 0.7);
            y.predict(0.1, 0.7);
            both.update(&seen(z[0], z[1], [0.01, 0.0, 0.04]));
            let (nx, ny) = (z[0] - x.value, z[1] - y.value);
            x.update(nx, 0.01);
            y.update(ny, 0.04);
        }
        let known = both.estimate();
        assert!((known.x_m - x.value).abs() < 1e-9 && (known.velocity_y_m_s - y.rate).abs() < 1e-9);
        assert!((known.covariance[0] - x.covariance[0]).abs() < 1e-9);
        assert!((known.covariance[9] - y.covariance[2]).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn the_covariance_stays_positive(steps in prop::collection::vec((0.001..0.5f64, -1.0..1.0f64, 1e-6..0.1f64, 1e-6..0.1f64), 1..80)) {
            let mut filter = Cartesian::start(&seen(0.0, 0.0, [0.01, 0.0, 0.01]), 1.5);
            for (dt, z, xx, yy) in steps {
                filter.predict(dt, 1.0);
                filter.update(&seen(z, -z, [xx, 0.3 * (xx * yy).sqrt(), yy]));
                let c = filter.estimate().covariance;
                prop_assert!(c[0] > 0.0 && c[4] > 0.0 && c[7] > 0.0 && c[9] > 0.0, "{c:?}");
                prop_assert!(c[7] * c[9] - c[8] * c[8] > -1e-12, "{c:?}");
            }
        }
    }
}
