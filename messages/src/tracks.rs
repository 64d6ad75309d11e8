//! What stands or moves around the body: pieces of the newest scan, and tracks through time.

use crate::{Message, Twist};

/// How sure it is that a track is something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum TrackState {
    /// Seen too seldom: perhaps noise. Its velocity means nothing yet.
    Tentative = 0,
    /// Seen often enough, and in this scan.
    Confirmed = 1,
    /// Confirmed before, and not seen in this scan: carried on by its velocity.
    Coasting = 2,
}

/// What is known of a track's motion over the ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum TrackMotion {
    /// Watched too shortly to tell.
    Unknown = 0,
    /// It stands: part of the surroundings. Its velocity is the filter's noise.
    Still = 1,
    /// It moves: predict it.
    Moving = 2,
}

/// All tracks at the time of a scan; the tail holds a [`Track`] each, by ascending number.
///
/// Stamp: the scan's. Two frames: *body* (x forward, y left) where it stood at the stamp, and *odometry*, in which
/// tracks are kept so that the body's own motion is none of theirs. `body_…` is odometry_from_body at the stamp.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(tail = Track)]
pub struct Tracks {
    /// The body's position in the odometry frame [m].
    pub body_x_m: f64,
    /// The body's position in the odometry frame [m].
    pub body_y_m: f64,
    /// The body's heading in the odometry frame, counter-clockwise [rad].
    pub body_heading_rad: f64,
    /// The body's own velocity, in its frame.
    pub body_velocity: Twist,
    /// Counts the times that the odometry frame's zero was moved; all tracks begin anew then.
    pub origin: u64,
    /// Time from one point of a track's path to the next; the first is so long after the stamp [s].
    pub path_step_s: f64,
    /// Obstacles, since the start, that became no track because there were too many.
    pub no_room: u64,
}

/// One thing, followed from scan to scan as a circle.
///
/// Velocities are over the ground in both frames (only the axes differ): what stands has none, however the body moves.
/// For the velocity seen from the body, subtract the body's own, turn rate × position included.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Track {
    /// Number of the track; never given twice until the node restarts (the sample's generation tells).
    pub id: u64,
    /// How sure it is; see [`TrackState`].
    #[message(values = "tentative confirmed coasting")]
    pub state: u32,
    /// Whether it stands or moves; see [`TrackMotion`].
    #[message(values = "unknown still moving")]
    pub motion: u32,
    /// Centre in the body frame, ahead [m].
    pub x_m: f64,
    /// Centre in the body frame, to the left [m].
    pub y_m: f64,
    /// Velocity over the ground along the body's x axis [m/s].
    pub velocity_x_m_s: f64,
    /// Velocity over the ground along the body's y axis [m/s].
    pub velocity_y_m_s: f64,
    /// Centre in the odometry frame [m].
    pub odom_x_m: f64,
    /// Centre in the odometry frame [m].
    pub odom_y_m: f64,
    /// Velocity over the ground along the odometry frame's x axis [m/s].
    pub odom_velocity_x_m_s: f64,
    /// Velocity over the ground along the odometry frame's y axis [m/s].
    pub odom_velocity_y_m_s: f64,
    /// Covariance of (x, y, velocity x, velocity y) in the odometry frame: the upper triangle, row by row [m², m²/s, m²/s²].
    pub covariance: [f64; 10],
    /// Radius of the circle [m].
    pub radius_m: f64,
    /// Standard deviation of the radius [m].
    pub radius_sigma_m: f64,
    /// Time since it was first seen [s].
    pub age_s: f64,
    /// Time since it was last seen; 0 when in this scan [s].
    pub unseen_s: f64,
    /// Where its centre will be, in the body frame of the stamp, every `path_step_s` [m].
    pub path_x_m: [f64; 4],
    /// Where its centre will be, in the body frame of the stamp, every `path_step_s` [m].
    pub path_y_m: [f64; 4],
}

impl Track {
    /// Where the centre will be `after_s` after the stamp, in the body frame of the stamp [m].
    pub fn predicted(&self, after_s: f64) -> (f64, f64) {
        (self.x_m + after_s * self.velocity_x_m_s, self.y_m + after_s * self.velocity_y_m_s)
    }

    /// Standard deviation of that prediction along its worse axis, for a thing that keeps its velocity [m].
    pub fn predicted_sigma_m(&self, after_s: f64) -> f64 {
        let [xx, xy, x_vx, x_vy, yy, y_vx, y_vy, vx_vx, vx_vy, vy_vy] = self.covariance;
        let t = after_s;
        let a = xx + 2.0 * t * x_vx + t * t * vx_vx;
        let b = xy + t * (x_vy + y_vx) + t * t * vx_vy;
        let d = yy + 2.0 * t * y_vy + t * t * vy_vy;
        let greatest = 0.5 * (a + d) + (0.25 * (a - d) * (a - d) + b * b).sqrt();
        greatest.max(0.0).sqrt()
    }

    /// Whether it is confirmed (or coasting) and moves.
    pub fn moves(&self) -> bool {
        self.state != TrackState::Tentative as u32 && self.motion == TrackMotion::Moving as u32
    }
}

/// What a segment looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum SegmentShape {
    /// Too few points, or too straight, for its radius to be measured: the circle is the smallest that fits the chord.
    Speck = 0,
    /// An arc: centre and radius are measured.
    Round = 1,
    /// Longer than anything that is followed as a circle, or a straight line: a wall.
    Straight = 2,
}

/// The pieces into which one scan falls, each with the circle through it; the tail holds a [`Segment`] each, in the
/// order of the beams.
///
/// Frame: body at the stamp. Stamp: the scan's.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
#[message(tail = Segment)]
pub struct Segments {
    /// Beams of the scan.
    pub beams: u32,
    /// Beams that measured a distance.
    pub points: u32,
    /// Segments, since the start, for which there was no room.
    pub no_room: u64,
}

/// Neighbouring points of a scan that belong together.
#[derive(Debug, Clone, Copy, PartialEq, Default, Message)]
#[repr(C)]
pub struct Segment {
    /// Index of its first beam in the scan.
    pub first_beam: u32,
    /// Index of its last beam in the scan.
    pub last_beam: u32,
    /// Number of points.
    pub points: u32,
    /// What it looks like; see [`SegmentShape`].
    #[message(values = "speck round straight")]
    pub shape: u32,
    /// 1 when something nearer hides what may lie before its first point.
    pub first_hidden: u32,
    /// 1 when something nearer hides what may lie behind its last point.
    pub last_hidden: u32,
    /// First point [m].
    pub first_x_m: f64,
    /// First point [m].
    pub first_y_m: f64,
    /// Last point [m].
    pub last_x_m: f64,
    /// Last point [m].
    pub last_y_m: f64,
    /// Point nearest to the body's origin [m].
    pub nearest_x_m: f64,
    /// Point nearest to the body's origin [m].
    pub nearest_y_m: f64,
    /// Centre of the circle [m].
    pub centre_x_m: f64,
    /// Centre of the circle [m].
    pub centre_y_m: f64,
    /// Radius of the circle [m].
    pub radius_m: f64,
    /// Standard deviation of the radius by the beams' noise; +∞ where it was not measured [m].
    pub radius_sigma_m: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prediction_keeps_the_velocity_and_grows_less_sure() {
        let mut track = Track { x_m: 1.0, y_m: -2.0, velocity_x_m_s: 0.5, velocity_y_m_s: 1.0, ..Track::default() };
        // x and y known to 0.1 m, velocity to 0.2 m/s along x and 0.3 m/s along y, nothing mixed.
        track.covariance = [0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.04, 0.0, 0.09];
        assert_eq!(track.predicted(2.0), (2.0, 0.0));
        assert!((track.predicted_sigma_m(0.0) - 0.1).abs() < 1e-12);
        assert!((track.predicted_sigma_m(2.0) - (0.01_f64 + 4.0 * 0.09).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn only_what_is_confirmed_counts_as_moving() {
        let moving = Track { motion: TrackMotion::Moving as u32, ..Track::default() };
        assert!(!moving.moves());
        assert!(Track { state: TrackState::Coasting as u32, ..moving }.moves());
        assert!(!Track { state: TrackState::Confirmed as u32, ..Track::default() }.moves());
    }
}
