//! What the robots of a swarm are: a disc, its speeds, its rays.

use crate::geometry::Point;
use drivers::p2os::model;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Rays in the robot's frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Rays {
    /// A few of them, each with a place and a direction (unit vector) of its own.
    Few(Vec<(Point, Point)>),
    /// A fan of evenly spaced rays from one place.
    Fan {
        /// Where it sits.
        place: Point,
        /// Bearing of the first ray [rad].
        first_rad: f64,
        /// From one ray to the next, counter-clockwise [rad].
        step_rad: f64,
        /// The directions.
        directions: Vec<Point>,
    },
}

/// The robots of a swarm are all of one kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Kind {
    /// For people.
    pub name: &'static str,
    /// Radius of the disc [m].
    pub radius_m: f64,
    /// Greatest speed [m/s].
    pub speed_m_s: f64,
    /// Greatest turn [rad/s].
    pub turn_rad_s: f64,
    /// What it sees with.
    pub rays: Rays,
    /// How far [m].
    pub reach_m: f64,
    /// Rays that look ahead to the left and to the right (see [`super::steer`]).
    pub(super) ahead: [Vec<u32>; 2],
}

/// Rays within this angle of ahead tell whether the way is free [rad].
const AHEAD_RAD: f64 = PI / 3.0;

impl Kind {
    fn new(name: &'static str, radius_m: f64, rays: Rays, reach_m: f64) -> Kind {
        let mut ahead = [Vec::new(), Vec::new()];
        for ray in 0..rays.count() {
            let direction = rays.ray(ray).1;
            let bearing_rad = direction.angle();
            if bearing_rad.abs() <= AHEAD_RAD {
                // A ray straight ahead belongs to both sides.
                if bearing_rad >= -1e-9 {
                    ahead[0].push(ray as u32);
                }
                if bearing_rad <= 1e-9 {
                    ahead[1].push(ray as u32);
                }
            }
        }
        Kind { name, radius_m, speed_m_s: 0.5, turn_rad_s: 1.2, rays, reach_m, ahead }
    }

    /// A disc of 0.1 m with `rays` rays of `reach_m` all round: twelve of 2 m are the usual swarm robot.
    pub fn simple(rays: usize, reach_m: f64) -> Kind {
        let direction = |k: usize| Point::unit(TAU * k as f64 / rays as f64);
        let rays = (0..rays).map(|k| (Point::ZERO, direction(k))).collect();
        Kind { speed_m_s: 0.3, ..Kind::new("simple", 0.05, Rays::Few(rays), reach_m) }
    }

    /// A Pioneer's size with a ray for each of its sixteen sonars.
    pub fn pioneer_with_sonars() -> Kind {
        let discs: &[model::SonarPose] = model::named("p3dx-sh").map_or(&[], |model| &model.sonar);
        let ray = |pose: &model::SonarPose| (Point::new(pose.x_m, pose.y_m), Point::unit(pose.bearing_rad));
        Kind::new("pioneer_sonar", 0.22, Rays::Few(discs.iter().map(ray).collect()), 5.0)
    }

    /// A Pioneer's size with a laser of `rays` rays over the front half.
    pub fn pioneer_with_laser(rays: usize, reach_m: f64) -> Kind {
        let step_rad = PI / rays.max(2).saturating_sub(1) as f64;
        let directions = (0..rays).map(|k| Point::unit(k as f64 * step_rad - FRAC_PI_2)).collect();
        let fan = Rays::Fan { place: Point::new(0.1, 0.0), first_rad: -FRAC_PI_2, step_rad, directions };
        Kind::new("pioneer_laser", 0.22, fan, reach_m)
    }

    /// Number of rays.
    pub fn ray_count(&self) -> usize {
        self.rays.count()
    }

    /// How far from the centre a ray can begin [m].
    pub(super) fn farthest_mount_m(&self) -> f64 {
        (0..self.rays.count()).map(|ray| self.rays.ray(ray).0.norm()).fold(0.0, f64::max)
    }
}

impl Rays {
    fn count(&self) -> usize {
        match self {
            Rays::Few(rays) => rays.len(),
            Rays::Fan { directions, .. } => directions.len(),
        }
    }

    /// Place and direction of a ray.
    fn ray(&self, index: usize) -> (Point, Point) {
        match self {
            Rays::Few(rays) => rays[index],
            Rays::Fan { place, directions, .. } => (*place, directions[index]),
        }
    }
}
