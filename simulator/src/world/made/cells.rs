//! Corridors and rooms: a grid of cells joined by a random spanning tree and a few more openings.
//!
//! The tree is grown depth first from the seed (recursive backtracking with a stack), so every cell can be reached;
//! some of the walls that it leaves are opened too, so that there are loops. In corridors the whole wall between two
//! joined cells is gone, in rooms a door's width of it.

use super::{STARTS, Size, add_bounds, between, start};
use crate::geometry::{Point, Segment};
use crate::noise::Chance;
use crate::world::Sketch;

/// What the cells are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kind {
    cell_m: f64,
    /// Width of the opening between joined cells; `None`: the whole wall [m].
    door_m: Option<f64>,
    /// How many of the walls that the tree leaves are opened too.
    loops: f64,
}

/// Corridors that wind and fork.
pub(super) const CORRIDORS: Kind = Kind { cell_m: 2.0, door_m: None, loops: 0.08 };
/// Rooms with doors.
pub(super) const ROOMS: Kind = Kind { cell_m: 4.0, door_m: Some(0.9), loops: 0.2 };

/// A door keeps so far from the ends of its wall [m].
const CORNER_M: f64 = 0.3;

/// Adds the whole world.
pub(super) fn add(sketch: &mut Sketch, size: Size, kind: Kind, chance: &mut Chance) {
    add_bounds(sketch, size);
    let columns = ((size.width_m / kind.cell_m).round() as usize).max(1);
    let rows = ((size.height_m / kind.cell_m).round() as usize).max(1);
    let cell = Point::new(size.width_m / columns as f64, size.height_m / rows as f64);
    let opened = grow(columns, rows, kind.loops, chance);
    for row in 0..rows {
        for column in 0..columns {
            let corner =
                |right: usize, up: usize| Point::new((column + right) as f64 * cell.x_m, (row + up) as f64 * cell.y_m);
            let [right, up] = opened[row * columns + column];
            if column + 1 < columns {
                add_wall(sketch, Segment::new(corner(1, 0), corner(1, 1)), right, kind.door_m, chance);
            }
            if row + 1 < rows {
                add_wall(sketch, Segment::new(corner(0, 1), corner(1, 1)), up, kind.door_m, chance);
            }
        }
    }
    let cells = columns * rows;
    for k in 0..cells.min(STARTS) {
        let at = k * cells / cells.min(STARTS);
        let middle = Point::new(((at % columns) as f64 + 0.5) * cell.x_m, ((at / columns) as f64 + 0.5) * cell.y_m);
        sketch.starts.push(start(middle, (0.5 * cell.x_m.min(cell.y_m) - 0.6).max(0.0)));
    }
}

/// For each cell whether it is joined to its right and to its upper neighbour.
fn grow(columns: usize, rows: usize, loops: f64, chance: &mut Chance) -> Vec<[bool; 2]> {
    let mut opened = vec![[false; 2]; columns * rows];
    let mut seen = vec![false; columns * rows];
    let mut stack = vec![0];
    seen[0] = true;
    while let Some(&here) = stack.last() {
        let (column, row) = (here % columns, here / columns);
        let mut next = [0; 4];
        let mut count = 0;
        for (there, exists) in [
            (here.wrapping_sub(1), column > 0),
            (here + 1, column + 1 < columns),
            (here.wrapping_sub(columns), row > 0),
            (here + columns, row + 1 < rows),
        ] {
            if exists && !seen[there] {
                next[count] = there;
                count += 1;
            }
        }
        if count == 0 {
            stack.pop();
            continue;
        }
        let there = next[((chance.share() * count as f64) as usize).min(count - 1)];
        let (low, high) = (here.min(there), here.max(there));
        opened[low][usize::from(high - low != 1 || columns == 1)] = true;
        seen[there] = true;
        stack.push(there);
    }
    for joined in opened.iter_mut().flatten() {
        *joined |= chance.happens(loops);
    }
    opened
}

fn add_wall(sketch: &mut Sketch, wall: Segment, joined: bool, door_m: Option<f64>, chance: &mut Chance) {
    match (joined, door_m) {
        (false, _) => sketch.add_line(wall, false),
        (true, None) => {}
        (true, Some(door_m)) => {
            let length_m = wall.length_m();
            let from_m = between(chance, CORNER_M, length_m - CORNER_M - door_m);
            let at = |way_m: f64| wall.a + (wall.b - wall.a) * (way_m / length_m);
            sketch.add_line(Segment::new(wall.a, at(from_m)), false);
            sketch.add_line(Segment::new(at(from_m + door_m), wall.b), false);
        }
    }
}
