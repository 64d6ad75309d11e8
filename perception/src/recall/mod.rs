//! Remembers what a laser has seen near the body and does not see now: one that looks ahead alone forgets what it passes.
//!
//! Reads `scan` (ranges of narrow beams in the body frame) and `odometry`; writes `ranges`: the newest scan's beams, and
//! behind them every remembered place that is out of sight, as a beam from the centre of rotation with its age. A scan
//! settles all that lies within its field; what has left it is kept for a minute where something has stood, for two
//! seconds where something had only just come (somebody who walks past), while it is near, and never where the body
//! stands. For a ranger with cones see [`crate::echoes`]: most of an arc is false.
//!
//! Without odometry it writes nothing: its readers then see that it is silent, and choose another source.
//!
//! ```toml
//! [nodes.recall]
//! type = "recall"
//! trigger = "scan"
//! deadline_ms = 20
//! priority = 61
//! reads.scan = "/drivers/laser/ranges"
//! reads.odometry = "/perception/odometry/pose"
//! ```

mod config;
mod memory;

pub use config::RecallConfig;
pub use memory::Memory;

use crate::place::place_at;
use messages::{Beam, Odometry, Ranges};
use runtime::{Body, Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer};

/// What overlaps the body's edge by no more than this may be there in truth [m].
const UNDER_BODY_M: f64 = 0.03;

/// The node.
pub struct Recall {
    scan: Reader<Ranges>,
    odometry: Reader<Odometry>,
    ranges: Writer<Ranges>,
    memory: Memory,
    published: Vec<Beam>,
    body: Body,
    most_beams: usize,
    /// Writer generation and origin of the odometry frame that the memory is in.
    frame: Option<(u64, u64)>,
}

impl Node for Recall {
    const TYPE: &'static str = "recall";
    const LAYER: Layer = Layer::Perception;
    type Config = RecallConfig;

    fn open(ports: &mut Ports, config: RecallConfig) -> Result<Recall, OpenError> {
        config.check().map_err(OpenError::config)?;
        let room = config.most_beams + config.capacity;
        Ok(Recall {
            scan: ports.reader("scan")?,
            odometry: ports.reader("odometry")?,
            ranges: ports.writer_with_tail("ranges", room)?,
            memory: Memory::new(config),
            published: Vec::with_capacity(room),
            body: *ports.body(),
            most_beams: config.most_beams,
            frame: None,
        })
    }

    fn step(&mut self, _now: Time) -> Result<(), Fault> {
        let Recall { scan, odometry, memory, published, .. } = self;
        let frame = odometry.latest().map(|pose| (pose.generation, pose.origin));
        if frame.is_some() && self.frame.is_some() && frame != self.frame {
            // Nobody knows where the old frame lies in the new one.
            memory.clear();
        }
        self.frame = frame.or(self.frame);
        let body = &self.body;
        let is_body = |x_m: f64, y_m: f64| {
            x_m < body.length_ahead_m - UNDER_BODY_M
                && x_m > UNDER_BODY_M - body.length_behind_m
                && y_m.abs() < body.half_width_m - UNDER_BODY_M
        };
        while let Some(sample) = scan.next_unread() {
            let Some(place) = place_at(odometry, sample.stamp) else { continue };
            let beams = &sample.tail[..sample.tail.len().min(self.most_beams)];
            memory.take(sample.stamp, &place, beams);
            published.clear();
            published.extend_from_slice(beams);
            memory.recall(sample.stamp, &place, is_body, |beam| published.push(beam));
            self.ranges.write_with_tail(sample.stamp, sample.message, published);
        }
        Ok(())
    }
}
