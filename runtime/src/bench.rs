//! A test bench for one node: feed its read ports, step it, look at what it wrote.

use crate::calls::{LocalCalls, LocalRequest, Ticket, TicketState};
use crate::channel::{Claim, Expect, Geometry, RawWriter, SampleBuffer, Tree};
use crate::device::MemoryLinks;
use crate::host::Opened;
use crate::node::{Fault, Node, NodeType, OpenError};
use crate::path::Layer;
use crate::ports::{Devices, PortKind};
use crate::pump::PumpBuilder;
use crate::robot::{
    Body, CareTable, Limp, Missed, NodeSpec, ReadWire, RealtimeTable, Resources, Restart, Robot, SupervisionTable,
    open_declared,
};
use crate::time::Time;
use messages::{Message, bytemuck};
use std::collections::BTreeMap;
use std::marker::PhantomData;

/// One node on a bench. All its read ports are wired to paths that the bench writes.
pub struct Bench<N: Node> {
    opened: Opened,
    tree: Tree,
    links: MemoryLinks,
    calls: LocalCalls,
    now: Time,
    feeds: BTreeMap<String, RawWriter>,
    started: bool,
    node: PhantomData<N>,
}

/// What a bench is built from; see [`Bench::builder`].
pub struct BenchBuilder<N: Node> {
    config: toml::Table,
    body: Body,
    members: BTreeMap<String, Vec<String>>,
    files: Option<std::path::PathBuf>,
    max_age_s: f64,
    limp: Option<Limp>,
    node: PhantomData<N>,
}

impl<N: Node> Bench<N> {
    /// A bench with settings written as in the robot file's `config`.
    pub fn builder(config: &str) -> BenchBuilder<N> {
        BenchBuilder {
            config: toml::from_str(config).expect("a bench's settings are TOML"),
            body: Body::default(),
            members: BTreeMap::new(),
            files: None,
            max_age_s: 0.5,
            limp: None,
            node: PhantomData,
        }
    }

    /// A bench with default settings and body.
    pub fn new() -> Result<Bench<N>, OpenError> {
        Bench::builder("").build()
    }

    /// Publishes a sample on what `port` reads.
    pub fn feed<M: Message>(&mut self, port: &str, stamp: Time, message: &M, tail: &[M::Tail]) {
        self.feed_path::<M>(&source(port), stamp, message, tail);
    }

    /// Publishes a sample as member `member` of the set that `port` reads.
    pub fn feed_member<M: Message>(&mut self, member: &str, stamp: Time, message: &M) {
        self.feed_path::<M>(member, stamp, message, &[]);
    }

    fn feed_path<M: Message>(&mut self, path: &str, stamp: Time, message: &M, tail: &[M::Tail]) {
        let tree = &self.tree;
        let writer = self.feeds.entry(path.to_owned()).or_insert_with(|| {
            tree.writer(path, &geometry::<M>(), Claim::Continue).expect("the bench writes its own paths")
        });
        writer.publish(stamp.nanos(), bytemuck::bytes_of(message), bytemuck::cast_slice(tail));
    }

    /// One step at `now`.
    pub fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.links.set_now(now);
        self.now = now;
        for input in self.opened.ports.inputs() {
            input.bind(&self.tree).expect("the bench feeds the types that the node reads");
        }
        if !self.started {
            self.started = true;
            self.opened.node.start(now)?;
        }
        self.opened.ports.freeze(now);
        let result = self.opened.node.step(now);
        self.calls.advance(now);
        result
    }

    /// Calls the node; its next step sees the request.
    pub fn call<Q: Message>(&mut self, command: &str, request: &Q) -> Ticket {
        let path = format!("/{}/{NAME}", N::LAYER);
        self.calls.request(
            self.now,
            &LocalRequest {
                path: &path,
                command,
                layout_hash: Q::layout_hash(),
                body: bytemuck::bytes_of(request),
                priority: 0,
                deadline: self.now.after_s(1.0),
            },
        )
    }

    /// How a call stands.
    pub fn call_state(&self, ticket: Ticket) -> TicketState {
        self.calls.poll(ticket)
    }

    /// An ordered stop.
    pub fn stop(&mut self, now: Time) {
        self.links.set_now(now);
        self.opened.node.stop(now);
    }

    /// The newest sample that the node wrote on `port`: stamp, message, tail.
    pub fn read<M: Message>(&self, port: &str) -> Option<(Time, M, Vec<M::Tail>)> {
        let path = format!("/{}/{NAME}/{port}", N::LAYER);
        let expect = Expect { type_name: M::NAME.into(), layout_hash: M::layout_hash() };
        let reader = self.tree.reader(&path, Some(expect)).ok()?;
        let mut buffer = SampleBuffer::new(reader.geometry());
        let raw = reader.read(reader.head(), &mut buffer).ok()?;
        let tail = if M::HAS_TAIL { bytemuck::cast_slice(buffer.tail()).to_vec() } else { Vec::new() };
        Some((Time::from_nanos(raw.stamp_ns), *bytemuck::from_bytes(buffer.fixed()), tail))
    }

    /// The memory links of the node's devices; the node's own device is link [`Bench::DEVICE`].
    pub fn links(&self) -> &MemoryLinks {
        &self.links
    }

    /// Name of the memory link that the node's device is the client of.
    pub const DEVICE: &'static str = NAME;
}

/// The instance's name on the bench.
const NAME: &str = "bench";

impl<N: Node> BenchBuilder<N> {
    /// The body that the node sees.
    #[must_use]
    pub fn body(mut self, body: Body) -> Self {
        self.body = body;
        self
    }

    /// Wires the set `port` to a pattern such as `/actions/*/proposal`.
    #[must_use]
    pub fn set(mut self, port: &str, pattern: &str) -> Self {
        self.members.insert(port.to_owned(), vec![pattern.to_owned()]);
        self
    }

    /// Folder that `ports.resource` reads from.
    #[must_use]
    pub fn files(mut self, folder: impl Into<std::path::PathBuf>) -> Self {
        self.files = Some(folder.into());
        self
    }

    /// What remains of the robot in limp mode.
    #[must_use]
    pub fn limp(mut self, limp: Limp) -> Self {
        self.limp = Some(limp);
        self
    }

    /// Greatest age of a fresh sample on all ports [s].
    #[must_use]
    pub fn max_age_s(mut self, seconds: f64) -> Self {
        self.max_age_s = seconds;
        self
    }

    /// Opens the node.
    pub fn build(self) -> Result<Bench<N>, OpenError> {
        let BenchBuilder { config, body, members, files, max_age_s, limp, .. } = self;
        let spec = NodeSpec {
            instance: NAME.into(),
            kind: NodeType::of::<N>(),
            triggers: Vec::new(),
            period_ns: Some(100_000_000),
            longest_period_ns: Some(100_000_000),
            deadline_ns: None,
            missed: Missed::Skip,
            priority: 50,
            process: None,
            isolate: crate::robot::Isolate::None,
            user: None,
            restart: Restart::Never,
            care: CareTable::default(),
            importance: 50,
            budget_ns: None,
            reads: BTreeMap::new(),
            calls: BTreeMap::new(),
            depth: BTreeMap::new(),
            record_inputs: false,
            config,
        };
        let mut robot = Robot {
            name: NAME.into(),
            description: String::new(),
            file: String::new(),
            text: String::new(),
            resources: Resources::Folder(files.unwrap_or_default()),
            body,
            realtime: RealtimeTable::default(),
            record: None,
            limp,
            supervision: SupervisionTable::default(),
            nodes: vec![spec],
        };
        // The node's own declarations say which ports there are to wire: wire one more each time it asks for one.
        let wire =
            |from: Vec<String>| ReadWire { from, max_age_ns: (max_age_s * 1e9) as u64, return_after_ns: 1_000_000_000 };
        for (port, from) in &members {
            robot.nodes[0].reads.insert(port.clone(), wire(from.clone()));
        }
        loop {
            match open_declared(&robot, &robot.nodes[0], 0, Devices::Declared) {
                Ok(opened) => {
                    for declared in opened.ports.declared() {
                        if matches!(declared.kind, PortKind::OptionalRead) {
                            robot.nodes[0].reads.insert(declared.port.into(), wire(vec![source(declared.port)]));
                        }
                    }
                    break;
                }
                Err(OpenError::Port { port, .. }) if !robot.nodes[0].reads.contains_key(&port) => {
                    robot.nodes[0].reads.insert(port.clone(), wire(vec![source(&port)]));
                }
                Err(e) => return Err(e),
            }
        }
        let (tree, links, calls) = (Tree::local(), MemoryLinks::new(), LocalCalls::new());
        let mut opened = open_declared(&robot, &robot.nodes[0], 0, Devices::Memory(links.clone()))?;
        opened.ports.bind(&tree, Claim::Continue)?;
        let pump = std::mem::replace(&mut opened.ports.pump, PumpBuilder::new(NAME));
        pump.join(&calls).map_err(|e| OpenError::Config { reason: e.to_string() })?;
        Ok(Bench {
            opened,
            tree,
            links,
            calls,
            now: Time::ZERO,
            feeds: BTreeMap::new(),
            started: false,
            node: PhantomData,
        })
    }
}

/// The path that the bench writes for a read port.
fn source(port: &str) -> String {
    format!("/{}/{port}/feed", Layer::Supervisor)
}

fn geometry<M: Message>() -> Geometry {
    Geometry::of::<M>(2048, 64)
}
