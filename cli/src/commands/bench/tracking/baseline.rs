//! The baseline: nearest neighbour without a filter. A track is where its circle was seen last, its velocity the last
//! difference; what was not seen stays where it was.

use messages::{Beam, SegmentShape, Twist};
use perception::place::Place;
use perception::scan::segments::{Segmenter, SegmentsConfig};
use runtime::{Time, math};

use super::score::Seen;

/// Nothing moves faster [m/s].
const MOST_SPEED_M_S: f64 = 2.5;
/// A circle is measured to about this [m].
const SLACK_M: f64 = 0.15;
/// Nothing is looked for farther away than this [m].
const MOST_JUMP_M: f64 = 1.0;
/// As long as the tracker waits for what is hidden [s].
const FORGET_S: f64 = 2.0;
/// As long as the tracker waits for what was seen too seldom [s].
const FORGET_TENTATIVE_S: f64 = 0.25;
/// Sightings that make a track.
const CONFIRM_AFTER: u32 = 3;

#[derive(Debug, Clone, Copy)]
struct Last {
    id: u64,
    x_m: f64,
    y_m: f64,
    vx: f64,
    vy: f64,
    seen: Time,
    sightings: u32,
}

/// The baseline's tracks, in the odometry frame.
#[derive(Debug)]
pub struct Nearest {
    segmenter: Segmenter,
    tracks: Vec<Last>,
    next_id: u64,
}

impl Nearest {
    pub fn new(config: SegmentsConfig) -> Nearest {
        Nearest { segmenter: Segmenter::new(config), tracks: Vec::new(), next_id: 1 }
    }

    pub fn segmenter(&self) -> &Segmenter {
        &self.segmenter
    }

    pub fn take(&mut self, now: Time, beams: &[Beam], place: &Place, velocity: &Twist) {
        self.segmenter.take(beams, velocity);
        let things: Vec<(f64, f64)> = self
            .segmenter
            .segments()
            .iter()
            .filter(|s| s.shape != SegmentShape::Straight as u32 && s.points >= 3)
            .map(|s| place.out(s.centre_x_m, s.centre_y_m))
            .collect();
        let mut pairs = Vec::new();
        for (row, track) in self.tracks.iter().enumerate() {
            let reach_m = (SLACK_M + MOST_SPEED_M_S * now.since(track.seen)).min(MOST_JUMP_M);
            for (column, thing) in things.iter().enumerate() {
                let off_m = math::hypot(thing.0 - track.x_m, thing.1 - track.y_m);
                if off_m < reach_m {
                    pairs.push((off_m, row, column));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut taken = vec![false; things.len()];
        for (_, row, column) in pairs {
            let track = &mut self.tracks[row];
            if taken[column] || track.seen == now {
                continue;
            }
            taken[column] = true;
            let (x, y) = things[column];
            let dt_s = now.since(track.seen);
            (track.vx, track.vy) = ((x - track.x_m) / dt_s, (y - track.y_m) / dt_s);
            (track.x_m, track.y_m, track.seen) = (x, y, now);
            track.sightings += 1;
        }
        self.tracks.retain(|track| {
            let confirmed = track.sightings >= CONFIRM_AFTER;
            now.since(track.seen) <= if confirmed { FORGET_S } else { FORGET_TENTATIVE_S }
        });
        for ((x_m, y_m), taken) in things.into_iter().zip(taken) {
            if !taken {
                self.tracks.push(Last { id: self.next_id, x_m, y_m, vx: 0.0, vy: 0.0, seen: now, sightings: 1 });
                self.next_id += 1;
            }
        }
    }

    /// Its confirmed tracks.
    pub fn seen(&self, now: Time, out: &mut Vec<Seen>) {
        out.extend(self.tracks.iter().filter(|track| track.sightings >= CONFIRM_AFTER).map(|track| Seen {
            id: track.id,
            x_m: track.x_m,
            y_m: track.y_m,
            velocity_x_m_s: track.vx,
            velocity_y_m_s: track.vy,
            now: track.seen == now,
            moves: None,
        }));
    }
}
