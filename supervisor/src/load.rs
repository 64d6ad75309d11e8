//! How busy the machine and each node is, told at `/supervisor/robot/load` for the governor, `sinew top` and recordings;
//! and what the governor says about it, heard for limp mode.
//!
//! Time on the processors comes from the kernel's account of each node's thread (schedstat), steps and missed deadlines
//! from the table of heartbeats: a few small files per look. What takes longer (/proc/stat, pressure, memory) is read by an
//! ordinary thread without real-time priority ([`crate::machine`]); this one never waits for it.

use std::path::Path;

use guard::{Line, Table};
use messages::{Load, Message, NODE_NAME_BYTES, NodeLoad, Periods, Shortage, bytemuck, path_number};
use runtime::channel::{Expect, SampleBuffer, Tree};
use runtime::robot::{NodeSpec, Robot};
use runtime::{GOVERNOR, LOAD_NODES, PERIODS, Time};

use crate::event::Event;
use crate::machine::Machine;
use crate::ring::Ring;
use crate::robot_plan::RobotPlan;
use crate::severity::Severity;

/// How often it is told to a governor [s].
const TELL_S: f64 = 0.04;
/// How often where nobody governs [s].
const IDLE_TELL_S: f64 = 1.0;
/// The code under which the governor's wish to limp is raised.
pub const OVERLOAD_CODE: u16 = 900;
/// A governor that has said nothing for so long wishes nothing any more [s].
const HEARD_S: f64 = 2.0;

/// What must be known of a node to tell its load.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeTask {
    /// The process that it belongs to, as the plan counts them.
    pub program: usize,
    /// Its path.
    pub path: String,
    /// Its name.
    pub instance: String,
    /// How little the robot can do without it.
    pub importance: u8,
    /// Its own period; 0 for none [ns].
    pub shortest_ns: u64,
    /// The longest that it may be given [ns].
    pub longest_ns: u64,
    /// Whether it governs the others.
    pub governs: bool,
}

impl NodeTask {
    /// Of the node `spec` in process number `program`.
    pub fn of(spec: &NodeSpec, program: usize) -> NodeTask {
        NodeTask {
            program,
            path: spec.path(),
            instance: spec.instance.clone(),
            importance: spec.importance,
            shortest_ns: spec.period_ns.unwrap_or(0),
            longest_ns: spec.longest_period_ns.or(spec.period_ns).unwrap_or(0),
            governs: spec.kind.name == GOVERNOR,
        }
    }
}

/// The nodes of `robot` in the order of the table of heartbeats.
pub fn node_tasks(robot: &Robot) -> Vec<NodeTask> {
    let crews = RobotPlan::of(robot).crews;
    let tasks =
        crews.iter().enumerate().flat_map(|(program, crew)| crew.nodes.iter().map(move |&node| (program, node)));
    tasks.map(|(program, node)| NodeTask::of(&robot.nodes[node], program)).collect()
}

struct Told {
    line: Line,
    program: usize,
    entry: NodeLoad,
}

/// Tells loads and hears the governor.
pub(crate) struct Teller {
    nodes: Vec<Told>,
    due: Time,
    machine: Machine,
    tree: Option<Tree>,
    governor: Option<(usize, Ring)>,
    limping: bool,
    tail: Vec<NodeLoad>,
}

impl Teller {
    /// For these nodes of the robot below `root`.
    pub fn start(root: &Path, table: &Table, tasks: &[NodeTask], now: Time) -> Teller {
        let mut teller = Teller {
            nodes: Vec::new(),
            due: now,
            machine: Machine::start(),
            tree: Tree::shared(root).ok(),
            governor: None,
            limping: false,
            tail: Vec::with_capacity(LOAD_NODES),
        };
        tasks.iter().enumerate().for_each(|(line, task)| teller.add(table, line, task));
        teller
    }

    /// Tells of one node more, whose heartbeats are in `line`.
    pub fn add(&mut self, table: &Table, line: usize, task: &NodeTask) {
        let Some(line) = table.line(line) else { return };
        let mut name = [0; NODE_NAME_BYTES];
        name.iter_mut().zip(task.instance.bytes()).for_each(|(to, from)| *to = from);
        let entry = NodeLoad {
            node: path_number(&task.path),
            importance: u32::from(task.importance),
            name,
            shortest_ns: task.shortest_ns,
            longest_ns: task.longest_ns,
            processors: f64::NAN,
            resident_bytes: f64::NAN,
            ..NodeLoad::default()
        };
        if task.governs {
            let expect = Expect { type_name: Periods::NAME.into(), layout_hash: Periods::layout_hash() };
            self.governor = Some((task.program, Ring::new(format!("{}/{PERIODS}", task.path), Some(expect))));
        }
        self.nodes.push(Told { line, program: task.program, entry });
    }

    /// What there is to tell at `now`, if it is time to. `process` tells a program's process, if it has one.
    pub fn look(
        &mut self,
        now: Time,
        process: impl Fn(usize) -> Option<i32>,
        mut publish: impl FnMut(&Load, &[NodeLoad]),
    ) -> Option<Event> {
        if now < self.due {
            return None;
        }
        self.due = now.after_s(if self.governor.is_some() { TELL_S } else { IDLE_TELL_S });
        let pids = self.nodes.iter().map(|told| process(told.program).unwrap_or(0));
        self.machine.ask(pids);
        self.tail.clear();
        for (index, told) in self.nodes.iter_mut().enumerate() {
            let (pid, tid) = told.line.writer();
            let living = process(told.program).is_some_and(|process| process as u32 == pid);
            if !living {
                continue;
            }
            let work = told.line.work();
            let (processors, resident_bytes) = self.machine.process(index);
            told.entry = NodeLoad {
                steps: work.steps,
                // Where the kernel keeps no account: the time in steps, in which others may have run, too.
                busy_ns: ran_ns(pid, tid).unwrap_or(work.busy_ns),
                missed_deadlines: work.missed_deadlines,
                processors,
                resident_bytes,
                ..told.entry
            };
            self.tail.push(told.entry);
        }
        self.tail.truncate(LOAD_NODES);
        publish(&self.machine.load(), &self.tail);
        self.hear(now)
    }

    /// Whether the governor has come to want limp mode, or no longer does.
    fn hear(&mut self, now: Time) -> Option<Event> {
        let (node, ring) = self.governor.as_mut()?;
        let node = *node;
        let wish = ring.reader(self.tree.as_ref()?).and_then(|ring| {
            let mut buffer = SampleBuffer::new(ring.geometry());
            let sample = ring.read(ring.head(), &mut buffer).ok()?;
            let fresh = now.since(Time::from_nanos(sample.stamp_ns)) <= HEARD_S;
            Some(fresh && bytemuck::from_bytes::<Periods>(buffer.fixed()).shortage == Shortage::Limp as u32)
        });
        let limps = wish.unwrap_or(false);
        if std::mem::replace(&mut self.limping, limps) == limps {
            return None;
        }
        Some(match limps {
            true => Event::Raised { node, code: OVERLOAD_CODE, severity: Severity::Limp },
            false => Event::Lowered { node, code: OVERLOAD_CODE },
        })
    }
}

/// Time that thread `tid` of process `pid` has had on a processor [ns].
fn ran_ns(pid: u32, tid: u32) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/task/{tid}/schedstat")).ok()?;
    text.split_ascii_whitespace().next()?.parse().ok().filter(|ns| *ns > 0)
}
