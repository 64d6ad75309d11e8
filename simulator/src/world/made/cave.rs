//! A cave: one ragged chamber with ragged pillars.
//!
//! Every outline is a circle (or, for the chamber, the ellipse that fits the size) whose radius is multiplied by
//! 1 + Σ aₖ sin(kφ + pₖ) with seeded aₖ and pₖ, drawn with sides of about 0.1 m.

use super::{STARTS, Size, between, start};
use crate::geometry::Point;
use crate::noise::Chance;
use crate::world::{Sketch, Solid};
use runtime::math;
use std::f64::consts::TAU;

/// Length of an outline's sides that is aimed at [m].
const SIDE_M: f64 = 0.1;
/// The chamber's radius varies by so much of itself.
const RAGGED: f64 = 0.16;
/// Between any two pillars, and between a pillar and the chamber's wall, is at least so much [m].
const PASSAGE_M: f64 = 1.2;
/// A pillar for so much floor [m²].
const FLOOR_PER_PILLAR_M2: f64 = 16.0;
const PILLAR_M: (f64, f64) = (0.3, 0.9);
/// Room around a start [m].
const START_ROOM_M: f64 = 0.6;

/// An outline about a middle.
struct Ragged {
    middle: Point,
    half: Point,
    waves: [(f64, f64); 7],
}

impl Ragged {
    fn new(middle: Point, half: Point, ragged: f64, chance: &mut Chance) -> Ragged {
        let mut waves = [(0.0, 0.0); 7];
        for (k, wave) in waves.iter_mut().enumerate() {
            *wave = (ragged * chance.share() / (1.0 + 0.5 * k as f64), TAU * chance.share());
        }
        // No wave reaches beyond the size.
        let sum: f64 = waves.iter().map(|wave| wave.0).sum();
        Ragged { middle, half: half * (1.0 / (1.0 + sum)), waves }
    }

    /// The outline's point at `angle_rad`.
    fn at(&self, angle_rad: f64) -> Point {
        let waves = self.waves.iter().enumerate();
        let factor = 1.0 + waves.map(|(k, (a, p))| a * math::sin((k + 2) as f64 * angle_rad + p)).sum::<f64>();
        let unit = Point::unit(angle_rad);
        self.middle + Point::new(unit.x_m * self.half.x_m, unit.y_m * self.half.y_m) * factor
    }

    fn outline(&self) -> Vec<Point> {
        let sides = (TAU * self.half.x_m.max(self.half.y_m) / SIDE_M).ceil().max(8.0) as usize;
        (0..sides).map(|k| self.at(TAU * k as f64 / sides as f64)).collect()
    }
}

/// Adds the whole world.
pub(super) fn add(sketch: &mut Sketch, size: Size, chance: &mut Chance) {
    let half = Point::new(0.5 * size.width_m, 0.5 * size.height_m);
    let chamber = Ragged::new(half, half, RAGGED, chance).outline();
    for (k, corner) in chamber.iter().enumerate() {
        sketch.add_line(crate::geometry::Segment::new(*corner, chamber[(k + 1) % chamber.len()]), true);
    }
    let inside = Solid { outline: chamber.clone() };
    let wall_m = |point: Point| chamber.iter().map(|corner| (*corner - point).norm()).fold(f64::INFINITY, f64::min);
    let mut pillars: Vec<(Point, f64)> = Vec::new();
    let wanted = (size.width_m * size.height_m / FLOOR_PER_PILLAR_M2) as usize;
    for _ in 0..wanted * 4 {
        if pillars.len() == wanted {
            break;
        }
        let place = Point::new(size.width_m * chance.share(), size.height_m * chance.share());
        let radius_m = between(chance, PILLAR_M.0, PILLAR_M.1);
        let free = inside.contains(place)
            && wall_m(place) > radius_m + PASSAGE_M
            && pillars.iter().all(|(other, other_m)| (*other - place).norm() > radius_m + other_m + PASSAGE_M);
        if free {
            let pillar = Ragged::new(place, Point::new(radius_m, radius_m), 0.3, chance);
            sketch.add_solid(Solid { outline: pillar.outline() }, true);
            pillars.push((place, radius_m));
        }
    }
    for _ in 0..STARTS * 200 {
        if sketch.starts.len() == STARTS {
            break;
        }
        let place = Point::new(size.width_m * chance.share(), size.height_m * chance.share());
        let free = inside.contains(place)
            && wall_m(place) > START_ROOM_M
            && pillars.iter().all(|(other, other_m)| (*other - place).norm() > other_m + START_ROOM_M)
            && sketch.starts.iter().all(|other| (other.pose.place() - place).norm() > 2.0 * START_ROOM_M);
        if free {
            sketch.starts.push(start(place, 0.0));
        }
    }
}
