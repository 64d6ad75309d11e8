//! Where the body is by dead reckoning: continuous whatever the device does to its origin, and with its uncertainty.
//!
//! Reads `odometry` (a driver's); writes `pose` ([`crate::track`]). The frame begins where this node saw the first sample:
//! there the body's pose is `start`, zero where the robot file says nothing. So without localisation the frame is the map
//! as far as the start pose is right: a robot that is set down at a known place of its map gets that place as `start`.
//! The frame is never moved while the node lives, but by the call `set_pose`: then `origin` counts on, and whoever kept
//! places in the old frame knows.

use crate::track::{Growth, Track};
use messages::{Done, Odometry as Pose, SetPose};
use runtime::{CallPort, Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer, math};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`Odometry`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OdometryConfig {
    /// The body's pose in the map when this node sees the first sample.
    pub start: StartPose,
    /// How fast the uncertainty grows.
    pub growth: Growth,
}

/// Where a body begins in the map.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StartPose {
    /// Position [m].
    pub x_m: f64,
    /// Position [m].
    pub y_m: f64,
    /// Heading, counter-clockwise from the map's x axis [deg].
    pub heading_deg: f64,
}

/// The node.
pub struct Odometry {
    odometry: Reader<Pose>,
    pose: Writer<Pose>,
    set_pose: CallPort<SetPose, Done>,
    track: Track,
    /// What was published last.
    last: Option<Pose>,
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
        let StartPose { x_m, y_m, heading_deg } = config.start;
        for (key, value) in [("x_m", x_m), ("y_m", y_m), ("heading_deg", heading_deg)] {
            if !value.is_finite() {
                return Err(OpenError::config(format!("start.{key} = {value} must be a number")));
            }
        }
        Ok(Odometry {
            odometry: ports.reader("odometry")?,
            pose: ports.writer("pose")?,
            set_pose: ports.call("set_pose")?,
            track: Track::beginning_at(x_m, y_m, heading_deg.to_radians()),
            last: None,
            config,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        while let Some(request) = self.set_pose.take() {
            let SetPose { x_m, y_m, heading_rad } = request.message;
            if let Some(origin) = self.track.move_to(x_m, y_m, heading_rad) {
                // Whoever asks next must not be told the old place.
                if let Some(last) = &mut self.last {
                    *last = Pose {
                        x_m,
                        y_m,
                        heading_rad: math::wrap_angle(heading_rad),
                        pose_covariance: [0.0; 9],
                        origin,
                        ..*last
                    };
                    self.pose.write(now, last);
                }
                self.set_pose.answer(request, &Done { at_ns: now.nanos() });
            } else {
                self.set_pose.refuse(request, "the pose is no number: give x_m, y_m and heading_rad");
            }
        }
        // Every sample counts, not only the newest: each is a step of the way.
        while let Some(sample) = self.odometry.next_unread() {
            let (stamp, generation) = (sample.stamp, sample.generation);
            if let Some(pose) = self.track.advance(sample.message, generation, &self.config.growth) {
                self.pose.write(stamp, &pose);
                self.last = Some(pose);
            }
        }
        Ok(())
    }
}
