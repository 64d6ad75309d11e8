//! Follows things from scan to scan: prediction, association, update, birth and death.

use super::association::{Association, NONE, Pair};
use super::config::TracksConfig;
use super::entry::Entry;
use super::measurement::Measurement;
use crate::place::Place;
use crate::scan::segments::Segmenter;
use crate::scan::sight::Sight;
use messages::{Beam, Segment, SegmentShape, Track, Twist};
use runtime::{Time, math};

/// A stamp earlier than the last one by more than this is another clock: everything begins anew [s].
const OTHER_CLOCK_S: f64 = 1.0;

/// All tracks.
#[derive(Debug, Clone)]
pub struct Tracker {
    config: TracksConfig,
    segmenter: Segmenter,
    sight: Sight,
    entries: Vec<Entry>,
    association: Association,
    /// Segments that may be things, with what they measure.
    seen: Vec<(usize, Measurement)>,
    /// Whether each of `seen` belongs to a track.
    taken: Vec<bool>,
    tracks: Vec<Track>,
    next_id: u64,
    last: Option<Time>,
    no_room: u64,
}

impl Tracker {
    /// A tracker with room for what the settings say.
    pub fn new(config: TracksConfig) -> Tracker {
        let (tracks, segments) = (config.most_tracks, config.segments.most_segments);
        Tracker {
            segmenter: Segmenter::new(config.segments),
            sight: Sight::new(config.segments.most_beams),
            entries: Vec::with_capacity(tracks),
            association: Association::new(tracks, segments),
            seen: Vec::with_capacity(segments),
            taken: Vec::with_capacity(segments),
            tracks: Vec::with_capacity(tracks),
            next_id: 1,
            last: None,
            no_room: 0,
            config,
        }
    }

    /// Forgets all tracks: the odometry frame is another one.
    pub fn begin_anew(&mut self) {
        self.entries.clear();
        self.tracks.clear();
        self.last = None;
    }

    /// Takes a scan of `beams`, stamped `now`, when the body stood at `place` and moved with `velocity`. False for a scan
    /// that is no newer than the last one: it changes nothing.
    pub fn take(&mut self, now: Time, beams: &[Beam], place: &Place, velocity: &Twist) -> bool {
        if let Some(last) = self.last.filter(|last| now <= *last) {
            if last.since(now) < OTHER_CLOCK_S {
                return false;
            }
            self.begin_anew();
        }
        let dt_s = self.last.map_or(0.0, |last| now.since(last));
        self.last = Some(now);
        self.segmenter.take(beams, velocity);
        self.sight.take(beams);
        for entry in &mut self.entries {
            entry.predict(dt_s, place, &self.config);
        }
        self.measure(place);
        self.associate(now, place);
        self.bear(now, place);
        self.tracks.clear();
        self.tracks.extend(self.entries.iter().map(|entry| entry.message(now, place, &self.config)));
        true
    }

    /// The tracks after the newest scan, by ascending number.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// The newest scan in pieces.
    pub fn segmenter(&self) -> &Segmenter {
        &self.segmenter
    }

    /// Things that became no track for want of room, so far.
    pub fn no_room(&self) -> u64 {
        self.no_room
    }

    fn measure(&mut self, place: &Place) {
        self.seen.clear();
        for (index, segment) in self.segmenter.segments().iter().enumerate() {
            if segment.shape != SegmentShape::Straight as u32 {
                let measured = Measurement::new(self.segmenter.circle(index), place, self.config.shape_sigma_m);
                self.seen.push((index, measured));
            }
        }
        self.taken.clear();
        self.taken.resize(self.seen.len(), false);
    }

    fn associate(&mut self, now: Time, place: &Place) {
        let config = &self.config;
        self.association.begin();
        for (row, entry) in self.entries.iter().enumerate() {
            for (column, (_, seen)) in self.seen.iter().enumerate() {
                if let Some(cost) = entry.distance(seen, config) {
                    self.association.may_be(Pair { row: row as u32, column: column as u32, cost });
                }
            }
        }
        let given = self.association.solve(self.entries.len(), self.seen.len(), config.gate);
        let (segmenter, sight, taken, all) = (&self.segmenter, &self.sight, &mut self.taken, &self.seen);
        let mut row = 0;
        self.entries.retain_mut(|entry| {
            let column = given[row];
            row += 1;
            if column == NONE {
                entry.judge(now, place, sight, None, config);
                return !entry.is_over(now, place, sight, config);
            }
            taken[column as usize] = true;
            let (index, _) = all[column as usize];
            // What is known of the radius says where the centre is behind the surface that was seen.
            let (radius_m, sigma_m) = entry.radius();
            let circle = segmenter.refit(index, radius_m, sigma_m);
            let seen = Measurement::new(&circle, place, config.shape_sigma_m);
            entry.update(now, &seen, segmenter.circle(index));
            entry.judge(now, place, sight, Some(&segmenter.segments()[index]), config);
            true
        });
    }

    fn bear(&mut self, now: Time, place: &Place) {
        for k in 0..self.seen.len() {
            let (index, seen) = self.seen[k];
            let segment = &self.segmenter.segments()[index];
            let circle = *self.segmenter.circle(index);
            if self.taken[k] || !begins(segment, &self.config) || seen.rho_m > self.config.within_m {
                continue;
            }
            let part_of = |entry: &Entry| {
                let distance = math::hypot(entry.known().x_m - seen.x_m, entry.known().y_m - seen.y_m);
                distance < entry.radius().0.max(circle.radius_m)
            };
            if self.entries.iter().any(part_of) || !self.has_room(&seen, place) {
                continue;
            }
            self.entries.push(Entry::new(self.next_id, now, &seen, &circle, place, &self.config));
            self.next_id += 1;
        }
    }

    /// Whether there is room for one more; the farthest track gives way to what is nearer.
    fn has_room(&mut self, seen: &Measurement, place: &Place) -> bool {
        if self.entries.len() < self.config.most_tracks {
            return true;
        }
        self.no_room += 1;
        let off = |entry: &Entry| math::hypot(entry.known().x_m - place.x_m, entry.known().y_m - place.y_m);
        let mut farthest = 0;
        for k in 1..self.entries.len() {
            if off(&self.entries[k]) > off(&self.entries[farthest]) {
                farthest = k;
            }
        }
        let gives_way = off(&self.entries[farthest]) > seen.rho_m;
        if gives_way {
            self.entries.remove(farthest);
        }
        gives_way
    }
}

/// Whether a segment that belongs to no track may begin one.
fn begins(segment: &Segment, config: &TracksConfig) -> bool {
    segment.points >= config.least_points && (segment.first_hidden == 0 || segment.last_hidden == 0)
}
