//! Where echoes came from during the last seconds: bounded, in the odometry frame.
//!
//! A reading of a ranger with a cone tells three things: *something* lies on the arc at that distance; nothing lies
//! nearer within the cone; nothing is known of what lies behind. So each reading adds spots along its arc, and takes
//! away spots of older readings that lie nearer than it, well inside its cone, and are looked at from about the side
//! they were seen from (a smooth wall that is looked at askance throws the sound away and seems to be gone). A spot that
//! was confirmed needs to be denied as often. Where the body stands there is nothing else.
//!
//! Most of an arc is false: the echo came from one place on it. Arcs heard from different places cross at the true one.
//! So a spot is confirmed by every arc through it that was heard from another place than the last one that did; once it
//! has been confirmed often enough it *explains* the arcs through it, later and earlier ones, of which only the part
//! near the spot is kept. That is how a jamb stops blocking the door beside it. (Triangulation of arcs: Wijk and
//! Christensen 2000; the votes are theirs, the rest is simpler.)

mod arc;
mod config;
mod reading;
mod spots;
#[cfg(test)]
mod tests;

pub use config::{MemoryConfig, Outline};

use crate::place::Place;
use arc::{Arc, Free, Spot, near};
use messages::{Beam, Echo, Ranges};
use reading::{Heard, Reading};
use runtime::{Time, math};
use spots::Spots;

/// Readings that are recalled.
const RECALLED: usize = 512;
/// Far more than rounding moves a place [m].
const ROUNDING_M: f64 = 1e-6;
/// So many of them must deny a place before it counts as free: one may be a lost echo.
const DENIALS: usize = 2;

/// The memory.
#[derive(Debug)]
pub struct EchoMemory {
    spots: Spots,
    /// The last readings, in a ring.
    recalled: Vec<Free>,
    next: usize,
    /// Indices of the spots about the arc that is being added, in order.
    about: Vec<usize>,
    /// Indices of the readings that may have seen it free, in order.
    witnesses: Vec<usize>,
    config: MemoryConfig,
    cos_askance: f64,
    lost: u64,
}

impl EchoMemory {
    /// Empty, with all the room it will ever take.
    pub fn new(config: MemoryConfig) -> EchoMemory {
        let cos_askance = math::cos(config.denies_askance_rad);
        let (spots, recalled) = (Spots::new(config.capacity), Vec::with_capacity(RECALLED));
        let (about, witnesses) = (Vec::with_capacity(config.capacity), Vec::with_capacity(RECALLED));
        EchoMemory { spots, recalled, next: 0, about, witnesses, config, cos_askance, lost: 0 }
    }

    /// Number of spots.
    pub fn len(&self) -> usize {
        self.spots.len()
    }

    /// Whether nothing is remembered.
    pub fn is_empty(&self) -> bool {
        self.spots.len() == 0
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.spots.clear();
        self.recalled.clear();
        self.next = 0;
    }

    /// Whether an echo of `beam` is among what the memory keeps.
    pub fn keeps(&self, beam: &Beam) -> bool {
        let value = beam.echo == Echo::Value as u32 && f64::from(beam.range_m) <= self.config.keep_within_m;
        value || beam.echo == Echo::TooNear as u32
    }

    /// Spots that found no room so far.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Takes in `beam` of `ranges`, fired at `time` when the body was at `place`.
    pub fn hear(&mut self, time: Time, place: &Place, ranges: &Ranges, beam: &Beam) {
        let Some(reading) = Reading::of(ranges, beam, place) else { return };
        let free = Free {
            time,
            x_m: reading.x_m,
            y_m: reading.y_m,
            axis_x: reading.axis_x,
            axis_y: reading.axis_y,
            cos_sure: math::cos(reading.half_width_rad * self.config.denies_within_share),
            reach_m: reading.free_m * (1.0 - self.config.denies_beyond_share) - self.config.denies_beyond_m,
        };
        self.deny(&free);
        match reading.echo {
            Heard::At(distance_m) if distance_m <= self.config.keep_within_m => {
                self.add_arc(time, &reading, distance_m);
            }
            Heard::Within(distance_m) => self.add_too_near(time, &reading, distance_m),
            Heard::At(_) | Heard::Nothing => {}
        }
        self.recall(free);
    }

    /// Forgets what is old, far away, or where the body stands.
    pub fn tidy(&mut self, now: Time, place: &Place, body: &Outline) {
        let c = self.config;
        self.spots.retain(|spot| {
            let (x_m, y_m) = place.inward(spot.x_m, spot.y_m);
            let under_body = x_m < body.ahead_m && x_m > -body.behind_m && y_m.abs() < body.half_width_m;
            let far = x_m * x_m + y_m * y_m > c.keep_within_m * c.keep_within_m;
            let keep_s = if spot.confirmations >= c.explains_from { c.keep_s } else { c.keep_unexplained_s };
            !under_body && !far && now.since(spot.seen) <= keep_s
        });
    }

    /// Hands every spot as a beam of the body at `place`, with its age at `now`, to `each`.
    pub fn each(&self, now: Time, place: &Place, mut each: impl FnMut(Beam)) {
        for spot in self.spots.iter() {
            let (x_m, y_m) = place.inward(spot.x_m, spot.y_m);
            each(Beam {
                origin_x_m: 0.0,
                origin_y_m: 0.0,
                bearing_rad: math::atan2_f32(y_m as f32, x_m as f32),
                range_m: math::hypot(x_m, y_m) as f32,
                age_s: now.since(spot.seen) as f32,
                echo: Echo::Value as u32,
            });
        }
    }

    fn deny(&mut self, free: &Free) {
        if free.reach_m <= 0.0 {
            return;
        }
        let EchoMemory { spots, about, cos_askance, .. } = self;
        spots.find(about, |x_m, y_m| free.may_deny(x_m, y_m));
        let mut forgotten = false;
        for &k in about.iter() {
            let mut spot = spots[k];
            if free.denies(spot.x_m, spot.y_m, spot.look_x, spot.look_y, *cos_askance) {
                spot.confirmations -= 1;
                forgotten |= spot.confirmations == 0;
                spots.set(k, spot);
            }
        }
        if forgotten {
            spots.retain(|spot| spot.confirmations > 0);
        }
    }

    fn recall(&mut self, free: Free) {
        if free.reach_m <= 0.0 {
            return;
        }
        if self.recalled.len() < RECALLED {
            self.recalled.push(free);
        } else {
            self.recalled[self.next] = free;
        }
        self.next = (self.next + 1) % RECALLED;
    }

    /// Gathers the readings that may deny a spot of an arc of width `width_rad`: all that see into the disc around it.
    fn call_witnesses(&mut self, time: Time, arc: &Arc, width_rad: f64) {
        let EchoMemory { recalled, witnesses, config, .. } = self;
        let (x_m, y_m) = (arc.x_m + arc.radius_m * arc.axis_x, arc.y_m + arc.radius_m * arc.axis_y);
        let room_m = 0.5 * width_rad * arc.radius_m + ROUNDING_M;
        witnesses.clear();
        let see = |free: &Free| free.sees_into(x_m, y_m, room_m) && time.since(free.time) <= config.recall_s;
        witnesses.extend(recalled.iter().enumerate().filter(|(_, free)| see(free)).map(|(k, _)| k));
    }

    /// Whether the readings that were called leave it open that something is at a new spot.
    fn is_open(&self, new: &Spot) -> bool {
        let denials = self
            .witnesses
            .iter()
            .filter(|&&k| self.recalled[k].denies(new.x_m, new.y_m, new.look_x, new.look_y, self.cos_askance))
            .take(DENIALS)
            .count();
        denials < DENIALS
    }

    /// Gathers the spots that an arc can confirm, or that a new spot on it can be the same as.
    fn gather(&mut self, arc: &Arc) {
        let EchoMemory { spots, about, config: c, .. } = self;
        let within_m = c.spacing_m.max(c.on_arc_within_m).max(c.same_within_m) + ROUNDING_M;
        let (least_m, most_m) = ((arc.radius_m - within_m).max(0.0), arc.radius_m + within_m);
        let (least_sq, most_sq) = (least_m * least_m, most_m * most_m);
        spots.find(about, |x_m, y_m| {
            let (dx, dy) = (x_m - arc.x_m, y_m - arc.y_m);
            let away_sq = dx * dx + dy * dy;
            (away_sq >= least_sq) & (away_sq <= most_sq)
        });
    }

    fn add_arc(&mut self, time: Time, reading: &Reading, distance_m: f64) {
        let c = self.config;
        let arc = Arc::of(reading, distance_m);
        self.gather(&arc);
        let known = self.confirm(time, &arc);
        let kept = |spot: &Spot| known.is_none_or(|known| near(known, (spot.x_m, spot.y_m), c.explained_within_m));
        // Something is on the arc: where earlier readings leave none of it open, something has moved, and all counts.
        let mut narrow = distance_m <= c.near_m;
        if narrow {
            self.call_witnesses(time, &arc, 2.0 * reading.half_width_rad * c.arc_share);
            narrow = self.along(time, &arc, reading).filter(kept).any(|spot| self.is_open(&spot));
        }
        for spot in self.along(time, &arc, reading).filter(kept) {
            if !narrow || self.is_open(&spot) {
                self.add(spot);
            }
        }
    }

    /// Something is within `distance_m`, nobody knows where: nothing can be confirmed or explained by that.
    fn add_too_near(&mut self, time: Time, reading: &Reading, distance_m: f64) {
        for share in [0.5, 1.0] {
            let arc = Arc::of(reading, share * distance_m);
            self.gather(&arc);
            for spot in self.along(time, &arc, reading) {
                self.add(spot);
            }
        }
    }

    /// Spots along an arc.
    fn along(&self, time: Time, arc: &Arc, reading: &Reading) -> impl Iterator<Item = Spot> + use<> {
        let arc = *arc;
        let width_rad = 2.0 * reading.half_width_rad * self.config.arc_share;
        let length_m = width_rad * arc.radius_m;
        let steps = (length_m / self.config.spacing_m).ceil().min(16.0);
        let count = if length_m > self.config.same_within_m { (steps as usize + 1).max(3) } else { 1 };
        (0..count).map(move |k| {
            let share = if count > 1 { k as f64 / (count - 1) as f64 - 0.5 } else { 0.0 };
            let (sin, cos) = math::sin_cos(share * width_rad);
            let look_x = cos * arc.axis_x - sin * arc.axis_y;
            let look_y = sin * arc.axis_x + cos * arc.axis_y;
            let (x_m, y_m) = (arc.x_m + arc.radius_m * look_x, arc.y_m + arc.radius_m * look_y);
            Spot { x_m, y_m, look_x, look_y, arc, seen: time, confirmations: 1 }
        })
    }

    /// Confirms every spot on an arc; answers the best one that explains it.
    fn confirm(&mut self, time: Time, arc: &Arc) -> Option<(f64, f64)> {
        let c = self.config;
        let mut best: Option<(u8, f64, f64)> = None;
        let mut grown = None;
        for &k in &self.about {
            let mut spot = self.spots[k];
            let moved = !near((spot.arc.x_m, spot.arc.y_m), (arc.x_m, arc.y_m), c.confirmed_from_m);
            // A new spot stands for the stretch of arc around it: where a second arc crosses that stretch is the place.
            if moved && spot.confirmations == 1 && arc.meets(spot.x_m, spot.y_m, c.spacing_m) {
                let at = (spot.x_m, spot.y_m);
                if let Some((x_m, y_m)) = spot.arc.crossing(arc, at).filter(|&p| near(p, at, c.spacing_m)) {
                    (spot.x_m, spot.y_m) = (x_m, y_m);
                }
            }
            if !arc.meets(spot.x_m, spot.y_m, c.on_arc_within_m) {
                continue;
            }
            let away_m = math::hypot(spot.x_m - arc.x_m, spot.y_m - arc.y_m).max(1e-6);
            (spot.look_x, spot.look_y) = ((spot.x_m - arc.x_m) / away_m, (spot.y_m - arc.y_m) / away_m);
            spot.seen = time;
            if moved && spot.confirmations < c.most_confirmations {
                spot.arc = *arc;
                spot.confirmations += 1;
                if spot.confirmations == c.explains_from {
                    grown = Some((spot.x_m, spot.y_m));
                }
            }
            if spot.confirmations >= c.explains_from && best.is_none_or(|(most, ..)| spot.confirmations > most) {
                best = Some((spot.confirmations, spot.x_m, spot.y_m));
            }
            self.spots.set(k, spot);
        }
        if let Some(at) = grown {
            // What came of earlier arcs through it is explained now, too.
            self.spots.retain(|spot| {
                spot.confirmations >= c.explains_from
                    || near(at, (spot.x_m, spot.y_m), c.explained_within_m)
                    || !spot.arc.meets(at.0, at.1, c.on_arc_within_m)
            });
            self.gather(arc);
        }
        best.map(|(_, x_m, y_m)| (x_m, y_m))
    }

    /// Adds a spot of the arc whose surroundings were gathered.
    fn add(&mut self, new: Spot) {
        let EchoMemory { spots, about, config, .. } = self;
        let same = |k: usize| near((spots[k].x_m, spots[k].y_m), (new.x_m, new.y_m), config.same_within_m);
        if let Some(k) = about.iter().copied().find(|&k| same(k)) {
            // The place stays: the false end of an arc that moves along with the body must not carry its spot along.
            spots.set(k, Spot { seen: new.seen, ..spots[k] });
            return;
        }
        let k = spots.len();
        if spots.push(new) {
            about.push(k);
        } else {
            self.lost += 1;
        }
    }
}
