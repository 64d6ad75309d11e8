//! Rays against all that stands still: a uniform grid whose cells hold their primitives, and how far they are empty.
//!
//! A ray walks from cell to cell (Amanatides and Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987) and meets
//! the primitives of each cell exactly. An empty cell knows the square around it that is empty too (its distance to the
//! nearest primitive in cells, chessboard metric), so that open space is crossed in few strides. The cost follows the
//! cells on the way, not the number of primitives in the world.

use super::grid::{Entry, Grid};
use crate::geometry::{Circle, Point, Segment};

/// Bounds of a cell's edge [m].
const CELL_M: [f64; 2] = [0.1, 2.0];
/// Edge of a cell in mean distances between primitives: measured, see docs/decisions/0005-ray-casting.md.
const CELL_PER_GAP: f64 = 2.0;
/// Cells at most; larger worlds get larger cells rather than more of them.
const MAX_CELLS: f64 = 4_000_000.0;
/// Marks a cell that is not empty; the rest is the index of its list.
pub(super) const LISTED: u32 = 1 << 31;
/// List of the cells around the grid: a ray that comes there has left.
pub(super) const OUTSIDE: u32 = LISTED;
/// An empty square of fewer cells to either side is not worth a stride.
const STRIDE: u32 = 4;

/// What touches a cell: runs of `circles` and `segments`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct List {
    pub circles: (u32, u32),
    pub segments: (u32, u32),
}

/// See the module's text.
#[derive(Debug, Clone)]
pub(super) struct Rays {
    /// Lower left corner of the ring of cells around the grid.
    pub low: Point,
    /// Lower left and upper right corner of what is inside.
    inside: (Point, Point),
    pub cell_m: f64,
    pub inverse: f64,
    pub columns: i32,
    /// An empty cell's distance to the nearest one that is not; or `LISTED` and a list.
    pub cells: Vec<u32>,
    pub lists: Vec<List>,
    pub circles: Vec<Circle>,
    pub segments: Vec<Segment>,
}

/// One axis of a walk.
struct Axis {
    /// Index of the cell's neighbour along the ray.
    step: i32,
    /// Length of the ray at the next border [m].
    next: f64,
    /// Length of the ray per cell [m], and its inverse.
    each: f64,
    per_m: f64,
}

impl Axis {
    /// The ray is at `at` within the cell `cell`, after `gone` metres [cells].
    fn new(at: f64, cell: i32, along: f64, gone: f64, rays: &Rays, step: i32) -> Axis {
        if along == 0.0 {
            return Axis { step: 0, next: f64::INFINITY, each: f64::INFINITY, per_m: 0.0 };
        }
        let each = rays.cell_m / along.abs();
        let left = if along > 0.0 { f64::from(cell + 1) - at } else { at - f64::from(cell) };
        Axis {
            step: if along > 0.0 { step } else { -step },
            next: gone + left * each,
            each,
            per_m: along.abs() * rays.inverse,
        }
    }

    /// Crosses the borders up to the length `until`, and answers the way in indices.
    #[inline]
    fn cross(&mut self, until: f64) -> i32 {
        if self.next > until {
            return 0;
        }
        let borders = ((until - self.next) * self.per_m) as i32 + 1;
        self.next += f64::from(borders) * self.each;
        borders * self.step
    }
}

impl Rays {
    /// Everything between `low` and `high`.
    pub fn new(low: Point, high: Point, segments: &[Segment], circles: &[Circle]) -> Rays {
        let cell_m = cell_m(low, high, segments, circles);
        let grid = Grid::with_cells(cell_m, low, high, segments, circles);
        let (columns, rows) = (grid.columns + 2, grid.rows + 2);
        let mut rays = Rays {
            low: grid.low - Point::new(cell_m, cell_m),
            inside: (grid.low, grid.low + Point::new(f64::from(grid.columns), f64::from(grid.rows)) * cell_m),
            cell_m,
            inverse: 1.0 / cell_m,
            columns,
            cells: vec![OUTSIDE; columns as usize * rows as usize],
            lists: vec![List::default()],
            circles: Vec::new(),
            segments: Vec::new(),
        };
        for row in 0..grid.rows {
            for column in 0..grid.columns {
                let at = ((row + 1) * columns + column + 1) as usize;
                rays.cells[at] = rays.listed(grid.cell(column, row), segments, circles);
            }
        }
        rays.measure_free_squares();
        rays
    }

    /// Lists what touches a cell; 0 when nothing does.
    fn listed(&mut self, entries: impl Iterator<Item = Entry>, segments: &[Segment], circles: &[Circle]) -> u32 {
        let from = (self.circles.len() as u32, self.segments.len() as u32);
        for entry in entries {
            match entry {
                Entry::Segment(k) => self.segments.push(segments[k]),
                Entry::Circle(k) => self.circles.push(circles[k]),
            }
        }
        let to = (self.circles.len() as u32, self.segments.len() as u32);
        if from == to {
            return 0;
        }
        self.lists.push(List { circles: (from.0, to.0), segments: (from.1, to.1) });
        LISTED | (self.lists.len() - 1) as u32
    }

    /// Gives each empty cell its chessboard distance to the nearest cell that is not: two passes over the neighbours.
    fn measure_free_squares(&mut self) {
        let columns = self.columns as usize;
        let count = self.cells.len();
        let distance = |cell: u32| if cell >= LISTED { 0 } else { cell };
        for at in columns + 1..count {
            if self.cells[at] < LISTED {
                let before = [at - 1, at - columns - 1, at - columns, at - columns + 1];
                self.cells[at] = 1 + before.map(|at| distance(self.cells[at])).into_iter().min().unwrap_or(0);
            }
        }
        for at in (0..count - columns - 1).rev() {
            if self.cells[at] < LISTED {
                let behind = [at + 1, at + columns - 1, at + columns, at + columns + 1];
                let least = 1 + behind.map(|at| distance(self.cells[at])).into_iter().min().unwrap_or(0);
                self.cells[at] = self.cells[at].min(least);
            }
        }
    }

    /// Distance along a ray to the first surface, if one is within `reach_m`. `direction` is a unit vector.
    #[inline]
    pub fn cast(&self, origin: Point, direction: Point, reach_m: f64) -> Option<f64> {
        let gone = self.enter(origin, direction)?;
        let at = (origin + direction * gone - self.low) * self.inverse;
        // Rounding may put a ray that enters from outside into the ring: its cells end every ray.
        let inner = |cell: i32, count: i32| cell.clamp(1, count - 2);
        let rows = self.cells.len() as i32 / self.columns;
        let (column, row) = (inner(at.x_m as i32, self.columns), inner(at.y_m as i32, rows));
        let mut x = Axis::new(at.x_m, column, direction.x_m, gone, self, 1);
        let mut y = Axis::new(at.y_m, row, direction.y_m, gone, self, self.columns);
        let mut cell = row * self.columns + column;
        let mut best = f64::INFINITY;
        loop {
            let code = self.cells[cell as usize];
            if code >= LISTED {
                if code == OUTSIDE {
                    break;
                }
                best = self.meet(self.lists[(code & !LISTED) as usize], origin, direction, best);
            } else if code > STRIDE {
                // All cells less than `code` away are empty: on to the border of that square.
                let more = f64::from(code - 1);
                let until = (x.next + more * x.each).min(y.next + more * y.each);
                if until >= reach_m.min(best) {
                    break;
                }
                cell += x.cross(until) + y.cross(until);
                continue;
            }
            // Whatever lies in later cells is farther than where the ray leaves this one.
            let until = x.next.min(y.next);
            if until >= best || until >= reach_m {
                break;
            }
            if x.next < y.next {
                cell += x.step;
                x.next += x.each;
            } else {
                cell += y.step;
                y.next += y.each;
            }
        }
        (best <= reach_m).then_some(best)
    }

    #[inline]
    fn meet(&self, list: List, origin: Point, direction: Point, mut best: f64) -> f64 {
        for circle in &self.circles[list.circles.0 as usize..list.circles.1 as usize] {
            if let Some(distance) = circle.cast(origin, direction) {
                best = best.min(distance);
            }
        }
        for segment in &self.segments[list.segments.0 as usize..list.segments.1 as usize] {
            if let Some(distance) = segment.cast(origin, direction) {
                best = best.min(distance);
            }
        }
        best
    }

    /// Where a ray enters the grid: 0 from inside [m].
    #[inline]
    fn enter(&self, origin: Point, direction: Point) -> Option<f64> {
        let (low, high) = self.inside;
        let is_inside =
            origin.x_m >= low.x_m && origin.x_m <= high.x_m && origin.y_m >= low.y_m && origin.y_m <= high.y_m;
        if is_inside {
            return Some(0.0);
        }
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for (at, along, low, high) in
            [(origin.x_m, direction.x_m, low.x_m, high.x_m), (origin.y_m, direction.y_m, low.y_m, high.y_m)]
        {
            if along == 0.0 {
                if at < low || at > high {
                    return None;
                }
            } else {
                let (one, two) = ((low - at) / along, (high - at) / along);
                enter = enter.max(one.min(two));
                leave = leave.min(one.max(two));
            }
        }
        (enter <= leave).then_some(enter)
    }
}

/// An edge of a cell that follows the density of what it will hold.
fn cell_m(low: Point, high: Point, segments: &[Segment], circles: &[Circle]) -> f64 {
    let primitives = segments.len() + circles.len();
    let (width, height) = ((high.x_m - low.x_m).max(CELL_M[0]), (high.y_m - low.y_m).max(CELL_M[0]));
    let gap_m = (width * height / primitives.max(1) as f64).sqrt();
    let least_m = (width * height / MAX_CELLS).sqrt().max(width.max(height) / MAX_CELLS);
    (CELL_PER_GAP * gap_m).clamp(CELL_M[0], CELL_M[1]).max(least_m)
}
