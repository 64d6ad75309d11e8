//! What the robots of a swarm are: a disc, its speeds, its rays.

use crate::geometry::{Fan, Point};
use drivers::p2os::model;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Rays in the robot's frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Rays {
    /// A few of them, each where it likes.
    Few(Few),
    /// A fan of evenly spaced rays from one place.
    Fan(Fan),
}

/// Rays that have a place each, and which of them may meet a disc of a robot's size.
#[derive(Debug, Clone, PartialEq)]
pub struct Few {
    /// Places and directions (unit vectors).
    pub(super) rays: Vec<(Point, Point)>,
    /// The same, [`LANES`] at a time: a ray meets the disc about c where its line, y·cx − x·cy = beside, is near.
    lanes: Vec<Lanes>,
    /// Radius of the disc, with room for the rounding of the lanes' numbers [m].
    near_m: f32,
}

/// Rays that are asked at once.
const LANES: usize = 8;

/// Directions, how far their lines pass beside the centre, and where on them the rays begin.
#[derive(Debug, Clone, PartialEq, Default)]
struct Lanes {
    x: [f32; LANES],
    y: [f32; LANES],
    beside_m: [f32; LANES],
    begin_m: [f32; LANES],
}

impl Few {
    fn new(rays: Vec<(Point, Point)>, radius_m: f64) -> Few {
        let lanes = rays.chunks(LANES).map(|chunk| {
            // What is left over looks nowhere.
            let mut lanes = Lanes { begin_m: [f32::INFINITY; LANES], ..Lanes::default() };
            for (k, (place, direction)) in chunk.iter().enumerate() {
                (lanes.x[k], lanes.y[k]) = (direction.x_m as f32, direction.y_m as f32);
                lanes.beside_m[k] = direction.cross(*place) as f32;
                lanes.begin_m[k] = direction.dot(*place) as f32;
            }
            lanes
        });
        Few { lanes: lanes.collect(), rays, near_m: radius_m as f32 + ROUNDING_M }
    }

    /// Hands the rays that may meet the disc about `disc` to `each`; a ray that is left out does not.
    #[inline]
    pub(super) fn each_towards(&self, disc: Point, mut each: impl FnMut(usize)) {
        let (x_m, y_m) = (disc.x_m as f32, disc.y_m as f32);
        for (chunk, lanes) in self.lanes.iter().enumerate() {
            let mut near = [false; LANES];
            for (k, near) in near.iter_mut().enumerate() {
                let beside_m = lanes.x[k] * y_m - lanes.y[k] * x_m - lanes.beside_m[k];
                let ahead_m = lanes.x[k] * x_m + lanes.y[k] * y_m - lanes.begin_m[k];
                *near = (beside_m.abs() <= self.near_m) & (ahead_m >= -ROUNDING_M);
            }
            if near != [false; LANES] {
                (0..LANES).filter(|k| near[*k]).for_each(|k| each(chunk * LANES + k));
            }
        }
    }
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
    /// How far from the centre a ray can begin [m].
    pub(super) farthest_mount_m: f64,
}

/// What rounding to seven digits may move within a sensor's reach [m].
const ROUNDING_M: f32 = 1e-3;
/// Radius of the disc that stands for a Pioneer [m].
const PIONEER_M: f64 = 0.22;
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
        let farthest_mount_m = (0..rays.count()).map(|ray| rays.ray(ray).0.norm()).fold(0.0, f64::max);
        Kind { name, radius_m, speed_m_s: 0.5, turn_rad_s: 1.2, rays, reach_m, ahead, farthest_mount_m }
    }

    /// A disc of 0.1 m with `rays` rays of `reach_m` all round: twelve of 2 m are the usual swarm robot.
    pub fn simple(rays: usize, reach_m: f64) -> Kind {
        let direction = |k: usize| Point::unit(TAU * k as f64 / rays as f64);
        let rays = (0..rays).map(|k| (Point::ZERO, direction(k))).collect();
        let radius_m = 0.05;
        Kind { speed_m_s: 0.3, ..Kind::new("simple", radius_m, Rays::Few(Few::new(rays, radius_m)), reach_m) }
    }

    /// A Pioneer's size with a ray for each of its sixteen sonars.
    pub fn pioneer_with_sonars() -> Kind {
        let discs: &[model::SonarPose] = model::named("p3dx-sh").map_or(&[], |model| &model.sonar);
        let ray = |pose: &model::SonarPose| (Point::new(pose.x_m, pose.y_m), Point::unit(pose.bearing_rad));
        let few = Few::new(discs.iter().map(ray).collect(), PIONEER_M);
        Kind::new("pioneer_sonar", PIONEER_M, Rays::Few(few), 5.0)
    }

    /// A Pioneer's size with a laser of `rays` rays over the front half.
    pub fn pioneer_with_laser(rays: usize, reach_m: f64) -> Kind {
        let step_rad = PI / rays.max(2).saturating_sub(1) as f64;
        let fan = Rays::Fan(Fan::new(Point::new(0.1, 0.0), -FRAC_PI_2, step_rad, rays));
        Kind::new("pioneer_laser", PIONEER_M, fan, reach_m)
    }

    /// Number of rays.
    pub fn ray_count(&self) -> usize {
        self.rays.count()
    }
}

impl Rays {
    fn count(&self) -> usize {
        match self {
            Rays::Few(few) => few.rays.len(),
            Rays::Fan(fan) => fan.directions.len(),
        }
    }

    /// Place and direction of a ray.
    fn ray(&self, index: usize) -> (Point, Point) {
        match self {
            Rays::Few(few) => few.rays[index],
            Rays::Fan(fan) => (fan.place, fan.directions[index]),
        }
    }
}
