//! What a governor is told and tells in the simulated host: every 20 ms of virtual time how much each node has computed,
//! as the supervisor says on a live robot; and after each of its steps the periods that it announces.

use super::{SimulatedHost, Slot};
use crate::announced::{self, Announced};
use crate::channel::{ChannelError, Claim, Geometry, RawWriter, Tree};
use crate::ports::{LOAD_DEPTH, LOAD_NODES, SUPERVISOR_LOAD};
use crate::robot::{NodeSpec, Robot};
use crate::time::Time;
use messages::{Load, NODE_NAME_BYTES, NodeLoad, bytemuck, path_number};

/// How often it is told [s].
const TELL_S: f64 = 0.02;

/// What belongs to the governor.
pub(super) struct Governed {
    /// Its place among the nodes.
    pub node: usize,
    /// When it is told next.
    pub due: Time,
    load: RawWriter,
    told: Vec<NodeLoad>,
    /// Each node's entry without its counters.
    entries: Vec<NodeLoad>,
    /// What each node hears, where it has a period.
    ears: Vec<Option<Announced>>,
    /// Computed by all nodes when it was told before [ns].
    busy_ns: u64,
}

impl Governed {
    /// For `robot`; `None` where nobody governs.
    pub fn of(robot: &Robot, tree: &Tree, start: Time) -> Result<Option<Governed>, ChannelError> {
        let Some(path) = announced::announcing(robot) else { return Ok(None) };
        let Some(node) = robot.nodes.iter().position(|spec| path.starts_with(&(spec.path() + "/"))) else {
            return Ok(None);
        };
        let load = tree.writer(SUPERVISOR_LOAD, &Geometry::of::<Load>(LOAD_NODES, LOAD_DEPTH), Claim::Continue)?;
        Ok(Some(Governed {
            node,
            due: start.after_s(TELL_S),
            load,
            told: Vec::with_capacity(robot.nodes.len()),
            entries: robot.nodes.iter().map(entry).collect(),
            ears: robot.nodes.iter().map(|spec| Announced::of(robot, spec)).collect(),
            busy_ns: 0,
        }))
    }
}

/// A node's entry without its counters.
fn entry(spec: &NodeSpec) -> NodeLoad {
    let mut name = [0; NODE_NAME_BYTES];
    name.iter_mut().zip(spec.instance.bytes()).for_each(|(to, from)| *to = from);
    NodeLoad {
        node: path_number(&spec.path()),
        importance: u32::from(spec.importance),
        name,
        shortest_ns: spec.period_ns.unwrap_or(0),
        longest_ns: spec.longest_period_ns.or(spec.period_ns).unwrap_or(0),
        ..NodeLoad::default()
    }
}

impl Slot {
    fn load(&self, entry: &NodeLoad) -> NodeLoad {
        let work = self.running.as_ref().map(|running| running.counted.work()).unwrap_or_default();
        NodeLoad {
            steps: work.steps,
            busy_ns: work.busy_ns,
            missed_deadlines: work.missed_deadlines,
            processors: f64::NAN,
            resident_bytes: f64::NAN,
            ..*entry
        }
    }
}

impl SimulatedHost {
    /// Tells the governor how busy everybody is.
    pub(super) fn tell_load(&mut self) {
        let Some(governed) = &mut self.governed else { return };
        governed.due = governed.due.after_s(TELL_S);
        governed.told.clear();
        // The world costs the robot nothing.
        let robots = self.slots.iter().zip(&governed.entries);
        let robots = robots.filter(|(slot, _)| slot.spec.kind.layer != crate::Layer::Simulator);
        governed.told.extend(robots.map(|(slot, entry)| slot.load(entry)).take(LOAD_NODES));
        let busy_ns: u64 = governed.told.iter().map(|node| node.busy_ns).sum();
        let busy_processors = busy_ns.saturating_sub(governed.busy_ns) as f64 * 1e-9 / TELL_S;
        governed.busy_ns = busy_ns;
        // Where the nodes do not share processors each has one of its own.
        let processors = self.processors.as_ref().map_or(governed.told.len(), |processors| processors.count) as f64;
        let load = Load {
            processors,
            busy_processors,
            cpu_pressure: f64::NAN,
            memory_pressure: f64::NAN,
            available_bytes: f64::NAN,
        };
        let tail: &[u8] = bytemuck::cast_slice(&governed.told);
        governed.load.publish(self.now.nanos(), bytemuck::bytes_of(&load), tail);
        // A governor that has died lets go.
        self.hear_periods(self.now);
    }

    /// Has every node keep what is announced.
    pub(super) fn hear_periods(&mut self, now: Time) {
        let Some(mut governed) = self.governed.take() else { return };
        for (index, ear) in governed.ears.iter_mut().enumerate() {
            let (Some(ear), Some(running)) = (ear, &mut self.slots[index].running) else { continue };
            ear.bind(&self.tree);
            if running.keep_to(now, ear.look(now)) {
                self.plan(index);
            }
        }
        self.governed = Some(governed);
    }
}
