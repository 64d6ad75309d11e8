//! Figures of a scanner: what PP tells of it, and what values below its least distance mean.

use super::protocol::{Area, Reply, decimal};
use crate::laser::{MAX_BEAMS, Sweep};
use messages::{Echo, ScanBeam};
use std::f64::consts::TAU;

/// Bytes of a model's name that are kept.
const NAME: usize = 24;

/// A scanner's parameters, as PP tells them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sensor {
    name: [u8; NAME],
    name_length: usize,
    /// DMIN [mm].
    pub min_mm: u32,
    /// DMAX [mm].
    pub max_mm: u32,
    /// ARES: steps per turn.
    pub steps_per_turn: u32,
    /// AMIN: first measured step.
    pub first_step: u32,
    /// AMAX: last measured step.
    pub last_step: u32,
    /// AFRT: the step that looks ahead.
    pub front_step: u32,
    /// SCAN: turns per minute.
    pub rpm: u32,
}

impl Sensor {
    /// A scanner of these figures.
    #[allow(clippy::too_many_arguments, reason = "the eight parameters of PP in their order")]
    pub const fn new(
        name: &[u8],
        min_mm: u32,
        max_mm: u32,
        steps_per_turn: u32,
        first_step: u32,
        last_step: u32,
        front_step: u32,
        rpm: u32,
    ) -> Sensor {
        let mut kept = [0; NAME];
        let mut length = 0;
        while length < name.len() && length < NAME {
            kept[length] = name[length];
            length += 1;
        }
        Sensor {
            name: kept,
            name_length: length,
            min_mm,
            max_mm,
            steps_per_turn,
            first_step,
            last_step,
            front_step,
            rpm,
        }
    }

    /// Reads a PP reply; `None` when something is missing or cannot be.
    pub fn parse(reply: &Reply) -> Option<Sensor> {
        let number = |key: &[u8]| decimal(reply.value(key)?);
        let sensor = Sensor::new(
            reply.value(b"MODL")?,
            number(b"DMIN")?,
            number(b"DMAX")?,
            number(b"ARES")?,
            number(b"AMIN")?,
            number(b"AMAX")?,
            number(b"AFRT")?,
            number(b"SCAN")?,
        );
        let steps = sensor.last_step.checked_sub(sensor.first_step)? + 1;
        let sound = sensor.max_mm > sensor.min_mm
            && sensor.last_step <= 9999
            && sensor.last_step < sensor.steps_per_turn.saturating_mul(2)
            && sensor.steps_per_turn > 0
            && sensor.rpm > 0
            && sensor.rpm <= 60_000
            && steps as usize <= MAX_BEAMS;
        sound.then_some(sensor)
    }

    /// The model's name, as far as it is kept.
    pub fn name(&self) -> &[u8] {
        &self.name[..self.name_length]
    }

    /// Whether the scanner is a `model`, whatever its maker writes behind that.
    pub fn is(&self, model: &str) -> bool {
        let name = self.name();
        name.len() >= model.len() && name[..model.len()].eq_ignore_ascii_case(model.as_bytes())
    }

    /// All that it measures.
    pub fn whole(&self, cluster: u8) -> Area {
        Area { start: self.first_step as u16, end: self.last_step as u16, cluster }
    }

    /// The steps that lie between two directions, as far as they are measured [rad].
    pub fn area(&self, from_rad: f64, to_rad: f64, cluster: u8) -> Area {
        let step = |angle_rad: f64| {
            let step = angle_rad / TAU * f64::from(self.steps_per_turn) + f64::from(self.front_step);
            // A cast saturates; a step is at most 9999.
            (step.round() as u32).clamp(self.first_step, self.last_step) as u16
        };
        Area { start: step(from_rad), end: step(to_rad).max(step(from_rad)), cluster }
    }

    /// Directions and times of the beams of an area.
    pub fn sweep(&self, area: &Area) -> Sweep {
        let per_turn = f64::from(self.steps_per_turn);
        let cluster = f64::from(area.cluster.max(1));
        // A cluster's beam stands for the middle of its steps.
        let first = f64::from(area.start) + 0.5 * (cluster - 1.0) - f64::from(self.front_step);
        Sweep {
            beams: area.count(),
            angle_min_rad: first / per_turn * TAU,
            angle_increment_rad: cluster / per_turn * TAU,
            turn_s: self.turn_s(),
            turns: 1,
            step_s: self.turn_s() * cluster / per_turn,
            range_min_m: f64::from(self.min_mm) * 1e-3,
            range_max_m: f64::from(self.max_mm) * 1e-3,
        }
    }

    /// Time of a turn [s].
    pub fn turn_s(&self) -> f64 {
        60.0 / f64::from(self.rpm.max(1))
    }

    /// Time from a turn's step 0 to `step` [s].
    pub fn delay_s(&self, step: u16) -> f64 {
        self.turn_s() * f64::from(step) / f64::from(self.steps_per_turn.max(1))
    }

    /// What a value says.
    pub fn beam(&self, value: u32, intensity: u32) -> ScanBeam {
        let echo = if value > self.max_mm {
            Echo::Clear
        } else if value >= self.min_mm {
            Echo::Value
        } else {
            self.missing(value)
        };
        let range_m = if echo == Echo::Value { value as f32 * 1e-3 } else { 0.0 };
        ScanBeam { range_m, intensity: intensity.min(0xFFFF) as u16, echo: echo as u16 }
    }

    /// What a value below the least distance means.
    fn missing(&self, value: u32) -> Echo {
        match (self.is("URG-04LX"), value) {
            // Nothing answered, or too weakly: the codes up to 6 tell why.
            (true, 0..=6) => Echo::Clear,
            (true, 19) => Echo::Off,
            (true, 7..=18) => Echo::Fault,
            (false, 1) => Echo::Clear,
            (false, 2 | 4) => Echo::TooNear,
            (false, 0 | 3 | 5) => Echo::Fault,
            // A distance, but nearer than the device promises anything.
            _ => Echo::TooNear,
        }
    }
}

/// The scanners that the simulator imitates: name, standard deviation of a reading [m], and what PP says.
pub const MODELS: &[(&str, f64, Sensor)] = &[
    ("urg-04lx", 0.010, Sensor::new(b"URG-04LX(Hokuyo Automatic Co.,Ltd.)", 20, 5600, 1024, 44, 725, 384, 600)),
    ("utm-30lx", 0.010, Sensor::new(b"UTM-30LX(Hokuyo Automatic Co.,Ltd.)", 23, 60_000, 1440, 0, 1080, 540, 2400)),
    ("ust-10lx", 0.010, Sensor::new(b"UST-10LX", 20, 30_000, 1440, 0, 1080, 540, 2400)),
    // No product: 720 beams over 270° at 50 Hz, 0.1 to 30 m, as the laser of a Jackal in the BARN challenge has, behind the
    // SCIP protocol. That laser is simulated there without any wire; SCIP is our stand-in.
    ("sinew-720", 0.001, Sensor::new(b"SINEW-720(stand-in)", 100, 30_000, 960, 0, 719, 360, 3000)),
];

/// The model of that name: its standard deviation [m] and its figures.
pub fn named(name: &str) -> Option<(f64, &'static Sensor)> {
    MODELS.iter().find(|(known, ..)| known.eq_ignore_ascii_case(name)).map(|(_, sigma_m, sensor)| (*sigma_m, sensor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::urg::protocol::push_line;

    fn reply(lines: &[&str]) -> Vec<u8> {
        let mut message = b"PP\n00P\n".to_vec();
        for line in lines {
            let start = message.len();
            push_line(&mut message, line.as_bytes());
            message.insert(start + line.len(), b';');
        }
        message
    }

    const UTM: [&str; 8] =
        ["MODL:UTM-30LX", "DMIN:23", "DMAX:60000", "ARES:1440", "AMIN:0", "AMAX:1080", "AFRT:540", "SCAN:2400"];

    #[test]
    fn parameters_are_read_and_what_cannot_be_is_refused() {
        let message = reply(&UTM);
        let sensor = Sensor::parse(&Reply::parse(&message).unwrap()).unwrap();
        assert!(sensor.is("utm-30lx") && !sensor.is("ust-10lx") && !sensor.is("utm-30lx-ew"));
        let sweep = sensor.sweep(&sensor.whole(1));
        assert_eq!(sweep.beams, 1081);
        assert!((sweep.angle_min_rad.to_degrees() + 135.0).abs() < 1e-9);
        assert!((sweep.angle_increment_rad.to_degrees() - 0.25).abs() < 1e-9);
        assert!((sweep.span_s() - 0.018_75).abs() < 1e-9);
        for wrong in ["AMAX:9000", "AMIN:1081", "ARES:0", "SCAN:0", "DMAX:20", "AMAX:x", "SCAN:4294967295"] {
            let mut lines = UTM;
            let at = lines.iter().position(|line| line[..4] == wrong[..4]).unwrap();
            lines[at] = wrong;
            let message = reply(&lines);
            assert_eq!(Sensor::parse(&Reply::parse(&message).unwrap()), None, "{wrong}");
        }
        let message = reply(&UTM[..7]);
        assert_eq!(Sensor::parse(&Reply::parse(&message).unwrap()), None);
    }

    #[test]
    fn every_value_is_a_distance_or_a_reason() {
        let (_, utm) = named("utm-30lx").unwrap();
        let echoes = [0, 1, 2, 3, 4, 5, 22, 23, 60_000, 60_001, 65_533].map(|value| utm.beam(value, 0).echo);
        use Echo::*;
        let wanted = [Fault, Clear, TooNear, Fault, TooNear, Fault, TooNear, Value, Value, Clear, Clear];
        assert_eq!(echoes, wanted.map(|echo| echo as u16));
        let (_, urg) = named("urg-04lx").unwrap();
        assert_eq!([0, 6, 7, 19, 20].map(|v| urg.beam(v, 0).echo), [Clear, Clear, Fault, Off, Value].map(|e| e as u16));
    }

    #[test]
    fn an_area_is_cut_at_what_is_measured() {
        let (_, utm) = named("utm-30lx").unwrap();
        assert_eq!(utm.area(-9.0, 9.0, 1), utm.whole(1));
        let ahead = utm.area(-TAU / 8.0, TAU / 8.0, 1);
        assert_eq!((ahead.start, ahead.end), (360, 720));
        assert_eq!(utm.area(1.0, -1.0, 1).count(), 1);
    }
}
