//! What a robot's channels tell: where it is, what it hears, how it is. Collected by looking, several times a second.

use super::Seen;
use super::source::Source;
use crate::exit::Failure;
use crate::simulation::TrackPoint;
use crate::{load, picture};
use messages::{BaseState, Beam, Contact, CoordinatorState, Message, MotionState, Odometry, Ranges, Truth, Twist};
use runtime::channel::Tree;
use runtime::robot::{Body, Graph, Robot};
use runtime::{Layer, Time};
use simulator::geometry::Pose;
use simulator::world::World;
use std::path::Path;

/// Channels that were absent are looked for this often [s].
const LOOK_S: f64 = 0.25;
/// A sample older than this is not shown any more [s].
const FRESH_S: f64 = 1.0;
/// Least time between two points of the track [s].
const TRACK_S: f64 = 0.1;
/// Faster than this is moving [m/s].
const MOVING_M_S: f64 = 0.01;

/// The newest of everything.
#[derive(Debug, Clone, Default)]
pub struct Picture {
    /// The robot's name.
    pub name: String,
    /// When this was collected.
    pub now: Time,
    /// Time since the first look [s].
    pub watched_s: f64,
    /// Where the robot is: in the world where it is simulated, else in the odometry's frame.
    pub pose: Option<Pose>,
    /// What a simulator knows.
    pub truth: Option<Truth>,
    /// What the robot believes.
    pub odometry: Option<Odometry>,
    /// Fresh beams of all rangers, with the greatest range and the opening angle of each.
    pub beams: Vec<(Beam, f64, f64)>,
    /// Battery, bumpers, link.
    pub base: Option<BaseState>,
    /// What motion does, and why.
    pub motion: Option<MotionState>,
    /// How the coordinator decided.
    pub coordinator: Option<CoordinatorState>,
    /// Contacts so far, each with its place.
    pub contacts: Vec<Contact>,
}

impl Picture {
    /// Velocity of the body: the true one where it is known.
    pub fn velocity(&self) -> Option<Twist> {
        self.truth.map(|truth| truth.velocity).or(self.odometry.map(|odometry| odometry.velocity))
    }
}

/// Collects.
pub struct Watch {
    tree: Tree,
    body: Body,
    world: Option<World>,
    picture: Picture,
    track: Vec<TrackPoint>,
    truth: Vec<Source<Truth>>,
    odometry: Vec<Source<Odometry>>,
    ranges: Vec<Ranger>,
    base: Vec<Source<BaseState>>,
    motion: Vec<Source<MotionState>>,
    coordinator: Vec<Source<CoordinatorState>>,
    looked: Option<Time>,
    begun: Option<Time>,
    heard: Heard,
    moving: (f64, u64),
    least_clearance_m: f64,
    driven_m: f64,
}

/// A ranger and its newest beams.
struct Ranger {
    source: Source<Ranges>,
    beams: Vec<(Beam, f64, f64)>,
    stamp: Time,
}

/// When each kind of sample was last heard.
#[derive(Default)]
struct Heard {
    odometry: Time,
    base: Time,
    motion: Time,
    coordinator: Time,
}

impl Watch {
    /// Watches the robot whose channels are below `root`. They need not be there yet.
    pub fn open(root: &Path, robot: &Robot) -> Result<Watch, Failure> {
        let tree = Tree::shared(root)?;
        let graph = robot.graph().map_err(load::errors)?;
        Ok(Watch::of(tree, robot, &graph))
    }

    fn of(tree: Tree, robot: &Robot, graph: &Graph) -> Watch {
        Watch {
            tree,
            body: robot.body,
            world: picture::world_of(robot),
            picture: Picture { name: robot.name.clone(), ..Picture::default() },
            track: Vec::new(),
            truth: sources(graph, None),
            // The one that navigation would use wins over the device's own.
            odometry: sources(graph, Some(Layer::Perception))
                .into_iter()
                .chain(sources(graph, Some(Layer::Drivers)))
                .take(1)
                .collect(),
            ranges: sources(graph, Some(Layer::Drivers))
                .into_iter()
                .map(|source| Ranger { source, beams: Vec::new(), stamp: Time::ZERO })
                .collect(),
            base: sources(graph, None),
            motion: sources(graph, None),
            coordinator: sources(graph, None),
            looked: None,
            begun: None,
            heard: Heard::default(),
            moving: (0.0, 0),
            least_clearance_m: f64::INFINITY,
            driven_m: 0.0,
        }
    }

    /// The newest of everything.
    pub fn picture(&self) -> &Picture {
        &self.picture
    }

    /// The robot's channels.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// The robot's body.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The world, where the robot is simulated.
    pub fn world(&self) -> Option<&World> {
        self.world.as_ref()
    }

    /// Where the robot has been.
    pub fn track(&self) -> &[TrackPoint] {
        &self.track
    }

    /// What was seen so far.
    pub fn seen(&self) -> Seen {
        let truth = self.picture.truth;
        Seen {
            track: self.track.clone(),
            contacts: truth.map(|truth| truth.contacts),
            distance_m: truth.map_or(self.driven_m, |truth| truth.distance_m),
            mean_speed_m_s: if self.moving.1 > 0 { self.moving.0 / self.moving.1 as f64 } else { 0.0 },
            least_clearance_m: self.least_clearance_m,
        }
    }

    /// Reads what has come. Call it at least three times a second: what touched the robot stays in its ring for half a
    /// second.
    pub fn collect(&mut self, now: Time) {
        if self.looked.is_none_or(|looked| now.since(looked) >= LOOK_S) {
            self.looked = Some(now);
            self.look();
        }
        let begun = *self.begun.get_or_insert(now);
        self.picture.now = now;
        self.picture.watched_s = now.since(begun);
        self.collect_truth();
        self.collect_odometry();
        self.collect_ranges(now);
        self.collect_states();
        self.forget_stale(now);
    }

    fn look(&mut self) {
        let tree = &self.tree;
        self.truth.iter_mut().for_each(|source| source.look(tree));
        self.odometry.iter_mut().for_each(|source| source.look(tree));
        self.ranges.iter_mut().for_each(|ranger| ranger.source.look(tree));
        self.base.iter_mut().for_each(|source| source.look(tree));
        self.motion.iter_mut().for_each(|source| source.look(tree));
        self.coordinator.iter_mut().for_each(|source| source.look(tree));
    }

    fn collect_truth(&mut self) {
        let Watch { truth, picture, track, moving, least_clearance_m, .. } = self;
        for source in truth.iter_mut().take(1) {
            source.drain(|stamp, sample, contacts| {
                *least_clearance_m = least_clearance_m.min(sample.clearance_m);
                count_speed(moving, sample.velocity.linear_x_m_s);
                push(track, TrackPoint { time_s: stamp.seconds(), truth: *sample });
                picture.contacts.extend_from_slice(contacts);
                picture.pose = Some(Pose::new(sample.x_m, sample.y_m, sample.heading_rad));
                picture.truth = Some(*sample);
            });
        }
    }

    fn collect_odometry(&mut self) {
        let Watch { odometry, picture, track, moving, heard, driven_m, .. } = self;
        for source in odometry {
            source.drain(|stamp, sample, _| {
                heard.odometry = stamp;
                let before = picture.odometry.replace(*sample);
                if picture.truth.is_some() {
                    return;
                }
                let moved = |old: Odometry| Pose::new(sample.x_m - old.x_m, sample.y_m - old.y_m, 0.0).place().norm();
                *driven_m += before.filter(|old| old.origin == sample.origin).map_or(0.0, moved);
                count_speed(moving, sample.velocity.linear_x_m_s);
                picture.pose = Some(Pose::new(sample.x_m, sample.y_m, sample.heading_rad));
                push(track, TrackPoint { time_s: stamp.seconds(), truth: as_truth(sample, *driven_m) });
            });
        }
    }

    fn collect_ranges(&mut self, now: Time) {
        for ranger in &mut self.ranges {
            let Ranger { source, beams, stamp } = ranger;
            source.newest(|at, ranges, tail| {
                *stamp = at;
                let facts = (f64::from(ranges.max_range_m), f64::from(ranges.beam_width_rad));
                beams.clear();
                beams.extend(tail.iter().map(|beam| (*beam, facts.0, facts.1)));
            });
        }
        self.picture.beams.clear();
        for ranger in self.ranges.iter().filter(|ranger| now.since(ranger.stamp) < FRESH_S) {
            let age_s = now.since(ranger.stamp);
            let fresh = ranger.beams.iter().filter(|(beam, ..)| f64::from(beam.age_s) + age_s < FRESH_S);
            self.picture.beams.extend(fresh);
        }
    }

    fn collect_states(&mut self) {
        let Watch { base, motion, coordinator, picture, heard, .. } = self;
        for source in base {
            source.newest(|stamp, sample, _| (picture.base, heard.base) = (Some(*sample), stamp));
        }
        for source in motion {
            source.newest(|stamp, sample, _| (picture.motion, heard.motion) = (Some(*sample), stamp));
        }
        for source in coordinator {
            source.newest(|stamp, sample, _| (picture.coordinator, heard.coordinator) = (Some(*sample), stamp));
        }
    }

    /// A robot that fell silent shows no numbers, rather than old ones. Where it was seen last stays.
    fn forget_stale(&mut self, now: Time) {
        let stale = |heard: Time| now.since(heard) > FRESH_S;
        let Watch { picture, heard, .. } = self;
        picture.base = picture.base.filter(|_| !stale(heard.base));
        picture.motion = picture.motion.filter(|_| !stale(heard.motion));
        picture.coordinator = picture.coordinator.filter(|_| !stale(heard.coordinator));
        picture.odometry = picture.odometry.filter(|_| !stale(heard.odometry));
    }
}

/// The channels of `M` that nodes (of `layer`) write.
fn sources<M: Message>(graph: &Graph, layer: Option<Layer>) -> Vec<Source<M>> {
    let nodes = graph.nodes.iter().filter(|node| layer.is_none_or(|layer| node.spec.kind.layer == layer));
    let written = nodes.flat_map(|node| &node.writes).filter(|written| written.geometry.type_name == M::NAME);
    written.map(|written| Source::new(&written.path)).collect()
}

fn count_speed(moving: &mut (f64, u64), speed_m_s: f64) {
    if speed_m_s.abs() > MOVING_M_S {
        moving.0 += speed_m_s.abs();
        moving.1 += 1;
    }
}

fn push(track: &mut Vec<TrackPoint>, point: TrackPoint) {
    if track.last().is_none_or(|last| point.time_s - last.time_s >= TRACK_S - 1e-6) {
        track.push(point);
    }
}

fn as_truth(odometry: &Odometry, distance_m: f64) -> Truth {
    Truth {
        x_m: odometry.x_m,
        y_m: odometry.y_m,
        heading_rad: odometry.heading_rad,
        velocity: odometry.velocity,
        clearance_m: f64::INFINITY,
        distance_m,
        contacts: [0; 3],
    }
}
