//! One way of tracking, driven through one yard.

use super::baseline::Nearest;
use super::score::{Score, Seen, Truth};
use super::yard::{Laser, Mover, Moving};
use messages::{Beam, TrackState, Twist};
use perception::place::Place;
use perception::scan::segments::{Fit, Segmenter, SegmentsConfig};
use perception::tracks::config::{FilterKind, TracksConfig};
use perception::tracks::tracker::Tracker;
use runtime::{Time, math};

/// Length of a run [s].
const RUN_S: f64 = 20.0;
/// Time between scans [s].
const PERIOD_S: f64 = 0.02;
/// Beams and field of the laser.
const BEAMS: usize = 720;
/// A mover that fewer beams hit is not to be seen.
const LEAST_HITS: u32 = 3;

/// A way of tracking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// The nearest circle, no filter.
    Nearest(Fit),
    /// Kalman filters.
    Filtered(FilterKind, Fit),
}

/// A way of tracking at work.
pub enum Contestant {
    Nearest(Box<Nearest>),
    Filtered(Box<Tracker>),
}

impl Contestant {
    /// `way`, for a laser of `sigma_m`.
    pub fn new(way: Way, sigma_m: f64) -> Contestant {
        let segments = |fit| SegmentsConfig { fit, range_sigma_m: sigma_m, ..SegmentsConfig::default() };
        match way {
            Way::Nearest(fit) => Contestant::Nearest(Box::new(Nearest::new(segments(fit)))),
            Way::Filtered(filter, fit) => {
                let config = TracksConfig { filter, segments: segments(fit), ..TracksConfig::default() };
                Contestant::Filtered(Box::new(Tracker::new(config)))
            }
        }
    }

    /// Takes a scan.
    pub fn take(&mut self, now: Time, beams: &[Beam], place: &Place, velocity: &Twist) {
        match self {
            Contestant::Nearest(nearest) => nearest.take(now, beams, place, velocity),
            Contestant::Filtered(tracker) => {
                tracker.take(now, beams, place, velocity);
            }
        }
    }

    /// The newest scan in pieces.
    pub fn segmenter(&self) -> &Segmenter {
        match self {
            Contestant::Nearest(nearest) => nearest.segmenter(),
            Contestant::Filtered(tracker) => tracker.segmenter(),
        }
    }

    /// Its confirmed tracks in the odometry frame.
    pub fn seen(&self, now: Time, out: &mut Vec<Seen>) {
        out.clear();
        match self {
            Contestant::Nearest(nearest) => nearest.seen(now, out),
            Contestant::Filtered(tracker) => {
                let confirmed = tracker.tracks().iter().filter(|t| t.state != TrackState::Tentative as u32);
                out.extend(confirmed.map(|t| Seen {
                    id: t.id,
                    x_m: t.odom_x_m,
                    y_m: t.odom_y_m,
                    velocity_x_m_s: t.odom_velocity_x_m_s,
                    velocity_y_m_s: t.odom_velocity_y_m_s,
                    now: t.state == TrackState::Confirmed as u32,
                    moves: Some(t.moves()),
                }));
            }
        }
    }
}

/// Drives through `yard` and scores what `contestant` tracks.
pub fn drive(yard: &[Mover], seed: u64, sigma_m: f64, contestant: &mut Contestant, score: &mut Score) {
    let mut laser = Laser::new(BEAMS, 1.5 * std::f64::consts::PI, sigma_m, seed);
    let mut seen = Vec::new();
    let mut truths = Truths::default();
    for step in 1..=(RUN_S / PERIOD_S) as u64 {
        let t = step as f64 * PERIOD_S;
        let (place, velocity) = body(t);
        let movers: Vec<Moving> = yard.iter().map(|mover| mover.at(t)).collect();
        laser.look(&place, &movers);
        let now = Time::from_seconds(t);
        contestant.take(now, &laser.beams, &place, &velocity);
        contestant.seen(now, &mut seen);
        score.step(t, truths.of(&movers, &laser.hits), &seen);
    }
    score.end();
}

/// From the start towards the goal at 1 m/s, weaving.
fn body(t: f64) -> (Place, Twist) {
    let (sway_m, rate) = (0.5, 0.8);
    let (sin, cos) = math::sin_cos(rate * t);
    let (dx, dy) = (-1.0, sway_m * rate * cos);
    let heading = math::atan2(dy, dx);
    let turn = -sway_m * rate * rate * sin * dx / (dx * dx + dy * dy);
    let velocity = Twist { linear_x_m_s: math::hypot(dx, dy), linear_y_m_s: 0.0, angular_z_rad_s: turn };
    (Place::new(11.0 - t, sway_m * sin, heading), velocity)
}

/// The movers as the score wants them.
#[derive(Debug, Default)]
struct Truths(Vec<Truth>);

impl Truths {
    fn of(&mut self, movers: &[Moving], hits: &[u32]) -> &[Truth] {
        self.0.clear();
        self.0.extend(movers.iter().zip(hits).enumerate().map(|(k, (mover, &hits))| Truth {
            // One that begins its path anew has jumped: it is another thing.
            number: k as u64 + 1000 * mover.lap,
            x_m: mover.x_m,
            y_m: mover.y_m,
            velocity_x_m_s: mover.velocity_x_m_s,
            velocity_y_m_s: mover.velocity_y_m_s,
            visible: hits >= LEAST_HITS,
        }));
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bodys_velocity_is_the_derivative_of_its_place() {
        for t in [0.3, 2.0, 7.7] {
            let (place, velocity) = body(t);
            let (later, _) = body(t + 1e-5);
            let way = math::hypot(later.x_m - place.x_m, later.y_m - place.y_m) / 1e-5;
            let turned = math::wrap_angle(math::atan2(later.sin, later.cos) - math::atan2(place.sin, place.cos)) / 1e-5;
            assert!((way - velocity.linear_x_m_s).abs() < 1e-3, "{way} {velocity:?}");
            assert!((turned - velocity.angular_z_rad_s).abs() < 1e-3, "{turned} {velocity:?}");
        }
    }
}
