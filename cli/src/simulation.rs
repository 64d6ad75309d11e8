//! Runs of a whole robot in the simulated host: one run per seed, spread over the cores, results in order of seeds.

use messages::{Beam, FreeSectors, Message, NodeStatistics, Ranges, Truth, bytemuck};
use runtime::channel::{Expect, RawReader, SampleBuffer};
use runtime::robot::Robot;
use runtime::{Layer, OpenError, SimulatedHost, Time, clock};
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering};

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
    /// How each node kept time, by its path.
    pub nodes: Vec<(String, NodeStatistics)>,
}

impl Run {
    /// A run of which only the track is known.
    pub fn of_track(seed: u64, track: Vec<TrackPoint>) -> Run {
        let result = RunResult { seed, ..total(&[], 0.0) };
        Run { result, contacts: [0; 3], track, moment: None, nodes: Vec::new() }
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
/// Every so manieth truth becomes a point of the track.
const TRACK_EVERY: u64 = 10;

/// One run of `robot` for `seconds` from `seed`.
pub fn run(robot: &Robot, seed: u64, seconds: f64) -> Result<Run, OpenError> {
    let started = clock::now();
    let mut host = SimulatedHost::new(robot, seed, Time::ZERO)?;
    let mut watch = Watch::new(&host);
    let end = Time::from_seconds(seconds);
    while host.now() < end {
        host.run_until(host.now().after_s(SLICE_S).min(end));
        watch.collect();
    }
    let nodes = node_statistics(&host);
    host.stop();
    let spent_s = clock::now().since(started).max(1e-9);
    Ok(Run { nodes, ..watch.finish(seed, seconds, spent_s) })
}

/// How the nodes that live kept time.
fn node_statistics(host: &SimulatedHost) -> Vec<(String, NodeStatistics)> {
    let nodes = host.robot().nodes.iter().enumerate();
    nodes.filter_map(|(index, node)| Some((node.path(), host.statistics(index)?))).collect()
}

/// Runs for every seed of `seeds` on `jobs` threads; `done` is called after each with the number finished so far.
pub fn run_all(
    robot: &Robot,
    seeds: std::ops::Range<u64>,
    seconds: f64,
    jobs: usize,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Run>, OpenError> {
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
            runs.push((index, run(robot, seeds.start + index as u64, seconds)));
            done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        }
    };
    let mut all: Vec<(usize, Result<Run, OpenError>)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..jobs.clamp(1, count.max(1))).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(|e| std::panic::resume_unwind(e))).collect()
    });
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, run)| run).collect()
}

/// All runs as one: sums, extremes, and means weighted by time.
pub fn total(runs: &[Run], seconds: f64) -> RunResult {
    let mut hash = Fnv::default();
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
    };
    for run in runs {
        let result = &run.result;
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
    total
}

/// Collects what the robot did from its channels.
struct Watch {
    truth: Option<Tap>,
    command: Option<Tap>,
    ranges: Option<Tap>,
    sectors: Option<Tap>,
    moment: Option<Moment>,
    hash: Fnv,
    last: Option<Truth>,
    least_clearance_m: f64,
    moving: (f64, u64),
    track: Vec<TrackPoint>,
}

/// A channel, and how far it has been read.
struct Tap {
    ring: RawReader,
    buffer: SampleBuffer,
    read_to: u64,
}

impl Tap {
    fn open(host: &SimulatedHost, path: &str, expect: Option<Expect>) -> Option<Tap> {
        let ring = host.tree().reader(path, expect).ok()?;
        let buffer = SampleBuffer::new(ring.geometry());
        Some(Tap { ring, buffer, read_to: 0 })
    }

    /// Hands sequence number, stamp and bytes of every new sample to `each`.
    fn drain(&mut self, mut each: impl FnMut(u64, Time, &SampleBuffer)) {
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
            hash: Fnv::default(),
            last: None,
            least_clearance_m: f64::INFINITY,
            moving: (0.0, 0),
            track: Vec::new(),
        }
    }

    fn collect(&mut self) {
        let Watch { truth, command, hash, last, least_clearance_m, moving, track, .. } = self;
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
            },
            contacts: last.contacts,
            track: self.track,
            moment: self.moment,
            nodes: Vec::new(),
        }
    }
}

fn expected<M: Message>() -> Expect {
    Expect { type_name: M::NAME.into(), layout_hash: M::layout_hash() }
}

/// FNV-1a over 64 bits.
#[derive(Debug, Clone, Copy)]
pub struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Fnv {
        Fnv(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    /// Takes more bytes in.
    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    /// As sixteen digits.
    pub fn text(self) -> String {
        format!("{:016x}", self.0)
    }
}
