//! A world with bodies and their controllers, advanced in fixed steps from one seed.
//!
//! Each step of 10 ms: the people walk; then every body, in order, obeys its controller, moves as far as it can, and its
//! sonar fires. What a client sends takes effect with the next step. The same seed and the same bytes at the same times
//! give the same bits, on every machine. Nothing in a step allocates.

mod actor;
mod chassis;
#[cfg(test)]
mod crowd_tests;
mod line;
#[cfg(test)]
mod many_tests;
mod people;
mod setup;
mod social;
#[cfg(test)]
mod tests;

pub use chassis::Chassis;
pub use people::{Way, people_along};
pub use setup::{BodySetup, Setup, SetupError};

use crate::contact::Meeting;
use crate::geometry::{Circle, Footprint, Placed, Point, Pose};
use crate::laser::{Laser, Movers};
use crate::mcu::Mcu;
use crate::scene::{Scene, Thing};
use crate::statistics::Statistics;
use crate::world::{Walk, World};
use actor::{Actor, SKIN_M};
use line::Line;
use messages::{Contact, Truth, Twist};
use runtime::Time;

/// Length of a step [ns].
pub const STEP_NS: u64 = 10_000_000;
/// Length of a step [s].
pub const STEP_S: f64 = STEP_NS as f64 * 1e-9;
/// Halvings by which a touch is found: a thousandth of a step's way.
const HALVINGS: usize = 10;

/// The simulation; see the module's text.
#[derive(Debug, Clone)]
pub struct Simulation {
    world: World,
    walks: Vec<Walk>,
    /// The people as they stand now, and how they moved in the last step.
    discs: Vec<Circle>,
    disc_velocities: Vec<Point>,
    /// What social people feel [m/s²].
    pushes: Vec<Point>,
    actors: Vec<Actor>,
    placed: Vec<Placed>,
    lasers: Vec<(Laser, Line)>,
    movers: Movers,
    now: Time,
    hash: u64,
}

impl Simulation {
    /// The clock at which the simulation begins; time advances from there. Zero unless this is called.
    pub fn begin(&mut self, now: Time) {
        self.now = now;
        self.lasers.iter_mut().for_each(|(laser, _)| laser.begin(now));
    }

    /// Simulated time: the end of the last whole step.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Advances by whole steps up to `to`.
    pub fn advance(&mut self, to: Time) {
        while self.now.after_ns(STEP_NS) <= to {
            self.step();
        }
    }

    /// Advances by one step.
    pub fn step(&mut self) {
        let begin = self.now;
        if !self.lasers.is_empty() {
            self.movers.begin(self.actors.iter().map(|actor| actor.body.pose), &self.discs);
        }
        self.feel();
        for person in 0..self.walks.len() {
            self.walk(person);
        }
        for body in 0..self.actors.len() {
            self.drive(body);
        }
        self.now = self.now.after_ns(STEP_NS);
        for body in 0..self.actors.len() {
            self.sense(body);
        }
        if !self.lasers.is_empty() {
            self.movers.end(self.actors.iter().map(|actor| actor.body.pose), &self.placed, &self.discs);
        }
        for (laser, _) in &mut self.lasers {
            let to = self.actors[laser.body].body.pose;
            laser.advance(&self.movers.seen_by(&self.world.map, laser.body, to, begin, self.now));
        }
    }

    /// Number of laser scanners, in the order of their bodies and then of their places on each.
    pub fn lasers(&self) -> usize {
        self.lasers.len()
    }

    /// Takes bytes that a client sends to a scanner at `now`, which may lie within a step.
    pub fn laser_receive(&mut self, scanner: usize, now: Time, bytes: &[u8]) {
        let Some((laser, line)) = self.lasers.get_mut(scanner) else { return };
        let mut passed = [0; 256];
        for chunk in bytes.chunks(passed.len()) {
            passed[..chunk.len()].copy_from_slice(chunk);
            let count = line.pass(&mut passed[..chunk.len()]);
            laser.receive(now, &passed[..count]);
        }
    }

    /// Hands what a scanner has to say to `send`, and forgets it.
    pub fn laser_send(&mut self, scanner: usize, send: impl FnOnce(&[u8])) {
        let Some((laser, line)) = self.lasers.get_mut(scanner) else { return };
        let outbox = laser.outbox();
        if !outbox.is_empty() {
            let count = line.pass(outbox);
            send(&outbox[..count]);
            outbox.clear();
        }
    }

    /// The rate that a scanner's line is to have, where a command has set one [baud].
    pub fn laser_baud(&self, scanner: usize) -> Option<u32> {
        self.lasers.get(scanner).and_then(|(laser, _)| laser.requested_baud())
    }

    /// Another client: what the one before has set is forgotten.
    pub fn laser_restart(&mut self, scanner: usize) {
        if let Some((laser, _)) = self.lasers.get_mut(scanner) {
            laser.restart();
        }
    }

    /// Takes bytes that a client sends to a body's controller.
    pub fn receive(&mut self, body: usize, bytes: &[u8]) {
        let now = self.now;
        if let Some(actor) = self.actors.get_mut(body) {
            actor.receive(now, bytes);
        }
    }

    /// Moves bytes of a body's controller into `buffer`, oldest first; answers how many.
    pub fn send(&mut self, body: usize, buffer: &mut [u8]) -> usize {
        self.actors.get_mut(body).map_or(0, |actor| actor.send(buffer))
    }

    /// A body's controller.
    pub fn controller(&mut self, body: usize) -> Option<&mut Mcu> {
        self.actors.get_mut(body).map(|actor| &mut actor.mcu)
    }

    /// Makes a body's controller deaf and dumb, as one that hangs, or lets it go on. Its wheels keep turning.
    pub fn silence(&mut self, body: usize, silent: bool) {
        if let Some(actor) = self.actors.get_mut(body) {
            actor.silent = silent;
        }
    }

    /// The world, which never changes.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Number of bodies.
    pub fn bodies(&self) -> usize {
        self.actors.len()
    }

    /// The people as they stand now.
    pub fn persons(&self) -> &[Circle] {
        &self.discs
    }

    /// True pose of a body.
    pub fn pose(&self, body: usize) -> Pose {
        self.actors[body].body.pose
    }

    /// True velocity of a body in its own frame, over the last step.
    pub fn velocity(&self, body: usize) -> Twist {
        self.actors[body].body.velocity
    }

    /// Outline of a body.
    pub fn footprint(&self, body: usize) -> &Footprint {
        &self.actors[body].body.footprint
    }

    /// What the run has been like for a body.
    pub fn statistics(&self, body: usize) -> &Statistics {
        &self.actors[body].statistics
    }

    /// Distance of a body's outline from the nearest thing; +∞ in an empty world [m].
    pub fn clearance_m(&mut self, body: usize) -> f64 {
        let (actor, scene) = self.actor_in_scene(body);
        actor.clearance_m(&scene)
    }

    /// Takes the contacts of a body that began since the last call away, oldest first.
    pub fn take_contacts(&mut self, body: usize, mut take: impl FnMut(Contact)) {
        self.actors[body].fresh_contacts.drain(..).for_each(&mut take);
    }

    /// What only the simulator knows of a body.
    pub fn truth(&mut self, body: usize) -> Truth {
        let clearance_m = self.clearance_m(body);
        let actor = &self.actors[body];
        let pose = actor.body.pose;
        Truth {
            x_m: pose.x_m,
            y_m: pose.y_m,
            heading_rad: pose.heading_rad,
            velocity: actor.body.velocity,
            clearance_m,
            distance_m: actor.statistics.distance_m,
            contacts: actor.statistics.contacts,
        }
    }

    /// A number that two runs share only if every pose of every body, every packet's length and every contact agreed.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    fn actor_in_scene(&mut self, own: usize) -> (&mut Actor, Scene<'_>) {
        let scene = Scene { map: &self.world.map, persons: &self.discs, bodies: &self.placed, own };
        (&mut self.actors[own], scene)
    }

    /// Lets a person walk on, up to the first body in the way.
    fn walk(&mut self, index: usize) {
        let person = &self.world.persons[index];
        let walk = self.walks[index];
        if person.yields(&walk, &self.placed) {
            self.disc_velocities[index] = Point::ZERO;
            return;
        }
        let next = match person.social {
            Some(_) => self.pushed(index, person, &walk),
            None => person.walked(&walk, STEP_S),
        };
        self.disc_velocities[index] = next.velocity;
        if next.jumped {
            return self.appear(index, next);
        }
        let (from, way) = (walk.disc.centre, next.disc.centre - walk.disc.centre);
        let at = |share: f64| Circle::new(from + way * share, walk.disc.radius_m);
        for body in 0..self.placed.len() {
            let placed = &self.placed[body];
            // Nobody is let nearer than the skin; somebody who is may stay and leave.
            let allowed_m = placed.gap_to_circle(&walk.disc).0.min(SKIN_M);
            if placed.gap_to_circle(&next.disc).0 >= allowed_m {
                continue;
            }
            let (mut free, mut blocked) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (free + blocked);
                let side = if placed.gap_to_circle(&at(middle)).0 >= allowed_m { &mut free } else { &mut blocked };
                *side = middle;
            }
            let (_, on_body, on_thing) = placed.gap_to_circle(&at(blocked));
            let disc = at(free);
            self.walks[index].disc = disc;
            self.discs[index] = disc;
            if person.social.is_some() {
                let mut stopped = next;
                (stopped.disc, stopped.velocity) = (disc, Point::ZERO);
                self.walks[index] = stopped;
            }
            self.meet(body, Thing::Person(index), on_body, on_thing, None);
            return;
        }
        self.walks[index] = next;
        self.discs[index] = next.disc;
    }

    /// Puts a timed person where the round begins anew: nothing is met on the way there. Where a body stands in that
    /// place, the two meet.
    fn appear(&mut self, index: usize, walk: Walk) {
        self.walks[index] = walk;
        self.discs[index] = walk.disc;
        for body in 0..self.placed.len() {
            let (gap_m, on_body, on_thing) = self.placed[body].gap_to_circle(&walk.disc);
            if gap_m < SKIN_M {
                self.meet(body, Thing::Person(index), on_body, on_thing, None);
            }
        }
    }

    /// Lets a body obey its controller, up to the first thing in the way.
    fn drive(&mut self, index: usize) {
        let now = self.now;
        let (actor, scene) = self.actor_in_scene(index);
        let hit = actor.drive(&scene, now);
        let placed = actor.placed;
        self.placed[index] = placed;
        if let Some(hit) = hit {
            self.meet(index, hit.thing, hit.on_body, hit.on_thing, Some(hit.velocity));
        }
    }

    /// Lets a body's sensors and its controller's reports follow, at the end of the step.
    fn sense(&mut self, index: usize) {
        let now = self.now;
        let (actor, scene) = self.actor_in_scene(index);
        actor.sense(&scene, now);
        let pose = actor.body.pose;
        let words = [
            pose.x_m.to_bits(),
            pose.y_m.to_bits(),
            pose.heading_rad.to_bits(),
            actor.mcu.outbox().len() as u64,
            actor.statistics.contacts.iter().sum(),
        ];
        for word in words {
            // FNV-1a over words.
            self.hash = (self.hash ^ word).wrapping_mul(0x0000_0100_0000_01B3);
        }
    }

    /// Takes note that a body touches a thing. `driven` is the velocity that the body was about to have, its present
    /// one when `None`.
    fn meet(&mut self, body: usize, thing: Thing, on_body: Point, on_thing: Point, driven: Option<Twist>) {
        let actor = &self.actors[body];
        let driven = driven.unwrap_or(actor.body.velocity);
        let body_velocity = actor.velocity_at(driven, on_body);
        let thing_velocity = match thing {
            Thing::Static => Point::ZERO,
            Thing::Person(person) => self.disc_velocities[person],
            Thing::Body(other) => self.actors[other].velocity_at(self.actors[other].body.velocity, on_thing),
        };
        let towards = on_thing - on_body;
        let closing = body_velocity - thing_velocity;
        // Where they touch to the last bit, the direction of approach stands for the normal.
        let normal = [towards, closing].into_iter().find(|vector| vector.norm() > 1e-9).unwrap_or(Point::new(1.0, 0.0));
        let meeting = Meeting {
            normal: normal * (1.0 / normal.norm()),
            body_velocity,
            thing_velocity,
            forward_m_s: driven.linear_x_m_s,
            ahead_m: actor.ahead_m(on_body),
        };
        let (now, persons) = (self.now, self.discs.len());
        self.actors[body].met(now, thing, persons, on_body, &meeting);
        if let Thing::Body(other) = thing {
            let forward_m_s = self.actors[other].body.velocity.linear_x_m_s;
            let seen = meeting.seen_by_other(forward_m_s, self.actors[other].ahead_m(on_thing));
            self.actors[other].met(now, Thing::Body(body), persons, on_thing, &seen);
        }
    }
}
