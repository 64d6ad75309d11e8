//! Collects what a pump will run, without touching any of it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::watch::Watch;
use super::{Arrival, GuardLine, GuardPart, Log, Notifier, Part, Pump, Waker};
use crate::calls::{self, CallLine, CallPort, Caller, LocalCalls, NodeState, OrderPort, Stage, StepWatch};
use crate::device::{self, Device, Wire};
use crate::stop::SourceWord;

/// Poll, socket and formatting need a few KiB; the rest is reserve for the C library.
const DEFAULT_STACK_BYTES: usize = 128 * 1024;

/// A pump to be. Declaring a node opens nothing: everything begins with [`spawn`](PumpBuilder::spawn).
pub struct PumpBuilder {
    /// The node's path, `/<layer>/<instance>`.
    path: String,
    notifier: Notifier,
    log: Log,
    on_start: Option<Box<dyn FnOnce() + Send>>,
    stack_bytes: usize,
    wires: Vec<Arc<Wire>>,
    stages: Vec<Arc<Stage>>,
    lines: Vec<Arc<CallLine>>,
    watches: Vec<Watch>,
    state: NodeState,
    step: Arc<StepWatch>,
    take_over: bool,
    callers: Option<Vec<u32>>,
    guard: Option<Arc<GuardLine>>,
    sources: Vec<Arc<SourceWord>>,
}

/// Why a pump could not start.
#[derive(Debug, thiserror::Error)]
pub enum PumpError {
    /// Something that was attached runs in another pump.
    #[error("{0} is attached to two pumps")]
    AttachedTwice(String),
    /// The node's calls cannot be served.
    #[error(transparent)]
    Calls(#[from] calls::ServeError),
    /// The kernel gives no descriptor or no thread.
    #[error("the node's pump cannot start: {0}; raise the limits of open files (ulimit -n) or processes (ulimit -u)")]
    Kernel(#[from] std::io::Error),
}

/// What a pump can run: [`Device`], [`CallPort`], [`OrderPort`], [`Caller`].
pub trait Attach {
    /// Adds it to `builder`.
    fn attach_to(&self, builder: &mut PumpBuilder);
}

impl PumpBuilder {
    /// A pump for the node at `path` (`/<layer>/<instance>`).
    pub fn new(path: &str) -> PumpBuilder {
        PumpBuilder {
            path: path.into(),
            notifier: Arc::new(|_| {}),
            log: Arc::new(|_| {}),
            on_start: None,
            stack_bytes: DEFAULT_STACK_BYTES,
            wires: Vec::new(),
            stages: Vec::new(),
            lines: Vec::new(),
            watches: Vec::new(),
            state: NodeState::default(),
            step: Arc::default(),
            take_over: false,
            callers: None,
            guard: None,
            sources: Vec::new(),
        }
    }

    /// Adds a device, a port or a caller.
    pub fn attach(&mut self, part: &impl Attach) {
        part.attach_to(self);
    }

    /// How the step's thread learns that something has come.
    pub fn notify(&mut self, notifier: Notifier) {
        self.notifier = notifier;
    }

    /// Who hears each change of a device's link and each call that was not done, as one line: where, what or why, what to
    /// do.
    pub fn log(&mut self, log: Log) {
        self.log = log;
    }

    /// Runs `f` first on the pump's thread: the host sets its priority there.
    pub fn on_start(&mut self, f: impl FnOnce() + Send + 'static) {
        self.on_start = Some(Box::new(f));
    }

    /// Size of the thread's stack [byte].
    pub fn stack_bytes(&mut self, bytes: usize) {
        self.stack_bytes = bytes;
    }

    /// Calls `ended` once, on the pump's thread, when the process of this pidfd ends.
    pub fn watch_process(&mut self, process: std::os::fd::OwnedFd, ended: impl FnOnce() + Send + 'static) {
        self.watches.push(Watch::new(process, Box::new(ended)));
    }

    /// What the built-in call `state` answers, as JSON. Called on the pump's thread while a step may run.
    pub fn state(&mut self, state: impl Fn() -> String + Send + Sync + 'static) {
        self.state = NodeState::new(state);
    }

    /// When the node is in a step: the host tells this about each step's begin and end.
    pub fn step_watch(&self) -> Arc<StepWatch> {
        Arc::clone(&self.step)
    }

    /// Takes the call socket over from a predecessor that hangs but still holds it.
    pub fn take_over(&mut self) {
        self.take_over = true;
    }

    /// Hears calls of these users, root and this process's own only.
    pub fn callers(&mut self, users: Vec<u32>) {
        self.callers = Some(users);
    }

    /// A source of stops that the guard is told of.
    pub(crate) fn stop_source(&mut self, source: &Arc<SourceWord>) {
        self.sources.push(source.clone());
    }

    /// Speaks to the guard of the robot in `root`, if the node has anything to say to it: the line, for the host.
    pub(crate) fn guarded(&mut self, root: &Path) -> Option<Arc<GuardLine>> {
        let has_will = self.wires.iter().any(|wire| wire.will.get().is_some());
        if has_will || !self.sources.is_empty() {
            self.guard = Some(Arc::new(GuardLine::new(root.to_owned(), &self.path, &self.sources)));
        }
        self.guard.clone()
    }

    /// Opens the call socket under `root` (the robot's folder), and starts the thread, which opens the devices.
    pub fn spawn(self, root: &Path) -> Result<Pump, PumpError> {
        let waker = Waker::new().map_err(std::io::Error::from)?;
        let mut parts: Vec<Box<dyn Part>> = Vec::new();
        if let Some(guard) = &self.guard {
            // Before the devices: one that a predecessor has left is claimed first.
            guard.attach(waker.clone());
            parts.push(Box::new(GuardPart::new(guard.clone())));
        }
        for wire in self.wires {
            if !wire.attach(waker.clone()) {
                return Err(PumpError::AttachedTwice(format!("device {}", wire.address)));
            }
            let notify = told(&self.notifier, Arrival::Device);
            parts.push(Box::new(device::LiveDevice::new(
                wire,
                notify,
                Arc::clone(&self.log),
                waker.clone(),
                self.guard.clone(),
            )));
        }
        for stage in &self.stages {
            if !stage.attach(waker.clone()) {
                return Err(PumpError::AttachedTwice(format!("command {}", stage.command)));
            }
        }
        let desk = calls::Desk::new(&self.path, self.stages, self.state, self.step).map_err(calls::ServeError::from)?;
        let desk = desk.with_log(Arc::clone(&self.log));
        let notify = told(&self.notifier, Arrival::Call);
        parts.push(Box::new(calls::Server::open(root, &self.path, desk, notify, self.take_over, self.callers)?));
        for line in self.lines {
            if !line.attach(waker.clone()) {
                return Err(PumpError::AttachedTwice(format!("caller of {}", line.target)));
            }
            let notify = told(&self.notifier, Arrival::Reply);
            parts.push(Box::new(calls::Outgoing::new(PathBuf::from(root), line, &self.path, notify)));
        }
        for watch in self.watches {
            parts.push(Box::new(watch));
        }
        let name = format!("{}.pump", self.path.rsplit('/').next().unwrap_or("node"));
        Ok(Pump::spawn(name, self.stack_bytes, waker, parts, self.on_start)?)
    }

    /// Serves the node's calls within a simulated host instead, without a thread. Its devices are memory links.
    pub fn join(self, calls: &LocalCalls) -> Result<(), PumpError> {
        let desk = calls::Desk::new(&self.path, self.stages, self.state, self.step).map_err(calls::ServeError::from)?;
        let desk = desk.with_log(self.log);
        let (call, reply) = (told(&self.notifier, Arrival::Call), told(&self.notifier, Arrival::Reply));
        calls.join(&self.path, desk, self.lines, call, reply);
        Ok(())
    }
}

fn told(notifier: &Notifier, arrival: Arrival) -> Box<dyn Fn() + Send> {
    let notifier = Arc::clone(notifier);
    Box::new(move || notifier(arrival))
}

impl std::fmt::Debug for PumpBuilder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "PumpBuilder({}: {} devices, {} commands, {} callers)",
            self.path,
            self.wires.len(),
            self.stages.len(),
            self.lines.len()
        )
    }
}

impl Attach for Device {
    fn attach_to(&self, builder: &mut PumpBuilder) {
        // A memory link needs no pump.
        builder.wires.extend(self.wire().cloned());
    }
}

impl<Q: messages::Message, A: messages::Message> Attach for CallPort<Q, A> {
    fn attach_to(&self, builder: &mut PumpBuilder) {
        builder.stages.push(Arc::clone(self.stage()));
    }
}

impl<Q: messages::Message, P: messages::Message, A: messages::Message> Attach for OrderPort<Q, P, A> {
    fn attach_to(&self, builder: &mut PumpBuilder) {
        builder.stages.push(Arc::clone(self.stage()));
    }
}

impl<Q: messages::Message, A: messages::Message> Attach for Caller<Q, A> {
    fn attach_to(&self, builder: &mut PumpBuilder) {
        builder.lines.push(Arc::clone(self.line()));
    }
}
