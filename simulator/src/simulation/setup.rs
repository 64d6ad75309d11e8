//! How a simulation begins: which bodies, where, under which seed.

use super::Simulation;
use super::actor::{Actor, Parts};
use super::chassis::{Built, Chassis};
use super::line::Line;
use crate::body::{Body, Frame};
use crate::geometry::{Circle, Footprint, Placed, Point, Pose};
use crate::laser::{Laser, LaserSetup, Movers};
use crate::mcu::{Firmware, Flash, Mcu};
use crate::noise::{Chance, Purpose};
use crate::realism::Realism;
use crate::sonar::Ears;
use crate::world::{Start, Walk, World};
use drivers::p2os::Text;
use drivers::p2os::model::{self, Model};
use drivers::p2os::sip::Identity;
use runtime::Time;

/// A body to be.
#[derive(Debug, Clone, PartialEq)]
pub struct BodySetup {
    /// Subclass of a known model, such as `p3dx-sh`.
    pub model: String,
    /// Name that the controller tells.
    pub name: String,
    /// Where it starts; the world's own start of its index when `None`.
    pub start: Option<Pose>,
    /// Silence after which the controller stops the robot [ms].
    pub watchdog_ms: u16,
    /// Whether bumpers are fitted.
    pub bumpers: bool,
    /// Outline, wheels and controller where they are not the model's.
    pub chassis: Chassis,
    /// Its laser scanners.
    pub lasers: Vec<LaserSetup>,
}

impl Default for BodySetup {
    fn default() -> BodySetup {
        BodySetup {
            model: "p3dx-sh".into(),
            name: "simbot".into(),
            start: None,
            watchdog_ms: 2000,
            bumpers: true,
            chassis: Chassis::default(),
            lasers: Vec::new(),
        }
    }
}

/// All that a simulation depends on beside its world.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The bodies, in order.
    pub bodies: Vec<BodySetup>,
    /// All chance comes from it.
    pub seed: u64,
    /// Imperfections.
    pub realism: Realism,
}

impl Default for Setup {
    fn default() -> Setup {
        Setup { bodies: vec![BodySetup::default()], seed: 0, realism: Realism::default() }
    }
}

/// Why a simulation cannot begin.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SetupError {
    /// No table holds this model.
    #[error("body {body}: unknown model \"{model}\"; known are {known}")]
    UnknownModel {
        /// Index of the body.
        body: usize,
        /// As it was named.
        model: String,
        /// Names of all models.
        known: String,
    },
    /// No table holds this scanner.
    #[error("body {body}: unknown laser \"{model}\"; known are {known}")]
    UnknownLaser {
        /// Index of the body.
        body: usize,
        /// As it was named.
        model: String,
        /// Names of all models.
        known: String,
    },
    /// The world has fewer starts than there are bodies without one.
    #[error(
        "body {body} has no start and the world \"{world}\" has {starts}; add a [[start]] to it or give the body one"
    )]
    NoStart {
        /// Index of the body.
        body: usize,
        /// Name of the world.
        world: String,
        /// Starts that the world has.
        starts: usize,
    },
    /// The body would stand in something.
    #[error("body {body} cannot start at ({x_m:.3}, {y_m:.3}): something stands there; move the start or the obstacle")]
    Occupied {
        /// Index of the body.
        body: usize,
        /// Where [m].
        x_m: f64,
        /// Where [m].
        y_m: f64,
    },
    /// A chassis is out of bounds.
    #[error("body {body}: {reason}")]
    Chassis {
        /// Index of the body.
        body: usize,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// An imperfection is out of bounds.
    #[error("{0}")]
    Realism(String),
}

/// Encoder ticks per millimetre of wheel travel.
const TICKS_PER_MM: u16 = 128;
/// Bumper segments at either end.
const BUMPERS: u8 = 5;
/// A drawn start keeps so much room around the body [m].
const START_ROOM_M: f64 = 0.05;
/// Nobody's walk begins nearer to a robot, where its phase is drawn [m].
const PERSON_ROOM_M: f64 = 1.0;
/// Lines of scanners are numbered from here on, so that they have their own faults.
const LASER_LINES: usize = 1 << 16;
/// Draws of a start before the middle of its spread is taken.
const START_DRAWS: usize = 100;

impl Simulation {
    /// A simulation at its beginning.
    pub fn new(world: World, setup: &Setup) -> Result<Simulation, SetupError> {
        if let Some(reason) = setup.realism.fault() {
            return Err(SetupError::Realism(reason));
        }
        let seed = setup.seed;
        let mut simulation = Simulation {
            walks: Vec::new(),
            discs: Vec::new(),
            disc_velocities: Vec::new(),
            pushes: Vec::new(),
            actors: Vec::new(),
            placed: Vec::new(),
            lasers: Vec::new(),
            movers: Movers::default(),
            now: Time::ZERO,
            hash: 0xCBF2_9CE4_8422_2325,
            world,
        };
        for (index, body) in setup.bodies.iter().enumerate() {
            let mut actor = simulation.make(setup, index, body)?;
            let start = match (body.start, simulation.world.starts.get(index)) {
                (Some(pose), _) => Start { pose, spread_m: 0.0, spread_rad: 0.0 },
                (None, Some(start)) => *start,
                (None, None) => {
                    let (world, starts) = (simulation.world.name.clone(), simulation.world.starts.len());
                    return Err(SetupError::NoStart { body: index, world, starts });
                }
            };
            let pose = simulation.draw_start(&start, &actor.body.footprint, seed, index)?;
            actor.place(pose);
            simulation.placed.push(actor.placed);
            simulation.actors.push(actor);
            simulation.add_lasers(setup, index, body)?;
        }
        for index in 0..simulation.world.persons.len() {
            simulation.add_person(index, seed)?;
        }
        Ok(simulation)
    }

    fn add_lasers(&mut self, setup: &Setup, body: usize, of: &BodySetup) -> Result<(), SetupError> {
        for scanner in &of.lasers {
            let index = self.lasers.len();
            let Some(laser) = Laser::new(scanner, body, setup.realism.laser, setup.seed, index) else {
                let model = scanner.model.clone();
                return Err(SetupError::UnknownLaser { body, model, known: Laser::models() });
            };
            self.lasers.push((laser, Line::new(setup.realism.line, setup.seed, LASER_LINES + index)));
        }
        Ok(())
    }

    /// Puts a person on the path; where the phase is drawn, not where a robot starts.
    fn add_person(&mut self, index: usize, seed: u64) -> Result<(), SetupError> {
        let person = &self.world.persons[index];
        let mut chance = Chance::new(seed, Purpose::Person, index);
        let in_the_way =
            |disc: &Circle, room_m: f64| self.placed.iter().position(|body| body.gap_to_circle(disc).0 <= room_m);
        // Who gives way does not begin in somebody either.
        let is_apart = |walk: &Walk| {
            let apart_m = |disc: &Circle| (disc.centre - walk.disc.centre).norm() - disc.radius_m - walk.disc.radius_m;
            person.social.is_none() || self.discs.iter().all(|disc| apart_m(disc) > START_ROOM_M)
        };
        let drawn = (0..START_DRAWS).map(|_| person.start(chance.share()));
        let walk = match person.phase {
            Some(phase) => person.start(phase),
            None => drawn
                .into_iter()
                .find(|walk| in_the_way(&walk.disc, PERSON_ROOM_M).is_none() && is_apart(walk))
                .unwrap_or_else(|| person.start(0.0)),
        };
        if let Some(body) = in_the_way(&walk.disc, 0.0) {
            let Pose { x_m, y_m, .. } = self.pose(body);
            return Err(SetupError::Occupied { body, x_m, y_m });
        }
        self.walks.push(walk);
        self.discs.push(walk.disc);
        self.disc_velocities.push(Point::ZERO);
        self.pushes.push(Point::ZERO);
        Ok(())
    }

    fn make(&self, setup: &Setup, index: usize, body: &BodySetup) -> Result<Actor, SetupError> {
        let Some(model) = model::named(&body.model) else {
            let known: Vec<&str> = model::MODELS.iter().map(|model| model.subclass).collect();
            return Err(SetupError::UnknownModel { body: index, model: body.model.clone(), known: known.join(", ") });
        };
        let built = body.chassis.built(model).map_err(|reason| SetupError::Chassis { body: index, reason })?;
        let flash = flash(model, body, &built);
        let ticks_per_m = f64::from(flash.ticks_per_mm) * 1000.0;
        let frame = Frame {
            footprint: built.outline,
            turn_rad_per_m: model.turn_rad_per_m,
            ticks_per_m,
            max_wheel_m_s: built.max_wheel_m_s,
        };
        let range_m = (model.min_range_m, model.max_range_m);
        Ok(Actor::new(Parts {
            mcu: Mcu::new(flash),
            body: Body::new(frame, setup.realism.wheels, setup.seed, index),
            ears: Ears::new(&model.sonar, range_m, model.range_m_per_unit, setup.realism.sonar),
            sonar_chance: Chance::new(setup.seed, Purpose::Sonar, index),
            line: Line::new(setup.realism.line, setup.seed, index),
            things: 1 + self.world.persons.len() + setup.bodies.len(),
        }))
    }

    /// A free pose within the start's spread; the first draw with room around it.
    fn draw_start(&self, start: &Start, outline: &Footprint, seed: u64, body: usize) -> Result<Pose, SetupError> {
        let mut chance = Chance::new(seed, Purpose::Start, body);
        let middle = start.pose;
        if start.spread_m > 0.0 || start.spread_rad > 0.0 {
            for _ in 0..START_DRAWS {
                let pose = Pose::new(
                    middle.x_m + start.spread_m * chance.either_way(),
                    middle.y_m + start.spread_m * chance.either_way(),
                    runtime::math::wrap_angle(middle.heading_rad + start.spread_rad * chance.either_way()),
                );
                if self.is_free(&outline.placed(pose), START_ROOM_M) {
                    return Ok(pose);
                }
            }
        }
        if self.is_free(&outline.placed(middle), 0.0) {
            return Ok(middle);
        }
        Err(SetupError::Occupied { body, x_m: middle.x_m, y_m: middle.y_m })
    }

    fn is_free(&self, placed: &Placed, room_m: f64) -> bool {
        !self.world.is_solid(placed.centre)
            && self.world.map.nearest(placed, room_m).is_none()
            && self.placed.iter().all(|other| placed.gap_to_placed(other).0 > room_m)
    }
}

fn flash(model: &Model, body: &BodySetup, built: &Built) -> Flash {
    let bumpers = if body.bumpers { BUMPERS } else { 0 };
    Flash {
        identity: Identity {
            name: Text::from(body.name.as_str()),
            class: Text::from(model.class),
            subclass: Text::from(model.subclass),
        },
        serial_number: Text::from("SINEW0001"),
        firmware: if model.subclass == "p3dx" { Firmware::P2os } else { Firmware::Arcos },
        distance_m_per_unit: model.distance_m_per_unit,
        watchdog_ms: body.watchdog_ms,
        sip_cycle_ms: built.sip_cycle_ms,
        front_bumpers: bumpers,
        rear_bumpers: bumpers,
        ticks_per_mm: TICKS_PER_MM,
        turn_rad_per_m: model.turn_rad_per_m,
        tops: built.tops,
    }
}
