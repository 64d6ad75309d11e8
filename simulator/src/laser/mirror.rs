//! A turning mirror: each beam is cast at its own time, from where the body is then, at what stands there then.
//!
//! Within a step of the simulation the body and all that moves go straight from where they were to where they are. A
//! beam at the share s of the step starts at the body's place at s, and meets people and other bodies where they are at s.

use crate::geometry::{Circle, Placed, Point, Pose};
use crate::noise::Chance;
use crate::realism::LaserRealism;
use crate::world::Map;
use drivers::laser::Sweep;
use runtime::Time;
use runtime::math;

/// Neighbours whose distances differ by less than this are one surface [m].
const EDGE_M: f64 = 0.1;

/// How one body, seen by another, moves within a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mover {
    /// Its outline at the end of the step.
    pub placed: Placed,
    /// Its way within the step.
    pub way: Point,
    /// Its turn within the step [rad].
    pub turn_rad: f64,
}

/// All that moves within a step.
pub(crate) struct Motion<'a> {
    pub map: &'a Map,
    /// Each person at the end of the step, and the way there.
    pub persons: &'a [(Circle, Point)],
    pub bodies: &'a [Mover],
    /// The body that carries the scanner, before and after.
    pub own: usize,
    pub from: Pose,
    pub to: Pose,
    /// The step.
    pub begin: Time,
    pub end: Time,
}

/// Where the scanner sits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seat {
    pub place: Point,
    pub heading_rad: f64,
    pub upside_down: bool,
}

/// See the module's text.
#[derive(Debug, Clone)]
pub(crate) struct Mirror {
    seat: Seat,
    sweep: Sweep,
    turn_ns: u64,
    steps_per_turn: u64,
    /// Steps from the mirror's index to the first beam.
    first_step: u64,
    /// Directions of the beams in the body frame.
    directions: Vec<Point>,
    ranges_m: Vec<f64>,
    noisy_m: Vec<f64>,
    /// When the present scan's first turn began; its turn, and the next beam of it.
    begun: Time,
    turn: usize,
    next: usize,
    /// Every beam of the present scan so far was cast.
    whole: bool,
}

impl Mirror {
    /// A mirror whose beams lie as in `sweep`; `first_step` of its steps pass between its index and the first beam.
    pub fn new(seat: Seat, sweep: Sweep, first_step: u64, begun: Time) -> Mirror {
        let mut mirror = Mirror {
            seat,
            sweep,
            turn_ns: 1,
            steps_per_turn: 1,
            first_step,
            directions: Vec::with_capacity(drivers::laser::MAX_BEAMS),
            ranges_m: Vec::with_capacity(drivers::laser::MAX_BEAMS),
            noisy_m: Vec::with_capacity(drivers::laser::MAX_BEAMS),
            begun,
            turn: 0,
            next: 0,
            whole: false,
        };
        mirror.set(sweep);
        mirror
    }

    /// The next scan begins at `begun`.
    pub fn begin(&mut self, begun: Time) {
        (self.begun, self.turn, self.next, self.whole) = (begun, 0, 0, false);
    }

    /// Other beams from the next scan on.
    pub fn set(&mut self, sweep: Sweep) {
        self.sweep = sweep;
        self.turn_ns = ((sweep.turn_s * 1e9).round() as u64).max(1);
        self.steps_per_turn = ((sweep.turn_s / sweep.step_s).round() as u64).max(1);
        let Seat { heading_rad, upside_down, .. } = self.seat;
        self.directions.clear();
        self.directions.extend((0..sweep.beams).map(|beam| {
            let angle_rad = sweep.angle_min_rad + beam as f64 * sweep.angle_increment_rad;
            Point::unit(heading_rad + if upside_down { -angle_rad } else { angle_rad })
        }));
        self.ranges_m.clear();
        self.ranges_m.resize(sweep.beams, f64::INFINITY);
        (self.turn, self.next, self.whole) = (0, 0, false);
    }

    /// Turns on through a step. Where `active`, beams are cast, and each whole scan is handed to `done`: when its first
    /// turn began, when its last beam was taken, and the distances, infinite where nothing was met.
    pub fn advance(
        &mut self,
        motion: &Motion,
        active: bool,
        realism: &LaserRealism,
        sigma_m: f64,
        chance: &mut Chance,
        mut done: impl FnMut(Time, Time, &[f64]),
    ) {
        let turns = self.sweep.turns.max(1);
        let caster = Caster::new(motion, &self.seat);
        let span_ns = (motion.end.nanos_since(motion.begin)).max(1) as f64;
        self.whole &= active;
        loop {
            let beam = self.turn + turns * self.next;
            if beam < self.sweep.beams {
                let at = self.begun.after_ns(
                    self.turn as u64 * self.turn_ns
                        + (self.first_step + beam as u64) * self.turn_ns / self.steps_per_turn,
                );
                if at > motion.end {
                    return;
                }
                if self.whole && realism.mirror {
                    let share = (at.nanos_since(motion.begin) as f64 / span_ns).min(1.0);
                    self.ranges_m[beam] = caster.cast(self.directions[beam], share, self.sweep.range_max_m);
                }
                self.next += 1;
                let is_last = self.turn + 1 == turns && self.turn + turns * self.next >= self.sweep.beams;
                if is_last && self.whole {
                    if !realism.mirror {
                        for (range_m, direction) in self.ranges_m.iter_mut().zip(&self.directions) {
                            *range_m = caster.cast(*direction, 1.0, self.sweep.range_max_m);
                        }
                    }
                    self.spoil(realism, sigma_m, chance);
                    done(self.begun, at, &self.noisy_m);
                }
                continue;
            }
            (self.turn, self.next) = (self.turn + 1, 0);
            if self.turn >= turns {
                let next = self.begun.after_ns(turns as u64 * self.turn_ns);
                if next > motion.end {
                    // Past its last beam: the blind part of the turn.
                    (self.turn, self.next) = (turns - 1, self.sweep.beams);
                    return;
                }
                (self.begun, self.turn, self.whole) = (next, 0, active);
            }
        }
    }

    /// Mixed pixels, noise and lost beams.
    fn spoil(&mut self, realism: &LaserRealism, sigma_m: f64, chance: &mut Chance) {
        let sigma_m = sigma_m * realism.noise;
        self.noisy_m.clear();
        for (beam, range_m) in self.ranges_m.iter().enumerate() {
            let mut range_m = *range_m;
            if let Some(other_m) = self.ranges_m.get(beam + 1)
                && (other_m - range_m).abs() > EDGE_M
                && (other_m - range_m).abs() <= realism.mixed_within_m
                && chance.happens(realism.mixed)
            {
                range_m += (other_m - range_m) * chance.share();
            }
            if realism.dropped > 0.0 && chance.happens(realism.dropped) {
                range_m = f64::INFINITY;
            }
            if sigma_m > 0.0 && range_m < f64::INFINITY {
                range_m = (range_m + sigma_m * chance.normal()).max(0.0);
            }
            self.noisy_m.push(range_m);
        }
    }
}

/// Casts beams at any share of a step.
struct Caster<'a> {
    motion: &'a Motion<'a>,
    seat: Point,
    cos: f64,
    sin: f64,
    way: Point,
    turn_rad: f64,
}

impl Caster<'_> {
    fn new<'a>(motion: &'a Motion<'a>, seat: &Seat) -> Caster<'a> {
        let (sin, cos) = math::sin_cos(motion.from.heading_rad);
        let turn_rad = math::wrap_angle(motion.to.heading_rad - motion.from.heading_rad);
        Caster { motion, seat: seat.place, cos, sin, way: motion.to.place() - motion.from.place(), turn_rad }
    }

    fn cast(&self, direction: Point, share: f64, reach_m: f64) -> f64 {
        let (turn_sin, turn_cos) = small_sin_cos(self.turn_rad * share);
        let (sin, cos) = (self.sin * turn_cos + self.cos * turn_sin, self.cos * turn_cos - self.sin * turn_sin);
        let origin = self.motion.from.place() + self.way * share + self.seat.turned(cos, sin);
        let direction = direction.turned(cos, sin);
        let mut best = self.motion.map.cast(origin, direction, reach_m).unwrap_or(f64::INFINITY);
        let back = share - 1.0;
        for (disc, way) in self.motion.persons {
            if let Some(distance) = Circle::new(disc.centre + *way * back, disc.radius_m).cast(origin, direction) {
                best = best.min(distance);
            }
        }
        for (index, mover) in self.motion.bodies.iter().enumerate() {
            if index == self.motion.own {
                continue;
            }
            let centre = mover.placed.centre + mover.way * back;
            if Circle::new(centre, mover.placed.radius_m).cast(origin, direction).is_none() {
                continue;
            }
            // The ray as the outline at the end of the step would see it.
            let (sin, cos) = small_sin_cos(-mover.turn_rad * back);
            let origin = mover.placed.centre + (origin - centre).turned(cos, sin);
            let direction = direction.turned(cos, sin);
            for side in mover.placed.sides() {
                if let Some(distance) = side.cast(origin, direction) {
                    best = best.min(distance);
                }
            }
        }
        if best <= reach_m { best } else { f64::INFINITY }
    }
}

/// Sine and cosine of the small turn of one step, exact to 1e-11 up to 0.1 rad.
fn small_sin_cos(angle_rad: f64) -> (f64, f64) {
    if angle_rad.abs() > 0.1 {
        return math::sin_cos(angle_rad);
    }
    let squared = angle_rad * angle_rad;
    let sin = angle_rad * (1.0 - squared / 6.0 * (1.0 - squared / 20.0 * (1.0 - squared / 42.0)));
    let cos = 1.0 - squared / 2.0 * (1.0 - squared / 12.0 * (1.0 - squared / 30.0));
    (sin, cos)
}
