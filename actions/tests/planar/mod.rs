//! A planar robot among cylinders, for the planner alone: exact beams, the same limits, no protocol and no other nodes.
#![allow(dead_code, reason = "shared by a test and an example, each of which uses a part")]

use actions::follow_gap::planner::{Planner, Setup, Sight, Wish};
use actions::follow_gap::pose::{Point, Pose};
use actions::follow_gap::rollout::{Limits, Mover, Outline, State};
use messages::{Beam, Echo};
use runtime::math;
use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI};

pub const OUTLINE: Outline = Outline { ahead_m: 0.254, behind_m: 0.254, half_width_m: 0.215 };
pub const LASER_X_M: f64 = 0.12;
pub const BEAMS: usize = 720;
pub const MAX_RANGE_M: f64 = 30.0;
pub const STEP_S: f64 = 0.02;
const SUBSTEPS: usize = 4;

/// A cylinder that goes by a timetable.
#[derive(Debug, Clone)]
pub struct Round {
    pub keys: Vec<(f64, f64, f64)>,
    pub period_s: f64,
    pub radius_m: f64,
}

impl Round {
    /// Place and velocity at a time.
    pub fn at(&self, time_s: f64) -> (Point, Point) {
        let clock = time_s % self.period_s;
        let after = self.keys.iter().position(|key| key.0 > clock).unwrap_or(self.keys.len() - 1).max(1);
        let (a, b) = (self.keys[after - 1], self.keys[after]);
        let share = ((clock - a.0) / (b.0 - a.0)).clamp(0.0, 1.0);
        let velocity = Point::new((b.1 - a.1) / (b.0 - a.0), (b.2 - a.2) / (b.0 - a.0));
        (Point::new(a.1 + (b.1 - a.1) * share, a.2 + (b.2 - a.2) * share), velocity)
    }
}

#[derive(Debug, Clone)]
pub struct Course {
    pub index: u32,
    pub cylinders: Vec<(Point, f64)>,
    /// Walls as segments.
    pub walls: Vec<(Point, Point)>,
    pub rounds: Vec<Round>,
    pub start: Pose,
    pub goal: Point,
    pub path_m: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Result {
    pub success: bool,
    pub collided: bool,
    pub time_s: f64,
    pub score: f64,
    pub track: Vec<Pose>,
    pub step_us: Vec<f64>,
}

/// All BARN worlds of a folder.
pub fn barn(folder: &std::path::Path) -> Option<Vec<Course>> {
    let grids = std::fs::read_to_string(folder.join("grids.txt")).ok()?;
    let table = std::fs::read_to_string(folder.join("worlds.csv")).ok()?;
    let lengths: std::collections::BTreeMap<u32, f64> = table
        .lines()
        .skip(1)
        .filter_map(|line| {
            let mut parts = line.split(',');
            let index = parts.next()?.parse().ok()?;
            Some((index, parts.nth(4)?.parse().ok()?))
        })
        .collect();
    let mut lines = grids.lines();
    let mut all = Vec::new();
    while let Some(line) = lines.next() {
        let Some(index) = line.strip_prefix("world ").and_then(|n| n.trim().parse::<u32>().ok()) else { continue };
        let mut cylinders = Vec::new();
        for row in 0..30 {
            for (column, _) in lines.next()?.bytes().enumerate().filter(|(_, c)| *c == b'#') {
                cylinders.push((Point::new(-4.425 + 0.15 * f64::from(row), 5.175 + 0.15 * column as f64), 0.075));
            }
        }
        for k in 0..30 {
            cylinders.push((Point::new(-4.425 + 0.15 * f64::from(k), 0.075), 0.075));
        }
        for k in 1..=33 {
            for x in [-4.425, -0.075] {
                cylinders.push((Point::new(x, 0.075 + 0.15 * f64::from(k)), 0.075));
            }
        }
        all.push(Course {
            index,
            cylinders,
            walls: Vec::new(),
            rounds: Vec::new(),
            start: Pose::new(-2.25, 3.0, FRAC_PI_2),
            goal: Point::new(-2.25, 13.0),
            path_m: *lengths.get(&index)?,
        });
    }
    Some(all)
}

/// All DynaBARN worlds of a folder.
pub fn dynabarn(folder: &std::path::Path) -> Option<Vec<Course>> {
    let text = std::fs::read_to_string(folder.join("worlds.txt")).ok()?;
    let mut all: Vec<Course> = Vec::new();
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        if let Some(rest) = line.strip_prefix("world ") {
            let index = rest.split_whitespace().next()?.parse().ok()?;
            let mut walls = Vec::new();
            for inset in [-0.25, 0.25] {
                let h = 10.0 + inset;
                walls.push((Point::new(-h, -h), Point::new(-h, h)));
                walls.push((Point::new(-h, h), Point::new(10.0, h)));
                walls.push((Point::new(-h, -h), Point::new(10.0, -h)));
            }
            all.push(Course {
                index,
                cylinders: Vec::new(),
                walls,
                rounds: Vec::new(),
                start: Pose::new(11.0, 0.0, PI),
                goal: Point::new(-9.0, 0.0),
                path_m: 20.0,
            });
            continue;
        }
        let mut words = line.split_whitespace().skip(1);
        let period_s: f64 = words.next()?.parse().ok()?;
        let keys = words
            .skip(1)
            .filter_map(|word| {
                let n: Vec<f64> = word.split(',').filter_map(|p| p.parse().ok()).collect();
                Some((*n.first()?, *n.get(1)?, *n.get(2)?))
            })
            .collect();
        all.last_mut()?.rounds.push(Round { keys, period_s, radius_m: 0.5 });
    }
    Some(all)
}

/// A small generator.
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Chance {
        Chance(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }
    pub fn share(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 40) as f64 / f64::from(1 << 24)
    }
    pub fn normal(&mut self) -> f64 {
        ((0..4).map(|_| self.share()).sum::<f64>() - 2.0) * 3f64.sqrt()
    }
}

fn cast(course: &Course, discs: &[(Point, f64)], origin: Point, ux: f64, uy: f64) -> f64 {
    let mut best = MAX_RANGE_M;
    for (centre, radius) in course.cylinders.iter().chain(discs) {
        let d = origin.to(*centre);
        let along = d.x_m * ux + d.y_m * uy;
        let aside = d.x_m * uy - d.y_m * ux;
        let left = radius * radius - aside * aside;
        if along > 0.0 && left > 0.0 {
            let hit = along - left.sqrt();
            if hit < best {
                best = hit.max(0.0);
            }
        }
    }
    for (a, b) in &course.walls {
        let (ab, oa) = (a.to(*b), origin.to(*a));
        let cross = ux * ab.y_m - uy * ab.x_m;
        if cross.abs() > 1e-12 {
            let t = (oa.x_m * ab.y_m - oa.y_m * ab.x_m) / cross;
            let s = (oa.x_m * uy - oa.y_m * ux) / cross;
            if t > 0.0 && (0.0..=1.0).contains(&s) && t < best {
                best = t;
            }
        }
    }
    best
}

fn touches(course: &Course, discs: &[(Point, f64)], pose: Pose) -> bool {
    let frame = pose.frame();
    course.cylinders.iter().chain(discs).any(|(centre, radius)| OUTLINE.gap_m(frame.inner(*centre)) <= *radius)
        || course
            .walls
            .iter()
            .any(|(a, b)| (0..=400).any(|k| OUTLINE.gap_m(frame.inner(a.plus(a.to(*b), f64::from(k) / 400.0))) <= 0.0))
}

pub struct Trial {
    pub seed: u64,
    pub latency_s: f64,
    pub scale: f64,
    pub tracking: bool,
    pub keep_track: bool,
}

/// One run. The odometry frame begins at the start pose; the planner sees nothing else.
pub fn run(course: &Course, setup: &Setup, trial: &Trial) -> Result {
    let mut planner = Planner::new(*setup);
    let limits: Limits = setup.limits;
    let mut chance = Chance::new(trial.seed + 1 + u64::from(course.index) * 1000);
    let mut truth = State { pose: course.start, ..State::default() };
    let mut odometry = Pose::default();
    let goal = course.start.frame().inner(course.goal);
    let start_frame = course.start.frame();
    let delay = (trial.latency_s / STEP_S).round() as usize;
    let mut line: VecDeque<(f64, f64)> = VecDeque::from(vec![(0.0, 0.0); delay]);
    let mut beams = vec![Beam::default(); BEAMS];
    let mut began: Option<f64> = None;
    let mut out =
        Result { success: false, collided: false, time_s: 100.0, score: 0.0, track: Vec::new(), step_us: Vec::new() };
    let mut time_s = 0.0;
    // The world's clock starts with the robot's; a quiet second at the start, as a handshake takes.
    while time_s < 130.0 {
        let discs: Vec<(Point, f64)> = course.rounds.iter().map(|round| (round.at(time_s).0, round.radius_m)).collect();
        let frame = truth.pose.frame();
        let origin = frame.outer(LASER_X_M, 0.0);
        for (k, beam) in beams.iter_mut().enumerate() {
            let bearing = (-135.0 + 270.0 * k as f64 / (BEAMS - 1) as f64).to_radians();
            let (sin, cos) = math::sin_cos(truth.pose.heading_rad + bearing);
            let range = cast(course, &discs, origin, cos, sin);
            let echo = if range >= MAX_RANGE_M { Echo::Clear } else { Echo::Value };
            *beam = Beam {
                origin_x_m: LASER_X_M as f32,
                bearing_rad: bearing as f32,
                range_m: (range + 0.001 * chance.normal()) as f32,
                echo: echo as u32,
                ..Beam::default()
            };
        }
        let movers: Vec<Mover> = course
            .rounds
            .iter()
            .filter(|_| trial.tracking)
            .enumerate()
            .map(|(id, round)| {
                let (place, velocity) = round.at(time_s);
                let turned = Point::new(
                    velocity.x_m * start_frame.cos + velocity.y_m * start_frame.sin,
                    velocity.y_m * start_frame.cos - velocity.x_m * start_frame.sin,
                );
                Mover {
                    id: id as u64,
                    seen: true,
                    place: start_frame.inner(place),
                    velocity: turned,
                    radius_m: round.radius_m,
                }
            })
            .filter(|mover| {
                // Only what the laser can see: within 270°, not too far.
                let local = odometry.frame().inner(mover.place);
                local.length_m() < 12.0 && math::atan2(local.y_m, local.x_m).abs() < 2.4
            })
            .collect();
        let sight = Sight {
            pose: odometry,
            velocity: (truth.forward_m_s * trial.scale, truth.turn_rad_s),
            scan_pose: odometry,
            beams: &beams,
            movers: &movers,
            goal,
            tolerance_m: 0.3,
            time_s,
        };
        let started = runtime::clock::now();
        let wish: Wish = planner.step(&sight);
        out.step_us.push(runtime::clock::now().since(started) * 1e6);
        line.push_back((wish.forward_m_s, wish.turn_rad_s));
        let told = line.pop_front().unwrap_or_default();
        for _ in 0..SUBSTEPS {
            let dt = STEP_S / SUBSTEPS as f64;
            truth = truth.towards(told, &limits, dt);
            odometry = odometry.after(truth.forward_m_s * trial.scale, truth.turn_rad_s, dt);
        }
        time_s += STEP_S;
        let moved = course.start.place.to(truth.pose.place).length_m();
        if began.is_none() && moved > 0.1 {
            began = Some(time_s);
        }
        let discs: Vec<(Point, f64)> = course.rounds.iter().map(|round| (round.at(time_s).0, round.radius_m)).collect();
        if trial.keep_track {
            out.track.push(truth.pose);
        }
        let spent = time_s - began.unwrap_or(time_s);
        if touches(course, &discs, truth.pose) {
            out.collided = true;
            out.time_s = spent;
            return out;
        }
        if truth.pose.place.to(course.goal).length_m() <= 1.0 {
            let optimal = course.path_m / 2.0;
            out.success = true;
            out.time_s = spent;
            out.score = optimal / spent.clamp(2.0 * optimal, 8.0 * optimal);
            return out;
        }
        if spent > 100.0 {
            return out;
        }
    }
    out
}
