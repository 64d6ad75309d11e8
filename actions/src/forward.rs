//! Goes forward, at a constant speed or the slower the nearer something ahead is (S1, Forward).
//!
//! Reads `ranges` (only where the speed is scaled); writes `proposal`, on the forward axis alone. With the magnitude
//! m = 1 − d/d_full of the nearest echo ahead (0 beyond d_full), the speed is v·(1 − (1 − s)·m), s the least share.
//! Scaled without fresh ranges: abstains.

use messages::{Axis, Beam, Echo, Proposal, Ranges};
use runtime::math::wrap_angle;
use runtime::{Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`Forward`].
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ForwardConfig {
    /// Speed with nothing ahead [m/s].
    pub speed_m_s: f64,
    /// Whether the speed falls as something ahead comes nearer.
    pub scaled: bool,
    /// Share of the speed that is left when something ahead is at no distance, 0…1.
    pub least_share: f64,
    /// Distance from which on nothing slows it [m].
    pub full_speed_from_m: f64,
    /// Beams within this angle of straight ahead count [rad].
    pub ahead_rad: f64,
    /// Beams older than this do not count [s].
    pub max_beam_age_s: f64,
    /// Urgency of the proposal, 0…1.
    pub urgency: f64,
    /// How long a proposal counts [s].
    pub valid_for_s: f64,
}

impl Default for ForwardConfig {
    fn default() -> ForwardConfig {
        ForwardConfig {
            speed_m_s: 0.3,
            scaled: true,
            least_share: 0.4,
            full_speed_from_m: 1.2,
            ahead_rad: 0.6,
            max_beam_age_s: 1.0,
            urgency: 0.5,
            valid_for_s: 0.4,
        }
    }
}

/// The node.
pub struct Forward {
    ranges: Reader<Ranges>,
    proposal: Writer<Proposal>,
    config: ForwardConfig,
}

impl Node for Forward {
    const TYPE: &'static str = "forward";
    const LAYER: Layer = Layer::Actions;
    type Config = ForwardConfig;

    fn open(ports: &mut Ports, config: ForwardConfig) -> Result<Forward, OpenError> {
        check(&config).map_err(OpenError::config)?;
        Ok(Forward { ranges: ports.optional_reader("ranges")?, proposal: ports.writer("proposal")?, config })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let speed_m_s = if self.config.scaled {
            self.ranges.fresh(now).and_then(|ranges| scaled_speed_m_s(ranges.tail, &self.config))
        } else {
            Some(self.config.speed_m_s)
        };
        self.proposal.write(now, &propose(speed_m_s, &self.config));
        Ok(())
    }
}

fn check(config: &ForwardConfig) -> Result<(), String> {
    let c = config;
    for (key, value, most) in [
        ("speed_m_s", c.speed_m_s, f64::MAX),
        ("least_share", c.least_share, 1.0),
        ("full_speed_from_m", c.full_speed_from_m, f64::MAX),
        ("ahead_rad", c.ahead_rad, std::f64::consts::PI),
        ("max_beam_age_s", c.max_beam_age_s, f64::MAX),
        ("urgency", c.urgency, 1.0),
        ("valid_for_s", c.valid_for_s, f64::MAX),
    ] {
        if !(0.0..=most).contains(&value) {
            let up_to = if most < f64::MAX { format!(" and at most {most:.4}") } else { String::new() };
            return Err(format!("{key} = {value} must be a number, zero or greater{up_to}"));
        }
    }
    Ok(())
}

/// Translation at `speed_m_s`; no opinion when there is none.
fn propose(speed_m_s: Option<f64>, config: &ForwardConfig) -> Proposal {
    let forward = speed_m_s.map_or(Axis::NONE, Axis::exact);
    Proposal { forward, urgency: config.urgency, valid_for_s: config.valid_for_s, ..Proposal::default() }
}

/// The speed that the nearest echo ahead leaves [m/s]; `None` when no beam ahead tells anything.
pub fn scaled_speed_m_s(beams: &[Beam], config: &ForwardConfig) -> Option<f64> {
    let magnitude = beams
        .iter()
        .filter(|beam| wrap_angle(f64::from(beam.bearing_rad)).abs() <= config.ahead_rad)
        .filter(|beam| f64::from(beam.age_s) <= config.max_beam_age_s)
        .filter_map(|beam| match beam.echo {
            e if e == Echo::Value as u32 && beam.range_m >= 0.0 => Some(f64::from(beam.range_m)),
            e if e == Echo::TooNear as u32 => Some(0.0),
            e if e == Echo::Clear as u32 => Some(f64::INFINITY),
            _ => None,
        })
        .map(|d| if d < config.full_speed_from_m { 1.0 - d / config.full_speed_from_m } else { 0.0 })
        .reduce(f64::max)?;
    Some(config.speed_m_s * (1.0 - (1.0 - config.least_share) * magnitude))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn beam(bearing_rad: f32, range_m: f32, echo: Echo) -> Beam {
        Beam { origin_x_m: 0.0, origin_y_m: 0.0, bearing_rad, range_m, age_s: 0.0, echo: echo as u32 }
    }

    fn speed(beams: &[Beam]) -> Option<f64> {
        scaled_speed_m_s(beams, &ForwardConfig::default())
    }

    #[test]
    fn nothing_ahead_leaves_the_full_speed() {
        assert_eq!(speed(&[beam(0.1, 0.0, Echo::Clear), beam(-0.1, 3.0, Echo::Value)]), Some(0.3));
    }

    #[test]
    fn something_at_the_nose_leaves_the_least_share() {
        let v = speed(&[beam(0.1, 0.0, Echo::TooNear), beam(-0.1, 3.0, Echo::Value)]).unwrap();
        assert!((v - 0.12).abs() < 1e-12);
    }

    #[test]
    fn what_is_beside_does_not_slow() {
        assert_eq!(speed(&[beam(0.1, 0.0, Echo::Clear), beam(1.5, 0.2, Echo::Value)]), Some(0.3));
    }

    #[test]
    fn without_a_beam_that_tells_anything_it_abstains() {
        assert_eq!(speed(&[]), None);
        assert_eq!(speed(&[beam(0.0, 1.0, Echo::LinkLost), beam(0.0, f32::NAN, Echo::Value)]), None);
        let old = Beam { age_s: 3.0, ..beam(0.0, 1.0, Echo::Value) };
        assert_eq!(speed(&[old]), None);
        let proposal = propose(None, &ForwardConfig::default());
        assert_eq!(proposal.forward, Axis::NONE);
    }

    #[test]
    fn it_proposes_translation_only() {
        let proposal = propose(Some(0.2), &ForwardConfig::default());
        assert_eq!((proposal.forward, proposal.turn, proposal.sideways), (Axis::exact(0.2), Axis::NONE, Axis::NONE));
    }

    #[test]
    fn a_setting_out_of_bounds_is_named() {
        let config = ForwardConfig { least_share: 1.5, ..ForwardConfig::default() };
        assert_eq!(
            check(&config).unwrap_err(),
            "least_share = 1.5 must be a number, zero or greater and at most 1.0000"
        );
        assert_eq!(check(&ForwardConfig::default()), Ok(()));
    }

    proptest! {
        #[test]
        fn nearer_never_means_faster(near in 0.0..3.0f32, more in 0.0..3.0f32) {
            let slow = speed(&[beam(0.0, near, Echo::Value)]).unwrap();
            let fast = speed(&[beam(0.0, near + more, Echo::Value)]).unwrap();
            prop_assert!(slow <= fast && slow >= 0.3 * 0.4 - 1e-9 && fast <= 0.3);
        }
    }
}
