//! What a node may touch: its read and written ports, devices, calls, settings and files.
//!
//! `open` declares through [`Ports`]; the host binds what was declared, afterwards. So a node can be opened to look at
//! its ports alone, and a program that replaces another can warm up before it takes over the written paths.

mod input;
mod reader;
mod writer;

pub use reader::{Reader, Sample, Set};
pub use writer::Writer;

pub(crate) use input::Input;
pub(crate) use writer::{Doom, Output};

use crate::calls::{CallPort, Caller, OrderPort, Target};
use crate::channel::{Claim, Expect, Geometry, Tree};
use crate::device::{Address, Device, Direction, MemoryLink, MemoryLinks};
use crate::journal::{Journal, Note};
use crate::node::{AnyNode, OpenError};
use crate::path;
use crate::pump::PumpBuilder;
use crate::robot::{Body, Limp, NodeSpec, ReadWire, Resources, Robot};
use crate::stop::{Keepsake, LatchCell, StopLatch, StopSource};
use crate::time::Time;
use messages::{InputCursor, Load, Message, SupervisorState, path_number};
use std::cell::Cell;
use std::rc::Rc;

/// What a port is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PortKind {
    /// Reads one path or the best of several.
    Read,
    /// Like `Read`, and may stay unwired.
    OptionalRead,
    /// Reads all members of a pattern.
    Set,
    /// Writes.
    Write,
    /// A device, by its address; true where the node is the device's side.
    Device(String, bool),
    /// A command that the node answers.
    Command,
    /// A command that the node gives to another.
    Caller,
}

/// One declaration of a node's `open`.
#[derive(Debug, Clone)]
pub struct Declaration {
    /// The port's or command's name.
    pub port: &'static str,
    /// What it is.
    pub kind: PortKind,
    /// Message type: of the samples, or of a call's request.
    pub message: &'static str,
    /// Its layout.
    pub layout_hash: u64,
}

/// Where the supervisor says what the robot may do.
pub const SUPERVISOR_STATE: &str = "/supervisor/robot/state";
/// Depth of that channel.
pub const STATE_DEPTH: usize = 64;

/// Where whoever supervises says how busy the machine and the nodes are.
pub const SUPERVISOR_LOAD: &str = "/supervisor/robot/load";
/// Depth of that channel.
pub const LOAD_DEPTH: usize = 16;
/// Nodes that a sample of it tells of.
pub const LOAD_NODES: usize = 128;

/// How deep a ring is where the robot file says nothing.
const DEPTH: usize = 64;
/// Rings with long tails are shallower: this many bytes where the robot file says nothing.
const RING_BYTES: usize = 4 << 20;

/// What devices are made of.
#[derive(Debug, Clone)]
pub(crate) enum Devices {
    /// Nothing is opened: the node is looked at.
    Declared,
    /// Real ports; simulated twins live below this folder as pseudo-terminals.
    Live(std::path::PathBuf),
    /// Byte streams in memory, on virtual time.
    Memory(MemoryLinks),
}

/// Hands out ports to a node's `open`.
pub struct Ports {
    spec: NodeSpec,
    body: Body,
    limp: Option<Limp>,
    resources: Resources,
    seed: u64,
    now: Rc<Cell<Time>>,
    declared: Vec<Declaration>,
    inputs: Vec<Rc<Input>>,
    outputs: Vec<Rc<Output>>,
    doom: Rc<Doom>,
    place: Devices,
    /// The memory links that bring bytes to this node, and which way.
    pub(crate) incoming: Vec<(MemoryLink, Direction)>,
    pub(crate) pump: PumpBuilder,
    /// Where what the node hears and tells otherwise is written down, if it is.
    journal: Option<Journal>,
    /// Devices, commands, callers and keepsakes so far: their numbers in the journal.
    counts: [usize; 4],
    pub(crate) latch: Rc<LatchCell>,
    pub(crate) keepsake: Keepsake,
}

/// Places in [`Ports::counts`].
const DEVICES: usize = 0;
const COMMANDS: usize = 1;
const CALLERS: usize = 2;
const KEEPSAKES: usize = 3;

impl Ports {
    /// Ports for `spec` of `robot`. `seed` is the run's; each node gets its own from it.
    pub(crate) fn new(robot: &Robot, spec: &NodeSpec, seed: u64, place: Devices) -> Ports {
        Ports {
            seed: node_seed(seed, &spec.path()),
            spec: spec.clone(),
            body: robot.body,
            limp: robot.limp.clone(),
            resources: robot.resources.clone(),
            now: Rc::new(Cell::new(Time::ZERO)),
            declared: Vec::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            doom: Rc::default(),
            place,
            incoming: Vec::new(),
            pump: PumpBuilder::new(&spec.path()),
            journal: None,
            counts: [0; 4],
            latch: Rc::default(),
            keepsake: Keepsake::default(),
        }
    }

    /// Has what the node hears and tells otherwise than by samples written down, or played back.
    pub(crate) fn set_journal(&mut self, journal: Journal) {
        self.journal = Some(journal);
    }

    /// The place in the journal of the next port of this kind.
    fn note(&mut self, kind: usize) -> Option<Note> {
        let number = self.counts[kind];
        self.counts[kind] += 1;
        self.journal.as_ref().map(|journal| journal.note(number))
    }

    /// Whether the node hears anything otherwise than by samples, and whether a device is among it.
    pub(crate) fn event_sources(&self) -> Option<bool> {
        self.counts.iter().any(|count| *count > 0).then_some(self.counts[DEVICES] > 0)
    }

    /// A port that reads the path (or the candidates) that the robot file gives it.
    pub fn reader<M: Message>(&mut self, port: &'static str) -> Result<Reader<M>, OpenError> {
        if !self.spec.reads.contains_key(port) {
            let reason =
                format!("is not wired: add `reads.{port} = \"/layer/node/port\"` to [nodes.{}]", self.spec.instance);
            return Err(OpenError::port(port, reason));
        }
        self.any_reader(port, PortKind::Read)
    }

    /// Like [`Ports::reader`], but the robot file may leave it unwired: it then never has a sample.
    pub fn optional_reader<M: Message>(&mut self, port: &'static str) -> Result<Reader<M>, OpenError> {
        self.any_reader(port, PortKind::OptionalRead)
    }

    fn any_reader<M: Message>(&mut self, port: &'static str, kind: PortKind) -> Result<Reader<M>, OpenError> {
        if let Some(wire) = self.spec.reads.get(port)
            && let Some(pattern) = wire.from.iter().find(|source| path::is_pattern(source))
        {
            return Err(OpenError::port(
                port,
                format!("reads one path at a time; \"{pattern}\" is a pattern for sets"),
            ));
        }
        let input = self.declare_input::<M>(port, kind)?;
        Ok(Reader::new(input, self.now.clone()))
    }

    /// A port that reads all members of a pattern, such as `/actions/*/proposal`.
    pub fn set<M: Message>(&mut self, port: &'static str) -> Result<Set<M>, OpenError> {
        if !self.spec.reads.contains_key(port) {
            let reason =
                format!("is not wired: add `reads.{port} = \"/layer/*/port\"` to [nodes.{}]", self.spec.instance);
            return Err(OpenError::port(port, reason));
        }
        Ok(Set::new(self.declare_input::<M>(port, PortKind::Set)?))
    }

    fn declare_input<M: Message>(&mut self, port: &'static str, kind: PortKind) -> Result<Rc<Input>, OpenError> {
        let expect = Expect { type_name: M::NAME.into(), layout_hash: M::layout_hash() };
        let wire = self.spec.reads.get(port).cloned();
        let input = Rc::new(Input::new(port, kind == PortKind::Set, expect, wire));
        self.declare::<M>(port, kind)?;
        self.inputs.push(input.clone());
        Ok(input)
    }

    fn declare<M: Message>(&mut self, port: &'static str, kind: PortKind) -> Result<(), OpenError> {
        if !path::is_name(port) {
            return Err(OpenError::port(port, "is no name: use 1 to 32 of a-z, 0-9 and _"));
        }
        if self.declared.iter().any(|known| known.port == port) {
            return Err(OpenError::port(port, "is declared twice"));
        }
        self.declared.push(Declaration { port, kind, message: M::NAME, layout_hash: M::layout_hash() });
        Ok(())
    }

    /// A port that writes `/<layer>/<instance>/<port>`.
    pub fn writer<M: Message>(&mut self, port: &'static str) -> Result<Writer<M>, OpenError> {
        self.writer_with_tail(port, 0)
    }

    /// Like [`Ports::writer`], for messages that end in up to `tail_capacity` further elements.
    pub fn writer_with_tail<M: Message>(
        &mut self,
        port: &'static str,
        tail_capacity: usize,
    ) -> Result<Writer<M>, OpenError> {
        self.declare::<M>(port, PortKind::Write)?;
        let output = Rc::new(Output::new::<M>(&self.spec, port, tail_capacity, None, self.doom.clone()));
        self.outputs.push(output.clone());
        Ok(Writer::new(output))
    }

    /// The client's side of a byte-stream device at `address` (see [`Address`]); "simulator" is the simulated twin of
    /// this very node's device. In the simulated host every address is its twin.
    pub fn device(&mut self, address: &str) -> Result<Device, OpenError> {
        let parsed = parse_address(address)?;
        let twin = self.spec.instance.clone();
        let mut device = match (&self.place, parsed) {
            (Devices::Memory(links), Address::Memory { name, baud }) => links.client(&name, baud),
            (Devices::Memory(links), Address::Serial { baud, .. }) => links.client(&twin, Some(baud)),
            (Devices::Memory(links), _) => links.client(&twin, None),
            (Devices::Live(root), Address::Simulator) => Device::detached(twin_address(root, &twin)),
            (_, parsed) => Device::detached(parsed),
        };
        self.declare_device(address, false, &mut device);
        Ok(device)
    }

    /// The device's own side, on which a simulator answers for the driver instance `twin`: at `address`, or where that
    /// driver's "simulator" address leads.
    pub fn serve_device(&mut self, twin: &str, address: Option<&str>) -> Result<Device, OpenError> {
        let parsed = address.map(parse_address).transpose()?.filter(|a| *a != Address::Simulator);
        let mut device = match (&self.place, parsed) {
            (Devices::Memory(links), Some(Address::Memory { name, baud })) => links.server(&name, baud),
            (Devices::Memory(links), _) => links.server(twin, None),
            (Devices::Live(root), None) => Device::detached_server(twin_address(root, twin)),
            (_, Some(parsed)) => Device::detached_server(parsed),
            (Devices::Declared, None) => Device::detached_server(Address::Simulator),
        };
        self.declare_device(&format!("simulator:{twin}"), true, &mut device);
        Ok(device)
    }

    fn declare_device(&mut self, address: &str, serves: bool, device: &mut Device) {
        if let Some(note) = self.note(DEVICES) {
            device.noted(note);
        }
        self.declared.push(Declaration {
            port: "device",
            kind: PortKind::Device(address.to_owned(), serves),
            message: "bytes",
            layout_hash: 0,
        });
        if let (Devices::Memory(links), Address::Memory { name, .. }) = (&self.place, device.address())
            && let Some(link) = links.link(name)
        {
            self.incoming.push((link, if serves { Direction::ToServer } else { Direction::ToClient }));
        } else {
            self.pump.attach(&*device);
        }
    }

    /// A command that this node answers in its steps.
    pub fn call<Q: Message, A: Message>(&mut self, command: &'static str) -> Result<CallPort<Q, A>, OpenError> {
        self.declare::<Q>(command, PortKind::Command)?;
        let mut port = CallPort::detached(command);
        if let Some(note) = self.note(COMMANDS) {
            port.noted(note);
        }
        self.pump.attach(&port);
        Ok(port)
    }

    /// A long order that this node carries out over many steps.
    pub fn order<Q: Message, P: Message, A: Message>(
        &mut self,
        command: &'static str,
    ) -> Result<OrderPort<Q, P, A>, OpenError> {
        self.declare::<Q>(command, PortKind::Command)?;
        let mut port = OrderPort::detached(command);
        if let Some(note) = self.note(COMMANDS) {
            port.noted(note);
        }
        self.pump.attach(&port);
        Ok(port)
    }

    /// A port that calls the command of another node that the robot file names.
    pub fn caller<Q: Message, A: Message>(&mut self, port: &'static str) -> Result<Caller<Q, A>, OpenError> {
        let Some((path, command)) = self.spec.calls.get(port).cloned() else {
            let reason =
                format!("is not wired: add `calls.{port} = \"/layer/node command\"` to [nodes.{}]", self.spec.instance);
            return Err(OpenError::port(port, reason));
        };
        self.declare::<Q>(port, PortKind::Caller)?;
        let mut caller = Caller::detached(Target { path, command });
        if let Some(note) = self.note(CALLERS) {
            caller.noted(note);
        }
        self.pump.attach(&caller);
        Ok(caller)
    }

    /// The stop latch, for a node that moves something: it must not while the latch does not allow it. A change of the
    /// latch releases a step.
    pub fn stop_latch(&mut self) -> StopLatch {
        self.latch.declared.set(true);
        StopLatch(self.latch.clone())
    }

    /// The right to stop the robot in this node's name, for one of these reasons.
    pub fn stop_source(&mut self, reasons: &'static [&'static str]) -> StopSource {
        let source = StopSource::new(self.spec.path(), reasons);
        self.pump.stop_source(&source.0);
        source
    }

    /// A few bytes that outlive this node's process. What a predecessor left can be read from `start` on.
    pub fn keepsake(&mut self) -> Keepsake {
        let note = self.note(KEEPSAKES);
        self.keepsake.noted(note)
    }

    /// What the supervisor lets the robot do now: always wired, and without a sample where nobody supervises.
    pub fn supervision(&mut self) -> Reader<SupervisorState> {
        self.supervisors("supervision", SUPERVISOR_STATE)
    }

    /// How busy the machine and the robot's nodes are: always wired, and without a sample where nobody looks.
    pub fn load(&mut self) -> Reader<Load> {
        self.supervisors("load", SUPERVISOR_LOAD)
    }

    fn supervisors<M: Message>(&mut self, port: &'static str, path: &str) -> Reader<M> {
        let expect = Expect { type_name: M::NAME.into(), layout_hash: M::layout_hash() };
        let wire = ReadWire { from: vec![path.into()], max_age_ns: u64::MAX, return_after_ns: 0 };
        let input = Rc::new(Input::new(port, false, expect, Some(wire)));
        self.inputs.push(input.clone());
        Reader::new(input, self.now.clone())
    }

    /// What remains in limp mode, where the robot has one.
    pub fn limp(&self) -> Option<&Limp> {
        self.limp.as_ref()
    }

    /// The robot's body.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The content of a file of the robot, by its name relative to the robot's folder.
    pub fn resource(&self, name: &str) -> Result<Vec<u8>, OpenError> {
        self.resources.read(name).map_err(|reason| OpenError::Resource { reason })
    }

    /// This node's own seed.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The instance's name in the robot file.
    pub fn instance(&self) -> &str {
        &self.spec.instance
    }

    /// The node's period, if it has one [s].
    pub fn period_s(&self) -> Option<f64> {
        self.spec.period_ns.map(|ns| ns as f64 * 1e-9)
    }

    /// All that was declared so far.
    pub(crate) fn declared(&self) -> &[Declaration] {
        &self.declared
    }

    /// The moment of this node's simulated death.
    pub(crate) fn doom(&self) -> &Doom {
        &self.doom
    }

    /// Geometry of each written path.
    pub(crate) fn outputs(&self) -> &[Rc<Output>] {
        &self.outputs
    }

    /// Adds a path that the runtime itself writes in the node's name.
    pub(crate) fn own_writer<M: Message>(
        &mut self,
        port: &'static str,
        tail_capacity: usize,
        depth: usize,
    ) -> Writer<M> {
        let output = Rc::new(Output::new::<M>(&self.spec, port, tail_capacity, Some(depth), self.doom.clone()));
        self.outputs.push(output.clone());
        Writer::new(output)
    }

    /// Opens the node and what the runtime adds to it.
    pub(crate) fn open_node(mut self) -> Result<(Box<dyn AnyNode>, Ports), OpenError> {
        let open = self.spec.kind.open;
        let config = self.spec.config.clone();
        let node = open(&mut self, config)?;
        Ok((node, self))
    }

    /// Fixes what a step at `now` can see to what a recorded step saw: per source of each port its path and cursor.
    pub(crate) fn freeze_as(
        &self,
        now: Time,
        tree: &Tree,
        sources: &[Vec<(String, InputCursor)>],
    ) -> Result<(), OpenError> {
        self.now.set(now);
        for (input, sources) in self.inputs.iter().zip(sources) {
            input.freeze_as(now, tree, sources)?;
        }
        Ok(())
    }

    /// Takes the written paths and opens the read ones.
    pub(crate) fn bind(&self, tree: &Tree, claim: Claim) -> Result<(), OpenError> {
        for output in &self.outputs {
            output.bind(tree, claim)?;
        }
        for input in &self.inputs {
            input.bind(tree)?;
        }
        Ok(())
    }

    /// The read ports.
    pub(crate) fn inputs(&self) -> &[Rc<Input>] {
        &self.inputs
    }

    /// Fixes what the step at `now` can see.
    pub(crate) fn freeze(&self, now: Time) {
        self.now.set(now);
        self.latch.freeze();
        for input in &self.inputs {
            input.freeze(now);
        }
    }
}

impl Output {
    /// `own_depth` is that of a path of the runtime's own.
    fn new<M: Message>(
        spec: &NodeSpec,
        port: &'static str,
        tail_capacity: usize,
        own_depth: Option<usize>,
        doom: Rc<Doom>,
    ) -> Output {
        let tail_element_bytes = if M::HAS_TAIL { size_of::<M::Tail>() } else { 0 };
        let tail_capacity = if M::HAS_TAIL { tail_capacity } else { 0 };
        let sample_bytes = size_of::<M>() + tail_element_bytes * tail_capacity + 64;
        let depth = spec
            .depth
            .get(port)
            .copied()
            .or(own_depth)
            .unwrap_or_else(|| DEPTH.min((RING_BYTES / sample_bytes).max(4)));
        let path = spec.port_path(port);
        Output {
            number: path_number(&path),
            by_runtime: own_depth.is_some(),
            path,
            geometry: Geometry::of::<M>(tail_capacity, depth),
            writer: std::cell::RefCell::new(None),
            cut: Cell::new(0),
            lost: Cell::new(false),
            doom,
        }
    }
}

fn parse_address(address: &str) -> Result<Address, OpenError> {
    address.parse().map_err(|e: crate::device::AddressError| OpenError::Device { reason: e.to_string() })
}

/// Where the simulated twin of driver `instance` has its terminal on a live robot.
/// Folder of the robot's root with a folder per driver in it, where nodes have users of their own.
pub const TWINS: &str = ".twins";

fn twin_address(root: &std::path::Path, instance: &str) -> Address {
    // Where nodes have users of their own, driver and twin meet in a folder that these two alone may enter.
    let shared = root.join(TWINS).join(instance);
    let path = if shared.is_dir() { shared.join("tty") } else { root.join(".run").join(format!("{instance}.tty")) };
    Address::Pty { path }
}

/// A node's own seed: the run's seed mixed with the node's path, so that adding a node changes no other's.
fn node_seed(seed: u64, path: &str) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64 ^ seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for byte in path.bytes() {
        hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    // FNV's high bits are weak: one more mixing round.
    hash ^= hash >> 32;
    hash.wrapping_mul(0xd6e8_feb8_6659_fd93)
}
