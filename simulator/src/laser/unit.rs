//! One scanner on one body.

use super::lms::Lms;
use super::mirror::{Mirror, Mover, Seat};
use super::scip::Scip;
use super::server::{OUTBOX, Server};
use crate::geometry::{Circle, Placed, Point, Pose};
use crate::noise::{Chance, Purpose};
use crate::realism::LaserRealism;
use crate::world::Map;
use drivers::urg::model;
use runtime::Time;

pub(crate) use super::mirror::Motion;

/// The one model that speaks SICK's telegrams, and the standard deviation of its readings [m]: 5 mm up to 8 m by its data
/// sheet.
const LMS200: &str = "lms200";
const LMS200_SIGMA_M: f64 = 0.005;

/// A scanner to be.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LaserSetup {
    /// Model: lms200, urg-04lx, utm-30lx, ust-10lx, sinew-720.
    pub model: String,
    /// Place on the body [m].
    pub x_m: f64,
    /// Place on the body [m].
    pub y_m: f64,
    /// Where it looks [rad].
    pub heading_rad: f64,
    /// Mounted with its top down.
    pub upside_down: bool,
}

/// See the module's text.
#[derive(Debug, Clone)]
pub(crate) struct Laser {
    /// The body that carries it.
    pub body: usize,
    mirror: Mirror,
    server: Server,
    phase_ns: u64,
    sigma_m: f64,
    realism: LaserRealism,
    chance: Chance,
}

impl Laser {
    /// A scanner on `body`; `None` when no such model is known. `index` counts all scanners of the world.
    pub fn new(setup: &LaserSetup, body: usize, realism: LaserRealism, seed: u64, index: usize) -> Option<Laser> {
        let seat = Seat {
            place: Point::new(setup.x_m, setup.y_m),
            heading_rad: setup.heading_rad,
            upside_down: setup.upside_down,
        };
        let mut chance = Chance::new(seed, Purpose::Laser, index);
        // The mirror turns and the clock runs since some time before the world began.
        let boot_ms = (chance.share() * 1e6) as u32;
        let (sweep, first_step, sigma_m, server) = if setup.model.eq_ignore_ascii_case(LMS200) {
            let lms = Lms::new();
            (lms.sweep(), 0, LMS200_SIGMA_M, Server::Lms(Box::new(lms)))
        } else {
            let (sigma_m, sensor) = model::named(&setup.model)?;
            let server = Server::Scip(Box::new(Scip::new(*sensor, boot_ms)));
            (sensor.sweep(&sensor.whole(1)), u64::from(sensor.first_step), sigma_m, server)
        };
        let phase_ns = (sweep.turn_s * 1e9 * chance.share()) as u64;
        let mirror = Mirror::new(seat, sweep, first_step, Time::from_nanos(phase_ns));
        Some(Laser { body, mirror, server, phase_ns, sigma_m, realism, chance })
    }

    /// Names of all models.
    pub fn models() -> String {
        let names: Vec<&str> = [LMS200].into_iter().chain(model::MODELS.iter().map(|(name, ..)| *name)).collect();
        names.join(", ")
    }

    /// The clock at which the world begins.
    pub fn begin(&mut self, now: Time) {
        self.mirror.begin(now.after_ns(self.phase_ns));
    }

    /// Turns on through a step.
    pub fn advance(&mut self, motion: &Motion) {
        let Laser { mirror, server, realism, sigma_m, chance, .. } = self;
        if let Some(sweep) = server.take_sweep() {
            mirror.set(sweep);
        }
        let active = server.measures();
        mirror.advance(motion, active, realism, *sigma_m, chance, |begun, taken, ranges_m| {
            server.scan(begun, taken, ranges_m);
        });
    }

    /// Takes bytes from the client at `now`.
    pub fn receive(&mut self, now: Time, bytes: &[u8]) {
        self.server.hear(now, bytes);
    }

    /// Bytes for the client; clear what was taken.
    pub fn outbox(&mut self) -> &mut Vec<u8> {
        self.server.outbox()
    }

    /// The rate that the line is to have, where a command has set one [baud].
    pub fn requested_baud(&self) -> Option<u32> {
        self.server.baud()
    }

    /// Another client.
    pub fn restart(&mut self) {
        self.server.restart();
    }
}

/// How everybody moves within a step; kept, so that a step does not allocate.
#[derive(Debug, Clone, Default)]
pub(crate) struct Movers {
    poses: Vec<Pose>,
    persons: Vec<(Circle, Point)>,
    bodies: Vec<Mover>,
}

/// People who go farther than this in a step have been put elsewhere [m].
const LEAP_M: f64 = 0.5;

impl Movers {
    /// Remembers where everybody is at the beginning of a step.
    pub fn begin(&mut self, poses: impl Iterator<Item = Pose>, discs: &[Circle]) {
        self.poses.clear();
        self.poses.extend(poses);
        self.persons.clear();
        self.persons.extend(discs.iter().map(|disc| (*disc, Point::ZERO)));
    }

    /// Takes where everybody is at its end.
    pub fn end(&mut self, poses: impl Iterator<Item = Pose>, placed: &[Placed], discs: &[Circle]) {
        for ((kept, way), disc) in self.persons.iter_mut().zip(discs) {
            let gone = disc.centre - kept.centre;
            *way = if gone.norm() < LEAP_M { gone } else { Point::ZERO };
            *kept = *disc;
        }
        self.bodies.clear();
        self.bodies.extend(poses.zip(placed).zip(&self.poses).map(|((pose, placed), before)| Mover {
            placed: *placed,
            way: pose.place() - before.place(),
            turn_rad: runtime::math::wrap_angle(pose.heading_rad - before.heading_rad),
        }));
    }

    /// What a scanner on body `own`, which is now at `to`, sees of it.
    pub fn seen_by<'a>(&'a self, map: &'a Map, own: usize, to: Pose, begin: Time, end: Time) -> Motion<'a> {
        Motion { map, persons: &self.persons, bodies: &self.bodies, own, from: self.poses[own], to, begin, end }
    }
}

/// Room for what waits for a client.
pub(super) fn outbox() -> Vec<u8> {
    Vec::with_capacity(OUTBOX)
}
