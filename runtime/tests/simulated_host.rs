//! The simulated host with nodes made for the purpose: order, time, death, and the same bytes from the same seed.
#![allow(clippy::unwrap_used, reason = "tests")]

use messages::{Odometry, Twist};
use runtime::channel::{RawReader, SampleBuffer};
use runtime::robot::{Resources, Robot};
use runtime::{ExecutionModel, Fault, Layer, Node, NodeType, OpenError, Ports, Reader, SimulatedHost, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct NoConfig {}

/// Writes how often it stepped.
struct Clockwork {
    count: f64,
    out: Writer<Twist>,
}

impl Node for Clockwork {
    const TYPE: &'static str = "clockwork";
    const LAYER: Layer = Layer::Drivers;
    type Config = NoConfig;

    fn open(ports: &mut Ports, _config: NoConfig) -> Result<Self, OpenError> {
        Ok(Clockwork { count: 0.0, out: ports.writer("ticks")? })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.count += 1.0;
        self.out.write(now, &Twist { linear_x_m_s: self.count, ..Twist::default() });
        Ok(())
    }
}

/// Passes the newest tick on, with the time at which it saw it.
struct Relay {
    input: Reader<Twist>,
    out: Writer<Odometry>,
}

impl Node for Relay {
    const TYPE: &'static str = "relay";
    const LAYER: Layer = Layer::Perception;
    type Config = NoConfig;

    fn open(ports: &mut Ports, _config: NoConfig) -> Result<Self, OpenError> {
        Ok(Relay { input: ports.reader("ticks")?, out: ports.writer("seen")? })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let Some(tick) = self.input.fresh(now) else { return Err(Fault::new("no tick")) };
        let seen = Odometry { x_m: tick.linear_x_m_s, y_m: now.seconds(), ..Odometry::default() };
        self.out.write(now, &seen);
        Ok(())
    }
}

const TYPES: &[NodeType] = &[NodeType::of::<Clockwork>(), NodeType::of::<Relay>()];

const TOY: &str = r#"
[robot]
name = "toy"
[nodes.clock]
type = "clockwork"
period_ms = 10
[nodes.relay]
type = "relay"
trigger = "ticks"
record_inputs = true
reads.ticks = { from = "/drivers/clock/ticks", max_age_ms = 25 }
"#;

fn robot(text: &str) -> Robot {
    Robot::parse(text, "toy.toml", Resources::Folder(".".into()), TYPES).unwrap()
}

fn seconds(s: f64) -> Time {
    Time::from_seconds(s)
}

/// All samples that a ring still holds, as bytes.
fn bytes_of(ring: &RawReader) -> Vec<u8> {
    let mut buffer = SampleBuffer::new(ring.geometry());
    let mut all = Vec::new();
    for sequence in ring.oldest()..=ring.head() {
        if let Ok(raw) = ring.read(sequence, &mut buffer) {
            all.extend(raw.stamp_ns.to_le_bytes());
            all.extend(buffer.fixed());
        }
    }
    all
}

fn newest_seen(host: &SimulatedHost) -> (f64, f64) {
    let ring = host.tree().reader("/perception/relay/seen", None).unwrap();
    let mut buffer = SampleBuffer::new(ring.geometry());
    ring.read(ring.head(), &mut buffer).unwrap();
    let seen: Odometry = *messages::bytemuck::from_bytes(buffer.fixed());
    (seen.x_m, seen.y_m)
}

#[test]
fn a_sample_releases_its_reader_when_the_writers_step_ends() {
    let exact = ExecutionModel { least_s: 1e-3, most_s: 1e-3, stall_probability: 0.0, stall_s: 0.0 };
    let mut host = SimulatedHost::with_execution(&robot(TOY), 7, Time::ZERO, exact).unwrap();
    host.run_until(seconds(0.0955));
    // Ticks at 0, 10 … 90 ms; each is seen 1 ms later.
    assert_eq!(newest_seen(&host), (10.0, 0.091));
}

#[test]
fn a_period_that_a_long_step_covers_is_skipped_and_counted() {
    let slow = ExecutionModel { least_s: 25e-3, most_s: 25e-3, stall_probability: 0.0, stall_s: 0.0 };
    let mut host = SimulatedHost::with_execution(&robot(TOY), 7, Time::ZERO, slow).unwrap();
    host.run_until(seconds(1.0));
    let statistics = host.statistics(0).unwrap();
    // Steps at 0, 30, 60 … 990 ms and two skipped points after each.
    assert_eq!((statistics.steps, statistics.skipped), (34, 68));
    assert_eq!(statistics.missed_deadlines, 34);
}

#[test]
fn a_dead_writer_leaves_its_readers_without_fresh_samples_and_continues_its_ring_after_the_restart() {
    let mut host = SimulatedHost::new(&robot(TOY), 7, Time::ZERO).unwrap();
    host.run_until(seconds(0.1));
    let ring = host.tree().reader("/drivers/clock/ticks", None).unwrap();
    let (head, generation) = (ring.head(), ring.generation());
    host.kill(0);
    host.run_until(seconds(0.5));
    assert_eq!(ring.head(), head, "the dead write nothing");
    assert!(!host.alive(0));
    host.restart(0).unwrap();
    host.run_until(seconds(0.6));
    assert_eq!(ring.generation(), generation + 1);
    assert!(ring.head() > head, "the same ring goes on");
    assert!(newest_seen(&host).1 > 0.55, "the reader follows without being restarted");
}

#[test]
fn a_hanging_node_holds_its_path_and_goes_on_afterwards() {
    let mut host = SimulatedHost::new(&robot(TOY), 7, Time::ZERO).unwrap();
    host.run_until(seconds(0.1));
    host.hang(0, 0.2);
    let before = host.statistics(0).unwrap().steps;
    host.run_until(seconds(0.29));
    assert_eq!(host.statistics(0).unwrap().steps, before);
    host.run_until(seconds(0.35));
    assert!(host.statistics(0).unwrap().steps > before);
    assert!(host.statistics(0).unwrap().skipped >= 19);
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let run = |seed: u64| {
        let mut host = SimulatedHost::new(&robot(TOY), seed, Time::ZERO).unwrap();
        host.run_until(seconds(2.0));
        bytes_of(&host.tree().reader("/perception/relay/seen", None).unwrap())
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2), "the seed decides how long steps take");
}

#[test]
fn the_time_slices_in_which_a_host_is_run_do_not_matter() {
    let run = |slice_s: f64| {
        let mut host = SimulatedHost::new(&robot(TOY), 3, Time::ZERO).unwrap();
        while host.now() < seconds(2.0) {
            host.run_until(host.now().after_s(slice_s).min(seconds(2.0)));
        }
        bytes_of(&host.tree().reader("/perception/relay/seen", None).unwrap())
    };
    assert_eq!(run(2.0), run(0.0137));
}

#[test]
fn every_steps_inputs_are_published_where_the_robot_file_asks_for_it() {
    use messages::{InputCursor, StepInputs, StepKind, WRITTEN, path_number};
    let mut host = SimulatedHost::new(&robot(TOY), 7, Time::ZERO).unwrap();
    host.run_until(seconds(0.105));
    let ring = host.tree().reader("/perception/relay/inputs", None).unwrap();
    let mut buffer = SampleBuffer::new(ring.geometry());
    for number in 1..=ring.head() {
        ring.read(number, &mut buffer).unwrap();
        let step = number - 1;
        let inputs: StepInputs = *messages::bytemuck::from_bytes(buffer.fixed());
        let cursors: &[InputCursor] = messages::bytemuck::cast_slice(buffer.tail());
        let kind = if step == 0 { StepKind::Start } else { StepKind::Step };
        assert_eq!((inputs.step, inputs.kind, inputs.lost), (step, kind as u32, 0));
        let cursor =
            |port, path, sequence| InputCursor { port, source: path_number(path), generation: 1, sequence, read_to: 0 };
        assert_eq!(
            cursors,
            [
                cursor(0, "/drivers/clock/ticks", step),
                cursor(WRITTEN, "/perception/relay/seen", step.saturating_sub(1))
            ]
        );
    }
    assert_eq!(ring.head(), 12);
}
