//! Runs of a whole robot in the simulated host: one run per seed, spread over the cores, results in order of seeds.

use crate::batch::Faults;
use crate::exit::Failure;
use drivers::p2os::protocol::STOP_PACKETS;
use messages::{Beam, Command, FreeSectors, Message, NodeStatistics, Ranges, Truth, bytemuck};
use runtime::channel::{Expect, RawReader, SampleBuffer};
use runtime::robot::Robot;
use runtime::{Layer, OpenError, SimulatedHost, Time, clock};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use supervisor::SupervisedHost;

/// What became of one run, or of all together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunResult {
    /// Seed of the run.
    pub seed: u64,
    /// Contacts that the robot caused: it drove into something, or reversed blind into something.
    pub contacts_caused: u64,
    /// Contacts that something else caused.
    pub contacts_suffered: u64,
    /// Way travelled [m].
    pub distance_m: f64,
    /// Least distance from the footprint to anything [m].
    pub least_clearance_m: f64,
    /// Mean speed while moving (faster than 1 cm/s) [m/s].
    pub mean_speed_m_s: f64,
    /// Simulated time over the time that one core took.
    pub realtime_factor: f64,
    /// Hash over every sample of the truth and of the motor command.
    pub hash: String,
    /// Seeds with a contact caused, with an emergency stop let go, or with motion under one: replay them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub failing_seeds: Vec<u64>,
    /// What the faults did, where there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faults: Option<FaultResult>,
}

/// What injected faults did to a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct FaultResult {
    /// Faults injected: deaths, hangs, slow-downs, bursts of lost bytes, emergency stops, deaths of the supervisor, spells
    /// in which a command of reactions fails.
    pub injected: [u64; 7],
    /// Commands that reactions asked for (a simulated robot runs none), and those of them that were answered as failed.
    pub commands_and_failed: [u64; 2],
    /// Restarts of processes.
    pub restarts: u64,
    /// Processes given up.
    pub given_up: u64,
    /// Times that limp mode was entered, the robot was held, and an emergency stop was latched.
    pub limps_holds_stops: [u64; 3],
    /// Emergency stops that ended without a reset, or with one before their cause had gone.
    pub stops_let_go: u64,
    /// Commands to move more than a second after an emergency stop and before the robot was reset and resumed.
    pub moves_while_stopped: u64,
    /// From a death to the next sign of life: median, 99 % and greatest [ms].
    pub recovery_ms: [f64; 3],
    #[serde(skip)]
    recoveries_s: Vec<f64>,
}

impl FaultResult {
    fn add(&mut self, other: &FaultResult) {
        for (sum, one) in self.injected.iter_mut().zip(other.injected) {
            *sum += one;
        }
        for (sum, one) in self.limps_holds_stops.iter_mut().zip(other.limps_holds_stops) {
            *sum += one;
        }
        for (sum, one) in self.commands_and_failed.iter_mut().zip(other.commands_and_failed) {
            *sum += one;
        }
        self.restarts += other.restarts;
        self.given_up += other.given_up;
        self.stops_let_go += other.stops_let_go;
        self.moves_while_stopped += other.moves_while_stopped;
        self.recoveries_s.extend_from_slice(&other.recoveries_s);
    }

    fn summed_up(mut self) -> FaultResult {
        self.recoveries_s.sort_by(f64::total_cmp);
        let last = self.recoveries_s.len().saturating_sub(1);
        let at = |q: f64| self.recoveries_s.get((q * last as f64).round() as usize).map_or(0.0, |s| s * 1e3);
        self.recovery_ms = [at(0.5), at(0.99), at(1.0)];
        self
    }
}

/// A point of the track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPoint {
    /// Time since the start [s].
    pub time_s: f64,
    /// Truth at that time.
    pub truth: Truth,
}

/// One run in detail.
#[derive(Debug, Clone)]
pub struct Run {
    /// The figures.
    pub result: RunResult,
    /// Contacts by cause: drove, reversed blind, suffered.
    pub contacts: [u64; 3],
    /// Pose every tenth of a second.
    pub track: Vec<TrackPoint>,
    /// The moment of the greatest force, if an action offers forces.
    pub moment: Option<Moment>,
    moved_while_stopped: u64,
    /// How each node kept time, by its path.
    pub nodes: Vec<(String, NodeStatistics)>,
}

impl Run {
    /// A run of which only the track is known.
    pub fn of_track(seed: u64, track: Vec<TrackPoint>) -> Run {
        let result = RunResult { seed, ..total(&[], 0.0) };
        Run { result, contacts: [0; 3], track, moment: None, nodes: Vec::new(), moved_while_stopped: 0 }
    }
}

/// What the robot saw and felt at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Time since the start [s].
    pub time_s: f64,
    /// Where it was.
    pub truth: Truth,
    /// What its ranger said.
    pub beams: Vec<Beam>,
    /// The forces on it.
    pub sectors: FreeSectors,
}

/// Faster than this is moving [m/s].
const MOVING_M_S: f64 = 0.01;
/// The run goes in slices of this length, after each of which the samples are collected [s].
const SLICE_S: f64 = 0.25;
/// A body at its greatest speed is at rest this long after it was told to stop [s].
const RAMP_S: f64 = 2.0;
/// Looks per slice of a recorded run: no ring may overflow between two.
const RECORDED_LOOKS: u32 = 5;
/// Every so manieth truth becomes a point of the track.
const TRACK_EVERY: u64 = 10;

/// One run of `robot` for `seconds` from `seed`, under the supervisor's policy with these faults, if any.
pub fn run(robot: &Robot, seed: u64, seconds: f64, faults: Option<&Faults>) -> Result<Run, OpenError> {
    match faults {
        Some(faults) => run_under_faults(robot, seed, seconds, faults),
        None => run_slices(robot, seed, seconds, 1, &mut |_| {}),
    }
}

/// The same without faults, recorded to `file`: every step of every node can be replayed from it.
pub fn run_recorded(robot: &Robot, seed: u64, seconds: f64, file: &Path) -> Result<Run, Failure> {
    let mut robot = robot.clone();
    robot.nodes.iter_mut().for_each(|node| node.record_inputs = true);
    let mut facts = recorder::Facts::of(&robot, seed, "simulated");
    facts.build = recorder::facts::build_id();
    let mut out = recorder::RecordingWriter::create(file, &facts)?;
    let mut taps: Option<recorder::Taps> = None;
    let mut done = Ok(());
    let run = run_slices(&robot, seed, seconds, RECORDED_LOOKS, &mut |host| {
        let first = taps.is_none();
        let taps = taps.get_or_insert_with(|| recorder::Taps::new(host.tree().clone(), Vec::new()));
        if done.is_ok() {
            done = if first { taps.look_around(&mut out) } else { Ok(()) }.and_then(|()| taps.drain(&mut out));
        }
    })?;
    done?;
    out.losses(&taps.map(|taps| taps.losses()).unwrap_or_default())?;
    out.finish()?;
    Ok(run)
}

/// One run, with a look at the host after its start, `looks` times in every slice, and after its stop.
fn run_slices(
    robot: &Robot,
    seed: u64,
    seconds: f64,
    looks: u32,
    look: &mut dyn FnMut(&SimulatedHost),
) -> Result<Run, OpenError> {
    let started = clock::now();
    let mut host = SimulatedHost::new(robot, seed, Time::ZERO)?;
    let mut watch = Watch::new(&host);
    let end = Time::from_seconds(seconds);
    look(&host);
    while host.now() < end {
        let begin = host.now();
        for part in 1..=looks {
            host.run_until(begin.after_s(SLICE_S * f64::from(part) / f64::from(looks)).min(end));
            look(&host);
        }
        watch.collect(None);
    }
    let nodes = node_statistics(&host);
    host.stop();
    look(&host);
    let spent_s = clock::now().since(started).max(1e-9);
    Ok(Run { nodes, ..watch.finish(seed, seconds, spent_s) })
}

/// How the nodes that live kept time.
fn node_statistics(host: &SimulatedHost) -> Vec<(String, NodeStatistics)> {
    let nodes = host.robot().nodes.iter().enumerate();
    nodes.filter_map(|(index, node)| Some((node.path(), host.statistics(index)?))).collect()
}

/// One run under the supervisor's policy, with these faults.
fn run_under_faults(robot: &Robot, seed: u64, seconds: f64, faults: &Faults) -> Result<Run, OpenError> {
    let started = clock::now();
    let end = Time::from_seconds(seconds);
    let mut supervised = SupervisedHost::new(robot, seed, Time::ZERO, faults.of(robot, seed, seconds), &last_will)?;
    let mut watch = Watch::new(supervised.host());
    while supervised.host().now() < end {
        let now = supervised.host().now();
        supervised.run_until(now.after_s(SLICE_S).min(end));
        // The stop that stands now: another one may have been reset within the slice, and the robot have moved since.
        watch.collect(supervised.stopped_since().map(|since| since.after_s(RAMP_S)));
    }
    let nodes = robot.nodes.iter().enumerate().map(|(index, node)| (node.path(), supervised.statistics(index)));
    let nodes = nodes.collect();
    supervised.stop();
    let mut run = Run { nodes, ..watch.finish(seed, seconds, clock::now().since(started).max(1e-9)) };
    let told = supervised.chronicle();
    let result = FaultResult {
        injected: told.faults,
        commands_and_failed: [told.commands, told.commands_failed],
        restarts: told.restarts,
        given_up: told.given_up,
        limps_holds_stops: [told.limps, told.holds, told.stops],
        stops_let_go: told.let_go,
        moves_while_stopped: run.moved_while_stopped,
        recovery_ms: [0.0; 3],
        recoveries_s: told.recoveries_s.clone(),
    };
    if run.result.contacts_caused > 0 || result.stops_let_go > 0 || result.moves_while_stopped > 0 {
        run.result.failing_seeds.push(seed);
    }
    run.result.faults = Some(result.summed_up());
    Ok(run)
}

/// The bytes with which the guard stops the device of a driver that is dead, longer than any packet that it may have
/// left half-written.
fn last_will(kind: &str) -> Option<&'static [u8]> {
    static P2OS: [u8; 8 * STOP_PACKETS.len()] = {
        let mut bytes = [0; 8 * STOP_PACKETS.len()];
        let mut k = 0;
        while k < bytes.len() {
            bytes[k] = STOP_PACKETS[k % STOP_PACKETS.len()];
            k += 1;
        }
        bytes
    };
    (kind == "p2os").then_some(&P2OS)
}

/// Runs for every seed of `seeds` on `jobs` threads, recorded where `record` names a file; `done` is called after each with the number finished so far.
pub fn run_all(
    robot: &Robot,
    seeds: std::ops::Range<u64>,
    seconds: f64,
    faults: Option<&Faults>,
    jobs: usize,
    record: &(dyn Fn(u64) -> Option<PathBuf> + Sync),
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Run>, Failure> {
    let count = usize::try_from(seeds.end.saturating_sub(seeds.start)).unwrap_or(usize::MAX);
    let next = AtomicUsize::new(0);
    let finished = AtomicUsize::new(0);
    let work = || {
        let mut runs = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return runs;
            }
            let seed = seeds.start + index as u64;
            let one = match record(seed) {
                Some(file) => run_recorded(robot, seed, seconds, &file),
                None => run(robot, seed, seconds, faults).map_err(Failure::from),
            };
            runs.push((index, one));
            done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        }
    };
    let mut all: Vec<(usize, Result<Run, Failure>)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..jobs.clamp(1, count.max(1))).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(|e| std::panic::resume_unwind(e))).collect()
    });
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, run)| run).collect()
}

/// All runs as one: sums, extremes, and means weighted by time.
pub fn total(runs: &[Run], seconds: f64) -> RunResult {
    let mut hash = Fingerprint::default();
    let mut moving_s = 0.0;
    let mut moving_m = 0.0;
    let mut spent_s = 0.0;
    let mut total = RunResult {
        seed: runs.len() as u64,
        contacts_caused: 0,
        contacts_suffered: 0,
        distance_m: 0.0,
        least_clearance_m: f64::INFINITY,
        mean_speed_m_s: 0.0,
        realtime_factor: 0.0,
        hash: String::new(),
        failing_seeds: Vec::new(),
        faults: None,
    };
    for run in runs {
        let result = &run.result;
        total.failing_seeds.extend_from_slice(&result.failing_seeds);
        if let Some(faults) = &result.faults {
            total.faults.get_or_insert_default().add(faults);
        }
        total.contacts_caused += result.contacts_caused;
        total.contacts_suffered += result.contacts_suffered;
        total.distance_m += result.distance_m;
        total.least_clearance_m = total.least_clearance_m.min(result.least_clearance_m);
        if result.mean_speed_m_s > 0.0 {
            moving_m += result.distance_m;
            moving_s += result.distance_m / result.mean_speed_m_s;
        }
        spent_s += seconds / result.realtime_factor;
        hash.add(result.hash.as_bytes());
    }
    total.mean_speed_m_s = if moving_s > 0.0 { moving_m / moving_s } else { 0.0 };
    total.realtime_factor = if spent_s > 0.0 { seconds * runs.len() as f64 / spent_s } else { 0.0 };
    total.hash = hash.text();
    total.faults = total.faults.map(FaultResult::summed_up);
    total
}

/// Collects what the robot did from its channels.
struct Watch {
    truth: Option<Tap>,
    command: Option<Tap>,
    ranges: Option<Tap>,
    sectors: Option<Tap>,
    moment: Option<Moment>,
    hash: Fingerprint,
    last: Option<Truth>,
    least_clearance_m: f64,
    moving: (f64, u64),
    track: Vec<TrackPoint>,
    moved_while_stopped: u64,
}

/// A channel, and how far it has been read.
pub(crate) struct Tap {
    ring: RawReader,
    buffer: SampleBuffer,
    read_to: u64,
}

impl Tap {
    /// Opens a channel of a simulated robot.
    pub(crate) fn open(host: &SimulatedHost, path: &str, expect: Option<Expect>) -> Option<Tap> {
        let ring = host.tree().reader(path, expect).ok()?;
        let buffer = SampleBuffer::new(ring.geometry());
        Some(Tap { ring, buffer, read_to: 0 })
    }

    /// Hands sequence number, stamp and bytes of every new sample to `each`.
    pub(crate) fn drain(&mut self, mut each: impl FnMut(u64, Time, &SampleBuffer)) {
        let head = self.ring.head();
        while self.read_to < head {
            self.read_to += 1;
            if let Ok(raw) = self.ring.read(self.read_to, &mut self.buffer) {
                each(self.read_to, Time::from_nanos(raw.stamp_ns), &self.buffer);
            }
        }
    }
}

impl Watch {
    fn new(host: &SimulatedHost) -> Watch {
        let of = |layer: Layer, port: &str| {
            host.robot().nodes.iter().find(|n| n.kind.layer == layer).map(|n| n.port_path(port))
        };
        Watch {
            truth: of(Layer::Simulator, "truth").and_then(|path| Tap::open(host, &path, Some(expected::<Truth>()))),
            command: of(Layer::Motion, "command").and_then(|path| Tap::open(host, &path, None)),
            ranges: of(Layer::Drivers, "sonar").and_then(|path| Tap::open(host, &path, Some(expected::<Ranges>()))),
            sectors: host
                .tree()
                .members("/actions/*/free_sectors")
                .ok()
                .and_then(|members| Tap::open(host, members.first()?, Some(expected::<FreeSectors>()))),
            moment: None,
            hash: Fingerprint::default(),
            last: None,
            least_clearance_m: f64::INFINITY,
            moving: (0.0, 0),
            track: Vec::new(),
            moved_while_stopped: 0,
        }
    }

    /// Takes in the new samples; commands to move that were given after `still` must not be.
    fn collect(&mut self, still: Option<Time>) {
        let Watch { truth, command, hash, last, least_clearance_m, moving, track, moved_while_stopped, .. } = self;
        if let Some(truth) = truth {
            truth.drain(|sequence, stamp, buffer| {
                hash.add(&stamp.nanos().to_le_bytes());
                hash.add(buffer.fixed());
                hash.add(buffer.tail());
                let sample: Truth = *bytemuck::from_bytes(buffer.fixed());
                *least_clearance_m = least_clearance_m.min(sample.clearance_m);
                let speed_m_s = sample.velocity.linear_x_m_s.abs();
                if speed_m_s > MOVING_M_S {
                    moving.0 += speed_m_s;
                    moving.1 += 1;
                }
                if sequence % TRACK_EVERY == 1 {
                    track.push(TrackPoint { time_s: stamp.seconds(), truth: sample });
                }
                *last = Some(sample);
            });
        }
        if let Some(command) = command {
            command.drain(|_, stamp, buffer| {
                hash.add(&stamp.nanos().to_le_bytes());
                hash.add(buffer.fixed());
                if still.is_some_and(|still| stamp > still) && buffer.fixed().len() == size_of::<Command>() {
                    let command: Command = *bytemuck::from_bytes(buffer.fixed());
                    let rest = command.velocity.linear_x_m_s == 0.0 && command.velocity.angular_z_rad_s == 0.0;
                    *moved_while_stopped += u64::from(!rest);
                }
            });
        }
        self.collect_moment();
    }

    /// Keeps the moment at which the greatest force so far was felt.
    fn collect_moment(&mut self) {
        let (Some(sectors), Some(ranges), Some(truth)) = (&mut self.sectors, &mut self.ranges, self.last) else {
            return;
        };
        let greatest = |sectors: &FreeSectors| sectors.force.iter().copied().fold(0.0, f64::max);
        let mut newest: Option<(Time, FreeSectors)> = None;
        sectors.drain(|_, stamp, buffer| newest = Some((stamp, *bytemuck::from_bytes(buffer.fixed()))));
        let Some((stamp, felt)) = newest else { return };
        if self.moment.as_ref().is_some_and(|moment| greatest(&moment.sectors) >= greatest(&felt)) {
            return;
        }
        let head = ranges.ring.head();
        if ranges.ring.read(head, &mut ranges.buffer).is_ok() {
            let beams = bytemuck::cast_slice(ranges.buffer.tail()).to_vec();
            self.moment = Some(Moment { time_s: stamp.seconds(), truth, beams, sectors: felt });
        }
    }

    fn finish(self, seed: u64, seconds: f64, spent_s: f64) -> Run {
        let last = self.last.unwrap_or_default();
        let [drove, reversed, suffered] = last.contacts;
        Run {
            result: RunResult {
                seed,
                contacts_caused: drove + reversed,
                contacts_suffered: suffered,
                distance_m: last.distance_m,
                least_clearance_m: self.least_clearance_m,
                mean_speed_m_s: if self.moving.1 > 0 { self.moving.0 / self.moving.1 as f64 } else { 0.0 },
                realtime_factor: seconds / spent_s,
                hash: self.hash.text(),
                failing_seeds: Vec::new(),
                faults: None,
            },
            moved_while_stopped: self.moved_while_stopped,
            contacts: last.contacts,
            track: self.track,
            moment: self.moment,
            nodes: Vec::new(),
        }
    }
}

/// What a reader of `M` expects of a channel.
pub(crate) fn expected<M: Message>() -> Expect {
    Expect { type_name: M::NAME.into(), layout_hash: M::layout_hash() }
}

/// A fingerprint of bytes in 64 bits: tells runs apart, and resists nobody.
#[derive(Debug, Clone, Copy)]
pub struct Fingerprint(u64);

impl Default for Fingerprint {
    fn default() -> Fingerprint {
        Fingerprint(0xcbf2_9ce4_8422_2325)
    }
}

impl Fingerprint {
    /// Takes more bytes in, eight at a time.
    pub fn add(&mut self, bytes: &[u8]) {
        let (words, rest) = bytes.as_chunks();
        for word in words {
            self.mix(u64::from_le_bytes(*word));
        }
        if !rest.is_empty() {
            let mut word = [0; 8];
            word[..rest.len()].copy_from_slice(rest);
            self.mix(u64::from_le_bytes(word));
        }
    }

    /// Every step can be undone, so that one word that differs always tells; the turn brings high bits down again.
    fn mix(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(29) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    /// As sixteen digits.
    pub fn text(self) -> String {
        format!("{:016x}", self.0)
    }
}
