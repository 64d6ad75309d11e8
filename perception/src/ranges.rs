//! Any ranger as `Ranges` in the body frame, without the beams that see the body itself.
//!
//! Reads `scan` (a laser's own message, whose mount it carries) or `ranger` (the ranges of any
//! other, in the body frame already), whichever is wired; writes `ranges`. Beam k of a scan starts at the sensor's place and has the bearing
//! ψ ± (φ₀ + k·Δφ), minus where the sensor hangs upside down. Its age counts from the newest beam, whose time is the
//! sample's stamp: stamp = scan's + (n − 1)·Δt.
//!
//! *Footprint filter*: what is measured within the body's rectangle, and `margin_m` around it, is the body: its cables,
//! its arm. Such a beam says `off`, which is not `clear`: nobody looks there. *Field*: beams outside `field_rad`
//! about `field_middle_rad` say `off` too (S2 cuts out a region ahead).
//!
//! ```toml
//! [nodes.ranges]
//! type = "ranges"
//! trigger = "scan"
//! deadline_ms = 20
//! priority = 61
//! reads.scan = "/drivers/laser/scan"
//! config = { margin_m = 0.02 }
//! ```

use messages::{Beam, Echo, LaserScan, Ranges, ScanBeam};
use runtime::{Body, Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer, math};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// Settings of [`BodyRanges`].
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RangesConfig {
    /// What is measured this near to the body's rectangle, or within, is the body itself; negative: let it pass [m].
    pub margin_m: f64,
    /// Opening angle of the field that counts [rad].
    pub field_rad: f64,
    /// Middle of that field in the body frame [rad].
    pub field_middle_rad: f64,
    /// Most beams; those behind are cut off.
    pub most_beams: usize,
}

impl Default for RangesConfig {
    fn default() -> RangesConfig {
        RangesConfig { margin_m: 0.0, field_rad: TAU, field_middle_rad: 0.0, most_beams: 1200 }
    }
}

impl RangesConfig {
    fn check(&self) -> Result<(), String> {
        if !(self.margin_m.is_finite() && self.margin_m.abs() <= 10.0) {
            return Err(format!("margin_m = {} must be a number, −10 to 10", self.margin_m));
        }
        if !(self.field_rad > 0.0 && self.field_rad <= TAU) {
            return Err(format!("field_rad = {} must be greater than 0 and no more than 2π", self.field_rad));
        }
        if !(-PI..=PI).contains(&self.field_middle_rad) {
            return Err(format!("field_middle_rad = {} must be −π to π", self.field_middle_rad));
        }
        if !(1..=8192).contains(&self.most_beams) {
            return Err(format!("most_beams = {} must be 1 to 8192", self.most_beams));
        }
        Ok(())
    }
}

/// The node.
pub struct BodyRanges {
    scan: Reader<LaserScan>,
    ranger: Reader<Ranges>,
    out: Writer<Ranges>,
    beams: Vec<Beam>,
    filter: Filter,
    most_beams: usize,
}

impl Node for BodyRanges {
    const TYPE: &'static str = "ranges";
    const LAYER: Layer = Layer::Perception;
    type Config = RangesConfig;

    fn open(ports: &mut Ports, config: RangesConfig) -> Result<BodyRanges, OpenError> {
        config.check().map_err(OpenError::config)?;
        Ok(BodyRanges {
            filter: Filter::new(ports.body(), &config),
            scan: ports.optional_reader("scan")?,
            ranger: ports.optional_reader("ranger")?,
            out: ports.writer_with_tail("ranges", config.most_beams)?,
            beams: Vec::with_capacity(config.most_beams),
            most_beams: config.most_beams,
        })
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        while let Some(sample) = self.scan.next_unread() {
            self.beams.clear();
            let count = sample.tail.len().min(self.most_beams);
            self.beams.extend((0..count).map(|k| beam_of(sample.message, &sample.tail[..count], k)));
            let (stamp, head) = (sample.stamp.after_s(span_s(sample.message, count)), head_of(sample.message, count));
            self.filter.apply(&mut self.beams);
            self.out.write_with_tail(stamp, &head, &self.beams);
        }
        while let Some(sample) = self.ranger.next_unread() {
            self.beams.clear();
            self.beams.extend(sample.tail.iter().take(self.most_beams));
            let (stamp, head) = (sample.stamp, *sample.message);
            self.filter.apply(&mut self.beams);
            self.out.write_with_tail(stamp, &head, &self.beams);
        }
        Ok(())
    }
}

/// From the first to the last of `count` beams [s].
fn span_s(scan: &LaserScan, count: usize) -> f64 {
    let span_s = count.saturating_sub(1) as f64 * f64::from(scan.time_increment_s);
    if span_s.is_finite() { span_s.max(0.0) } else { 0.0 }
}

fn head_of(scan: &LaserScan, count: usize) -> Ranges {
    Ranges {
        min_range_m: scan.range_min_m,
        max_range_m: scan.range_max_m,
        beam_width_rad: 0.0,
        span_s: span_s(scan, count) as f32,
    }
}

/// Beam `k` of a scan in the body frame.
fn beam_of(scan: &LaserScan, beams: &[ScanBeam], k: usize) -> Beam {
    let beam = &beams[k];
    let last = beams.len() - 1;
    Beam {
        origin_x_m: scan.x_m,
        origin_y_m: scan.y_m,
        bearing_rad: scan.bearing_rad(k) as f32,
        range_m: beam.range_m,
        age_s: (last - k.min(last)) as f32 * scan.time_increment_s.max(0.0),
        echo: u32::from(beam.echo),
    }
}

/// What does not count: the body itself, and what is outside the field.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Filter {
    ahead_m: f64,
    behind_m: f64,
    half_width_m: f64,
    /// Nothing of the rectangle is farther from the body's origin.
    reach_m: f64,
    half_field_rad: f64,
    middle_rad: f64,
}

impl Filter {
    fn new(body: &Body, config: &RangesConfig) -> Filter {
        let ahead_m = body.length_ahead_m + config.margin_m;
        let behind_m = body.length_behind_m + config.margin_m;
        let half_width_m = body.half_width_m + config.margin_m;
        let reach_m = math::hypot(ahead_m.max(behind_m).max(0.0), half_width_m.max(0.0));
        let (half_field_rad, middle_rad) = (0.5 * config.field_rad, config.field_middle_rad);
        Filter { ahead_m, behind_m, half_width_m, reach_m, half_field_rad, middle_rad }
    }

    fn apply(&self, beams: &mut [Beam]) {
        for beam in beams {
            let bearing_rad = f64::from(beam.bearing_rad);
            if math::wrap_angle(bearing_rad - self.middle_rad).abs() > self.half_field_rad || self.is_body(beam) {
                beam.echo = Echo::Off as u32;
                beam.range_m = 0.0;
            }
        }
    }

    fn is_body(&self, beam: &Beam) -> bool {
        let range_m = f64::from(beam.range_m);
        let (x, y) = (f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
        // Most beams end far outside: no sine is spent on them.
        if beam.echo != Echo::Value as u32 || range_m > self.reach_m + math::hypot(x, y) {
            return false;
        }
        let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
        let (x, y) = (x + range_m * cos, y + range_m * sin);
        x < self.ahead_m && x > -self.behind_m && y.abs() < self.half_width_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn filter(margin_m: f64, field_rad: f64) -> Filter {
        let body = Body { length_ahead_m: 0.2, length_behind_m: 0.3, half_width_m: 0.2, ..Body::default() };
        Filter::new(&body, &RangesConfig { margin_m, field_rad, ..RangesConfig::default() })
    }

    fn beam(bearing_rad: f64, range_m: f64) -> Beam {
        Beam {
            bearing_rad: bearing_rad as f32,
            range_m: range_m as f32,
            echo: Echo::Value as u32,
            origin_x_m: 0.1,
            ..Beam::default()
        }
    }

    fn echoes(filter: &Filter, beams: &[Beam]) -> Vec<u32> {
        let mut beams = beams.to_vec();
        filter.apply(&mut beams);
        beams.iter().map(|beam| beam.echo).collect()
    }

    #[test]
    fn what_lies_within_the_body_and_its_margin_is_no_obstacle() {
        let beams = [beam(0.0, 0.09), beam(0.0, 0.11), beam(0.0, 0.2), beam(PI, 0.39), beam(PI, 0.41)];
        let (off, value) = (Echo::Off as u32, Echo::Value as u32);
        assert_eq!(echoes(&filter(0.0, TAU), &beams), [off, value, value, off, value]);
        assert_eq!(echoes(&filter(0.05, TAU), &beams), [off, off, value, off, off]);
        assert_eq!(echoes(&filter(-5.0, TAU), &beams), [value; 5]);
    }

    #[test]
    fn what_lies_outside_the_field_does_not_count() {
        let (off, value) = (Echo::Off as u32, Echo::Value as u32);
        let beams = [beam(-1.6, 2.0), beam(-1.5, 2.0), beam(1.5, 2.0), beam(1.6, 2.0), beam(TAU + 0.5, 2.0)];
        assert_eq!(echoes(&filter(0.0, PI), &beams), [off, value, value, off, value]);
    }

    #[test]
    fn a_scans_beams_start_at_the_sensor_and_age_back_from_the_last() {
        let scan = LaserScan {
            angle_min_rad: -1.0,
            angle_increment_rad: 0.5,
            time_increment_s: 0.01,
            x_m: 0.2,
            heading_rad: 0.25,
            ..LaserScan::default()
        };
        let beams = [ScanBeam { range_m: 1.5, intensity: 7, echo: Echo::Value as u16 }; 5];
        let first = beam_of(&scan, &beams, 0);
        assert_eq!((first.origin_x_m, first.bearing_rad, first.age_s), (0.2, -0.75, 0.04));
        assert_eq!((first.range_m, first.echo), (1.5, Echo::Value as u32));
        assert_eq!(beam_of(&scan, &beams, 4).age_s, 0.0);
        let hanging = beam_of(&LaserScan { upside_down: 1, ..scan }, &beams, 0);
        assert_eq!(hanging.bearing_rad, 1.25);
    }

    proptest! {
        #[test]
        fn the_filter_only_ever_takes_values_away(beams in prop::collection::vec((any::<f32>(), any::<f32>(), 0u32..9), 0..100)) {
            let before: Vec<Beam> =
                beams.iter().map(|&(bearing_rad, range_m, echo)| Beam { bearing_rad, range_m, echo, ..Beam::default() }).collect();
            let mut after = before.clone();
            filter(0.1, 3.0).apply(&mut after);
            for (was, is) in before.iter().zip(&after) {
                prop_assert!(is.echo == was.echo || is.echo == Echo::Off as u32);
                prop_assert!(is.echo == Echo::Off as u32 || is.range_m.to_bits() == was.range_m.to_bits());
            }
        }
    }
}
