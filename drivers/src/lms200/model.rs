//! What a laser measures and how: variant, configuration, status; and what a value means.

use super::protocol::{TURN_S, Unit, is_variant, value_bits};
use crate::laser::Sweep;
use messages::{Echo, ScanBeam};

/// Bytes of a configuration (answer to 0x74, request 0x77).
pub const CONFIG: usize = 34;
/// Of these: the measuring mode and the unit.
pub const MEASURING_MODE: usize = 5;
/// See [`MEASURING_MODE`].
pub const UNIT: usize = 6;
/// Values at the top of the scale that are codes, not distances. After the telegram listing: the lowest of them says that
/// nothing was met within the scale; dazzle, overflow, too weak a signal and the like count as faults.
pub const CODES: u16 = 9;

/// Which directions are measured: a field and the angle from one beam to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Variant {
    /// 180 or 100 [deg].
    pub angle_deg: u16,
    /// 100, 50, or 25 with the small field [1/100 deg].
    pub resolution_cdeg: u16,
}

/// As the laser is after power-on.
impl Default for Variant {
    fn default() -> Variant {
        Variant { angle_deg: 180, resolution_cdeg: 100 }
    }
}

impl Variant {
    /// The variant of these figures, if the laser has it.
    pub fn of(angle_deg: u16, resolution_cdeg: u16) -> Option<Variant> {
        is_variant(angle_deg, resolution_cdeg).then_some(Variant { angle_deg, resolution_cdeg })
    }

    /// Values of a scan.
    pub fn count(self) -> usize {
        usize::from(self.angle_deg) * 100 / usize::from(self.resolution_cdeg.max(1)) + 1
    }

    /// Directions and times of its beams, and what they can tell in `scale`. Whole degrees are taken in the first turn of
    /// the mirror, the ones between in further turns.
    pub fn sweep(self, scale: Scale) -> Sweep {
        let resolution_deg = f64::from(self.resolution_cdeg) * 0.01;
        Sweep {
            beams: self.count(),
            angle_min_rad: (-0.5 * f64::from(self.angle_deg)).to_radians(),
            angle_increment_rad: resolution_deg.to_radians(),
            turn_s: TURN_S,
            turns: usize::from(100 / self.resolution_cdeg.max(1)),
            step_s: TURN_S * resolution_deg / 360.0,
            range_min_m: scale.unit.metres(),
            range_max_m: f64::from(scale.most()) * scale.unit.metres(),
        }
    }
}

/// How distances are written: unit and bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scale {
    /// The unit.
    pub unit: Unit,
    /// Lower bits of a value that are its distance.
    pub bits: u32,
    /// The top bit says dazzle.
    pub flags_dazzle: bool,
}

impl Scale {
    /// By a configuration's measuring mode and unit.
    pub fn of(measuring_mode: u8, unit: Unit) -> Scale {
        Scale { unit, bits: value_bits(measuring_mode), flags_dazzle: measuring_mode == 0 }
    }

    /// The mask of the distance.
    pub fn mask(self) -> u16 {
        (u32::MAX >> (32 - self.bits.clamp(1, 16))) as u16
    }

    /// The greatest value that is a distance.
    pub fn most(self) -> u16 {
        self.mask() - CODES
    }

    /// What a value says.
    pub fn beam(self, value: u16) -> ScanBeam {
        let distance = value & self.mask();
        let echo = if self.flags_dazzle && value & 0x8000 != 0 {
            Echo::Fault
        } else if distance == 0 {
            Echo::TooNear
        } else if distance <= self.most() {
            Echo::Value
        } else if distance == self.most() + 1 {
            Echo::Clear
        } else {
            Echo::Fault
        };
        let range_m = if echo == Echo::Value { (f64::from(distance) * self.unit.metres()) as f32 } else { 0.0 };
        ScanBeam { range_m, intensity: 0, echo: echo as u16 }
    }

    /// The value that says `range_m`; infinite: nothing was met.
    pub fn value(self, range_m: f64) -> u16 {
        let units = range_m / self.unit.metres();
        if units < f64::from(self.most()) + 0.5 { units.round() as u16 } else { self.most() + 1 }
    }
}

/// How far a laser is to measure, and so in which unit and measuring mode it writes distances.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize, schemars::JsonSchema)]
pub enum Reach {
    /// As it is configured.
    #[default]
    #[serde(rename = "keep")]
    Keep,
    /// 8 m in millimetres.
    #[serde(rename = "8m")]
    Eight,
    /// 16 m in millimetres.
    #[serde(rename = "16m")]
    Sixteen,
    /// 32 m in millimetres.
    #[serde(rename = "32m")]
    ThirtyTwo,
    /// 80 m in centimetres.
    #[serde(rename = "80m")]
    Eighty,
}

impl Reach {
    /// Measuring mode and unit code of the configuration; `None`: as they are.
    pub fn codes(self) -> Option<(u8, u8)> {
        match self {
            Reach::Keep => None,
            Reach::Eight => Some((0, 1)),
            Reach::Sixteen => Some((3, 1)),
            Reach::ThirtyTwo => Some((5, 1)),
            Reach::Eighty => Some((0, 0)),
        }
    }
}

/// What the status answer (0xB1) tells, as far as it is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status {
    /// The laser has found a fault of its own.
    pub is_faulty: bool,
    /// The variant in use, if it is one.
    pub variant: Option<Variant>,
}

/// Where the status answer tells what, counted from the answer's command byte.
pub mod status_at {
    /// Operating mode.
    pub const MODE: usize = 8;
    /// Fault flag.
    pub const FAULT: usize = 9;
    /// Measuring mode.
    pub const MEASURING_MODE: usize = 102;
    /// Field [deg], two bytes.
    pub const ANGLE: usize = 107;
    /// Resolution [1/100 deg], two bytes.
    pub const RESOLUTION: usize = 109;
    /// Rate, two bytes.
    pub const BAUD: usize = 116;
    /// Address.
    pub const ADDRESS: usize = 120;
    /// Unit.
    pub const UNIT: usize = 122;
    /// The laser is on.
    pub const LASER_ON: usize = 123;
    /// Length of the answer, status byte included.
    pub const LENGTH: usize = 152;
}

impl Status {
    /// Reads the answer's body; `None` when it is too short.
    pub fn parse(body: &[u8]) -> Option<Status> {
        let word = |at: usize| Some(u16::from_le_bytes([*body.get(at)?, *body.get(at + 1)?]));
        Some(Status {
            is_faulty: *body.get(status_at::FAULT)? != 0,
            variant: Variant::of(word(status_at::ANGLE)?, word(status_at::RESOLUTION)?),
        })
    }
}

/// Whether the status byte at a telegram's end says error or worse.
pub fn is_error(status: u8) -> bool {
    status & 7 >= 3
}

/// Whether the status byte says anything but "all well": a severity, implausible values, pollution.
pub fn is_remarkable(status: u8) -> bool {
    status & 0xC7 != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variant_has_its_beams_and_turns() {
        let scale = Scale::of(0, Unit::Millimetre);
        let all = [(180, 100, 181, 1), (180, 50, 361, 2), (100, 100, 101, 1), (100, 50, 201, 2), (100, 25, 401, 4)];
        for (angle, resolution, count, turns) in all {
            let sweep = Variant::of(angle, resolution).unwrap().sweep(scale);
            assert_eq!((sweep.beams, sweep.turns), (count, turns));
            let last_deg = (sweep.angle_min_rad + (count - 1) as f64 * sweep.angle_increment_rad).to_degrees();
            assert!((last_deg - 0.5 * f64::from(angle)).abs() < 1e-9);
            assert!((sweep.scan_s() - turns as f64 / 75.0).abs() < 1e-12);
        }
        assert_eq!(Variant::of(180, 25), None);
    }

    #[test]
    fn every_value_is_a_distance_or_a_reason() {
        use Echo::*;
        let scale = Scale::of(0, Unit::Centimetre);
        let echoes = [0, 1, 8182, 8183, 8187, 8191, 0x2000 | 500, 0x8000 | 500].map(|value| scale.beam(value).echo);
        assert_eq!(echoes, [TooNear, Value, Value, Clear, Fault, Fault, Value, Fault].map(|echo| echo as u16));
        assert!((scale.beam(0x2000 | 500).range_m - 5.0).abs() < 1e-6, "a field's flag is no distance");
        let far = Scale::of(5, Unit::Millimetre);
        assert!((far.beam(0x8000 | 30_000).range_m - 30.0).abs() < 1e-5);
        for metres in [0.1, 7.123, f64::INFINITY] {
            let beam = scale.beam(scale.value(metres));
            assert_eq!(beam.echo == Value as u16, metres.is_finite());
            assert!(metres.is_infinite() || (f64::from(beam.range_m) - metres).abs() < 0.0051);
        }
        assert_eq!(Scale::of(0x0F, Unit::Millimetre).most(), 0xFFFF - 9);
    }

    #[test]
    fn a_status_tells_the_variant_and_the_fault() {
        let mut body = vec![0; status_at::LENGTH];
        body[status_at::ANGLE] = 180;
        body[status_at::RESOLUTION] = 50;
        assert_eq!(Status::parse(&body), Some(Status { is_faulty: false, variant: Variant::of(180, 50) }));
        body[status_at::FAULT] = 1;
        assert!(Status::parse(&body).unwrap().is_faulty);
        assert_eq!(Status::parse(&body[..100]), None);
        assert!(!is_error(0x10) && !is_remarkable(0x10) && is_error(0x13) && is_remarkable(0x90));
    }
}
