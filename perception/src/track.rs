//! Dead reckoning that never jumps: unwraps moved origins and lets the uncertainty grow.
//!
//! With X the pose in the continuous frame and (Δf, Δl, Δθ) the motion since the last sample in the body's frame,
//! X ← X ⊕ Δ and P ← F·P·Fᵀ + G·Q·Gᵀ, where F = ∂X/∂X, G = ∂X/∂Δ and Q = diag(k_f²·d, k_l²·d, k_d²·d + k_t²·|Δθ|):
//! variances grow with the way d and with the turn, not with time.

use messages::Odometry;
use runtime::math;
use schemars::JsonSchema;
use serde::Deserialize;

/// How fast the uncertainty of dead reckoning grows.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Growth {
    /// Standard deviation along the way after 1 m [m].
    pub along_m: f64,
    /// Standard deviation across the way after 1 m, beside what the heading causes [m].
    pub across_m: f64,
    /// Standard deviation of the heading after 1 m [rad].
    pub heading_per_metre_rad: f64,
    /// Standard deviation of the heading after a turn of 1 rad [rad].
    pub heading_per_turn_rad: f64,
}

impl Default for Growth {
    fn default() -> Growth {
        Growth { along_m: 0.02, across_m: 0.005, heading_per_metre_rad: 0.02, heading_per_turn_rad: 0.03 }
    }
}

/// Position and heading in the continuous frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// x [m].
    pub x_m: f64,
    /// y [m].
    pub y_m: f64,
    /// Heading, in (−π, π] [rad].
    pub heading_rad: f64,
}

/// What is known from the samples so far.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Track {
    pose: Pose,
    covariance: [[f64; 3]; 3],
    last: Option<Seen>,
    /// Times that the frame was moved by [`Track::move_to`].
    origin: u64,
}

/// The sample before, in the device's frame, and what tells whether that frame is still the same.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen {
    pose: Pose,
    frame: (u64, u64),
}

impl Track {
    /// A track that begins at a pose [m, rad].
    pub fn beginning_at(x_m: f64, y_m: f64, heading_rad: f64) -> Track {
        let pose = Pose { x_m, y_m, heading_rad: math::wrap_angle(heading_rad) };
        Track { pose, ..Track::default() }
    }

    /// Moves the frame so that the body's pose in it is this one [m, rad], and forgets how uncertain the old one was.
    /// The new count of origins; `None`, and nothing changes, when a number is none.
    pub fn move_to(&mut self, x_m: f64, y_m: f64, heading_rad: f64) -> Option<u64> {
        if !(x_m.is_finite() && y_m.is_finite() && heading_rad.is_finite()) {
            return None;
        }
        self.pose = Pose { x_m, y_m, heading_rad: math::wrap_angle(heading_rad) };
        self.covariance = [[0.0; 3]; 3];
        self.origin += 1;
        Some(self.origin)
    }

    /// Takes in one sample of writer generation `generation`; `None` when it holds a number that is none.
    ///
    /// After the origin moved, or the writer restarted, the first sample only says where the new frame lies: what the
    /// body did in between is not known and counts as nothing.
    pub fn advance(&mut self, raw: &Odometry, generation: u64, growth: &Growth) -> Option<Odometry> {
        let device = Pose { x_m: raw.x_m, y_m: raw.y_m, heading_rad: raw.heading_rad };
        let velocity = raw.velocity;
        let numbers = [device.x_m, device.y_m, device.heading_rad, velocity.linear_x_m_s, velocity.angular_z_rad_s];
        if !numbers.iter().all(|n| n.is_finite()) {
            return None;
        }
        let frame = (generation, raw.origin);
        if let Some(last) = self.last.filter(|last| last.frame == frame) {
            self.move_by(&last.pose, &device, growth);
        }
        self.last = Some(Seen { pose: device, frame });
        let p = &self.covariance;
        Some(Odometry {
            x_m: self.pose.x_m,
            y_m: self.pose.y_m,
            heading_rad: self.pose.heading_rad,
            velocity,
            pose_covariance: [p[0][0], p[0][1], p[0][2], p[1][0], p[1][1], p[1][2], p[2][0], p[2][1], p[2][2]],
            velocity_covariance: raw.velocity_covariance.map(math::canonical),
            origin: self.origin,
        })
    }

    fn move_by(&mut self, from: &Pose, to: &Pose, growth: &Growth) {
        let (sin, cos) = math::sin_cos(from.heading_rad);
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let (forward_m, left_m) = (cos * dx + sin * dy, cos * dy - sin * dx);
        let turned_rad = math::wrap_angle(to.heading_rad - from.heading_rad);
        let (sin, cos) = math::sin_cos(self.pose.heading_rad);
        let (step_x, step_y) = (cos * forward_m - sin * left_m, sin * forward_m + cos * left_m);
        self.pose.x_m += step_x;
        self.pose.y_m += step_y;
        self.pose.heading_rad = math::wrap_angle(self.pose.heading_rad + turned_rad);
        // F differs from the identity only in how the heading moves x and y.
        let f = [[1.0, 0.0, -step_y], [0.0, 1.0, step_x], [0.0, 0.0, 1.0]];
        self.covariance = propagated(&f, &self.covariance);
        let way_m = math::hypot(forward_m, left_m);
        let along = growth.along_m * growth.along_m * way_m;
        let across = growth.across_m * growth.across_m * way_m;
        let p = &mut self.covariance;
        p[0][0] += cos * cos * along + sin * sin * across;
        p[1][1] += sin * sin * along + cos * cos * across;
        let mixed = sin * cos * (along - across);
        p[0][1] += mixed;
        p[1][0] += mixed;
        p[2][2] += growth.heading_per_metre_rad * growth.heading_per_metre_rad * way_m
            + growth.heading_per_turn_rad * growth.heading_per_turn_rad * turned_rad.abs();
    }
}

/// F·P·Fᵀ.
fn propagated(f: &[[f64; 3]; 3], p: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut fp = [[0.0; 3]; 3];
    let mut out = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            fp[i][j] = (0..3).map(|k| f[i][k] * p[k][j]).sum();
        }
    }
    for i in 0..3 {
        for j in 0..3 {
            out[i][j] = (0..3).map(|k| fp[i][k] * f[j][k]).sum();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Twist;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn raw(x_m: f64, y_m: f64, heading_rad: f64, origin: u64) -> Odometry {
        Odometry {
            x_m,
            y_m,
            heading_rad,
            velocity: Twist::default(),
            pose_covariance: [0.0; 9],
            velocity_covariance: [0.0; 9],
            origin,
        }
    }

    fn after(samples: &[(Odometry, u64)]) -> Odometry {
        let mut track = Track::default();
        let mut out = None;
        for (sample, generation) in samples {
            out = track.advance(sample, *generation, &Growth::default());
        }
        out.unwrap()
    }

    #[test]
    fn the_frame_begins_where_the_first_sample_was_taken() {
        let out = after(&[(raw(3.0, 1.0, FRAC_PI_2, 0), 1), (raw(3.0, 2.0, FRAC_PI_2, 0), 1)]);
        assert!((out.x_m - 1.0).abs() < 1e-12 && out.y_m.abs() < 1e-12 && out.heading_rad.abs() < 1e-12);
    }

    #[test]
    fn a_moved_origin_does_not_move_the_pose() {
        let out = after(&[
            (raw(0.0, 0.0, 0.0, 0), 1),
            (raw(1.0, 0.0, FRAC_PI_2, 0), 1),
            (raw(0.0, 0.0, 0.0, 1), 1),
            (raw(0.5, 0.0, 0.0, 1), 1),
        ]);
        assert!((out.x_m - 1.0).abs() < 1e-12 && (out.y_m - 0.5).abs() < 1e-12, "{out:?}");
        assert!((out.heading_rad - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn a_restarted_driver_that_counts_from_zero_does_not_move_the_pose() {
        let out = after(&[(raw(0.0, 0.0, 0.0, 0), 1), (raw(2.0, 0.0, 0.0, 0), 1), (raw(0.0, 0.0, 0.0, 0), 2)]);
        assert!((out.x_m - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_heading_goes_on_through_half_a_turn() {
        let out = after(&[(raw(0.0, 0.0, PI - 0.1, 0), 1), (raw(0.0, 0.0, -PI + 0.1, 0), 1)]);
        assert!((out.heading_rad - 0.2).abs() < 1e-12);
    }

    #[test]
    fn uncertainty_grows_on_the_way_and_not_at_rest() {
        let mut track = Track::default();
        let mut variances = Vec::new();
        for x in [0.0, 0.0, 1.0, 2.0, 2.0] {
            let out = track.advance(&raw(x, 0.0, 0.0, 0), 1, &Growth::default()).unwrap();
            variances.push(out.pose_covariance);
        }
        assert_eq!(variances[1], [0.0; 9]);
        assert!((variances[2][0] - 0.0004).abs() < 1e-12);
        assert!(variances[3][4] > 2.0 * variances[2][4], "the heading's error carries the side away");
        assert_eq!(variances[4], variances[3]);
    }

    #[test]
    fn a_sample_with_a_number_that_is_none_is_refused_and_changes_nothing() {
        let mut track = Track::default();
        track.advance(&raw(0.0, 0.0, 0.0, 0), 1, &Growth::default());
        let before = track;
        assert_eq!(track.advance(&raw(f64::NAN, 0.0, 0.0, 0), 1, &Growth::default()), None);
        assert_eq!(track, before);
    }

    proptest! {
        #[test]
        fn the_covariance_stays_symmetric_and_positive(
            steps in prop::collection::vec((-0.1..0.1f64, -0.3..0.3f64), 1..100),
        ) {
            let mut track = Track::default();
            let (mut x, mut y, mut heading) = (0.0, 0.0, 0.0);
            for (way, turn) in steps {
                heading = math::wrap_angle(heading + turn);
                x += way * math::cos(heading);
                y += way * math::sin(heading);
                let p = track.advance(&raw(x, y, heading, 0), 1, &Growth::default()).unwrap().pose_covariance;
                prop_assert!((p[1] - p[3]).abs() < 1e-12 && (p[2] - p[6]).abs() < 1e-12 && (p[5] - p[7]).abs() < 1e-12);
                prop_assert!(p[0] >= 0.0 && p[4] >= 0.0 && p[8] >= 0.0);
                prop_assert!(p[0] * p[4] - p[1] * p[3] >= -1e-12);
            }
        }
    }
}
