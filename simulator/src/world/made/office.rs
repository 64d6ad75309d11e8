//! Offices (and, large enough, hospitals): bands of rooms on both sides of corridors, cross corridors between them.
//!
//! A band is a corridor of 2.2 m with rooms above and below it. Where there are several bands, cross corridors at the
//! ends and about every 35 m join them. Every room has a door to its corridor; every third one is furnished.

use super::{STARTS, Size, add_bounds, between, start};
use crate::geometry::{Point, Segment};
use crate::noise::Chance;
use crate::world::{Sketch, Solid};

const CORRIDOR_M: f64 = 2.2;
/// Depth of a band that is aimed at: two rooms and a corridor [m].
const BAND_M: f64 = 13.0;
/// Distance between cross corridors that is aimed at [m].
const BLOCK_M: f64 = 35.0;
const ROOM_M: (f64, f64) = (3.0, 6.0);
const DOOR_M: (f64, f64) = (0.9, 1.1);
/// A door keeps so far from the room's corners [m].
const CORNER_M: f64 = 0.3;
const WALL_M: f64 = 0.12;
const FURNISHED: f64 = 0.35;

/// Adds the whole world.
pub(super) fn add(sketch: &mut Sketch, size: Size, chance: &mut Chance) {
    add_bounds(sketch, size);
    let bands = ((size.height_m / BAND_M).round() as usize).max(1);
    let band_m = size.height_m / bands as f64;
    let blocks = blocks(size, bands);
    for band in 0..bands {
        let middle_m = (band as f64 + 0.5) * band_m;
        for (from_m, to_m) in &blocks {
            let lower = middle_m - 0.5 * CORRIDOR_M;
            let upper = middle_m + 0.5 * CORRIDOR_M;
            add_rooms(sketch, (*from_m, *to_m), lower, band as f64 * band_m, chance);
            add_rooms(sketch, (*from_m, *to_m), upper, (band + 1) as f64 * band_m, chance);
            if bands > 1 {
                for x_m in [*from_m, *to_m] {
                    let ends = [(band as f64 * band_m, lower), (upper, (band + 1) as f64 * band_m)];
                    for (low, high) in ends {
                        add_wall(sketch, Point::new(x_m, low), Point::new(x_m, high));
                    }
                }
            }
            if band + 1 < bands {
                let back_m = (band + 1) as f64 * band_m;
                add_wall(sketch, Point::new(*from_m, back_m), Point::new(*to_m, back_m));
            }
        }
    }
    for k in 0..STARTS {
        let band = k % bands;
        let share = (k / bands) as f64 + 0.5;
        let x_m = 1.5 + (size.width_m - 3.0) * share / STARTS.div_ceil(bands) as f64;
        sketch.starts.push(start(Point::new(x_m, (band as f64 + 0.5) * band_m), 0.4));
    }
}

/// From where to where along x rooms are built; the rest is cross corridors.
fn blocks(size: Size, bands: usize) -> Vec<(f64, f64)> {
    if bands == 1 {
        return vec![(0.0, size.width_m)];
    }
    let count = ((size.width_m / BLOCK_M).round() as usize).max(1);
    let block_m = (size.width_m - CORRIDOR_M * (count + 1) as f64) / count as f64;
    (0..count)
        .map(|k| {
            let from_m = CORRIDOR_M + k as f64 * (block_m + CORRIDOR_M);
            (from_m, from_m + block_m)
        })
        .collect()
}

/// A row of rooms between the corridor's wall at `door_y_m` and the back wall at `back_y_m`.
fn add_rooms(sketch: &mut Sketch, (from_m, to_m): (f64, f64), door_y_m: f64, back_y_m: f64, chance: &mut Chance) {
    let mut left_m = from_m;
    while left_m < to_m {
        let wanted_m = left_m + between(chance, ROOM_M.0, ROOM_M.1);
        let right_m = if to_m - wanted_m < ROOM_M.0 { to_m } else { wanted_m };
        let door_m = between(chance, DOOR_M.0, DOOR_M.1);
        let door_from_m = between(chance, left_m + CORNER_M, (right_m - CORNER_M - door_m).max(left_m + CORNER_M));
        add_wall(sketch, Point::new(left_m, door_y_m), Point::new(door_from_m, door_y_m));
        add_wall(sketch, Point::new((door_from_m + door_m).min(right_m), door_y_m), Point::new(right_m, door_y_m));
        if right_m < to_m {
            add_wall(sketch, Point::new(right_m, door_y_m), Point::new(right_m, back_y_m));
        }
        if chance.happens(FURNISHED) {
            add_desk(sketch, (left_m, right_m), door_y_m, back_y_m, chance);
        }
        left_m = right_m;
    }
}

/// A desk in the back half of a room, away from its walls.
fn add_desk(sketch: &mut Sketch, (left_m, right_m): (f64, f64), door_y_m: f64, back_y_m: f64, chance: &mut Chance) {
    let middle = Point::new(between(chance, left_m + 1.2, right_m - 1.2), door_y_m + (back_y_m - door_y_m) * 0.65);
    let (half_m, depth_m) = (between(chance, 0.5, 0.8), 0.35);
    let corner = |x: f64, y: f64| middle + Point::new(x * half_m, y * depth_m);
    sketch.add_solid(
        Solid { outline: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)] },
        false,
    );
}

fn add_wall(sketch: &mut Sketch, from: Point, to: Point) {
    if (to - from).norm() > 0.01 {
        sketch.add_slab(Segment::new(from, to), WALL_M, false);
    }
}
