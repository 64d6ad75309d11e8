//! The periods that a governor announces, as the hosts read them.
//!
//! Every step of the governor says at `/coordinator/<governor>/periods` which nodes have not their own period now. A host
//! keeps to it at the node's next release, never beyond the robot file's `period_ms = { min, max }`. When the governor
//! says nothing for [`VALID_S`], its node has its own period again: nobody stays suspended by the dead.

use crate::channel::{Expect, RawReader, SampleBuffer, Tree};
use crate::path::Layer;
use crate::robot::{NodeSpec, Robot};
use crate::time::Time;
use messages::{Message, NodePeriod, Periods, bytemuck, path_number};

/// Name of the node type that governs.
pub const GOVERNOR: &str = "governor";
/// The port at which it announces periods.
pub const PERIODS: &str = "periods";
/// What it announces counts for so long [s].
pub(crate) const VALID_S: f64 = 2.0;

/// Where the governor of `robot` announces periods, if it has one.
pub(crate) fn announcing(robot: &Robot) -> Option<String> {
    let governs = |spec: &&NodeSpec| spec.kind.layer == Layer::Coordinator && spec.kind.name == GOVERNOR;
    robot.nodes.iter().find(governs).map(|governor| governor.port_path(PERIODS))
}

/// What a node is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Told {
    /// The period [ns].
    pub period_ns: u64,
    /// Whether it does not step at all.
    pub suspended: bool,
}

/// One node's ear for what is announced.
pub(crate) struct Announced {
    path: String,
    node: u32,
    own_ns: u64,
    longest_ns: u64,
    ring: Option<(RawReader, SampleBuffer)>,
    seen: u64,
    heard_at: Time,
    told: Told,
}

impl Announced {
    /// For `spec` of `robot`; `None` where nobody announces or the node has no period.
    pub fn of(robot: &Robot, spec: &NodeSpec) -> Option<Announced> {
        let (path, own_ns) = (announcing(robot)?, spec.period_ns?);
        if spec.kind.name == GOVERNOR {
            return None;
        }
        Some(Announced {
            path,
            node: path_number(&spec.path()),
            own_ns,
            longest_ns: spec.longest_period_ns.unwrap_or(own_ns).max(own_ns),
            ring: None,
            seen: 0,
            heard_at: Time::ZERO,
            told: Told { period_ns: own_ns, suspended: false },
        })
    }

    /// Opens the ring, or the one that has taken its place. Allocates: between steps only.
    pub fn bind(&mut self, tree: &Tree) {
        if self.ring.as_ref().is_none_or(|(ring, _)| ring.retired() || ring.unlinked()) {
            let expect = Expect { type_name: Periods::NAME.into(), layout_hash: Periods::layout_hash() };
            let open = tree.reader(&self.path, Some(expect)).ok();
            self.ring = open.map(|ring| {
                let buffer = SampleBuffer::new(ring.geometry());
                (ring, buffer)
            });
            self.seen = 0;
        }
    }

    /// What the node is told at `now`. Neither allocates nor blocks.
    pub fn look(&mut self, now: Time) -> Told {
        let own = Told { period_ns: self.own_ns, suspended: false };
        let Some((ring, buffer)) = &mut self.ring else { return own };
        let head = ring.head();
        if head != self.seen
            && let Ok(sample) = ring.read(head, buffer)
        {
            self.seen = head;
            self.heard_at = Time::from_nanos(sample.stamp_ns);
            let entries: &[NodePeriod] = bytemuck::try_cast_slice(buffer.tail()).unwrap_or(&[]);
            self.told = entries.iter().find(|entry| entry.node == self.node).map_or(own, |entry| Told {
                period_ns: entry.period_ns.clamp(self.own_ns, self.longest_ns),
                suspended: entry.suspended != 0,
            });
        }
        if now.since(self.heard_at) > VALID_S { own } else { self.told }
    }
}
