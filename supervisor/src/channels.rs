//! The supervisor's own channels: `/supervisor/robot/state`, `incidents`, `changes` and `load`.
//!
//! A supervisor that cannot have one of them (a full memory, a node that squats on the path) supervises all the same.

use std::path::Path;

use messages::{Load, NodeLoad, Notice, SupervisorState, bytemuck};
use runtime::channel::{Claim, Geometry, RawWriter, Tree};
use runtime::{LOAD_DEPTH, LOAD_NODES, STATE_DEPTH, SUPERVISOR_LOAD, SUPERVISOR_STATE, Time};

use crate::policy::Policy;
use crate::severity::Severity;

/// Where incidents stand, each a record as in `incidents.jsonl`.
pub const INCIDENTS: &str = "/supervisor/robot/incidents";
/// Where changes stand that somebody asked for.
pub const CHANGES: &str = "/supervisor/robot/changes";
/// A notice is no longer; what is longer is cut [byte].
const NOTICE_BYTES: usize = 2048;
/// Notices kept.
const NOTICES: usize = 64;
/// For what concerns no single node.
const NO_NODE: u32 = u32::MAX;

/// The supervisor's channels and their geometry, to be made before the nodes look for them.
pub fn supervisor_channels() -> [(&'static str, Geometry); 4] {
    let notices = || Geometry::of::<Notice>(NOTICE_BYTES, NOTICES);
    [
        (SUPERVISOR_STATE, Geometry::of::<SupervisorState>(0, STATE_DEPTH)),
        (INCIDENTS, notices()),
        (CHANGES, notices()),
        (SUPERVISOR_LOAD, Geometry::of::<Load>(LOAD_NODES, LOAD_DEPTH)),
    ]
}

/// The writers.
pub(crate) struct Channels {
    state: Option<RawWriter>,
    incidents: Option<RawWriter>,
    changes: Option<RawWriter>,
    load: Option<RawWriter>,
    said: Option<SupervisorState>,
    numbers: [u64; 2],
}

impl Channels {
    /// None: for runs without a robot.
    pub fn none() -> Channels {
        Channels { state: None, incidents: None, changes: None, load: None, said: None, numbers: [0; 2] }
    }

    /// Those below `root`, and what is wrong with the ones that cannot be had.
    pub fn open(root: &Path) -> (Channels, Vec<String>) {
        let mut flaws = Vec::new();
        let tree = match Tree::shared(root) {
            Ok(tree) => tree,
            Err(e) => return (Channels::none(), vec![e.to_string()]),
        };
        let [state, incidents, changes, load] = supervisor_channels().map(|(path, geometry)| {
            tree.writer(path, &geometry, Claim::Continue).map_err(|e| flaws.push(e.to_string())).ok()
        });
        (Channels { state, incidents, changes, load, said: None, numbers: [0; 2] }, flaws)
    }

    /// Says what the robot may do, when that has changed.
    pub fn say(&mut self, now: Time, policy: &Policy) {
        let severity = policy.severity();
        let state = SupervisorState {
            severity: severity as u32,
            limp: u32::from(severity >= Severity::Limp),
            hold: u32::from(severity >= Severity::Hold),
            stop: u32::from(severity >= Severity::Stop),
            causes: policy.causes().len() as u32,
            lost: (0..policy.nodes()).filter(|&node| policy.node(node).is_lost()).count() as u32,
        };
        if let Some(writer) = self.state.as_mut().filter(|_| self.said != Some(state)) {
            writer.publish(now.nanos(), bytemuck::bytes_of(&state), &[]);
            self.said = Some(state);
        }
    }

    /// Publishes an incident.
    pub fn incident(&mut self, now: Time, text: &str) {
        notice(&mut self.incidents, &mut self.numbers[0], self.said, now, None, text);
    }

    /// Publishes how busy everybody is.
    pub fn load(&mut self, now: Time, load: &Load, nodes: &[NodeLoad]) {
        if let Some(writer) = &mut self.load {
            writer.publish(now.nanos(), bytemuck::bytes_of(load), bytemuck::cast_slice(nodes));
        }
    }

    /// Publishes a change that somebody asked for.
    pub fn change(&mut self, now: Time, node: Option<usize>, text: &str) {
        notice(&mut self.changes, &mut self.numbers[1], self.said, now, node, text);
    }
}

fn notice(
    writer: &mut Option<RawWriter>,
    number: &mut u64,
    said: Option<SupervisorState>,
    now: Time,
    node: Option<usize>,
    text: &str,
) {
    let Some(writer) = writer else { return };
    *number += 1;
    let node = node.map_or(NO_NODE, |node| node as u32);
    let notice = Notice { number: *number, node, severity: said.map_or(0, |state| state.severity) };
    let cut = (0..=text.len().min(NOTICE_BYTES)).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
    writer.publish(now.nanos(), bytemuck::bytes_of(&notice), &text.as_bytes()[..cut]);
}
