//! One body with its controller and its ears: how far it gets in a step, and what it feels.
//!
//! No outline is let nearer to anything than a skin of half a millimetre. A step that would go nearer is cut where the
//! skin begins, found by halving; what is left of it may still be turned (away from a wall) or driven (out of a turn),
//! if that leads nowhere nearer. The distance to the nearest wall is known within two bounds that the way travelled
//! widens, so that most steps ask the map nothing.

use crate::body::{Body, Stride};
use crate::contact::{Latch, Meeting};
use crate::geometry::{Placed, Point, Pose};
use crate::mcu::{Felt, Mcu};
use crate::noise::Chance;
use crate::scene::{Scene, Thing};
use crate::sonar::Ears;
use crate::statistics::Statistics;
use crate::world::Nearest;
use messages::{Contact, Twist};
use runtime::Time;

use super::line::Line;
use super::{HALVINGS, STEP_S};

/// Nothing comes nearer to an outline [m].
pub(super) const SKIN_M: f64 = 0.0005;
/// Nearer than this counts as touching [m].
const TOUCH_M: f64 = 0.001;
/// How far a step that needs to know looks around [m].
const PROBE_M: f64 = 0.25;
/// A wheel that makes less of its way than this share is blocked.
const BLOCKED_SHARE: f64 = 0.5;
/// Contacts kept until somebody takes them away; later ones are counted only.
const MAX_FRESH: usize = 64;
/// Bytes that pass a faulty line at a time.
const CHUNK: usize = 256;
/// Bumper segments look at the ends of the body only: nothing is pressed between these points of its length [m].
const REAR_BUMPER_M: f64 = -0.15;
const FRONT_BUMPER_M: f64 = 0.05;

/// The first thing in a body's way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    pub thing: Thing,
    pub on_body: Point,
    pub on_thing: Point,
    /// Velocity that the body was about to have.
    pub velocity: Twist,
}

/// See the module's text.
#[derive(Debug, Clone)]
pub(super) struct Actor {
    pub mcu: Mcu,
    pub body: Body,
    pub placed: Placed,
    pub statistics: Statistics,
    pub fresh_contacts: Vec<Contact>,
    pub silent: bool,
    ears: Ears,
    sonar_chance: Chance,
    line: Line,
    /// The nearest wall is at least, and at most, so far [m].
    wall_least_m: f64,
    wall_most_m: f64,
    /// Whether contact lasts: with what stands still, with each person, with each body.
    latches: Vec<Latch>,
    felt: Felt,
}

/// What an actor is made of.
pub(super) struct Parts {
    pub mcu: Mcu,
    pub body: Body,
    pub ears: Ears,
    pub sonar_chance: Chance,
    pub line: Line,
    pub things: usize,
}

impl Actor {
    pub fn new(parts: Parts) -> Actor {
        let placed = parts.body.footprint.placed(parts.body.pose);
        Actor {
            mcu: parts.mcu,
            body: parts.body,
            placed,
            statistics: Statistics::default(),
            fresh_contacts: Vec::with_capacity(MAX_FRESH),
            silent: false,
            ears: parts.ears,
            sonar_chance: parts.sonar_chance,
            line: parts.line,
            wall_least_m: 0.0,
            wall_most_m: f64::INFINITY,
            latches: vec![Latch::default(); parts.things],
            felt: Felt::default(),
        }
    }

    /// Puts the body somewhere else.
    pub fn place(&mut self, pose: Pose) {
        self.body.pose = pose;
        self.placed = self.body.footprint.placed(pose);
        (self.wall_least_m, self.wall_most_m) = (0.0, f64::INFINITY);
    }

    /// One step of driving; answers what was in the way.
    pub fn drive(&mut self, scene: &Scene, now: Time) -> Option<Hit> {
        self.take_arrived(now);
        let told = self.mcu.drive(now, STEP_S);
        let wheels = self.body.stride(told.speed_m_s, told.turn_rad_s, STEP_S);
        let ground = self.body.on_ground(wheels);
        let (share, hit) = self.go(scene, ground);
        let mut done = wheels.part(share);
        let mut ground_done = ground.part(share);
        if share < 1.0 {
            // What is left may still be turned, or else driven: a robot at a wall can turn away from it.
            let rest = 1.0 - share;
            for only in [Axis::Turn, Axis::Way] {
                let left = only.of(ground.part(rest));
                if !left.is_none() && self.go_whole(scene, left) {
                    let wheels_left = only.of(wheels.part(rest));
                    done = Stride {
                        way_m: done.way_m + wheels_left.way_m,
                        turn_rad: done.turn_rad + wheels_left.turn_rad,
                    };
                    ground_done = Stride {
                        way_m: ground_done.way_m + left.way_m,
                        turn_rad: ground_done.turn_rad + left.turn_rad,
                    };
                    break;
                }
            }
        }
        self.body.velocity = twist(ground_done);
        self.statistics.travelled(ground_done.way_m, STEP_S);
        let (left_ticks, right_ticks) = self.body.turn_wheels(done);
        let (told_left, told_right) = self.body.wheel_ways_m(wheels);
        let (done_left, done_right) = self.body.wheel_ways_m(done);
        let blocked = |told: f64, done: f64| share < 1.0 && told != 0.0 && done / told < BLOCKED_SHARE;
        self.felt = Felt {
            left_ticks,
            right_ticks,
            left_blocked: blocked(told_left, done_left),
            right_blocked: blocked(told_right, done_right),
            ..self.felt
        };
        hit.map(|(near, thing)| Hit { thing, on_body: near.on_body, on_thing: near.on_thing, velocity: twist(ground) })
    }

    /// What follows the motion: contacts that last or end, what the controller feels, sonar, reports.
    pub fn sense(&mut self, scene: &Scene, now: Time) {
        if self.latches.iter().any(Latch::is_closed) {
            self.follow_contacts(scene, now);
        }
        if self.wall_least_m.min(scene.mover_bound_m(&self.placed)) < self.statistics.least_clearance_m {
            let clearance_m = self.clearance_m(scene);
            self.statistics.least_clearance_m = self.statistics.least_clearance_m.min(clearance_m);
        }
        self.mcu.observe(now, self.felt, STEP_S);
        let Actor { ears, body, sonar_chance, mcu, .. } = self;
        mcu.ping(now, |disc, other| ears.reading(scene, body.pose, disc, other.is_some(), sonar_chance));
        mcu.report(now);
    }

    /// Distance to the nearest thing, exactly [m].
    pub fn clearance_m(&mut self, scene: &Scene) -> f64 {
        if self.wall_least_m < self.wall_most_m {
            let mut within_m = if self.wall_most_m.is_finite() { self.wall_most_m + 1e-9 } else { 1.0 };
            let exact_m = loop {
                if let Some(nearest) = scene.map.nearest(&self.placed, within_m) {
                    break nearest.distance_m;
                }
                let (low, high) = scene.map.extent();
                if within_m > (high - low).norm() + (self.placed.centre - low).norm() {
                    break f64::INFINITY;
                }
                within_m *= 4.0;
            };
            (self.wall_least_m, self.wall_most_m) = (exact_m, exact_m);
        }
        scene.nearest_mover(&self.placed, self.wall_least_m).map_or(self.wall_least_m, |(near, _)| near.distance_m)
    }

    /// Takes note of a touch; a new contact is counted and kept.
    pub fn met(&mut self, now: Time, thing: Thing, persons: usize, on_body: Point, meeting: &Meeting) {
        if !self.latches[latch_index(thing, persons)].touch(now) {
            return;
        }
        let cause = meeting.cause();
        self.statistics.contacts[cause as usize] += 1;
        if self.fresh_contacts.len() < MAX_FRESH {
            let Point { x_m, y_m } = on_body;
            self.fresh_contacts.push(Contact { x_m, y_m, speed_m_s: meeting.closing_m_s(), cause: cause as u64 });
        }
    }

    /// Velocity of a point of the body in the world, when the body moves so.
    pub fn velocity_at(&self, twist: Twist, point: Point) -> Point {
        let ahead = Point::unit(self.body.pose.heading_rad);
        let arm = point - self.body.pose.place();
        ahead * twist.linear_x_m_s + arm.left() * twist.angular_z_rad_s
    }

    /// How far ahead of the axle a point of the body lies [m].
    pub fn ahead_m(&self, point: Point) -> f64 {
        self.body.pose.body_from_world(point).x_m
    }

    /// Takes bytes from the client, through the line's faults.
    pub fn receive(&mut self, now: Time, bytes: &[u8]) {
        if self.silent {
            return;
        }
        for chunk in bytes.chunks(CHUNK) {
            let mut passed = [0; CHUNK];
            passed[..chunk.len()].copy_from_slice(chunk);
            let count = self.line.pass(&mut passed[..chunk.len()]);
            if self.line.is_slow() {
                self.line.hold(now, &passed[..count]);
            } else {
                self.mcu.receive(now, &passed[..count]);
            }
        }
    }

    /// Hands the controller what a slow line has brought by now.
    fn take_arrived(&mut self, now: Time) {
        let mut arrived = [0; CHUNK];
        loop {
            let count = self.line.arrived(now, &mut arrived);
            if count == 0 {
                return;
            }
            self.mcu.receive(now, &arrived[..count]);
        }
    }

    /// Moves bytes for the client into `buffer`, through the line's faults.
    pub fn send(&mut self, buffer: &mut [u8]) -> usize {
        let bytes = self.mcu.outbox();
        let count = bytes.len().min(buffer.len());
        buffer[..count].copy_from_slice(&bytes[..count]);
        self.mcu.sent(count);
        if self.silent { 0 } else { self.line.pass(&mut buffer[..count]) }
    }

    /// Moves the body along `stride` as far as it is free; answers the share that was, and what ended it.
    fn go(&mut self, scene: &Scene, stride: Stride) -> (f64, Option<(Nearest, Thing)>) {
        if stride.is_none() {
            return (1.0, None);
        }
        let reach_m = stride.reach_m(self.body.footprint.radius_m());
        let from = self.body.pose;
        let at = |share: f64| from.after_arc(stride.way_m * share, stride.turn_rad * share);
        let whole = self.body.footprint.placed(at(1.0));
        if self.wall_least_m - reach_m > SKIN_M && scene.mover_bound_m(&self.placed) - reach_m > SKIN_M {
            self.take(at(1.0), whole, reach_m);
            return (1.0, None);
        }
        let (wall, nearest) = look(scene, &whole);
        let Some(near) = nearest.filter(|(near, _)| near.distance_m < SKIN_M) else {
            self.take(at(1.0), whole, reach_m);
            self.learn(wall);
            return (1.0, None);
        };
        let before_m = look(scene, &self.placed).1.map_or(f64::INFINITY, |(near, _)| near.distance_m);
        let allowed_m = before_m.min(SKIN_M);
        if near.0.distance_m >= allowed_m {
            self.take(at(1.0), whole, reach_m);
            self.learn(wall);
            return (1.0, None);
        }
        let (mut free, mut blocked, mut hit) = (0.0, 1.0, near);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (free + blocked);
            match look(scene, &self.body.footprint.placed(at(middle))).1.filter(|(near, _)| near.distance_m < allowed_m)
            {
                Some(near) => (blocked, hit) = (middle, near),
                None => free = middle,
            }
        }
        let placed = self.body.footprint.placed(at(free));
        self.take(at(free), placed, reach_m * free);
        self.learn(look(scene, &placed).0);
        (free, Some(hit))
    }

    /// Moves the body along all of `stride`, or not at all.
    fn go_whole(&mut self, scene: &Scene, stride: Stride) -> bool {
        let before = (self.body.pose, self.placed, self.wall_least_m, self.wall_most_m);
        let whole = self.go(scene, stride).0 == 1.0;
        if !whole {
            (self.body.pose, self.placed, self.wall_least_m, self.wall_most_m) = before;
        }
        whole
    }

    fn take(&mut self, pose: Pose, placed: Placed, reach_m: f64) {
        (self.body.pose, self.placed) = (pose, placed);
        self.wall_least_m = (self.wall_least_m - reach_m).max(0.0);
        self.wall_most_m += reach_m;
    }

    /// Takes over what a look around has said of the walls.
    fn learn(&mut self, wall: Option<Nearest>) {
        match wall {
            Some(near) => (self.wall_least_m, self.wall_most_m) = (near.distance_m, near.distance_m),
            None => self.wall_least_m = self.wall_least_m.max(PROBE_M),
        }
    }

    /// Lets contacts last or end, and the bumpers press what touches.
    fn follow_contacts(&mut self, scene: &Scene, now: Time) {
        let persons = scene.persons.len();
        let (mut front, mut rear) = (0, 0);
        for index in 0..self.latches.len() {
            if !self.latches[index].is_closed() {
                continue;
            }
            let gap = match thing_of(index, persons) {
                Thing::Static => scene.map.nearest(&self.placed, PROBE_M).map(|near| (near.distance_m, near.on_body)),
                Thing::Person(person) => scene.persons.get(person).map(|disc| {
                    let gap = self.placed.gap_to_circle(disc);
                    (gap.0, gap.1)
                }),
                Thing::Body(body) => scene.bodies.get(body).map(|other| {
                    let gap = self.placed.gap_to_placed(other);
                    (gap.0, gap.1)
                }),
            };
            let (gap_m, on_body) = gap.unwrap_or((f64::INFINITY, Point::ZERO));
            if gap_m < TOUCH_M {
                self.latches[index].touch(now);
                let (pressed_front, pressed_rear) = bumpers(self.body.pose.body_from_world(on_body));
                (front, rear) = (front | pressed_front, rear | pressed_rear);
            } else {
                self.latches[index].observe_gap(now, gap_m);
            }
        }
        let flash = self.mcu.flash();
        self.felt.front_bumpers = if flash.front_bumpers > 0 { front } else { 0 };
        self.felt.rear_bumpers = if flash.rear_bumpers > 0 { rear } else { 0 };
    }
}

#[derive(Debug, Clone, Copy)]
enum Axis {
    Turn,
    Way,
}

impl Axis {
    fn of(self, stride: Stride) -> Stride {
        match self {
            Axis::Turn => Stride { way_m: 0.0, ..stride },
            Axis::Way => Stride { turn_rad: 0.0, ..stride },
        }
    }
}

/// The nearest wall and the nearest thing of any kind within the probe's distance.
fn look(scene: &Scene, placed: &Placed) -> (Option<Nearest>, Option<(Nearest, Thing)>) {
    let wall = scene.map.nearest(placed, PROBE_M);
    let within_m = wall.map_or(PROBE_M, |near| near.distance_m);
    (wall, scene.nearest_mover(placed, within_m).or(wall.map(|near| (near, Thing::Static))))
}

/// Bumper segments (front, rear) that a touch at `point` of the body presses: five of 36° at either end, bit 0 leftmost.
fn bumpers(point: Point) -> (u8, u8) {
    const SEGMENTS: f64 = 5.0;
    let segment =
        |from_left_rad: f64| 1 << (from_left_rad / std::f64::consts::PI * SEGMENTS).clamp(0.0, SEGMENTS - 1.0) as u8;
    let bearing_rad = point.angle();
    let quarter = std::f64::consts::FRAC_PI_2;
    if point.x_m > FRONT_BUMPER_M {
        (segment(quarter - bearing_rad), 0)
    } else if point.x_m < REAR_BUMPER_M {
        (0, segment(runtime::math::wrap_angle(bearing_rad - quarter)))
    } else {
        (0, 0)
    }
}

fn latch_index(thing: Thing, persons: usize) -> usize {
    match thing {
        Thing::Static => 0,
        Thing::Person(index) => 1 + index,
        Thing::Body(index) => 1 + persons + index,
    }
}

fn thing_of(latch: usize, persons: usize) -> Thing {
    match latch {
        0 => Thing::Static,
        _ if latch <= persons => Thing::Person(latch - 1),
        _ => Thing::Body(latch - 1 - persons),
    }
}

fn twist(stride: Stride) -> Twist {
    Twist { linear_x_m_s: stride.way_m / STEP_S, linear_y_m_s: 0.0, angular_z_rad_s: stride.turn_rad / STEP_S }
}
