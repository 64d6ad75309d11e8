//! One thing that is followed: its filter, its radius, and whether it stands or moves.
//!
//! *Moves* takes two witnesses: the filter's velocity differs from none (v·P_v⁻¹·v beyond χ²₉₉), and the scan shows it:
//! the ranger now sees through where the thing stood a while ago, or sees the thing itself well in front of there. A
//! velocity alone is not enough: the visible part of a standing thing that comes out from behind another, or that the
//! body drives past, slides along and pulls its circle with it, but nothing is ever seen through where it stands.

use super::cartesian::Cartesian;
use super::config::{FilterKind, TracksConfig};
use super::measurement::{Estimate, Measurement};
use super::polar::Polar;
use crate::place::Place;
use crate::scan::circles::Circle;
use crate::scan::sight::Sight;
use messages::{Segment, Track, TrackMotion, TrackState};
use runtime::{Time, math};

/// Where a thing stood is remembered for between this and twice this [s].
const ANCHOR_S: f64 = 0.4;
/// What was seen to move counts as moving for so long [s].
const HOLD_S: f64 = 0.8;
/// What was not seen to move for so long stands [s].
const WATCH_S: f64 = 0.6;
/// χ² of two degrees of freedom, 99 %.
const SIGNIFICANT: f64 = 9.21;
/// A beam sees through a surface when it goes this much farther: this [m], …
const THROUGH_M: f64 = 0.08;
/// … or this share of the radius.
const THROUGH_SHARE: f64 = 0.3;
/// Accelerations last so long [s].
const ACCELERATION_S: f64 = 0.1;
/// A radius is known no better than this [m] …
const RADIUS_SIGMA_M: f64 = 0.01;
/// … and forgotten at this rate, for shapes change as they turn [m²/s].
const RADIUS_DRIFT_M2_S: f64 = 0.0004;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Filter {
    Polar(Polar),
    Cartesian(Cartesian),
}

/// Where a thing stood.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Anchor {
    time: Time,
    x_m: f64,
    y_m: f64,
}

/// A track.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    id: u64,
    filter: Filter,
    known: Estimate,
    radius_m: f64,
    radius_variance: f64,
    born: Time,
    seen: Time,
    sightings: u32,
    anchors: [Anchor; 2],
    moved: Option<Time>,
    motion: TrackMotion,
}

impl Entry {
    /// Something seen for the first time, at `now`.
    pub fn new(id: u64, now: Time, seen: &Measurement, circle: &Circle, place: &Place, config: &TracksConfig) -> Entry {
        let filter = match config.filter {
            FilterKind::Polar => Filter::Polar(Polar::start(seen, place, config.speed_sigma_m_s)),
            FilterKind::Cartesian => Filter::Cartesian(Cartesian::start(seen, config.speed_sigma_m_s)),
        };
        let anchor = Anchor { time: now, x_m: seen.x_m, y_m: seen.y_m };
        let mut entry = Entry {
            id,
            filter,
            known: Estimate::default(),
            radius_m: circle.radius_m,
            radius_variance: circle.covariance[2][2].max(RADIUS_SIGMA_M * RADIUS_SIGMA_M),
            born: now,
            seen: now,
            sightings: 1,
            anchors: [anchor; 2],
            moved: None,
            motion: TrackMotion::Unknown,
        };
        entry.look_up();
        entry
    }

    /// Carried on by `dt_s`, to when the body stands at `place`.
    pub fn predict(&mut self, dt_s: f64, place: &Place, config: &TracksConfig) {
        if dt_s <= 0.0 {
            return;
        }
        // As much velocity is added per second whatever the scans' rate.
        let acceleration = config.acceleration_m_s2 * (ACCELERATION_S / dt_s).sqrt();
        match &mut self.filter {
            Filter::Polar(filter) => filter.predict(dt_s, place, acceleration),
            Filter::Cartesian(filter) => filter.predict(dt_s, acceleration),
        }
        self.radius_variance += RADIUS_DRIFT_M2_S * dt_s;
        self.look_up();
    }

    /// The squared distance of a measurement, in standard deviations; `None` beyond the gates.
    pub fn distance(&self, seen: &Measurement, config: &TracksConfig) -> Option<f64> {
        let (dx, dy) = (seen.x_m - self.known.x_m, seen.y_m - self.known.y_m);
        if dx * dx + dy * dy > config.most_jump_m * config.most_jump_m {
            return None;
        }
        let distance = match &self.filter {
            Filter::Polar(filter) => filter.distance(seen),
            Filter::Cartesian(filter) => filter.distance(seen),
        };
        (distance < config.gate).then_some(distance)
    }

    /// Takes in a measurement whose circle alone, without the track's radius, was `circle`.
    pub fn update(&mut self, now: Time, seen: &Measurement, circle: &Circle) {
        match &mut self.filter {
            Filter::Polar(filter) => filter.update(seen),
            Filter::Cartesian(filter) => filter.update(seen),
        }
        let gain = self.radius_variance / (self.radius_variance + circle.covariance[2][2]);
        self.radius_m += gain * (circle.radius_m - self.radius_m);
        self.radius_variance = ((1.0 - gain) * self.radius_variance).max(RADIUS_SIGMA_M * RADIUS_SIGMA_M);
        self.seen = now;
        self.sightings = self.sightings.saturating_add(1);
        self.look_up();
    }

    fn look_up(&mut self) {
        self.known = match &self.filter {
            Filter::Polar(filter) => filter.estimate(),
            Filter::Cartesian(filter) => filter.estimate(),
        };
    }

    /// Decides whether it stands or moves, by the scan at `now` in which it is `segment`.
    pub fn judge(&mut self, now: Time, place: &Place, sight: &Sight, segment: Option<&Segment>, config: &TracksConfig) {
        let known = &self.known;
        let speed = math::hypot(known.velocity_x_m_s, known.velocity_y_m_s);
        let fast = speed > config.moving_above_m_s && known.speed_significance() > SIGNIFICANT;
        if fast && self.anchors.iter().any(|anchor| self.has_left(anchor, place, sight, segment)) {
            self.moved = Some(now);
        }
        let slow = speed < 0.5 * config.moving_above_m_s;
        self.motion = match self.moved {
            Some(moved) if now.since(moved) < HOLD_S && !slow => TrackMotion::Moving,
            _ if now.since(self.born) < WATCH_S => TrackMotion::Unknown,
            _ => TrackMotion::Still,
        };
        if segment.is_some() && now.since(self.anchors[0].time) > ANCHOR_S {
            self.anchors = [Anchor { time: now, x_m: known.x_m, y_m: known.y_m }, self.anchors[0]];
        }
    }

    /// Whether the scan shows that the thing is no longer at `anchor`.
    fn has_left(&self, anchor: &Anchor, place: &Place, sight: &Sight, segment: Option<&Segment>) -> bool {
        let (x, y) = place.inward(anchor.x_m, anchor.y_m);
        let length = math::hypot(x, y).max(1e-9);
        let through_m = (THROUGH_SHARE * self.radius_m).max(THROUGH_M);
        // Straight at the centre, and at both flanks of what is large enough to have some.
        let flank = (self.radius_m - through_m).max(0.0);
        let flanks = [0.0, flank, -flank];
        let places = if flank > 0.05 { &flanks[..] } else { &flanks[..1] };
        places.iter().any(|aside| {
            let Some(look) = sight.towards(x - aside * y / length, y + aside * x / length) else { return false };
            let surface = look.distance_m - (self.radius_m * self.radius_m - aside * aside).max(0.0).sqrt();
            let itself = segment.is_some_and(|s| (s.first_beam..=s.last_beam).contains(&look.beam));
            look.range_m > surface + through_m + self.radius_m.min(0.1)
                || (itself && look.range_m < surface - through_m)
        })
    }

    /// Whether it is to be forgotten at `now`, not having been seen in this scan.
    pub fn is_over(&self, now: Time, place: &Place, sight: &Sight, config: &TracksConfig) -> bool {
        let unseen_s = now.since(self.seen);
        if self.sightings < config.confirm_after {
            return unseen_s > config.forget_tentative_s;
        }
        let (x, y) = place.inward(self.known.x_m, self.known.y_m);
        let visible = sight.towards(x, y).is_some_and(|look| look.range_m > look.distance_m);
        unseen_s > if visible { config.forget_visible_s } else { config.forget_hidden_s }
    }

    /// Where it is.
    pub fn known(&self) -> &Estimate {
        &self.known
    }

    /// Its radius and that one's standard deviation [m].
    pub fn radius(&self) -> (f64, f64) {
        (self.radius_m, self.radius_variance.sqrt())
    }

    /// The message about it at `now`, when the body stands at `place`.
    pub fn message(&self, now: Time, place: &Place, config: &TracksConfig) -> Track {
        let known = &self.known;
        let (x_m, y_m) = place.inward(known.x_m, known.y_m);
        let (vx, vy) = place.turned_inward(known.velocity_x_m_s, known.velocity_y_m_s);
        let state = match self.sightings {
            few if few < config.confirm_after => TrackState::Tentative,
            _ if self.seen == now => TrackState::Confirmed,
            _ => TrackState::Coasting,
        };
        let mut track = Track {
            id: self.id,
            state: state as u32,
            motion: self.motion as u32,
            x_m,
            y_m,
            velocity_x_m_s: vx,
            velocity_y_m_s: vy,
            odom_x_m: known.x_m,
            odom_y_m: known.y_m,
            odom_velocity_x_m_s: known.velocity_x_m_s,
            odom_velocity_y_m_s: known.velocity_y_m_s,
            covariance: known.covariance,
            radius_m: self.radius_m,
            radius_sigma_m: self.radius_variance.sqrt(),
            age_s: now.since(self.born),
            unseen_s: now.since(self.seen),
            path_x_m: [x_m; 4],
            path_y_m: [y_m; 4],
        };
        if self.motion != TrackMotion::Still {
            for k in 0..track.path_x_m.len() {
                (track.path_x_m[k], track.path_y_m[k]) = track.predicted(config.path_step_s * (k + 1) as f64);
            }
        }
        track
    }
}
