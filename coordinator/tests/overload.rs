//! Overload in the simulated host: nodes that share one processor by their priorities, and one whose steps become dear.
#![allow(clippy::unwrap_used, reason = "tests")]

use coordinator::governor::Governor;
use messages::{Governance, Message, Periods, Shortage, Twist, bytemuck};
use runtime::channel::SampleBuffer;
use runtime::robot::{Resources, Robot};
use runtime::{ExecutionModel, Fault, Layer, Node, NodeType, OpenError, Ports, SimulatedHost, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct NoConfig {}

/// Writes a sample per step.
struct Worker(Writer<Twist>);

impl Node for Worker {
    const TYPE: &'static str = "worker";
    const LAYER: Layer = Layer::Perception;
    type Config = NoConfig;

    fn open(ports: &mut Ports, _config: NoConfig) -> Result<Self, OpenError> {
        Ok(Worker(ports.writer("out")?))
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.0.write(now, &Twist::default());
        Ok(())
    }
}

const TYPES: &[NodeType] = &[NodeType::of::<Worker>(), NodeType::of::<Governor>()];

/// `hog` stands above the two that matter, so that they pay for it. A step takes 1 ms.
const ROBOT: &str = r#"
[robot]
name = "busy"
[nodes.hog]
type = "worker"
period_ms = { min = 10, max = 200 }
priority = 60
importance = 20
[nodes.vital]
type = "worker"
period_ms = 20
priority = 50
importance = 90
[nodes.steering]
type = "worker"
period_ms = { min = 10, max = 40 }
deadline_ms = 15
priority = 55
importance = 80
[nodes.governor]
type = "governor"
period_ms = 20
priority = 70
importance = 100
config.load = {}
"#;

fn host(text: &str) -> SimulatedHost {
    let robot = Robot::parse(text, "busy.toml", Resources::Folder(".".into()), TYPES).unwrap();
    let exact = ExecutionModel { least_s: 1e-3, most_s: 1e-3, stall_probability: 0.0, stall_s: 0.0 };
    let mut host = SimulatedHost::with_execution(&robot, 1, Time::ZERO, exact).unwrap();
    host.share_processors(1);
    host
}

fn seconds(s: f64) -> Time {
    Time::from_seconds(s)
}

fn newest<M: Message>(host: &SimulatedHost, path: &str) -> (M, Vec<u8>) {
    let reader = host.tree().reader(path, None).unwrap();
    let mut buffer = SampleBuffer::new(reader.geometry());
    reader.read(reader.head(), &mut buffer).unwrap();
    (*bytemuck::from_bytes(buffer.fixed()), buffer.tail().to_vec())
}

fn state(host: &SimulatedHost) -> (Governance, String) {
    let (state, tail) = newest(host, "/coordinator/governor/state");
    (state, String::from_utf8(tail).unwrap())
}

fn shortage(host: &SimulatedHost) -> u32 {
    newest::<Periods>(host, "/coordinator/governor/periods").0.shortage
}

fn missed(host: &SimulatedHost, node: &str) -> u64 {
    host.statistics(host.index_of(&format!("/perception/{node}")).unwrap()).unwrap().missed_deadlines
}

fn period_ms(host: &SimulatedHost, node: &str) -> f64 {
    host.statistics(host.index_of(&format!("/perception/{node}")).unwrap()).unwrap().period_s * 1e3
}

/// Makes the steps of `node` cost `ms` until `until_s`.
fn make_dear(host: &mut SimulatedHost, node: &str, ms: f64, until_s: f64) {
    let index = host.index_of(&format!("/perception/{node}")).unwrap();
    host.slow_down(index, ms, seconds(until_s));
}

#[test]
fn who_shares_a_processor_waits_for_those_above_and_nobody_else() {
    let mut host = host(ROBOT);
    make_dear(&mut host, "hog", 4.0, 1.0);
    host.run_until(seconds(1.0));
    let response = |node: &str| {
        let statistics = host.statistics(host.index_of(&format!("/perception/{node}")).unwrap()).unwrap();
        (statistics.execution_s[0] * 1e3, statistics.response_s[3] * 1e3)
    };
    let near = |found: (f64, f64), execution: f64, response: f64| {
        (found.0 - execution).abs() < 0.1 && (found.1 - response).abs() < 0.1
    };
    // At 0 all are due: the governor, the hog, who steers, who is vital.
    assert!(near(response("hog"), 4.0, 5.0), "{:?}", response("hog"));
    assert!(near(response("steering"), 1.0, 6.0), "{:?}", response("steering"));
    assert!(near(response("vital"), 1.0, 7.0), "{:?}", response("vital"));
}

#[test]
fn an_overload_takes_from_the_least_important_and_the_critical_keep_their_deadlines() {
    let mut host = host(ROBOT);
    host.run_until(seconds(1.0));
    assert_eq!((missed(&host, "vital"), shortage(&host)), (0, Shortage::None as u32));
    // 0.85 for the hog, 0.1 + 0.05 + 0.05 for the others: 1.05 processors of one.
    make_dear(&mut host, "hog", 8.5, 6.0);
    host.run_until(seconds(1.2));
    let at_200_ms = (missed(&host, "vital"), missed(&host, "steering"));
    assert!(at_200_ms.0 + at_200_ms.1 > 0, "without a miss this would show nothing");
    host.run_until(seconds(6.0));
    assert_eq!((missed(&host, "vital"), missed(&host, "steering")), at_200_ms, "none after 200 ms");
    assert_eq!(shortage(&host), Shortage::Stretched as u32);
    assert!(period_ms(&host, "hog") > 12.0 && period_ms(&host, "steering") == 10.0);
    let (during, reason) = state(&host);
    assert!(reason.contains("hog 10.0 →") && reason.starts_with("load "), "{reason}");
    assert!(during.period_decisions <= 2, "it flaps: {reason}");

    host.run_until(seconds(7.9));
    assert!(period_ms(&host, "hog") > 12.0, "it waits whether the calm lasts");
    host.run_until(seconds(10.0));
    let (after, reason) = state(&host);
    assert_eq!((period_ms(&host, "hog"), shortage(&host)), (10.0, Shortage::None as u32), "{reason}");
    assert!(reason.starts_with("room again") && after.period_decisions <= during.period_decisions + 2, "{reason}");
    host.run_until(seconds(30.0));
    assert_eq!(state(&host).0.period_decisions, after.period_decisions, "and rests");
    assert_eq!((missed(&host, "vital"), missed(&host, "steering")), at_200_ms);
}

#[test]
fn an_overload_that_comes_and_goes_is_met_more_and_more_cautiously() {
    let mut host = host(ROBOT);
    let mut decisions = Vec::new();
    for k in 0..10 {
        let begin = 1.0 + 6.0 * f64::from(k);
        host.run_until(seconds(begin));
        make_dear(&mut host, "hog", 9.0, begin + 3.0);
        host.run_until(seconds(begin + 6.0));
        decisions.push(state(&host).0.period_decisions);
    }
    assert!(decisions[9] < 2 * 10, "a decision for each coming and going would be twenty: {decisions:?}");
    let late = decisions[9] - decisions[5];
    assert!(late <= 4, "it goes on: {decisions:?}");
}

#[test]
fn what_no_stretching_can_meet_suspends_and_then_limps_and_comes_back() {
    let mut host = host(ROBOT);
    host.run_until(seconds(1.0));
    make_dear(&mut host, "hog", 190.0, 8.0);
    host.run_until(seconds(2.5));
    assert_eq!(shortage(&host), Shortage::Suspended as u32, "{}", state(&host).1);
    assert_eq!(period_ms(&host, "hog"), 0.0);
    make_dear(&mut host, "vital", 19.5, 8.0);
    host.run_until(seconds(6.0));
    assert_eq!(shortage(&host), Shortage::Limp as u32, "{}", state(&host).1);
    host.run_until(seconds(40.0));
    assert_eq!(shortage(&host), Shortage::None as u32, "{}", state(&host).1);
    assert_eq!((period_ms(&host, "hog"), period_ms(&host, "steering")), (10.0, 10.0));
}

#[test]
fn a_governor_that_dies_lets_go_of_every_node() {
    let mut host = host(ROBOT);
    make_dear(&mut host, "hog", 9.0, 60.0);
    host.run_until(seconds(2.0));
    assert!(period_ms(&host, "hog") > 10.0);
    host.kill(host.index_of("/coordinator/governor").unwrap());
    host.run_until(seconds(3.9));
    assert!(period_ms(&host, "hog") > 10.0, "it may come back");
    host.run_until(seconds(4.1));
    assert_eq!(period_ms(&host, "hog"), 10.0);
}

#[test]
fn a_rule_asks_for_periods_beside_its_mode() {
    let rules = r#"config.rules = [{ when = "always", mode = "idle", periods_ms = { hog = 50 } }]"#;
    let mut host = host(&ROBOT.replace("config.load = {}", rules));
    host.run_until(seconds(1.0));
    assert_eq!((period_ms(&host, "hog"), shortage(&host)), (50.0, Shortage::None as u32));
    assert!(state(&host).1.contains("idle: always; asked by the rule: hog 10.0 → 50.0 ms"), "{}", state(&host).1);
}

#[test]
fn the_same_seed_decides_the_same() {
    let run = || {
        let mut host = host(ROBOT);
        make_dear(&mut host, "hog", 7.5, 3.0);
        host.run_until(seconds(8.0));
        (state(&host), host.statistics(0), host.statistics(1))
    };
    assert_eq!(run(), run());
}
