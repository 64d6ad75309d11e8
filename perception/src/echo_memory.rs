//! Where echoes came from during the last seconds: bounded, in the odometry frame.
//!
//! A reading of a ranger with a cone tells three things: *something* lies on the arc at that distance; nothing lies
//! nearer within the cone; nothing is known of what lies behind. So each reading adds spots along its arc, and takes
//! away spots of older readings that lie nearer than it, well inside its cone, and are looked at from about the side
//! they were seen from (a smooth wall that is looked at askance throws the sound away and seems to be gone). A spot that
//! was confirmed needs to be denied as often. Where the body stands there is nothing else.

use messages::{Beam, Echo, Ranges};
use runtime::{Time, math};
use schemars::JsonSchema;
use serde::Deserialize;

/// Rules of the memory.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MemoryConfig {
    /// How long a spot is remembered that nothing confirms or denies [s].
    pub keep_s: f64,
    /// Spots farther away from the body than this are forgotten [m].
    pub keep_within_m: f64,
    /// Most spots.
    pub capacity: usize,
    /// Spots along an arc stand no farther apart than this [m].
    pub spacing_m: f64,
    /// A new spot this near to an old one confirms it [m].
    pub same_within_m: f64,
    /// A reading denies spots that lie nearer than it by more than this [m].
    pub denies_beyond_m: f64,
    /// Share of the cone's half width within which a reading can deny.
    pub denies_within_share: f64,
    /// A reading denies only what was seen from within this angle of its own line of sight [rad].
    pub denies_askance_rad: f64,
    /// Most confirmations that count.
    pub most_confirmations: u8,
    /// How long before its time stamp a reading was taken, on average: a Pioneer's pings are gathered for 100 ms [s].
    pub heard_before_s: f64,
}

impl Default for MemoryConfig {
    fn default() -> MemoryConfig {
        MemoryConfig {
            keep_s: 10.0,
            keep_within_m: 1.5,
            capacity: 256,
            spacing_m: 0.06,
            same_within_m: 0.03,
            denies_beyond_m: 0.08,
            denies_within_share: 0.7,
            denies_askance_rad: 0.5,
            most_confirmations: 3,
            heard_before_s: 0.05,
        }
    }
}

impl MemoryConfig {
    /// Whether every setting is within its bounds; else which is not.
    pub fn check(&self) -> Result<(), String> {
        for (key, value) in [
            ("keep_s", self.keep_s),
            ("keep_within_m", self.keep_within_m),
            ("spacing_m", self.spacing_m),
            ("same_within_m", self.same_within_m),
            ("denies_beyond_m", self.denies_beyond_m),
            ("denies_within_share", self.denies_within_share),
            ("denies_askance_rad", self.denies_askance_rad),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{key} = {value} must be a number greater than zero"));
            }
        }
        if !(0.0..=1.0).contains(&self.heard_before_s) {
            return Err(format!("heard_before_s = {} must be 0 to 1", self.heard_before_s));
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
    /// Unit vector of the line of sight that it was seen along.
    look_x: f64,
    look_y: f64,
    seen: Time,
    confirmations: u8,
}

/// The memory.
#[derive(Debug)]
pub struct EchoMemory {
    spots: Vec<Spot>,
    config: MemoryConfig,
    cos_askance: f64,
    lost: u64,
}

impl EchoMemory {
    /// Empty, with all the room it will ever take.
    pub fn new(config: MemoryConfig) -> EchoMemory {
        let cos_askance = math::cos(config.denies_askance_rad);
        EchoMemory { spots: Vec::with_capacity(config.capacity), config, cos_askance, lost: 0 }
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
        self.deny(&reading);
        if let Some(distance_m) = reading.echo_m.filter(|&d| d <= self.config.keep_within_m) {
            self.add_arc(time, &reading, distance_m);
        }
    }

    /// Forgets what is old, far away, or where the body stands.
    pub fn tidy(&mut self, now: Time, place: &Place, body: &Outline) {
        let c = self.config;
        self.spots.retain(|spot| {
            let (x_m, y_m) = place.inward(spot.x_m, spot.y_m);
            let under_body = x_m < body.ahead_m && x_m > -body.behind_m && y_m.abs() < body.half_width_m;
            let far = x_m * x_m + y_m * y_m > c.keep_within_m * c.keep_within_m;
            !under_body && !far && now.since(spot.seen) <= c.keep_s
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

    fn deny(&mut self, reading: &Reading) {
        let c = &self.config;
        let reach_m = reading.free_m - c.denies_beyond_m;
        if reach_m <= 0.0 {
            return;
        }
        let cos_sure = math::cos(reading.half_width_rad * c.denies_within_share);
        let cos_askance = self.cos_askance;
        self.spots.retain_mut(|spot| {
            let (dx, dy) = (spot.x_m - reading.x_m, spot.y_m - reading.y_m);
            let along = dx * reading.axis_x + dy * reading.axis_y;
            if along <= 0.0 || along > reach_m {
                return true;
            }
            let distance_m = math::hypot(dx, dy);
            let denied = distance_m < reach_m
                && along >= cos_sure * distance_m
                && dx * spot.look_x + dy * spot.look_y >= cos_askance * distance_m;
            if denied {
                spot.confirmations -= 1;
            }
            spot.confirmations > 0
        });
    }

    fn add_arc(&mut self, time: Time, reading: &Reading, distance_m: f64) {
        let width_rad = 2.0 * reading.half_width_rad;
        let steps = (width_rad * distance_m / self.config.spacing_m).ceil().min(16.0);
        let count = if steps > 0.0 { (steps as usize + 1).max(3) } else { 1 };
        for k in 0..count {
            let share = if count > 1 { k as f64 / (count - 1) as f64 - 0.5 } else { 0.0 };
            let (sin, cos) = math::sin_cos(share * width_rad);
            let look_x = cos * reading.axis_x - sin * reading.axis_y;
            let look_y = sin * reading.axis_x + cos * reading.axis_y;
            let (x_m, y_m) = (reading.x_m + distance_m * look_x, reading.y_m + distance_m * look_y);
            self.add(Spot { x_m, y_m, look_x, look_y, seen: time, confirmations: 1 });
        }
    }

    fn add(&mut self, new: Spot) {
        let same_sq = self.config.same_within_m * self.config.same_within_m;
        let near = |old: &&mut Spot| {
            let (dx, dy) = (old.x_m - new.x_m, old.y_m - new.y_m);
            // Spots of one reading do not confirm each other.
            dx * dx + dy * dy <= same_sq && old.seen != new.seen
        };
        if let Some(old) = self.spots.iter_mut().find(near) {
            let confirmations = (old.confirmations + 1).min(self.config.most_confirmations);
            *old = Spot { confirmations, ..new };
        } else if self.spots.len() < self.spots.capacity() {
            self.spots.push(new);
        } else {
            self.lost += 1;
        }
    }
}

/// A beam in the odometry frame.
struct Reading {
    x_m: f64,
    y_m: f64,
    axis_x: f64,
    axis_y: f64,
    half_width_rad: f64,
    /// Where the echo came from, if there was one.
    echo_m: Option<f64>,
    /// Nothing is nearer than this.
    free_m: f64,
}

impl Reading {
    fn of(ranges: &Ranges, beam: &Beam, place: &Place) -> Option<Reading> {
        let (min_m, max_m) = (f64::from(ranges.min_range_m), f64::from(ranges.max_range_m));
        let range_m = f64::from(beam.range_m);
        let (echo_m, free_m) = match beam.echo {
            e if e == Echo::Value as u32 && range_m >= 0.0 => (Some(range_m), range_m),
            e if e == Echo::TooNear as u32 => (Some(min_m), 0.0),
            e if e == Echo::Clear as u32 => (None, max_m),
            _ => return None,
        };
        let (origin_x, origin_y) = (f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
        let half_width_rad = 0.5 * f64::from(ranges.beam_width_rad);
        let numbers = [origin_x, origin_y, f64::from(beam.bearing_rad), half_width_rad, free_m];
        if !numbers.iter().all(|n| n.is_finite()) || echo_m.is_some_and(|m| !m.is_finite()) {
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
            echo_m,
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
        for k in 0..9 {
            memory.hear(Time::from_nanos(k), &home(), &laser, &beam(0.0, 0.6, Echo::Value));
        }
        let centre = |memory: &EchoMemory| beams_at(memory, &home()).iter().any(|b| b.bearing_rad.abs() < 1e-3);
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.0, Echo::Clear));
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.0, Echo::Clear));
        assert!(centre(&memory));
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.0, Echo::Clear));
        assert!(!centre(&memory));
    }

    #[test]
    fn a_wall_that_is_looked_at_askance_is_not_thought_away() {
        let mut memory = memory();
        let laser = Ranges { beam_width_rad: 0.0, ..RANGES };
        memory.hear(Time::ZERO, &home(), &laser, &beam(0.0, 0.6, Echo::Value));
        // The same spot along a line of sight that differs by a radian.
        let (sin, cos) = math::sin_cos(1.0);
        let elsewhere = Place::new(0.6 - 0.6 * cos, -0.6 * sin, 0.0);
        let wide = Ranges { beam_width_rad: 0.5, ..RANGES };
        memory.hear(Time::ZERO, &elsewhere, &wide, &beam(1.0, 0.0, Echo::Clear));
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
        kept.tidy(Time::from_seconds(9.0), &home(), &BODY);
        assert_eq!(kept.len(), 1);
        for (s, place) in [(0.0, Place::new(0.5, 0.0, 0.0)), (11.0, home()), (0.0, Place::new(-1.0, 0.0, 0.0))] {
            let mut memory = fill();
            memory.tidy(Time::from_seconds(s), &place, &BODY);
            assert!(memory.is_empty());
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
