//! The rules of the memory, and the body that it is kept for.

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
