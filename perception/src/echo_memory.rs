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

use messages::{Beam, Echo, Ranges};
use runtime::{Time, math};
use schemars::JsonSchema;
use serde::Deserialize;

/// Rules of the memory.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MemoryConfig {
    /// How long a spot is remembered that explains arcs, when nothing confirms or denies it any more [s].
    pub keep_s: f64,
    /// The same for every other spot [s].
    pub keep_unexplained_s: f64,
    /// Spots farther away from the body than this are forgotten [m].
    pub keep_within_m: f64,
    /// Most spots.
    pub capacity: usize,
    /// Spots along an arc stand no farther apart than this [m].
    pub spacing_m: f64,
    /// No spot is added this near to another one [m].
    pub same_within_m: f64,
    /// A spot this near to an arc is on it [m].
    pub on_arc_within_m: f64,
    /// A reading denies spots that lie nearer than it by more than this [m] …
    pub denies_beyond_m: f64,
    /// … and this share of it.
    pub denies_beyond_share: f64,
    /// Share of the cone's half width that an arc takes up.
    pub arc_share: f64,
    /// Share of the cone's half width within which a reading can deny.
    pub denies_within_share: f64,
    /// A reading denies only what was seen from within this angle of its own line of sight [rad].
    pub denies_askance_rad: f64,
    /// An echo confirms a spot when the disc has moved by this since the last one that did [m].
    pub confirmed_from_m: f64,
    /// A spot with so many confirmations explains the arcs through it.
    pub explains_from: u8,
    /// What is left of an explained arc on either side of the spot [m].
    pub explained_within_m: f64,
    /// Most confirmations that count.
    pub most_confirmations: u8,
    /// Of an arc nearer than this, only what earlier readings leave open is kept [m].
    pub near_m: f64,
    /// Readings older than this leave everything open [s].
    pub recall_s: f64,
    /// How long before its time stamp a reading was taken, on average: a Pioneer's pings are gathered for 100 ms [s].
    pub heard_before_s: f64,
}

impl Default for MemoryConfig {
    fn default() -> MemoryConfig {
        MemoryConfig {
            keep_s: 10.0,
            keep_unexplained_s: 5.0,
            keep_within_m: 1.5,
            capacity: 256,
            spacing_m: 0.05,
            same_within_m: 0.025,
            on_arc_within_m: 0.012,
            denies_beyond_m: 0.015,
            denies_beyond_share: 0.03,
            arc_share: 1.0,
            denies_within_share: 0.9,
            denies_askance_rad: 1.2,
            confirmed_from_m: 0.03,
            explains_from: 3,
            explained_within_m: 0.03,
            most_confirmations: 3,
            near_m: 0.35,
            recall_s: 10.0,
            heard_before_s: 0.05,
        }
    }
}

/// A ranger that clamps reads no less than its least range: within this of it nothing is known but "nearer" [m].
const TOO_NEAR_M: f64 = 0.002;

impl MemoryConfig {
    /// Whether every setting is within its bounds; else which is not.
    pub fn check(&self) -> Result<(), String> {
        for (key, value) in [
            ("keep_s", self.keep_s),
            ("keep_unexplained_s", self.keep_unexplained_s),
            ("on_arc_within_m", self.on_arc_within_m),
            ("keep_within_m", self.keep_within_m),
            ("spacing_m", self.spacing_m),
            ("same_within_m", self.same_within_m),
            ("denies_beyond_m", self.denies_beyond_m),
            ("denies_askance_rad", self.denies_askance_rad),
            ("confirmed_from_m", self.confirmed_from_m),
            ("explained_within_m", self.explained_within_m),
            ("near_m", self.near_m),
            ("recall_s", self.recall_s),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{key} = {value} must be a number greater than zero"));
            }
        }
        for (key, value) in [
            ("heard_before_s", self.heard_before_s),
            ("denies_beyond_share", self.denies_beyond_share),
            ("denies_within_share", self.denies_within_share),
            ("arc_share", self.arc_share),
        ] {
            if !(0.0..=1.0).contains(&value) {
                return Err(format!("{key} = {value} must be 0 to 1"));
            }
        }
        if !(16..=4096).contains(&self.capacity) {
            return Err(format!("capacity = {} must be 16 to 4096 spots", self.capacity));
        }
        if self.most_confirmations == 0 {
            return Err("most_confirmations = 0 would forget every echo at once; write 1 or more".into());
        }
        Ok(())
    }
}

/// A place and heading in the odometry frame, ready for use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// x [m].
    pub x_m: f64,
    /// y [m].
    pub y_m: f64,
    /// Sine and cosine of the heading.
    pub sin: f64,
    /// Cosine of the heading.
    pub cos: f64,
}

impl Place {
    /// At (`x_m`, `y_m`), heading `heading_rad`.
    pub fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Place {
        let (sin, cos) = math::sin_cos(heading_rad);
        Place { x_m, y_m, sin, cos }
    }

    fn out(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        (self.x_m + self.cos * x_m - self.sin * y_m, self.y_m + self.sin * x_m + self.cos * y_m)
    }

    fn inward(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        (self.cos * dx + self.sin * dy, self.cos * dy - self.sin * dx)
    }
}

/// The body's rectangle, for what cannot be where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// From the centre of rotation to the front [m].
    pub ahead_m: f64,
    /// From the centre of rotation to the rear [m].
    pub behind_m: f64,
    /// To either side [m].
    pub half_width_m: f64,
}

/// A place where an echo may have come from.
#[derive(Debug, Clone, Copy)]
struct Spot {
    x_m: f64,
    y_m: f64,
    /// Unit vector of the line of sight that it was last seen along.
    look_x: f64,
    look_y: f64,
    /// The reading that it came from, or that confirmed it last.
    arc: Arc,
    seen: Time,
    confirmations: u8,
}

/// Where something is, by one reading: on this arc.
#[derive(Debug, Clone, Copy)]
struct Arc {
    x_m: f64,
    y_m: f64,
    axis_x: f64,
    axis_y: f64,
    cos_half: f64,
    radius_m: f64,
}

impl Arc {
    fn of(reading: &Reading, radius_m: f64) -> Arc {
        Arc {
            x_m: reading.x_m,
            y_m: reading.y_m,
            axis_x: reading.axis_x,
            axis_y: reading.axis_y,
            cos_half: math::cos(reading.half_width_rad),
            radius_m,
        }
    }

    /// Where two arcs cross, the place nearer to `at`; `None` where they run too much alike to say.
    fn crossing(&self, other: &Arc, at: (f64, f64)) -> Option<(f64, f64)> {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        let apart_sq = dx * dx + dy * dy;
        if apart_sq < 1e-6 {
            return None;
        }
        // Along the line of the centres, and to its side.
        let along = 0.5 + 0.5 * (self.radius_m * self.radius_m - other.radius_m * other.radius_m) / apart_sq;
        let side_sq = self.radius_m * self.radius_m / apart_sq - along * along;
        if side_sq <= 0.0 {
            return None;
        }
        let side = side_sq.sqrt();
        let place = |side: f64| (self.x_m + along * dx - side * dy, self.y_m + along * dy + side * dx);
        let (a, b) = (place(side), place(-side));
        let far_sq = |p: (f64, f64)| (p.0 - at.0) * (p.0 - at.0) + (p.1 - at.1) * (p.1 - at.1);
        let p = if far_sq(a) <= far_sq(b) { a } else { b };
        let (ux, uy) = (p.0 - self.x_m, p.1 - self.y_m);
        let (vx, vy) = (p.0 - other.x_m, p.1 - other.y_m);
        let sine = (ux * vy - uy * vx).abs() / (self.radius_m * other.radius_m).max(1e-9);
        (sine >= LEAST_CROSSING).then_some(p)
    }

    /// Whether the arc passes through a place.
    fn meets(&self, x_m: f64, y_m: f64, within_m: f64) -> bool {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        let along_m = dx * self.axis_x + dy * self.axis_y;
        if along_m <= 0.0 || along_m > self.radius_m + within_m {
            return false;
        }
        let away_m = math::hypot(dx, dy);
        (away_m - self.radius_m).abs() <= within_m && along_m >= self.cos_half * away_m
    }
}

/// What one reading said to be free: nothing nearer than `reach_m` well inside its cone.
#[derive(Debug, Clone, Copy)]
struct Free {
    time: Time,
    x_m: f64,
    y_m: f64,
    axis_x: f64,
    axis_y: f64,
    cos_sure: f64,
    reach_m: f64,
}

impl Free {
    /// Whether a place is said to be free by somebody who looked along about the unit vector (`look_x`, `look_y`).
    fn denies(&self, x_m: f64, y_m: f64, look_x: f64, look_y: f64, cos_askance: f64) -> bool {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        let along_m = dx * self.axis_x + dy * self.axis_y;
        if along_m <= 0.0 || along_m > self.reach_m {
            return false;
        }
        let away_m = math::hypot(dx, dy);
        away_m < self.reach_m && along_m >= self.cos_sure * away_m && dx * look_x + dy * look_y >= cos_askance * away_m
    }
}

/// Sine of the least angle at which two arcs cross rather than run alongside.
const LEAST_CROSSING: f64 = 0.1;

/// Readings that are recalled.
const RECALLED: usize = 512;
/// So many of them must deny a place before it counts as free: one may be a lost echo.
const DENIALS: usize = 2;

/// The memory.
#[derive(Debug)]
pub struct EchoMemory {
    spots: Vec<Spot>,
    /// The last readings, in a ring.
    recalled: Vec<Free>,
    next: usize,
    config: MemoryConfig,
    cos_askance: f64,
    lost: u64,
}

impl EchoMemory {
    /// Empty, with all the room it will ever take.
    pub fn new(config: MemoryConfig) -> EchoMemory {
        let cos_askance = math::cos(config.denies_askance_rad);
        let (spots, recalled) = (Vec::with_capacity(config.capacity), Vec::with_capacity(RECALLED));
        EchoMemory { spots, recalled, next: 0, config, cos_askance, lost: 0 }
    }

    /// Number of spots.
    pub fn len(&self) -> usize {
        self.spots.len()
    }

    /// Whether nothing is remembered.
    pub fn is_empty(&self) -> bool {
        self.spots.is_empty()
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
        for spot in &self.spots {
            let (x_m, y_m) = place.inward(spot.x_m, spot.y_m);
            each(Beam {
                origin_x_m: 0.0,
                origin_y_m: 0.0,
                bearing_rad: math::atan2(y_m, x_m) as f32,
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
        let cos_askance = self.cos_askance;
        self.spots.retain_mut(|spot| {
            if free.denies(spot.x_m, spot.y_m, spot.look_x, spot.look_y, cos_askance) {
                spot.confirmations -= 1;
            }
            spot.confirmations > 0
        });
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

    /// Whether earlier readings leave it open that something is at a new spot.
    fn is_open(&self, new: &Spot) -> bool {
        let denials = self
            .recalled
            .iter()
            .filter(|free| new.seen.since(free.time) <= self.config.recall_s)
            .filter(|free| free.denies(new.x_m, new.y_m, new.look_x, new.look_y, self.cos_askance))
            .take(DENIALS)
            .count();
        denials < DENIALS
    }

    fn add_arc(&mut self, time: Time, reading: &Reading, distance_m: f64) {
        let c = self.config;
        let arc = Arc::of(reading, distance_m);
        let known = self.confirm(time, &arc);
        let kept = |spot: &Spot| known.is_none_or(|known| near(known, (spot.x_m, spot.y_m), c.explained_within_m));
        // Something is on the arc: where earlier readings leave none of it open, something has moved, and all counts.
        let narrow =
            distance_m <= c.near_m && self.along(time, &arc, reading).filter(kept).any(|spot| self.is_open(&spot));
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
        for k in 0..self.spots.len() {
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
            self.spots[k] = spot;
        }
        if let Some(at) = grown {
            // What came of earlier arcs through it is explained now, too.
            self.spots.retain(|spot| {
                spot.confirmations >= c.explains_from
                    || near(at, (spot.x_m, spot.y_m), c.explained_within_m)
                    || !spot.arc.meets(at.0, at.1, c.on_arc_within_m)
            });
        }
        best.map(|(_, x_m, y_m)| (x_m, y_m))
    }

    fn add(&mut self, new: Spot) {
        let within_m = self.config.same_within_m;
        let same = |old: &&mut Spot| near((old.x_m, old.y_m), (new.x_m, new.y_m), within_m);
        if let Some(old) = self.spots.iter_mut().find(same) {
            // The place stays: the false end of an arc that moves along with the body must not carry its spot along.
            old.seen = new.seen;
            return;
        }
        if self.spots.len() < self.spots.capacity() {
            self.spots.push(new);
        } else {
            self.lost += 1;
        }
    }
}

fn near(a: (f64, f64), b: (f64, f64), within_m: f64) -> bool {
    let (dx, dy) = (a.0 - b.0, a.1 - b.1);
    dx * dx + dy * dy <= within_m * within_m
}

/// What a beam heard.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Heard {
    Nothing,
    /// Something at this distance [m].
    At(f64),
    /// Something nearer than can be measured, which is this [m].
    Within(f64),
}

/// A beam in the odometry frame.
struct Reading {
    x_m: f64,
    y_m: f64,
    axis_x: f64,
    axis_y: f64,
    half_width_rad: f64,
    echo: Heard,
    /// Nothing is nearer than this.
    free_m: f64,
}

impl Reading {
    fn of(ranges: &Ranges, beam: &Beam, place: &Place) -> Option<Reading> {
        let (min_m, max_m) = (f64::from(ranges.min_range_m), f64::from(ranges.max_range_m));
        let range_m = f64::from(beam.range_m);
        let (echo, free_m) = match beam.echo {
            e if e == Echo::TooNear as u32 || (e == Echo::Value as u32 && range_m < min_m + TOO_NEAR_M) => {
                (Heard::Within(min_m), 0.0)
            }
            e if e == Echo::Value as u32 && range_m >= 0.0 => (Heard::At(range_m), range_m),
            e if e == Echo::Clear as u32 => (Heard::Nothing, max_m),
            _ => return None,
        };
        let (origin_x, origin_y) = (f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
        let half_width_rad = 0.5 * f64::from(ranges.beam_width_rad);
        let numbers = [origin_x, origin_y, f64::from(beam.bearing_rad), half_width_rad, free_m, min_m];
        if !numbers.iter().all(|n| n.is_finite()) {
            return None;
        }
        let (x_m, y_m) = place.out(origin_x, origin_y);
        let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
        Some(Reading {
            x_m,
            y_m,
            axis_x: place.cos * cos - place.sin * sin,
            axis_y: place.sin * cos + place.cos * sin,
            half_width_rad,
            echo,
            free_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RANGES: Ranges = Ranges { min_range_m: 0.1, max_range_m: 5.0, beam_width_rad: 0.52, span_s: 0.3 };
    const BODY: Outline = Outline { ahead_m: 0.21, behind_m: 0.3, half_width_m: 0.2 };

    fn beam(bearing_rad: f32, range_m: f32, echo: Echo) -> Beam {
        Beam { origin_x_m: 0.0, origin_y_m: 0.0, bearing_rad, range_m, age_s: 0.0, echo: echo as u32 }
    }

    fn home() -> Place {
        Place::new(0.0, 0.0, 0.0)
    }

    fn memory() -> EchoMemory {
        EchoMemory::new(MemoryConfig::default())
    }

    fn beams_at(memory: &EchoMemory, place: &Place) -> Vec<Beam> {
        let mut beams = Vec::new();
        memory.each(Time::ZERO, place, |beam| beams.push(beam));
        beams
    }

    #[test]
    fn an_echo_is_remembered_along_its_arc() {
        let mut memory = memory();
        memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 0.6, Echo::Value));
        let beams = beams_at(&memory, &home());
        assert!(beams.len() >= 5);
        assert!(beams.iter().all(|b| (b.range_m - 0.6).abs() < 1e-6));
        let widest = beams.iter().map(|b| b.bearing_rad.abs()).fold(0.0, f32::max);
        assert!((widest - 0.26).abs() < 1e-6);
    }

    #[test]
    fn what_was_ahead_is_beside_after_a_turn_and_nearer_after_a_way() {
        let mut memory = memory();
        let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.6, Echo::Value));
        let turned = beams_at(&memory, &Place::new(0.0, 0.0, 1.0));
        assert!((turned[0].bearing_rad + 1.0).abs() < 1e-6);
        let nearer = beams_at(&memory, &Place::new(0.2, 0.0, 0.0));
        assert!((nearer[0].range_m - 0.4).abs() < 1e-6);
    }

    #[test]
    fn a_longer_reading_along_the_same_line_takes_the_spot_away() {
        let mut memory = memory();
        memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 0.6, Echo::Value));
        memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 1.4, Echo::Value));
        let left: Vec<f32> =
            beams_at(&memory, &home()).iter().filter(|b| b.range_m < 1.0).map(|b| b.bearing_rad).collect();
        assert!(left.iter().all(|bearing| bearing.abs() > 0.7 * 0.26), "only the arc's ends stay: {left:?}");
    }

    #[test]
    fn a_confirmed_spot_needs_to_be_denied_as_often() {
        let mut memory = memory();
        let laser = Ranges { beam_width_rad: 0.02, ..RANGES };
        for k in 0..9_u32 {
            let x_m = 0.04 * f64::from(k);
            let place = Place::new(x_m, 0.0, 0.0);
            memory.hear(Time::from_nanos(u64::from(k)), &place, &laser, &beam(0.0, (0.6 - x_m) as f32, Echo::Value));
        }
        let centre = |memory: &EchoMemory| beams_at(memory, &home()).iter().any(|b| b.bearing_rad.abs() < 1e-3);
        for _ in 0..2 {
            memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.0, Echo::Clear));
        }
        assert!(centre(&memory));
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.0, Echo::Clear));
        assert!(!centre(&memory));
    }

    #[test]
    fn a_body_at_rest_confirms_nothing() {
        let mut memory = memory();
        let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
        for k in 0..9 {
            memory.hear(Time::from_nanos(k), &home(), &laser, &beam(0.0, 0.6, Echo::Value));
        }
        memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 0.0, Echo::Clear));
        assert!(memory.is_empty());
    }

    #[test]
    fn arcs_that_cross_at_a_jamb_leave_the_door_beside_it_open() {
        let mut memory = memory();
        // A jamb at (1, 0.25), heard by a disc that looks 30° to the left while the body moves on.
        let jamb_from = |x_m: f64| math::hypot(1.0 - x_m, 0.25);
        for k in 0..12_u32 {
            let x_m = 0.3 + 0.025 * f64::from(k);
            let place = Place::new(x_m, 0.0, 0.0);
            let heard = beam(0.52, jamb_from(x_m) as f32, Echo::Value);
            memory.hear(Time::from_nanos(u64::from(k)), &place, &RANGES, &heard);
        }
        // The last arc's inner end lies 15° to the left, in the door: it is not among the spots.
        let last = Place::new(0.575, 0.0, 0.0);
        let fresh: Vec<Beam> =
            beams_at(&memory, &last).into_iter().filter(|b| (b.range_m - 0.493).abs() < 0.01).collect();
        assert!(fresh.iter().any(|b| (b.bearing_rad - 0.532).abs() < 0.06), "the jamb is there");
        assert!(fresh.iter().all(|b| b.bearing_rad > 0.4), "its false images are not: {fresh:?}");
    }

    #[test]
    fn a_wall_that_is_looked_at_askance_is_not_thought_away() {
        let mut memory = memory();
        let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.6, Echo::Value));
        // The same spot along a line of sight that differs by a right angle.
        let (sin, cos) = math::sin_cos(1.5);
        let elsewhere = Place::new(0.6 - 0.6 * cos, -0.6 * sin, 0.0);
        let wide = Ranges { beam_width_rad: 0.5, ..RANGES };
        memory.hear(Time::ZERO, &elsewhere, &wide, &beam(1.5, 0.0, Echo::Clear));
        assert_eq!(memory.len(), 1);
    }

    #[test]
    fn nothing_stays_where_the_body_stands_nor_for_ever_nor_far_away() {
        let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
        let fill = || {
            let mut memory = memory();
            memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.6, Echo::Value));
            memory
        };
        let mut kept = fill();
        kept.tidy(Time::from_seconds(4.0), &home(), &BODY);
        assert_eq!(kept.len(), 1);
        for (s, place) in [(0.0, Place::new(0.5, 0.0, 0.0)), (6.0, home()), (0.0, Place::new(-1.0, 0.0, 0.0))] {
            let mut memory = fill();
            memory.tidy(Time::from_seconds(s), &place, &BODY);
            assert!(memory.is_empty());
        }
    }

    #[test]
    fn what_is_nearer_than_can_be_measured_is_taken_to_be_very_near() {
        for too_near in [beam(0.0, 0.0, Echo::TooNear), beam(0.0, 0.1, Echo::Value)] {
            let mut memory = memory();
            memory.hear(Time::ZERO, &home(), &RANGES, &too_near);
            assert!(beams_at(&memory, &home()).iter().any(|b| (b.range_m - 0.05).abs() < 1e-6));
            assert!(beams_at(&memory, &home()).iter().any(|b| (b.range_m - 0.1).abs() < 1e-6));
            assert!(!memory.is_empty());
        }
    }

    #[test]
    fn a_beam_that_tells_nothing_changes_nothing() {
        let mut memory = memory();
        memory.hear(Time::ZERO, &home(), &RANGES, &beam(0.0, 0.6, Echo::Value));
        let before = memory.len();
        for silent in
            [beam(0.0, 3.0, Echo::LinkLost), beam(0.0, f32::NAN, Echo::Value), beam(f32::NAN, 3.0, Echo::Value)]
        {
            memory.hear(Time::ZERO, &home(), &RANGES, &silent);
        }
        assert_eq!(memory.len(), before);
    }

    proptest! {
        #[test]
        fn the_memory_never_grows_beyond_its_room(
            readings in prop::collection::vec((-3.0..3.0f32, 0.0..2.0f32, 0..7u32, -1.0..1.0f64, -3.0..3.0f64), 0..300),
        ) {
            let mut memory = EchoMemory::new(MemoryConfig { capacity: 64, ..MemoryConfig::default() });
            for (bearing_rad, range_m, echo, x, heading) in readings {
                let beam = Beam { echo, ..beam(bearing_rad, range_m, Echo::Value) };
                let place = Place::new(x, 0.0, heading);
                memory.hear(Time::ZERO, &place, &RANGES, &beam);
                memory.tidy(Time::ZERO, &place, &BODY);
                prop_assert!(memory.len() <= 64);
            }
            let ok = beams_at(&memory, &home()).iter().all(|b| b.range_m.is_finite() && b.bearing_rad.is_finite());
            prop_assert!(ok);
        }
    }
}
