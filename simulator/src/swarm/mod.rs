//! Many robots in one process: discs with rays, simple controllers, no protocol bytes.
//!
//! The state is a struct of arrays. A step reads the poses of its beginning alone and writes each robot's own next
//! state, so that robots can be shared out over any number of threads and the result is the same to the last bit:
//!
//! 1. the index of neighbours is built anew (`neighbours`);
//! 2. every robot, in parallel: its rays are cast (`sense`), its controller decides (`steer`), its way is cut where
//!    something stands (`stride`);
//! 3. the new state takes the old one's place.
//!
//! Cost grows with robots × rays, and hardly with the map: a ray looks at the cells that it passes. A step allocates
//! nothing.

mod kind;
mod neighbours;
mod places;
mod sense;
mod steer;
mod stride;
#[cfg(test)]
mod tests;

pub use kind::{Few, Kind, Rays};

use crate::geometry::{Point, Pose};
use crate::noise::{Chance, Purpose};
use crate::world::World;
use neighbours::Neighbours;
use rayon::prelude::*;
use steer::Mood;

/// Robots that one thread takes at a time.
const SHARE: usize = 16;

/// Why a swarm cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SwarmError {
    /// Nothing to simulate.
    #[error("a swarm of 0 robots has nothing to simulate; give at least 1")]
    NoRobots,
    /// The world is a point or a line.
    #[error("the world \"{world}\" has no area to drive in; it needs walls that enclose one")]
    NoArea {
        /// Name of the world.
        world: String,
    },
    /// The robots do not fit.
    #[error(
        "of {wanted} robots of {radius_m} m radius only {placed} found a place in the world \"{world}\"; \
         take fewer robots or a larger world"
    )]
    Full {
        /// Robots wanted.
        wanted: usize,
        /// Robots that found a place.
        placed: usize,
        /// Their radius [m].
        radius_m: f64,
        /// Name of the world.
        world: String,
    },
    /// A given place is taken.
    #[error("robot {robot} cannot start at ({x_m:.3}, {y_m:.3}): something stands there; move one of the two")]
    Occupied {
        /// Index of the robot.
        robot: usize,
        /// Where [m].
        x_m: f64,
        /// Where [m].
        y_m: f64,
    },
    /// No such number of threads.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// As asked for.
        threads: usize,
        /// Why not.
        reason: String,
    },
}

/// Where the robots are and how they move; one array per quantity.
#[derive(Debug, Clone, Default)]
struct Bodies {
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Vec<f64>,
    cos: Vec<f64>,
    sin: Vec<f64>,
    /// No wall is nearer to the centre [m].
    wall_m: Vec<f32>,
}

/// What a step changes of one robot.
#[derive(Debug, Clone)]
struct Own {
    pose: Pose,
    wall_m: f32,
    mood: Mood,
    chance: Chance,
    blocked: bool,
    way_m: f64,
    contacts: u64,
}

/// The swarm; see the module's text.
#[derive(Debug)]
pub struct Swarm {
    world: World,
    kind: Kind,
    step_s: f64,
    bodies: Bodies,
    own: Vec<Own>,
    ranges_m: Vec<f32>,
    neighbours: Neighbours,
    pool: Option<rayon::ThreadPool>,
    steps: u64,
}

impl Swarm {
    /// `count` robots of one kind on free places that `seed` draws, all of them reachable from the world's first start
    /// where it has one. Steps last `step_s`.
    pub fn new(world: World, kind: Kind, count: usize, step_s: f64, seed: u64) -> Result<Swarm, SwarmError> {
        let poses = places::draw(&world, kind.radius_m, count, seed)?;
        Ok(Swarm::begin(world, kind, &poses, step_s, seed))
    }

    /// Robots at these poses.
    pub fn at(world: World, kind: Kind, poses: &[Pose], step_s: f64, seed: u64) -> Result<Swarm, SwarmError> {
        places::check(&world, kind.radius_m, poses)?;
        Ok(Swarm::begin(world, kind, poses, step_s, seed))
    }

    fn begin(world: World, kind: Kind, poses: &[Pose], step_s: f64, seed: u64) -> Swarm {
        let own = |(index, pose): (usize, &Pose)| Own {
            pose: *pose,
            wall_m: 0.0,
            mood: Mood::default(),
            chance: Chance::new(seed, Purpose::Swarm, index),
            blocked: false,
            way_m: 0.0,
            contacts: 0,
        };
        let reach_m = kind.reach_m + kind.farthest_mount_m + kind.radius_m;
        let closest_m = 2.0 * kind.radius_m + 2.0 * kind.speed_m_s * step_s;
        let mut swarm = Swarm {
            neighbours: Neighbours::new(world.map.extent(), poses.len(), (0.25 * reach_m).max(closest_m)),
            ranges_m: vec![kind.reach_m as f32; poses.len() * kind.ray_count()],
            own: poses.iter().enumerate().map(own).collect(),
            bodies: Bodies::default(),
            world,
            kind,
            step_s,
            pool: None,
            steps: 0,
        };
        let zero = vec![0.0; poses.len()];
        let [x_m, y_m, heading_rad, cos, sin] = std::array::from_fn(|_| zero.clone());
        swarm.bodies = Bodies { x_m, y_m, heading_rad, cos, sin, wall_m: vec![0.0; poses.len()] };
        swarm.publish();
        swarm
    }

    /// Shares the robots out over so many threads from now on. The results do not depend on it.
    pub fn use_threads(&mut self, threads: usize) -> Result<(), SwarmError> {
        let fault = |reason: String| SwarmError::Threads { threads, reason };
        self.pool = match threads {
            0 => return Err(fault("one is the least".into())),
            1 => None,
            _ => {
                let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                Some(built.map_err(|e| fault(e.to_string()))?)
            }
        };
        Ok(())
    }

    /// Advances by one step.
    pub fn step(&mut self) {
        let rays = self.kind.ray_count();
        let Swarm { world, kind, step_s, bodies, own, ranges_m, neighbours, pool, .. } = self;
        neighbours.fill(&bodies.x_m, &bodies.y_m);
        let around = Around { world, kind, bodies, neighbours, step_s: *step_s };
        match pool {
            None => own
                .iter_mut()
                .zip(ranges_m.chunks_exact_mut(rays))
                .enumerate()
                .for_each(|(robot, (own, ranges_m))| around.advance(robot, own, ranges_m)),
            Some(pool) => pool.install(|| {
                own.par_iter_mut()
                    .zip(ranges_m.par_chunks_exact_mut(rays))
                    .enumerate()
                    .with_min_len(SHARE)
                    .for_each(|(robot, (own, ranges_m))| around.advance(robot, own, ranges_m));
            }),
        }
        self.publish();
        self.steps += 1;
    }

    /// Lets every robot's new state be seen by the others.
    fn publish(&mut self) {
        let bodies = &mut self.bodies;
        for (robot, own) in self.own.iter().enumerate() {
            bodies.x_m[robot] = own.pose.x_m;
            bodies.y_m[robot] = own.pose.y_m;
            bodies.heading_rad[robot] = own.pose.heading_rad;
            let heading = Point::unit(own.pose.heading_rad);
            (bodies.cos[robot], bodies.sin[robot]) = (heading.x_m, heading.y_m);
            bodies.wall_m[robot] = own.wall_m;
        }
    }

    /// The world that they are in.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// What they are.
    pub fn kind(&self) -> &Kind {
        &self.kind
    }

    /// Number of robots.
    pub fn robots(&self) -> usize {
        self.own.len()
    }

    /// Simulated time [s].
    pub fn time_s(&self) -> f64 {
        self.steps as f64 * self.step_s
    }

    /// Where a robot is.
    pub fn pose(&self, robot: usize) -> Pose {
        self.own[robot].pose
    }

    /// What a robot's rays read in the last step [m].
    pub fn ranges_m(&self, robot: usize) -> &[f32] {
        let rays = self.kind.ray_count();
        &self.ranges_m[robot * rays..(robot + 1) * rays]
    }

    /// Way of all robots together [m].
    pub fn distance_m(&self) -> f64 {
        self.own.iter().map(|own| own.way_m).sum()
    }

    /// How often robots came up against something, all together.
    pub fn contacts(&self) -> u64 {
        self.own.iter().map(|own| own.contacts).sum()
    }

    /// A number that two runs share only if every pose and every range of their last step agree.
    pub fn hash(&self) -> u64 {
        let poses = self.own.iter().flat_map(|own| {
            [own.pose.x_m.to_bits(), own.pose.y_m.to_bits(), own.pose.heading_rad.to_bits(), own.way_m.to_bits()]
        });
        let ranges = self.ranges_m.iter().map(|range_m| u64::from(range_m.to_bits()));
        poses
            .chain(ranges)
            .fold(0xCBF2_9CE4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0000_0100_0000_01B3).rotate_left(5))
    }
}

/// What all robots share while a step runs.
struct Around<'a> {
    world: &'a World,
    kind: &'a Kind,
    bodies: &'a Bodies,
    neighbours: &'a Neighbours,
    step_s: f64,
}

impl Around<'_> {
    /// One robot's step.
    fn advance(&self, robot: usize, own: &mut Own, ranges_m: &mut [f32]) {
        self.sense(robot, ranges_m);
        let (speed_m_s, turn_rad_s) = steer::wander(self.kind, ranges_m, &mut own.mood, &mut own.chance);
        self.stride(robot, own, speed_m_s, turn_rad_s);
    }
}
