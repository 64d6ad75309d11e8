//! A service robot in simulation, ordered by call and watched from outside.

use crate::built_in::{SERVICE, node_types};
use crate::exit::Failure;
use crate::load;
use messages::{Command, Message, SetMode, SetPose, Truth, bytemuck};
use runtime::calls::{LocalRequest, Ticket, TicketState};
use runtime::channel::{Expect, SampleBuffer};
use runtime::robot::{Resources, Robot};
use runtime::{Layer, SimulatedHost, Time};

/// S2's op modes as the service robot's file lists them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OpMode {
    /// Nothing moves.
    None = 0,
    /// Velocity control.
    Velocity = 1,
    /// Velocity control with avoidance.
    VelocityAvoidance = 2,
    /// Position control.
    Position = 3,
    /// Position control with avoidance.
    PositionAvoidance = 4,
}

/// A moment of a run.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Since the start [s].
    pub time_s: f64,
    /// What is true.
    pub truth: Truth,
    /// What motion sends to the wheels.
    pub command: Command,
}

/// How an order ended.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// With its result.
    Done(Vec<u8>),
    /// Refused or failed, with the reason.
    Not(String),
    /// Not within the time that it was given.
    TooLate,
}

/// A robot under way.
pub struct Rig {
    host: SimulatedHost,
    /// Truth and command every 20 ms.
    pub moments: Vec<Moment>,
}

/// Moments are this far apart [s].
pub const EVERY_S: f64 = 0.02;
/// The robot has its odometry and its lasers by then [s].
const READY_S: f64 = 1.5;

/// The service robot in one of its worlds.
pub fn service(world: &str) -> Result<Robot, Failure> {
    variant("robot.toml", world)
}

/// The service robot as one of its files has it: `robot.toml` with a ring of sonars, `laser.toml` with a laser.
pub fn variant(file: &str, world: &str) -> Result<Robot, Failure> {
    let text = SERVICE.iter().find(|(name, _)| *name == file).map_or(&[][..], |(_, text)| *text);
    let text = std::str::from_utf8(text).map_err(|e| Failure::from(e.to_string()))?;
    let name = format!("robots/service/{file}");
    let robot = Robot::parse(text, &name, Resources::Embedded(SERVICE), &node_types(&[])).map_err(load::errors)?;
    Ok(placed(robot, world))
}

/// A robot in a world of the service robot's.
pub fn placed(mut robot: Robot, world: &str) -> Robot {
    configure(&mut robot, Layer::Simulator, "world", |config| {
        config.insert("world".into(), format!("worlds/{world}.toml").into());
    });
    robot
}

/// Changes a node's settings.
pub fn configure(robot: &mut Robot, layer: Layer, instance: &str, change: impl FnOnce(&mut toml::Table)) {
    let node = robot.nodes.iter_mut().find(|node| node.kind.layer == layer && node.instance == instance);
    if let Some(node) = node {
        change(&mut node.config);
    }
}

impl Rig {
    /// The robot, ready, in `mode`, set down at a place that it is told.
    pub fn new(robot: &Robot, seed: u64, mode: OpMode) -> Result<Rig, Failure> {
        let host = SimulatedHost::new(robot, seed, Time::ZERO)?;
        let mut rig = Rig { host, moments: Vec::new() };
        rig.watch(READY_S);
        let truth: Truth = rig.latest("/simulator/world/truth").unwrap_or_default();
        let pose = SetPose { x_m: truth.x_m, y_m: truth.y_m, heading_rad: truth.heading_rad };
        rig.ask("/perception/odometry", "set_pose", &pose)?;
        rig.ask("/coordinator/arbiter", "set_mode", &SetMode { mode: mode as u64 })?;
        Ok(rig)
    }

    /// Time since the start [s].
    pub fn now_s(&self) -> f64 {
        self.host.now().seconds()
    }

    /// Goes on for a while, and watches.
    pub fn watch(&mut self, seconds: f64) {
        let end = self.host.now().after_s(seconds);
        while self.host.now() < end {
            self.host.run_until(self.host.now().after_s(EVERY_S).min(end));
            let truth = self.latest("/simulator/world/truth").unwrap_or_default();
            let command = self.latest("/motion/drive/command").unwrap_or_default();
            self.moments.push(Moment { time_s: self.now_s(), truth, command });
        }
    }

    /// The newest sample of a path.
    pub fn latest<M: Message>(&self, path: &str) -> Option<M> {
        let expect = Expect { type_name: M::NAME.into(), layout_hash: M::layout_hash() };
        let ring = self.host.tree().reader(path, Some(expect)).ok()?;
        let mut buffer = SampleBuffer::new(ring.geometry());
        ring.read(ring.head(), &mut buffer).ok()?;
        Some(*bytemuck::from_bytes(buffer.fixed()))
    }

    /// What is true now.
    pub fn truth(&self) -> Truth {
        self.latest("/simulator/world/truth").unwrap_or_default()
    }

    /// Gives an order, or asks something.
    pub fn order<Q: Message>(&mut self, path: &str, command: &str, message: &Q) -> Ticket {
        let deadline = self.host.now().after_s(1.0);
        self.host.call(&LocalRequest {
            path,
            command,
            layout_hash: Q::layout_hash(),
            body: bytemuck::bytes_of(message),
            priority: 128,
            deadline,
        })
    }

    /// How an order stands.
    pub fn state(&self, ticket: Ticket) -> TicketState {
        self.host.call_state(ticket)
    }

    /// Asks something that is answered at once.
    fn ask<Q: Message>(&mut self, path: &str, command: &str, message: &Q) -> Result<(), Failure> {
        let ticket = self.order(path, command, message);
        match self.until_over(ticket, 1.0) {
            End::Done(_) => Ok(()),
            other => Err(Failure::from(format!("{path} {command}: {other:?}"))),
        }
    }

    /// Watches until an order is over, at most for `seconds`.
    pub fn until_over(&mut self, ticket: Ticket, seconds: f64) -> End {
        let until = self.host.now().after_s(seconds);
        loop {
            match self.host.call_state(ticket) {
                TicketState::Pending | TicketState::Running(_) if self.host.now() < until => self.watch(EVERY_S),
                TicketState::Pending | TicketState::Running(_) => return End::TooLate,
                TicketState::Answered(body) => return End::Done(body),
                TicketState::Refused(refusal) | TicketState::Failed(refusal) => return End::Not(refusal.reason),
                TicketState::Cancelled => return End::Not("cancelled".into()),
                TicketState::Lost(loss) => return End::Not(loss.to_string()),
            }
        }
    }

    /// The way that was taken, as points of a picture.
    pub fn track(&self) -> Vec<crate::simulation::TrackPoint> {
        let every_tenth = self.moments.iter().step_by(5);
        every_tenth.map(|m| crate::simulation::TrackPoint { time_s: m.time_s, truth: m.truth }).collect()
    }
}
