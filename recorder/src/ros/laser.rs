//! A laser scan as sensor_msgs/LaserScan.
//!
//! The fields are found by their names, so that every laser's message that has them is copied, whatever else it says. A
//! beam without a value follows REP 117: nothing within reach is +∞, too near is −∞, everything else is not a number.

use crate::cdr::Cdr;
use messages::{Echo, Kind, Schema};

/// Where the fields of a scan lie in its bytes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LaserFields {
    angle_min: usize,
    angle_increment: usize,
    time_increment: usize,
    scan_time: usize,
    range_min: usize,
    range_max: usize,
    beam_bytes: usize,
    range: usize,
    echo: usize,
    intensity: Option<usize>,
}

impl LaserFields {
    /// The places of a scan's fields; `None` when the message has not all of them.
    pub fn of(schema: &Schema) -> Option<LaserFields> {
        let float = |name: &str| place(schema, name, &Kind::F32);
        let Kind::Struct(beam) = &schema.tail.as_ref()?.kind else { return None };
        Some(LaserFields {
            angle_min: float("angle_min_rad")?,
            angle_increment: float("angle_increment_rad")?,
            time_increment: float("time_increment_s")?,
            scan_time: float("scan_time_s")?,
            range_min: float("range_min_m")?,
            range_max: float("range_max_m")?,
            beam_bytes: beam.size,
            range: place(beam, "range_m", &Kind::F32)?,
            echo: place(beam, "echo", &Kind::U16)?,
            intensity: place(beam, "intensity", &Kind::U16),
        })
    }

    /// Writes the copy.
    pub fn encode(&self, ns: u64, fixed: &[u8], tail: &[u8], into: &mut Cdr) -> Option<()> {
        let float = |at: usize| f32_at(fixed, at);
        let beams = || tail.chunks_exact(self.beam_bytes);
        let count = beams().len();
        let (first, step) = (float(self.angle_min)?, float(self.angle_increment)?);
        let last = f64::from(first) + count.saturating_sub(1) as f64 * f64::from(step);
        into.header(ns, "laser").f32(first).f32(last as f32).f32(step);
        into.f32(float(self.time_increment)?).f32(float(self.scan_time)?);
        into.f32(float(self.range_min)?).f32(float(self.range_max)?);
        into.u32(count as u32);
        for beam in beams() {
            let echo = u32::from(u16_at(beam, self.echo)?);
            into.f32(match echo {
                echo if echo == Echo::Value as u32 => f32_at(beam, self.range)?,
                echo if echo == Echo::Clear as u32 => f32::INFINITY,
                echo if echo == Echo::TooNear as u32 => f32::NEG_INFINITY,
                _ => f32::NAN,
            });
        }
        match self.intensity {
            None => into.u32(0),
            Some(at) => {
                into.u32(count as u32);
                for beam in beams() {
                    into.f32(f32::from(u16_at(beam, at)?));
                }
                into
            }
        };
        Some(())
    }
}

fn place(schema: &Schema, name: &str, kind: &Kind) -> Option<usize> {
    schema.fields.iter().find(|f| f.name == name && f.kind == *kind && f.count.is_none()).map(|field| field.offset)
}

fn f32_at(bytes: &[u8], at: usize) -> Option<f32> {
    Some(f32::from_le_bytes(*bytes.get(at..at + 4)?.first_chunk()?))
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(*bytes.get(at..at + 2)?.first_chunk()?))
}
