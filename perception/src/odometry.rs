//! Where the body is by dead reckoning: continuous whatever the device does to its origin, and with its uncertainty.
//!
//! Reads `odometry` (a driver's); writes `pose`, in a frame that begins where this node saw the first sample and is
//! never moved while the node lives ([`crate::track`]).

use crate::track::{Growth, Track};
use messages::Odometry as Pose;
use runtime::{Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`Odometry`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometryConfig {
    /// How fast the uncertainty grows.
    pub growth: Growth,
}

/// The node.
pub struct Odometry {
    odometry: Reader<Pose>,
    pose: Writer<Pose>,
    track: Track,
    config: OdometryConfig,
}

impl Node for Odometry {
    const TYPE: &'static str = "odometry";
    const LAYER: Layer = Layer::Perception;
    type Config = OdometryConfig;

    fn open(ports: &mut Ports, config: OdometryConfig) -> Result<Odometry, OpenError> {
        let growth = &config.growth;
        for (key, value) in [
            ("along_m", growth.along_m),
            ("across_m", growth.across_m),
            ("heading_per_metre_rad", growth.heading_per_metre_rad),
            ("heading_per_turn_rad", growth.heading_per_turn_rad),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(OpenError::config(format!("growth.{key} = {value} must be a number, zero or greater")));
            }
        }
        Ok(Odometry {
            odometry: ports.reader("odometry")?,
            pose: ports.writer("pose")?,
            track: Track::default(),
            config,
        })
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        // Every sample counts, not only the newest: each is a step of the way.
        while let Some(sample) = self.odometry.next_unread() {
            let (stamp, generation) = (sample.stamp, sample.generation);
            if let Some(pose) = self.track.advance(sample.message, generation, &self.config.growth) {
                self.pose.write(stamp, &pose);
            }
        }
        Ok(())
    }
}
