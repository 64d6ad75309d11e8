//! The force of each sector around the robot (S1): M = (a − b·d)/T_s, with a = b·d_max.
//!
//! d is a reading as the disc gives it, T_s the threshold of the sector that its bearing falls into. M > 1 is acted
//! upon, and M ≤ 1 is not, so T_s says from which distance on: d < d_max − T_s/b. No vector sums, no odometry.

use messages::{Beam, Echo, FreeSectors};
use runtime::math::wrap_angle;
use schemars::JsonSchema;
use serde::Deserialize;

/// Most sectors, as [`FreeSectors`] has room for.
pub const MAX_SECTORS: usize = 16;

/// Bearings that share a threshold, counter-clockwise from `from_rad` to `to_rad`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sector {
    /// Rightmost bearing [rad].
    pub from_rad: f64,
    /// Leftmost bearing [rad].
    pub to_rad: f64,
    /// T_s; the smaller, the more critical the sector.
    pub threshold: f64,
}

impl Sector {
    /// Bearing of its middle [rad].
    pub fn middle_rad(&self) -> f64 {
        0.5 * (self.from_rad + self.to_rad)
    }

    fn holds(&self, bearing_rad: f64) -> bool {
        bearing_rad >= self.from_rad && bearing_rad < self.to_rad
    }
}

/// What is known of each sector, rightmost first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forces {
    /// Greatest M among the sector's beams; 0 when nothing is within d_max.
    pub force: [f64; MAX_SECTORS],
    /// Distance of the nearest echo within d_max, else d_max [m].
    pub nearest_m: [f64; MAX_SECTORS],
    /// Whether a beam of the sector told anything.
    pub known: [bool; MAX_SECTORS],
    /// Age of the beam that spoke for the sector [s].
    pub age_s: [f64; MAX_SECTORS],
    /// Number of sectors.
    pub count: usize,
}

impl Forces {
    /// Forces of `beams` no older than `max_age_s`. `a`, `b_per_m` as in M = (a − b·d)/T_s.
    pub fn of(beams: &[Beam], sectors: &[Sector], a: f64, b_per_m: f64, max_age_s: f64) -> Forces {
        let count = sectors.len().min(MAX_SECTORS);
        let mut forces = Forces {
            force: [0.0; MAX_SECTORS],
            nearest_m: [a / b_per_m; MAX_SECTORS],
            known: [false; MAX_SECTORS],
            age_s: [f64::INFINITY; MAX_SECTORS],
            count,
        };
        for beam in beams {
            let magnitude = match beam.echo {
                e if e == Echo::Value as u32 && beam.range_m >= 0.0 => (a - b_per_m * f64::from(beam.range_m)).max(0.0),
                e if e == Echo::TooNear as u32 => a,
                e if e == Echo::Clear as u32 => 0.0,
                _ => continue,
            };
            let bearing_rad = wrap_angle(f64::from(beam.bearing_rad));
            let fresh = f64::from(beam.age_s) <= max_age_s;
            if let Some(k) = sectors[..count].iter().position(|sector| sector.holds(bearing_rad)).filter(|_| fresh) {
                let force = magnitude / sectors[k].threshold;
                if !forces.known[k] || force > forces.force[k] {
                    forces.age_s[k] = f64::from(beam.age_s);
                }
                forces.known[k] = true;
                forces.force[k] = forces.force[k].max(force);
                forces.nearest_m[k] = forces.nearest_m[k].min((a - magnitude) / b_per_m);
            }
        }
        forces
    }

    /// Whether sector `k` holds something to act upon.
    pub fn acts(&self, k: usize) -> bool {
        self.known[k] && self.force[k] > 1.0
    }

    /// Whether sector `k` is known to be free.
    pub fn is_free(&self, k: usize) -> bool {
        self.known[k] && self.force[k] <= 1.0
    }

    /// Free sectors, and the longest run of neighbours among them.
    pub fn free_sectors(&self, sectors: &[Sector]) -> FreeSectors {
        let mut out = FreeSectors { sectors: self.count as u32, force: self.force, ..FreeSectors::default() };
        let mut run = 0;
        for k in 0..self.count {
            run = if self.is_free(k) { run + 1 } else { 0 };
            if run > 0 {
                out.mask |= 1 << k;
                out.free += 1;
            }
            if run > out.longest_run {
                out.longest_run = run;
                let first = k + 1 - run as usize;
                out.run_bearing_rad = 0.5 * (sectors[first].from_rad + sectors[k].to_rad);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sectors() -> Vec<Sector> {
        [(-1.5, -0.5), (-0.5, 0.5), (0.5, 1.5)]
            .map(|(from_rad, to_rad)| Sector { from_rad, to_rad, threshold: 2.0 })
            .to_vec()
    }

    fn beam(bearing_rad: f32, range_m: f32, echo: Echo) -> Beam {
        Beam { origin_x_m: 0.0, origin_y_m: 0.0, bearing_rad, range_m, age_s: 0.1, echo: echo as u32 }
    }

    fn forces(beams: &[Beam]) -> Forces {
        Forces::of(beams, &sectors(), 3.0, 1.0, 1.0)
    }

    #[test]
    fn the_force_is_one_where_the_threshold_says_and_zero_from_the_greatest_distance_on() {
        assert_eq!(forces(&[beam(0.0, 1.0, Echo::Value)]).force[1], 1.0);
        assert!(forces(&[beam(0.0, 0.99, Echo::Value)]).acts(1));
        assert!(!forces(&[beam(0.0, 1.01, Echo::Value)]).acts(1));
        assert_eq!(forces(&[beam(0.0, 3.0, Echo::Value)]).force[1], 0.0);
        assert_eq!(forces(&[beam(0.0, 4.5, Echo::Value)]).force[1], 0.0);
    }

    #[test]
    fn the_nearest_beam_of_a_sector_speaks_for_it() {
        let forces = forces(&[beam(1.0, 2.0, Echo::Value), beam(1.2, 0.5, Echo::Value), beam(0.8, 0.0, Echo::Clear)]);
        assert_eq!(forces.force[2], 1.25);
    }

    #[test]
    fn a_sector_without_a_reading_is_neither_free_nor_acted_upon() {
        let stale = Beam { age_s: 2.0, ..beam(0.0, 0.2, Echo::Value) };
        let none = forces(&[stale, beam(1.0, 0.2, Echo::Off), beam(-1.0, f32::NAN, Echo::Value)]);
        for k in 0..3 {
            assert!(!none.acts(k) && !none.is_free(k));
        }
        assert_eq!(none.free_sectors(&sectors()).free, 0);
    }

    #[test]
    fn beams_behind_belong_to_no_sector() {
        assert_eq!(forces(&[beam(3.0, 0.1, Echo::Value)]).known, [false; MAX_SECTORS]);
    }

    #[test]
    fn free_sectors_tell_the_longest_run_and_where_it_points() {
        let forces = forces(&[beam(-1.0, 0.2, Echo::Value), beam(0.0, 0.0, Echo::Clear), beam(1.0, 2.5, Echo::Value)]);
        let free = forces.free_sectors(&sectors());
        assert_eq!((free.mask, free.free, free.longest_run, free.sectors), (0b110, 2, 2, 3));
        assert_eq!(free.run_bearing_rad, 0.5);
    }
}
