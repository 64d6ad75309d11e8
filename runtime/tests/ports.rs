//! What a step sees through its ports: frozen inputs, candidates, sets, history, losses, calls.
#![allow(clippy::unwrap_used, reason = "tests")]

use messages::{Command, Message, Odometry, Twist, bytemuck};
use runtime::calls::{LocalRequest, TicketState};
use runtime::channel::SampleBuffer;
use runtime::robot::{Resources, Robot};
use runtime::{
    CallPort, Fault, Layer, Node, NodeType, OpenError, Ports, Reader, Sample, Set, SimulatedHost, Time, Writer,
};
use schemars::JsonSchema;
use serde::Deserialize;

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Settings {
    value: f64,
}

/// Writes its setting and its step's number; answers a call with the doubled request.
struct Source {
    value: f64,
    steps: f64,
    out: Writer<Twist>,
    double: CallPort<Twist, Twist>,
}

impl Node for Source {
    const TYPE: &'static str = "source";
    const LAYER: Layer = Layer::Drivers;
    type Config = Settings;

    fn open(ports: &mut Ports, config: Settings) -> Result<Self, OpenError> {
        Ok(Source { value: config.value, steps: 0.0, out: ports.writer("twist")?, double: ports.call("double")? })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.steps += 1.0;
        self.out.write(now, &Twist { linear_x_m_s: self.value, linear_y_m_s: self.steps, angular_z_rad_s: 0.0 });
        while let Some(request) = self.double.take() {
            let doubled = Twist { linear_x_m_s: 2.0 * request.message.linear_x_m_s, ..Twist::default() };
            self.double.answer(request, &doubled);
        }
        Ok(())
    }
}

/// Tells what it reads: value, switches and drops of its reader; members and sum of its set; what it wrote itself.
struct Witness {
    best: Reader<Twist>,
    slow: Reader<Twist>,
    own: Reader<Odometry>,
    all: Set<Twist>,
    out: Writer<Odometry>,
    count: u64,
}

impl Node for Witness {
    const TYPE: &'static str = "witness";
    const LAYER: Layer = Layer::Perception;
    type Config = Settings;

    fn open(ports: &mut Ports, _config: Settings) -> Result<Self, OpenError> {
        Ok(Witness {
            best: ports.reader("best")?,
            slow: ports.reader("slow")?,
            own: ports.reader("own")?,
            all: ports.set("all")?,
            out: ports.writer("report")?,
            count: 0,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.count += 1;
        let mut seen = Odometry { origin: self.count, ..Odometry::default() };
        seen.x_m = self.best.fresh(now).map_or(-1.0, |s| s.linear_x_m_s);
        seen.y_m = self.best.switches() as f64;
        let mut members = 0.0;
        self.all.each(|_, s: Sample<'_, Twist>| {
            members += 1.0;
            seen.heading_rad += s.linear_x_m_s;
        });
        seen.pose_covariance[0] = members;
        // Only every twentieth step reads what it has not read.
        if self.count.is_multiple_of(20) {
            while self.slow.next_unread().is_some() {
                seen.pose_covariance[1] += 1.0;
            }
        }
        seen.pose_covariance[2] = self.slow.dropped() as f64;
        let middle = now.before_s(0.015);
        if let Some((before, after)) = self.slow.around(middle) {
            seen.pose_covariance[3] = after.stamp.since(before.stamp);
            seen.pose_covariance[4] = f64::from(before.stamp <= middle && middle < after.stamp);
        }
        let mut history = 0.0;
        self.slow.newest(3, |s| history = history * 1000.0 + s.linear_y_m_s);
        seen.pose_covariance[5] = history;
        seen.pose_covariance[6] = self.best.age_s();
        let before = self.own.latest().map_or(0, |s| s.origin);
        self.out.write(now, &seen);
        let after = self.own.latest().map_or(0, |s| s.origin);
        assert_eq!(before, after, "a step's inputs are frozen, even against its own writing");
        assert_eq!(after, self.count - 1);
        Ok(())
    }
}

const TYPES: &[NodeType] = &[NodeType::of::<Source>(), NodeType::of::<Witness>()];

const TOY: &str = r#"
[robot]
name = "toy"
[nodes.laser]
type = "source"
period_ms = 10
config.value = 1.0
depth.twist = 8
[nodes.sonar]
type = "source"
period_ms = 10
config.value = 2.0
[nodes.witness]
type = "witness"
period_ms = 10
reads.best = { from = ["/drivers/laser/twist", "/drivers/sonar/twist"], max_age_ms = 35, return_after_ms = 200 }
reads.slow = "/drivers/laser/twist"
reads.own = "/perception/witness/report"
reads.all = "/drivers/*/twist"
"#;

fn host() -> SimulatedHost {
    let robot = Robot::parse(TOY, "toy.toml", Resources::Folder(".".into()), TYPES).unwrap();
    SimulatedHost::new(&robot, 1, Time::ZERO).unwrap()
}

fn report(host: &SimulatedHost) -> Odometry {
    let ring = host.tree().reader("/perception/witness/report", None).unwrap();
    let mut buffer = SampleBuffer::new(ring.geometry());
    ring.read(ring.head(), &mut buffer).unwrap();
    *bytemuck::from_bytes(buffer.fixed())
}

fn at(host: &mut SimulatedHost, seconds: f64) -> Odometry {
    host.run_until(Time::from_seconds(seconds));
    report(host)
}

#[test]
fn the_second_candidate_takes_over_when_the_first_is_stale_and_gives_back_after_a_while_of_health() {
    let mut host = host();
    let laser = host.index_of("/drivers/laser").unwrap();
    assert_eq!(at(&mut host, 0.5).x_m, 1.0, "the preferred one");
    host.kill(laser);
    let seen = at(&mut host, 0.525);
    assert_eq!((seen.x_m, seen.y_m), (1.0, 0.0), "still fresh");
    let seen = at(&mut host, 0.565);
    assert_eq!((seen.x_m, seen.y_m), (2.0, 1.0), "stale: the sonar counts");
    host.restart(laser).unwrap();
    assert_eq!(at(&mut host, 0.7).x_m, 2.0, "not proven yet");
    let seen = at(&mut host, 0.8);
    assert_eq!((seen.x_m, seen.y_m), (1.0, 2.0), "healthy for 200 ms: back");
}

#[test]
fn without_any_fresh_candidate_there_is_no_sample() {
    let mut host = host();
    host.run_until(Time::from_seconds(0.1));
    for path in ["/drivers/laser", "/drivers/sonar"] {
        let index = host.index_of(path).unwrap();
        host.kill(index);
    }
    let seen = at(&mut host, 0.3);
    assert_eq!(seen.x_m, -1.0);
    assert!(seen.pose_covariance[6] > 0.15, "its age tells for how long: {}", seen.pose_covariance[6]);
}

#[test]
fn a_set_has_the_newest_sample_of_every_member() {
    let mut host = host();
    let seen = at(&mut host, 0.1);
    assert_eq!((seen.pose_covariance[0], seen.heading_rad), (2.0, 3.0));
}

#[test]
fn a_slow_reader_knows_how_many_samples_it_lost() {
    let mut host = host();
    let seen = at(&mut host, 0.199);
    // Step 20 reads: twenty samples were written, the ring keeps the newest eight.
    assert_eq!(seen.origin, 20);
    assert_eq!(seen.pose_covariance[1] + seen.pose_covariance[2], 20.0, "read and lost are all");
    assert_eq!(seen.pose_covariance[1], 8.0);
}

#[test]
fn history_is_read_by_time_and_by_count() {
    let mut host = host();
    let seen = at(&mut host, 0.5);
    assert!((seen.pose_covariance[3] - 0.01).abs() < 1e-9, "the pair around a time is one period apart");
    assert_eq!(seen.pose_covariance[4], 1.0, "and lies around it");
    let newest = seen.pose_covariance[5] % 1000.0;
    let expected = ((newest - 2.0) * 1000.0 + newest - 1.0) * 1000.0 + newest;
    assert_eq!(seen.pose_covariance[5], expected, "the newest three, oldest first");
}

fn double<'a>(body: &'a [u8], deadline_s: f64) -> LocalRequest<'a> {
    LocalRequest {
        path: "/drivers/laser",
        command: "double",
        layout_hash: Twist::layout_hash(),
        body,
        priority: 0,
        deadline: Time::from_seconds(deadline_s),
    }
}

#[test]
fn a_call_is_answered_by_the_next_step() {
    let mut host = host();
    host.run_until(Time::from_seconds(0.1));
    let request = Twist { linear_x_m_s: 21.0, ..Twist::default() };
    let ticket = host.call(&double(bytemuck::bytes_of(&request), 1.0));
    assert_eq!(host.call_state(ticket), TicketState::Pending);
    host.run_until(Time::from_seconds(0.12));
    let TicketState::Answered(bytes) = host.call_state(ticket) else { panic!("{:?}", host.call_state(ticket)) };
    assert_eq!(bytemuck::from_bytes::<Twist>(&bytes).linear_x_m_s, 42.0);
}

#[test]
fn a_node_that_dies_in_mid_call_gives_its_caller_an_error_at_once() {
    let mut host = host();
    host.run_until(Time::from_seconds(0.1));
    let request = Twist::default();
    let ticket = host.call(&double(bytemuck::bytes_of(&request), 1.0));
    let laser = host.index_of("/drivers/laser").unwrap();
    host.kill(laser);
    assert!(matches!(host.call_state(ticket), TicketState::Lost(_)), "{:?}", host.call_state(ticket));
}

#[test]
fn a_request_of_another_layout_is_refused() {
    let mut host = host();
    let request = Command::default();
    let wrong = LocalRequest { layout_hash: Command::layout_hash(), ..double(bytemuck::bytes_of(&request), 1.0) };
    let ticket = host.call(&wrong);
    host.run_until(Time::from_seconds(0.1));
    assert!(matches!(host.call_state(ticket), TicketState::Refused(_)), "{:?}", host.call_state(ticket));
}
