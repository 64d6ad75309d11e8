//! One run through one world: the whole robot in the simulated host, judged by the truth.

use super::suite::{ARRIVED_M, CLOCK_FROM_M, Course, LIMIT_S, Suite, score};
use crate::exit::{CHECK, Failure};
use crate::load;
use crate::simulation::{Tap, TrackPoint, expected};
use messages::{GotoGoal, Message, Truth, bytemuck};
use runtime::calls::{LocalRequest, Ticket, TicketState};
use runtime::robot::{Override, Robot};
use runtime::{Layer, NodeType, SimulatedHost, Time};
use simulator::geometry::Point;

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// It got there.
    Success,
    /// It touched something, or something touched it.
    Collision,
    /// The time was over.
    Timeout,
}

/// What became of one run.
#[derive(Debug, Clone)]
pub struct Trial {
    pub world: u32,
    pub seed: u64,
    pub end: End,
    /// From the first 0.1 m of motion to the end [s].
    pub time_s: f64,
    pub score: f64,
    pub least_clearance_m: f64,
    pub distance_m: f64,
    pub track: Vec<TrackPoint>,
    /// What CPU time the planner's steps took; empty unless asked for [µs].
    pub steps_us: Vec<f64>,
}

/// The run goes in slices of this length [s].
const SLICE_S: f64 = 0.1;
/// Without motion for this long from the beginning, the robot does not start any more [s].
const NO_START_S: f64 = 30.0;
/// Every so manieth truth becomes a point of the track.
const TRACK_EVERY: u64 = 5;
/// What the node that is given the goal is called.
pub const PLANNER: &str = "follow_gap";

/// The robot in that world.
pub fn robot_in(robot: &Robot, suite: &Suite, course: &Course, types: &[NodeType]) -> Result<Robot, Failure> {
    let Some(world) = robot.nodes.iter().find(|node| node.kind.layer == Layer::Simulator) else {
        return Err(Failure::new(CHECK, format!("robot \"{}\" has no simulator node", robot.name)));
    };
    let name = format!("{}#{}", suite.file.display(), course.index);
    let key = format!("nodes.{}.config.world", world.instance);
    let value = toml::Value::String(name).to_string();
    robot.with_overrides(&[Override { key, value }], types).map_err(load::errors)
}

/// Runs `robot` from `seed` until it has arrived, touched something, or run out of time.
pub fn run(robot: &Robot, suite: &Suite, course: &Course, seed: u64) -> Result<Trial, Failure> {
    let mut host = SimulatedHost::new(robot, seed, Time::ZERO)?;
    let planner = robot.nodes.iter().find(|node| node.kind.name == PLANNER).map(|node| node.path());
    let Some(planner) = planner else {
        return Err(Failure::new(CHECK, format!("robot \"{}\" has no node of type {PLANNER}", robot.name)));
    };
    let truth_path = robot.nodes.iter().find(|node| node.kind.layer == Layer::Simulator).map(|n| n.port_path("truth"));
    let tap = truth_path.and_then(|path| Tap::open(&host, &path, Some(expected::<Truth>())));
    let Some(mut truth) = tap else { return Err(Failure::new(CHECK, "the simulator publishes no truth".to_owned())) };
    let mut referee = Referee::new(suite, course);
    let mut ticket: Option<Ticket> = None;
    while referee.end.is_none() {
        host.run_until(host.now().after_s(SLICE_S));
        truth.drain(|sequence, stamp, buffer| {
            referee.see(sequence, stamp, bytemuck::from_bytes(buffer.fixed()));
        });
        // The goal is given as soon as the robot takes one: when it knows where it is.
        let open = match ticket {
            None => true,
            Some(ticket) => matches!(host.call_state(ticket), TicketState::Refused(_) | TicketState::Lost(_)),
        };
        if open && referee.began.is_none() {
            ticket = Some(give_goal(&mut host, &planner, suite));
        }
    }
    host.stop();
    Ok(referee.trial(seed))
}

/// The goal as seen from the start, which is where the odometry begins.
fn give_goal(host: &mut SimulatedHost, planner: &str, suite: &Suite) -> Ticket {
    let local = suite.start().body_from_world(suite.goal());
    let goal = GotoGoal { x_m: local.x_m, y_m: local.y_m, heading_rad: f64::NAN, tolerance_m: 0.0 };
    let deadline = host.now().after_s(1.0);
    host.call(&LocalRequest {
        path: planner,
        command: "goto",
        layout_hash: GotoGoal::layout_hash(),
        body: bytemuck::bytes_of(&goal),
        priority: 128,
        deadline,
    })
}

/// Applies the benchmark's rules to the truth.
struct Referee {
    course: Course,
    start: Point,
    goal: Point,
    began: Option<Time>,
    end: Option<(End, f64)>,
    last: Truth,
    least_clearance_m: f64,
    track: Vec<TrackPoint>,
}

impl Referee {
    fn new(suite: &Suite, course: &Course) -> Referee {
        Referee {
            course: *course,
            start: suite.start().place(),
            goal: suite.goal(),
            began: None,
            end: None,
            last: Truth::default(),
            least_clearance_m: f64::INFINITY,
            track: Vec::new(),
        }
    }

    fn see(&mut self, sequence: u64, stamp: Time, truth: &Truth) {
        if self.end.is_some() {
            return;
        }
        self.last = *truth;
        self.least_clearance_m = self.least_clearance_m.min(truth.clearance_m);
        if sequence % TRACK_EVERY == 1 {
            self.track.push(TrackPoint { time_s: stamp.seconds(), truth: *truth });
        }
        let place = Point::new(truth.x_m, truth.y_m);
        if self.began.is_none() && (place - self.start).norm() > CLOCK_FROM_M {
            self.began = Some(stamp);
        }
        let spent_s = self.began.map_or(0.0, |began| stamp.since(began));
        if truth.contacts.iter().any(|count| *count > 0) {
            self.end = Some((End::Collision, spent_s));
        } else if (place - self.goal).norm() <= ARRIVED_M {
            self.end = Some((End::Success, spent_s));
        } else if spent_s >= LIMIT_S || (self.began.is_none() && stamp.seconds() > NO_START_S) {
            self.end = Some((End::Timeout, LIMIT_S));
        }
    }

    fn trial(self, seed: u64) -> Trial {
        let (end, time_s) = self.end.unwrap_or((End::Timeout, LIMIT_S));
        Trial {
            world: self.course.index,
            seed,
            end,
            time_s,
            score: if end == End::Success { score(self.course.path_m, time_s) } else { 0.0 },
            least_clearance_m: self.least_clearance_m,
            distance_m: self.last.distance_m,
            track: self.track,
            steps_us: super::pace::take(),
        }
    }
}
