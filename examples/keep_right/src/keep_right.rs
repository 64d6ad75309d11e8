//! Keeps to the right: steers so that what stands at the right hand stays at a wanted distance.
//!
//! Reads `ranges`; writes `proposal`, on the turn axis alone: ω = k·(wanted − d), d the nearest echo at the right hand.
//! Too near turns left, too far turns right. With nothing there within reach: abstains, and others decide.

use sinew::messages::{Axis, Beam, Echo, Proposal, Ranges};
use sinew::schemars::JsonSchema;
use sinew::serde::Deserialize;
use sinew::{Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer};

/// Settings, as `config = { … }` in the robot file has them.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(crate = "sinew::serde", deny_unknown_fields, default)]
#[schemars(crate = "sinew::schemars")]
pub struct KeepRightConfig {
    /// Distance to keep [m].
    pub wanted_m: f64,
    /// Farther away than this is nothing to keep to [m].
    pub reach_m: f64,
    /// Turn rate per metre of error [rad/s per m].
    pub gain: f64,
}

impl Default for KeepRightConfig {
    fn default() -> KeepRightConfig {
        KeepRightConfig { wanted_m: 0.7, reach_m: 1.5, gain: 0.4 }
    }
}

/// The node.
pub struct KeepRight {
    ranges: Reader<Ranges>,
    proposal: Writer<Proposal>,
    config: KeepRightConfig,
}

impl Node for KeepRight {
    const TYPE: &'static str = "keep_right";
    const LAYER: Layer = Layer::Actions;
    type Config = KeepRightConfig;

    fn open(ports: &mut Ports, config: KeepRightConfig) -> Result<KeepRight, OpenError> {
        Ok(KeepRight { ranges: ports.reader("ranges")?, proposal: ports.writer("proposal")?, config })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let turn = self.ranges.fresh(now).map_or(Axis::NONE, |ranges| steer(ranges.tail, &self.config));
        self.proposal.write(now, &Proposal { turn, urgency: 0.3, valid_for_s: 0.3, ..Proposal::default() });
        Ok(())
    }
}

/// The turn that `beams` ask for.
fn steer(beams: &[Beam], config: &KeepRightConfig) -> Axis {
    let at_right = |beam: &&Beam| (-1.8..=-0.8).contains(&beam.bearing_rad) && beam.echo == Echo::Value as u32;
    let nearest_m = beams.iter().filter(at_right).map(|beam| f64::from(beam.range_m)).fold(f64::INFINITY, f64::min);
    if nearest_m > config.reach_m { Axis::NONE } else { Axis::exact(config.gain * (config.wanted_m - nearest_m)) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use sinew::Bench;

    fn beam(bearing_rad: f32, range_m: f32) -> Beam {
        Beam { bearing_rad, range_m, echo: Echo::Value as u32, ..Beam::default() }
    }

    #[test]
    fn turns_left_when_too_near_right_when_too_far_and_leaves_the_open_to_others() {
        let turn = |range_m| steer(&[beam(-1.57, range_m), beam(0.0, 0.2)], &KeepRightConfig::default());
        assert!(turn(0.4).value > 0.0 && turn(1.2).value < 0.0);
        assert_eq!(turn(3.0), Axis::NONE);
    }

    #[test]
    fn proposes_on_the_turn_axis_alone_and_abstains_without_fresh_ranges() {
        let mut bench = Bench::<KeepRight>::new().unwrap();
        bench.feed("ranges", Time::ZERO, &Ranges::default(), &[beam(-1.57, 0.4)]);
        bench.step(Time::ZERO).unwrap();
        let (_, said, _) = bench.read::<Proposal>("proposal").unwrap();
        assert!(said.turn.value > 0.0 && said.forward == Axis::NONE);
        bench.step(Time::from_seconds(5.0)).unwrap();
        assert_eq!(bench.read::<Proposal>("proposal").unwrap().1.turn, Axis::NONE);
    }
}
