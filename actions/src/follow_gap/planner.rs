//! The planner: scans, pose and goal in, a wanted velocity out. Pure: no ports, no clock.
//!
//! Every step: the newest scan goes into the memory ([`super::memory`]); of what is remembered the clearance is worked
//! out ([`super::clearance`]), of that the way to the goal ([`super::guide`]); plans are judged along their whole swept
//! footprint ([`super::rollout`], [`super::candidates`]), the best is changed at random and judged again, twice; its
//! first part is wanted. The plan is kept as a candidate of the next step.
//!
//! Without memory (`memory_s` = 0) all of this is done from the newest scan alone and nothing is kept: purely reactive.

use super::candidates::{self, Candidates};
use super::clearance::Clearance;
use super::guide::{Guide, Price};
use super::memory::Memory;
use super::movers::Movers;
use super::pose::{Point, Pose};
use super::rollout::{COLLISION, INTERVALS, Limits, Mover, Outcome, Outline, Plan, Scene, State, Weights};
use messages::{Beam, Echo};
use runtime::math;

/// What the planner is built with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// The robot's outline.
    pub outline: Outline,
    /// Its limits.
    pub limits: Limits,
    /// What counts how much.
    pub weights: Weights,
    /// What a metre of way costs.
    pub price: Price,
    /// How long what nobody looks at is kept; 0: only the newest scan counts [s].
    pub memory_s: f64,
    /// Beams are used up to here [m].
    pub horizon_m: f64,
    /// From a scan to the wheels' answer [s].
    pub delay_s: f64,
    /// Time from one wanted velocity to the next [s].
    pub period_s: f64,
    /// Room between outline and obstacle when the robot has come to rest along the arc that is wanted [m].
    pub stop_margin_m: f64,
    /// Time in which nothing slows yet, for the same [s].
    pub stop_delay_s: f64,
    /// Random changes per refinement.
    pub changes: usize,
    /// Seed of the changes.
    pub seed: u64,
}

/// What the planner is told in a step.
#[derive(Debug, Clone, Copy)]
pub struct Sight<'a> {
    /// Where the robot is now, in the odometry frame.
    pub pose: Pose,
    /// Forward speed and turn rate now.
    pub velocity: (f64, f64),
    /// Where the robot was when the scan was taken.
    pub scan_pose: Pose,
    /// The scan; empty when there is no new one.
    pub beams: &'a [Beam],
    /// What is said to move, as of now; believed only where the memory agrees.
    pub movers: &'a [Mover],
    /// Where to go.
    pub goal: Point,
    /// The goal counts as reached within this [m].
    pub tolerance_m: f64,
    /// Time since the planner's beginning [s].
    pub time_s: f64,
}

/// What the planner wants.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wish {
    /// Forward speed [m/s].
    pub forward_m_s: f64,
    /// Turn rate [rad/s].
    pub turn_rad_s: f64,
    /// Cost to go from here.
    pub cost_to_go: f64,
    /// No plan is free of collisions.
    pub cornered: bool,
    /// The goal is reached.
    pub arrived: bool,
}

/// Cells of the fine raster (footprint) and of the coarse one (way), and their sides [m].
const FINE_CELLS: usize = 96;
const FINE_M: f64 = 0.06;
const COARSE_CELLS: usize = 96;
const COARSE_M: f64 = 0.125;
/// Cells of the memory.
const MEMORY_CELLS: usize = 240;
const MEMORY_M: f64 = 0.05;
/// Most obstacle points.
const MOST_POINTS: usize = 8192;
/// Points of the guide's path, and their spacing [m].
const PATH_POINTS: usize = 60;
const PATH_STEP_M: f64 = 0.06;
/// The guide is worked out so much farther than the robot [m of free way].
const BEYOND: f32 = 5.0;
/// The wanted velocity is the plan's so much later, so that ramps below have something to ramp to [s].
const LEAD_S: f64 = 0.1;

/// Within this of one place for [`STANDS_S`] the robot counts as stuck [m].
const STANDS_M: f64 = 0.15;
/// See [`STANDS_M`] [s].
const STANDS_S: f64 = 1.0;
/// By so much more room does a stuck robot ask the guide for, each time, and at most [m].
const WIDER_M: f64 = 0.03;
const WIDEST_M: f64 = 0.12;
/// Where it got stuck counts as left behind from here on [m].
const LEFT_M: f64 = 2.5;

/// Notices that the guide leads where the footprint does not pass, and asks for wider ways until that place is behind.
#[derive(Debug, Clone, Copy, Default)]
struct Patience {
    /// Where, and since when [s].
    stands: Option<(Point, f64)>,
    stuck_at: Point,
    wider_m: f64,
}

impl Patience {
    fn wider_m(&mut self, time_s: f64, place: Point) -> f64 {
        let (at, since_s) = *self.stands.get_or_insert((place, time_s));
        if place.to(at).length_m() > STANDS_M {
            self.stands = Some((place, time_s));
        } else if time_s - since_s > STANDS_S {
            self.stands = Some((at, time_s));
            self.stuck_at = place;
            self.wider_m = (self.wider_m + WIDER_M).min(WIDEST_M);
        }
        if place.to(self.stuck_at).length_m() > LEFT_M {
            self.wider_m = 0.0;
        }
        self.wider_m
    }
}

/// The planner.
#[derive(Debug)]
pub struct Planner {
    setup: Setup,
    memory: Memory,
    points: Vec<Point>,
    fine: Clearance,
    coarse: Clearance,
    guide: Guide,
    candidates: Candidates,
    followers: Vec<Plan>,
    path: Vec<Point>,
    plan: Option<Plan>,
    movers: Movers,
    patience: Patience,
}

impl Planner {
    /// A planner that knows nothing yet.
    pub fn new(setup: Setup) -> Planner {
        Planner {
            memory: Memory::new(MEMORY_CELLS, MEMORY_M, setup.memory_s),
            points: Vec::with_capacity(MOST_POINTS),
            fine: Clearance::new(FINE_CELLS, FINE_M),
            coarse: Clearance::new(COARSE_CELLS, COARSE_M),
            guide: Guide::new(COARSE_CELLS),
            candidates: Candidates::new(&setup.limits, setup.changes, setup.seed),
            followers: Vec::with_capacity(32),
            path: Vec::with_capacity(PATH_POINTS),
            plan: None,
            movers: Movers::default(),
            patience: Patience::default(),
            setup,
        }
    }

    /// Forgets what was seen and planned: the odometry's frame is another.
    pub fn forget(&mut self) {
        self.memory.clear();
        self.points.clear();
        self.plan = None;
        self.movers = Movers::default();
        self.patience = Patience::default();
    }

    /// The guide's path of the last step, for pictures.
    pub fn path(&self) -> &[Point] {
        &self.path
    }

    /// The movers that were believed in the last step, for pictures.
    pub fn movers(&self) -> &[Mover] {
        self.movers.believed()
    }

    /// What to want now.
    pub fn step(&mut self, sight: &Sight) -> Wish {
        let setup = self.setup;
        self.take_scan(sight);
        let place = sight.pose.place;
        if place.to(sight.goal).length_m() <= sight.tolerance_m {
            self.plan = None;
            return Wish { arrived: true, ..Wish::default() };
        }
        self.fine.rebuild(place, &self.points);
        self.coarse.rebuild(place, &self.points);
        let mut price = setup.price;
        if setup.memory_s > 0.0 {
            price.blocked_m += self.patience.wider_m(sight.time_s, place);
            price.free_m = price.free_m.max(price.blocked_m + 0.05);
        }
        self.guide.rebuild(&self.coarse, &price, sight.goal, place, BEYOND);
        let now = State { pose: sight.pose, forward_m_s: sight.velocity.0, turn_rad_s: sight.velocity.1 };
        // What was wanted before goes on until this step's wish reaches the wheels.
        let before = self.plan.filter(|_| setup.memory_s > 0.0);
        let state = match &before {
            Some(plan) => now.towards(plan[0], &setup.limits, setup.delay_s),
            None => now.towards(sight.velocity, &setup.limits, setup.delay_s),
        };
        self.guide.descend(state.pose.place, sight.goal, PATH_STEP_M, &mut self.path);
        let (plan, outcome) = self.choose(sight, state, before);
        self.plan = Some(plan);
        let lead = state.towards(plan[0], &setup.limits, LEAD_S);
        let wanted = (lead.forward_m_s, lead.turn_rad_s);
        let (forward_m_s, turn_rad_s) = self.stoppable(state, wanted);
        let cornered = outcome.cost >= COLLISION;
        Wish { forward_m_s, turn_rad_s, cost_to_go: self.guide.cost(place), cornered, arrived: false }
    }

    fn take_scan(&mut self, sight: &Sight) {
        if sight.beams.is_empty() {
            return;
        }
        let setup = &self.setup;
        let frame = sight.scan_pose.frame();
        let now_ms = (sight.time_s * 1e3) as u32;
        let remembers = setup.memory_s > 0.0;
        self.points.clear();
        let end_of = |beam: &Beam, range_m: f64| {
            let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
            let (x_m, y_m) = (f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
            frame.outer(x_m + range_m * cos, y_m + range_m * sin)
        };
        if remembers {
            self.memory.follow(sight.pose.place);
            for beam in sight.beams {
                let is_clear = beam.echo == Echo::Clear as u32;
                let is_value = beam.echo == Echo::Value as u32 && beam.range_m.is_finite();
                if is_clear || is_value {
                    let reach_m = if is_clear { setup.horizon_m } else { f64::from(beam.range_m).min(setup.horizon_m) };
                    let from = frame.outer(f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
                    self.memory.pass(from, end_of(beam, reach_m));
                }
            }
        }
        self.movers.begin(if remembers { sight.movers } else { &[] });
        for beam in sight.beams {
            let near = f64::from(beam.range_m) < setup.horizon_m;
            if beam.echo != Echo::Value as u32 || !near {
                continue;
            }
            let end = end_of(beam, f64::from(beam.range_m));
            if remembers {
                self.memory.hit(end, now_ms);
                self.movers.look_at(end, self.memory.age_ms(end, now_ms));
            } else if self.points.len() < self.points.capacity() {
                self.points.push(end);
            }
        }
        if remembers {
            self.movers.decide();
            let outline = &setup.outline;
            let shape = (outline.ahead_m, outline.behind_m, outline.half_width_m);
            self.memory.collect(now_ms, &sight.pose.frame(), shape, &mut self.points);
            let movers = &self.movers;
            self.points.retain(|point| !movers.hold(*point));
        }
    }

    fn scene<'a>(&'a self, sight: &'a Sight) -> Scene<'a> {
        Scene {
            clearance: &self.fine,
            guide: &self.guide,
            movers: self.movers.believed(),
            outline: self.setup.outline,
            limits: self.setup.limits,
            weights: self.setup.weights,
            goal: sight.goal,
        }
    }

    /// The best plan of all candidates, refined.
    fn choose(&mut self, sight: &Sight, state: State, before: Option<Plan>) -> (Plan, Outcome) {
        let setup = self.setup;
        let weights = &setup.weights;
        let interval_s = weights.steps as f64 * weights.step_s / INTERVALS as f64;
        self.followers.clear();
        let mut followers = std::mem::take(&mut self.followers);
        candidates::followers(state, &self.path, &setup.limits, interval_s, &mut followers);
        let scene = self.scene(sight);
        let judge = |plan: &Plan| scene.judge(state, setup.delay_s, plan);
        let mut best = self.candidates.fixed()[0];
        let mut outcome = judge(&best);
        let mut offer = |plan: &Plan| {
            let found = judge(plan);
            if found.cost < outcome.cost {
                (best, outcome) = (*plan, found);
            }
        };
        if let Some(before) = before {
            offer(&candidates::shifted(&before, (setup.period_s / interval_s).min(1.0)));
        }
        for plan in self.candidates.fixed().iter().skip(1).chain(&followers) {
            offer(plan);
        }
        for spread in [(0.35, 0.7), (0.12, 0.25)] {
            let middle = best;
            for k in 0..self.candidates.changes() {
                let plan = self.candidates.changed(&middle, k, spread, &setup.limits);
                let found = judge(&plan);
                if found.cost < outcome.cost {
                    (best, outcome) = (plan, found);
                }
            }
        }
        self.followers = followers;
        (best, outcome)
    }

    /// `wanted`, slowed down along its arc until the robot comes to rest on it before it touches anything that stands.
    fn stoppable(&self, state: State, wanted: (f64, f64)) -> (f64, f64) {
        let setup = &self.setup;
        let (v, w) = wanted;
        let pace_m_s = v.abs() + w.abs() * setup.outline.radius_m();
        if pace_m_s < 0.05 {
            return wanted;
        }
        // Time to contact at the wanted velocity, in steps of no more than 4 cm.
        let step_s = 0.04 / pace_m_s;
        let brake_s = (v.abs() / setup.limits.deceleration_m_s2).max(w.abs() / setup.limits.turn_acceleration_rad_s2);
        let needed_s = setup.stop_delay_s + 0.5 * brake_s;
        let steps = (needed_s / step_s).ceil() as usize + 3;
        let scene = Scene {
            clearance: &self.fine,
            guide: &self.guide,
            movers: &[],
            outline: setup.outline,
            limits: setup.limits,
            weights: setup.weights,
            goal: Point::default(),
        };
        let now_m = scene.gap_m(&state.pose.frame());
        let margin_m = setup.stop_margin_m.min(now_m - 1e-3);
        let mut pose = state.pose;
        for step in 1..=steps.min(200) {
            pose = pose.after(v, w, step_s);
            if scene.gap_m(&pose.frame()) < margin_m {
                let clear_s = (step - 1) as f64 * step_s;
                let delay_s = setup.stop_delay_s;
                let root = (delay_s * delay_s + 2.0 * brake_s * clear_s).sqrt();
                let share = (2.0 * clear_s / (delay_s + root).max(1e-9)).min(1.0);
                return (v * share, w * share);
            }
        }
        wanted
    }
}
