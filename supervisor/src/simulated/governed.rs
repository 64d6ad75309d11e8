//! The governor's wish to limp, as the supervisor hears it on a live robot.

use messages::{Periods, Shortage, bytemuck};
use runtime::channel::{RawReader, SampleBuffer};
use runtime::{GOVERNOR, Layer, PERIODS, SimulatedHost, Time};

use crate::event::Event;
use crate::load::OVERLOAD_CODE;
use crate::robot_plan::Crew;
use crate::severity::Severity;

/// A governor that has said nothing for so long wishes nothing any more [s].
const HEARD_S: f64 = 2.0;

/// What it says.
pub(super) struct Governor {
    crew: usize,
    ring: RawReader,
    buffer: SampleBuffer,
    limping: bool,
}

impl Governor {
    /// That of the robot, if it has one.
    pub fn of(host: &SimulatedHost, crews: &[Crew]) -> Option<Governor> {
        let governs = |node: &&runtime::robot::NodeSpec| node.kind.name == GOVERNOR;
        let spec = host.robot().nodes.iter().filter(|node| node.kind.layer == Layer::Coordinator).find(governs)?;
        let path = spec.path();
        let crew = crews.iter().position(|crew| crew.paths.contains(&path))?;
        let ring = host.tree().reader(&spec.port_path(PERIODS), None).ok()?;
        let buffer = SampleBuffer::new(ring.geometry());
        Some(Governor { crew, ring, buffer, limping: false })
    }

    /// Whether it has come to want limp mode, or no longer does.
    pub fn hear(&mut self, now: Time) -> Option<Event> {
        let sample = self.ring.read(self.ring.head(), &mut self.buffer).ok();
        let fresh = sample.is_some_and(|sample| now.since(Time::from_nanos(sample.stamp_ns)) <= HEARD_S);
        let limps = fresh && bytemuck::from_bytes::<Periods>(self.buffer.fixed()).shortage == Shortage::Limp as u32;
        if std::mem::replace(&mut self.limping, limps) == limps {
            return None;
        }
        let node = self.crew;
        Some(match limps {
            true => Event::Raised { node, code: OVERLOAD_CODE, severity: Severity::Limp },
            false => Event::Lowered { node, code: OVERLOAD_CODE },
        })
    }
}
