//! The live host: the nodes of one process, a thread each, on the real clock, over shared memory.
//!
//! Between steps a node's thread sleeps in one wait on its triggers and its private word; it uses no CPU while nothing
//! comes. Opening of new rings, publishing of statistics and logging happen between steps, after the outputs are out.

use crate::announced::Announced;
use crate::calls::StepWatch;
use crate::channel::{Claim, PrivateWord, Tree, Waiter};
use crate::clock;
use crate::host::{Opened, Running};
use crate::node::OpenError;
use crate::ports::{Devices, Input, Ports};
use crate::pump::{Arrival, GuardLine, Notifier, Pump, PumpBuilder};
use crate::realtime::{self, Grants};
use crate::robot::{Isolate, NodeSpec, Robot, Scheduler, open_declared};
use crate::stop::{KeepPlace, LatchPlace};
use crate::sys;
use crate::time::Time;
use guard::{Injected, LatchPage, Line, Phase, Table};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Barrier, Mutex, OnceLock};

/// How the nodes of a process are run.
#[derive(Debug, Clone)]
pub struct LiveOptions {
    /// The robot's folder of channels.
    pub root: PathBuf,
    /// Seed of the run.
    pub seed: u64,
    /// The supervisor: when it dies the nodes stop by themselves.
    pub supervisor: Option<u32>,
    /// Take the written paths from a predecessor that merely hangs.
    pub fence: bool,
    /// What the process tree gives its nodes, where there is one.
    pub tree: Option<TreeShare>,
    /// A standby: open everything, then wait for a byte on this descriptor before taking any path.
    pub go: Option<i32>,
}

/// What the process tree gives a process of nodes: see the supervisor's table of what a node finds.
#[derive(Debug, Clone, Copy)]
pub struct TreeShare {
    latch: LatchPage,
    table: Table,
    first: usize,
    count: usize,
    /// Whether this run is one of chaos, in which nodes have the faults that they are told to have.
    faults: bool,
}

impl TreeShare {
    /// From `SINEW_TABLE` ("descriptor first count") and `SINEW_LATCH_FD`; `None` outside a tree.
    pub fn inherited() -> Option<TreeShare> {
        let number = |text: &str| text.parse::<i32>().ok();
        let latch = guard::inherited(number(&std::env::var("SINEW_LATCH_FD").ok()?)?).ok()?;
        let told = std::env::var("SINEW_TABLE").ok()?;
        let mut words = told.split(' ').map(number);
        let (descriptor, first, count) = (words.next()??, words.next()??, words.next()??);
        let table = guard::inherited(descriptor).ok()?;
        Some(TreeShare {
            latch: LatchPage::map(&latch).ok()?,
            table: Table::map(&table).ok()?,
            first: usize::try_from(first).ok()?,
            count: usize::try_from(count).ok()?,
            faults: std::env::var_os("SINEW_FAULTS").is_some_and(|word| word == "allowed"),
        })
    }

    fn line(&self, node: usize) -> Option<Line> {
        self.table.line(self.first + node).filter(|_| node < self.count)
    }
}

/// Why a process of nodes could not run or ended.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// A node could not be opened.
    #[error("node {instance}: {source}")]
    Open {
        /// Which.
        instance: String,
        /// Why.
        source: OpenError,
    },
    /// There is no such node.
    #[error("robot \"{robot}\" has no node {instance}")]
    Unknown {
        /// The robot.
        robot: String,
        /// The node asked for.
        instance: String,
    },
    /// The channels' folder cannot be used.
    #[error("{0}")]
    Tree(String),
    /// A thread could not be started, or ended in a panic.
    #[error("node {instance}: {reason}")]
    Thread {
        /// Which.
        instance: String,
        /// Why.
        reason: String,
    },
}

/// Stack of a node's thread: enough for any step that keeps its arrays in its struct [byte].
const STACK_BYTES: usize = 256 * 1024;
/// How often a node publishes how it keeps time [s].
const STATISTICS_S: f64 = 1.0;
/// A node in a process tree wakes at least this often, so that a hang is told from an idle node [s].
const BEAT_S: f64 = 0.025;
/// A node that is told to take memory for ever takes so many MiB.
const MOST_HOGGED: usize = 512;
/// It may be silent for three periods, and for so long in any case [s].
const SILENT_S: f64 = 0.1;
/// How often a node looks for rings that were absent [s].
const REBIND_S: f64 = 0.25;

/// Words to bump when the process is asked to stop. The signal's handler may not take a lock: they are set once, before
/// signals are caught.
static STOP_WORDS: OnceLock<Vec<PrivateWord>> = OnceLock::new();

fn wake_all() {
    for word in STOP_WORDS.get().into_iter().flatten() {
        word.bump();
    }
}

/// Runs the nodes `paths` ("/layer/instance") of `robot` in this process until it is asked to stop. `ready` runs when
/// all have started.
pub fn run(
    robot: &Robot,
    paths: &[String],
    options: &LiveOptions,
    ready: impl FnOnce(&[Grants]),
) -> Result<(), LiveError> {
    let mut specs = Vec::new();
    for path in paths {
        match robot.nodes.iter().find(|spec| spec.path() == *path) {
            Some(spec) => specs.push(spec.clone()),
            None => return Err(LiveError::Unknown { robot: robot.name.clone(), instance: path.clone() }),
        }
    }
    let lowest = specs.iter().map(|spec| spec.priority).min().unwrap_or(1);
    let words: Vec<PrivateWord> = specs.iter().map(|_| PrivateWord::new()).collect();
    let _ = STOP_WORDS.set(words.clone());
    sys::catch_stop_signals(wake_all);
    let barrier = Arc::new(Barrier::new(specs.len() + 1));
    let gate =
        options.go.map(|_| Arc::new(Gate { opened: Barrier::new(specs.len() + 1), go: Barrier::new(specs.len() + 1) }));
    let grants = Arc::new(Mutex::new(Vec::new()));
    let failed = Arc::new(Mutex::new(None));
    let mut threads = Vec::new();
    for (index, (spec, word)) in specs.into_iter().zip(words).enumerate() {
        let (robot, options, barrier) = (robot.clone(), options.clone(), barrier.clone());
        let (grants, failed, gate) = (grants.clone(), failed.clone(), gate.clone());
        let instance = spec.instance.clone();
        let body = move || {
            let line = options.tree.as_ref().and_then(|tree| tree.line(index));
            let opened = NodeThread::open(&robot, &spec, &options);
            if let Some(gate) = &gate {
                if opened.is_err() {
                    sys::request_stop();
                }
                gate.opened.wait();
                gate.go.wait();
            }
            let started = opened.and_then(|opened| NodeThread::start(&robot, &spec, &options, opened, word, line));
            match &started {
                Ok(thread) => grants.lock().unwrap_or_else(|e| e.into_inner()).push(thread.grants.clone()),
                Err(_) => sys::request_stop(),
            }
            barrier.wait();
            match started {
                Ok(thread) => thread.run(),
                Err(e) => *failed.lock().unwrap_or_else(|e| e.into_inner()) = Some(e),
            }
        };
        let thread = std::thread::Builder::new().name(instance.clone()).stack_size(STACK_BYTES).spawn(body);
        let thread = thread.map_err(|e| LiveError::Thread { instance: instance.clone(), reason: e.to_string() })?;
        threads.push((instance, thread));
    }
    if let (Some(gate), Some(go)) = (&gate, options.go) {
        gate.opened.wait();
        if !sys::stop_requested() {
            report_waiting();
            if !sys::wait_for_go(go) {
                sys::request_stop();
            }
        }
        gate.go.wait();
    }
    barrier.wait();
    if !sys::stop_requested() {
        if robot.realtime.lock_memory {
            sys::forget_startup_code();
        }
        ready(&grants.lock().unwrap_or_else(|e| e.into_inner()));
        if robot.realtime.scheduler == Scheduler::Fifo {
            // From here on this thread sleeps until the end. A killed process is dead when the last of its threads is: one
            // that waits for a processor behind everybody else would hide the death from the supervisor.
            let _ = realtime::ask_for_fifo(lowest);
        }
    }
    for (instance, thread) in threads {
        if thread.join().is_err() {
            // The other nodes of this process end with it: they share its fate by the robot file's wish.
            sys::request_stop();
            return Err(LiveError::Thread { instance, reason: "its step panicked".into() });
        }
    }
    match failed.lock().unwrap_or_else(|e| e.into_inner()).take() {
        Some(e) => Err(e),
        None => Ok(()),
    }
}

/// A node's pump, and what the step's thread shares with it.
type Pumped = (Pump, Arc<StepWatch>, Granted, Option<Arc<GuardLine>>);

/// What the step's thread was granted, once that is known.
type Granted = Arc<OnceLock<Grants>>;

/// Starts the node's waiting thread, one priority above its step, so that no caller waits for a step.
fn spawn_pump(
    ports: &mut Ports,
    spec: &NodeSpec,
    robot: &Robot,
    options: &LiveOptions,
    notifier: Notifier,
) -> Result<Pumped, OpenError> {
    let mut pump = std::mem::replace(&mut ports.pump, PumpBuilder::new(&spec.path()));
    pump.notify(notifier);
    let (realtime, priority, path) = (robot.realtime, spec.priority + 1, spec.path());
    pump.on_start(move || {
        let grants = realtime::apply(&realtime, priority, &format!("{path} pump"));
        if grants.refused() {
            eprintln!("{grants}");
        }
    });
    let said_by = spec.path();
    pump.log(Arc::new(move |line| eprintln!("{said_by}: {line}")));
    let told: Granted = Arc::default();
    let (state, type_name, seed) = (told.clone(), spec.kind.name, options.seed);
    let path = spec.path();
    pump.state(move || {
        let granted = state.get().map_or_else(|| "starting".to_owned(), ToString::to_string);
        serde_json::json!({ "node": path, "type": type_name, "pid": std::process::id(), "seed": seed, "granted": granted })
            .to_string()
    });
    if options.fence {
        pump.take_over();
    }
    if robot.nodes.iter().any(|node| node.isolate == Isolate::Strict) {
        pump.callers(callers_of(robot, &spec.path(), &options.root));
    }
    let guard = options.tree.and_then(|_| pump.guarded(&options.root));
    if let Some(supervisor) = options.supervisor
        && let Some(process) = rustix::process::Pid::from_raw(supervisor as i32)
    {
        // A process that dies between its end and our look has left us to somebody else; its number may be taken again.
        let gone = rustix::process::getppid().is_none_or(|parent| parent.as_raw_nonzero().get() == 1);
        match rustix::process::pidfd_open(process, rustix::process::PidfdFlags::empty()) {
            Ok(_) if gone => sys::request_stop(),
            Ok(descriptor) => pump.watch_process(descriptor, sys::request_stop),
            // It is gone already: nobody would stop this node.
            Err(_) => sys::request_stop(),
        }
    }
    let step_watch = pump.step_watch();
    let pump = pump.spawn(&options.root).map_err(|e| OpenError::Device { reason: e.to_string() })?;
    Ok((pump, step_watch, told, guard))
}

/// Users of the nodes that call the node at `path`: their folders belong to them.
fn callers_of(robot: &Robot, path: &str, root: &std::path::Path) -> Vec<u32> {
    let calls = |spec: &&NodeSpec| spec.calls.values().any(|(target, _)| target == path);
    let folder = |spec: &NodeSpec| root.join(spec.path().trim_start_matches('/'));
    let user = |spec: &NodeSpec| rustix::fs::stat(folder(spec)).ok().map(|folder| folder.st_uid);
    robot.nodes.iter().filter(calls).filter_map(user).collect()
}

/// Tells the supervisor that this process is ready, where one is listening (`SINEW_READY_FD`).
pub fn report_ready() {
    if let Some(descriptor) = std::env::var("SINEW_READY_FD").ok().and_then(|text| text.parse().ok())
        && let Err(e) = sys::report_ready(descriptor)
    {
        eprintln!("cannot tell the supervisor that this process is ready: {e}");
    }
}

/// Tells the supervisor that this standby waits, on the descriptor on which it will say that it is ready.
fn report_waiting() {
    if let Some(descriptor) = std::env::var("SINEW_READY_FD").ok().and_then(|text| text.parse().ok())
        && let Err(e) = sys::report_waiting(descriptor)
    {
        eprintln!("cannot tell the supervisor that this standby waits: {e}");
    }
}

/// Where the nodes of a standby wait: all are opened, then all go on.
struct Gate {
    opened: Barrier,
    go: Barrier,
}

/// What has come from the pump since the last look.
#[derive(Default)]
struct Arrivals {
    /// A bit per kind.
    kinds: AtomicU32,
    /// When the newest came [ns].
    at_ns: AtomicU64,
}

/// One node on its thread.
struct NodeThread {
    instance: String,
    running: Running,
    tree: Tree,
    word: PrivateWord,
    arrivals: Arc<Arrivals>,
    triggers: Vec<Rc<Input>>,
    device_trigger: bool,
    pump: Pump,
    step_watch: Arc<StepWatch>,
    grants: Grants,
    rebind: Time,
    last_fault: Option<crate::Fault>,
    line: Option<Line>,
    faults: bool,
    guard: Option<Arc<GuardLine>>,
    /// What the governor says of its period.
    announced: Option<Announced>,
    /// The newest word of the latch that a step has seen, and that the node has said to have obeyed.
    latch_seen: u32,
    obeyed: u32,
}

impl NodeThread {
    /// Opens the node without taking any path. A standby asks the kernel for its real-time rights here: what it locks
    /// in memory then is there when it must be quick.
    fn open(robot: &Robot, spec: &NodeSpec, options: &LiveOptions) -> Result<(Opened, Option<Grants>), LiveError> {
        let fail = |source: OpenError| LiveError::Open { instance: spec.instance.clone(), source };
        let place = Devices::Live(options.root.clone());
        let opened = open_declared(robot, spec, options.seed, place).map_err(fail)?;
        Ok((opened, options.go.map(|_| realtime::apply(&robot.realtime, spec.priority, &spec.path()))))
    }

    fn start(
        robot: &Robot,
        spec: &NodeSpec,
        options: &LiveOptions,
        (mut opened, granted): (Opened, Option<Grants>),
        word: PrivateWord,
        line: Option<Line>,
    ) -> Result<NodeThread, LiveError> {
        let instance = spec.instance.clone();
        let fail = |source: OpenError| LiveError::Open { instance: instance.clone(), source };
        if granted.is_none() {
            // What reading and opening took, and a step does not need.
            sys::trim_heap();
        }
        let tree = Tree::shared(&options.root).map_err(|e| LiveError::Tree(e.to_string()))?;
        let claim = if options.fence { Claim::Fence } else { Claim::Continue };
        opened.ports.bind(&tree, claim).map_err(fail)?;
        let arrivals = Arc::new(Arrivals::default());
        let notifier: Notifier = {
            let (arrivals, word) = (arrivals.clone(), word.clone());
            Arc::new(move |arrival| {
                arrivals.at_ns.store(clock::now().nanos(), Ordering::Relaxed);
                arrivals.kinds.fetch_or(bit(arrival), Ordering::Release);
                word.bump();
            })
        };
        if let Some(tree) = &options.tree {
            *opened.ports.latch.place.borrow_mut() = LatchPlace::Shared(tree.latch);
        }
        if let Some(line) = line {
            *opened.ports.keepsake.place.borrow_mut() = KeepPlace::Line(line);
            let period_s = spec.period_ns.map_or(0.0, |period| period as f64 * 1e-9);
            let deadline_s = spec.deadline_ns.map_or(0.0, |deadline| deadline as f64 * 1e-9);
            let limit_s = SILENT_S.max(3.0 * period_s).max(3.0 * deadline_s);
            let thread = rustix::thread::gettid().as_raw_nonzero().get() as u32;
            line.begin(std::process::id(), thread, (limit_s * 1e9) as u64);
        }
        let (pump, step_watch, told, guard) =
            spawn_pump(&mut opened.ports, spec, robot, options, notifier).map_err(fail)?;
        let grants = granted.unwrap_or_else(|| realtime::apply(&robot.realtime, spec.priority, &spec.path()));
        let _ = told.set(grants.clone());
        let start = clock::now();
        let triggers: Vec<Rc<Input>> = opened
            .ports
            .inputs()
            .iter()
            .filter(|input| spec.triggers.iter().any(|t| t == input.port))
            .cloned()
            .collect();
        for input in &triggers {
            input.take_arrival();
        }
        let mut running = Running::new(opened, spec, start);
        if let Err(fault) = running.start(start) {
            eprintln!("{}: start: {fault}", spec.path());
        }
        Ok(NodeThread {
            instance: spec.path(),
            running,
            tree,
            word,
            arrivals,
            triggers,
            device_trigger: spec.triggers.iter().any(|t| t == "device"),
            pump,
            step_watch,
            grants,
            rebind: start,
            last_fault: None,
            line,
            faults: options.tree.is_some_and(|tree| tree.faults),
            guard,
            announced: Announced::of(robot, spec),
            latch_seen: 0,
            obeyed: 0,
        })
    }

    fn run(mut self) {
        let mut waiter = self.waiter();
        while !sys::stop_requested() {
            waiter.snapshot();
            let now = clock::now();
            if let Some(announced) = &mut self.announced {
                self.running.keep_to(now, announced.look(now));
            }
            match self.release(now) {
                Some(release) => {
                    // The result is counted by `step`; what changed is logged between steps.
                    self.beat(now, Phase::Stepping);
                    if self.faults {
                        self.suffer();
                    }
                    self.step_watch.begin(now);
                    let _ = self.running.step(now, release, clock::now);
                    let ended = clock::now();
                    self.step_watch.end(ended);
                    self.count();
                    self.tell_obeyed();
                    self.beat(ended, Phase::Waiting);
                    if self.between_steps() {
                        waiter = self.waiter();
                    }
                }
                None => {
                    self.beat(now, Phase::Waiting);
                    let grid = self.running.next_on_grid();
                    let beat = self.line.map(|_| now.after_s(BEAT_S));
                    let until = [grid, beat].into_iter().flatten().min();
                    waiter.wait(until.map(Time::nanos));
                    // Of the suspended there is no step to do it after.
                    if self.running.suspended && self.between_steps() {
                        waiter = self.waiter();
                    }
                }
            }
        }
        self.beat(clock::now(), Phase::Ended);
        self.running.stop(clock::now());
        let summary = self.running.summary();
        self.running.opened.statistics.write(clock::now(), &summary);
        self.pump.stop();
    }

    fn beat(&self, now: Time, phase: Phase) {
        if let Some(line) = &self.line {
            line.beat(now.nanos(), phase);
        }
    }

    fn count(&self) {
        if let Some(line) = &self.line {
            line.count(self.running.counted.work());
        }
    }

    /// Has the fault that chaos wants, if it wants one.
    fn suffer(&self) {
        let Some(fault) = self.line.as_ref().and_then(Line::take_injected) else { return };
        eprintln!("{}: {fault:?}, as chaos wants", self.instance);
        let mut memory = Vec::new();
        loop {
            match fault {
                Injected::Hang => clock::sleep_s(3600.0),
                Injected::Spin => std::hint::spin_loop(),
                // Bounded, so that a supervisor that fails does not take the machine with it.
                Injected::Hog if memory.len() < MOST_HOGGED => memory.push(vec![1_u8; 1 << 20]),
                Injected::Hog => std::hint::spin_loop(),
            }
        }
    }

    /// Passes on that the step has obeyed the stop latch, and when.
    fn tell_obeyed(&mut self) {
        let latch = &self.running.opened.ports.latch;
        let (word, at) = (latch.obeyed.get().0, latch.obeyed_at.get());
        if word != self.obeyed {
            self.obeyed = word;
            if let Some(line) = &self.line {
                line.obeyed(word, at.nanos());
            }
            if let Some(guard) = &self.guard {
                guard.obeyed(word);
            }
        }
    }

    /// When the latch has changed since the last step: now.
    fn latched(&mut self, now: Time) -> Option<Time> {
        let word = self.running.opened.ports.latch.futex()?.load(Ordering::Relaxed);
        (std::mem::replace(&mut self.latch_seen, word) != word).then_some(now)
    }

    /// When the step that is due now was released; `None` when none is due. A sample releases a step at its stamp (so
    /// that the way here counts as lateness), the pump at the moment of its news, the grid on the grid.
    fn release(&mut self, now: Time) -> Option<Time> {
        let kinds = self.arrivals.kinds.swap(0, Ordering::Acquire);
        let called = kinds & (bit(Arrival::Call) | bit(Arrival::Reply)) != 0;
        let device = self.device_trigger && kinds & bit(Arrival::Device) != 0;
        let sampled = self.triggers.iter().fold(None, |newest: Option<Time>, input| newest.max(input.take_arrival()));
        let latched = self.latched(now);
        let sampled = sampled.filter(|_| !self.running.suspended);
        match self.running.grid.filter(|_| !self.running.suspended) {
            Some(grid) if grid.due(now) => Some(grid.next()),
            _ if device || called => Some(Time::from_nanos(self.arrivals.at_ns.load(Ordering::Relaxed)).min(now)),
            _ => latched.or(sampled.map(|stamp| stamp.min(now))),
        }
    }

    fn waiter(&self) -> Waiter {
        let mut words = Vec::new();
        for input in &self.triggers {
            input.take_changed();
            words.extend(input.sources.borrow().iter().filter_map(|s| s.ring.as_ref().map(|ring| ring.word())));
        }
        let mut waiter = Waiter::new(&self.word, words).unwrap_or_else(|e| {
            // Only the private word is left to wait on; the grid goes on.
            eprintln!("{}: cannot wait on the triggers: {e}", self.instance);
            Waiter::new(&self.word, Vec::new()).expect("a wait on one word needs nothing of the kernel")
        });
        if let Some(latch) = self.running.opened.ports.latch.futex() {
            waiter.also(latch);
        }
        waiter
    }

    /// Everything that may take its time: opens rings, publishes, logs. Whether the waiter must be made anew.
    fn between_steps(&mut self) -> bool {
        let now = clock::now();
        self.running.publish_statistics(now, STATISTICS_S);
        if self.running.last_fault != self.last_fault {
            self.last_fault = self.running.last_fault;
            match self.last_fault {
                Some(fault) => eprintln!("{}: fault: {fault}", self.instance),
                None => eprintln!("{}: fault is over", self.instance),
            }
        }
        for input in self.running.opened.ports.inputs() {
            if let Some((at, path)) = input.take_switched() {
                eprintln!("{}: {} is read from {path} since {:.6} s", self.instance, input.port, at.seconds());
            }
        }
        if let Some(output) = self.running.opened.ports.outputs().iter().find(|output| output.lost.get()) {
            // A successor writes here now, or the file is damaged: this process has nothing left to do.
            eprintln!("{}: {} is no longer this process's to write; stopping", self.instance, output.path);
            sys::request_stop();
        }
        if now.since(self.rebind) < REBIND_S {
            return false;
        }
        self.rebind = now;
        if let Some(announced) = &mut self.announced {
            announced.bind(&self.tree);
        }
        for input in self.running.opened.ports.inputs() {
            if let Err(e) = input.bind(&self.tree) {
                eprintln!("{}: {e}", self.instance);
            }
        }
        self.triggers.iter().any(|input| input.take_changed())
    }
}

fn bit(arrival: Arrival) -> u32 {
    match arrival {
        Arrival::Device => 1,
        Arrival::Call => 2,
        Arrival::Reply => 4,
    }
}
