//! A circle as the filters take it: in the body frame, as distance and bearing, and in the odometry frame.

use crate::place::Place;
use crate::scan::circles::Circle;
use runtime::math;

/// Where something was seen, how surely.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Measurement {
    /// Distance of the centre from the body's origin [m].
    pub rho_m: f64,
    /// Bearing of the centre from there [rad].
    pub theta_rad: f64,
    /// Variance of the distance [m²].
    pub rho_variance: f64,
    /// Variance of the bearing [rad²].
    pub theta_variance: f64,
    /// Centre in the odometry frame [m].
    pub x_m: f64,
    /// Centre in the odometry frame [m].
    pub y_m: f64,
    /// Variances and covariance of these two: xx, xy, yy [m²].
    pub covariance: [f64; 3],
}

/// Nothing is measured nearer to the body's origin than this [m].
pub const LEAST_RHO_M: f64 = 0.05;

impl Measurement {
    /// `circle`, seen from `place`; its centre is known no better than `sigma_m` each way.
    pub fn new(circle: &Circle, place: &Place, sigma_m: f64) -> Measurement {
        let (x, y) = (circle.x_m, circle.y_m);
        let more = sigma_m * sigma_m;
        let c = &circle.covariance;
        let (xx, xy, yy) = (c[0][0] + more, c[0][1], c[1][1] + more);
        let rho_m = math::hypot(x, y).max(LEAST_RHO_M);
        let (u_x, u_y) = (x / rho_m, y / rho_m);
        let along = u_x * u_x * xx + 2.0 * u_x * u_y * xy + u_y * u_y * yy;
        let across = u_y * u_y * xx - 2.0 * u_x * u_y * xy + u_x * u_x * yy;
        let (odom_x, odom_y) = place.out(x, y);
        let (s, k) = (place.sin, place.cos);
        Measurement {
            rho_m,
            theta_rad: math::atan2(y, x),
            rho_variance: along,
            theta_variance: across / (rho_m * rho_m),
            x_m: odom_x,
            y_m: odom_y,
            covariance: [
                k * k * xx - 2.0 * s * k * xy + s * s * yy,
                s * k * (xx - yy) + (k * k - s * s) * xy,
                s * s * xx + 2.0 * s * k * xy + k * k * yy,
            ],
        }
    }
}

/// What a filter knows, in the odometry frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimate {
    /// Centre [m].
    pub x_m: f64,
    /// Centre [m].
    pub y_m: f64,
    /// Velocity over the ground [m/s].
    pub velocity_x_m_s: f64,
    /// Velocity over the ground [m/s].
    pub velocity_y_m_s: f64,
    /// Upper triangle of the covariance of these four, row by row.
    pub covariance: [f64; 10],
}

impl Estimate {
    /// v·P_v⁻¹·v: how many standard deviations, squared, the velocity is away from none (χ², 2 degrees of freedom).
    pub fn speed_significance(&self) -> f64 {
        let [.., xx, xy, yy] = self.covariance;
        let det = xx * yy - xy * xy;
        let (x, y) = (self.velocity_x_m_s, self.velocity_y_m_s);
        if det > 0.0 { (x * x * yy - 2.0 * x * y * xy + y * y * xx) / det } else { 0.0 }
    }
}
