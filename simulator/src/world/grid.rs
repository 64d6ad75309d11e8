//! Uniform grid over the static primitives, so that a query looks only at what is near.

use crate::geometry::{Circle, Point, Segment};

/// Edge of a cell in worlds of ordinary size [m].
const CELL_M: f64 = 0.25;
/// Larger worlds get larger cells rather than more of them.
const MAX_CELLS: f64 = 1_000_000.0;
/// Primitives are entered this much fatter, so that rounding at a cell's border loses none [m].
const MARGIN_M: f64 = 1e-9;
/// Marks a circle among the entries; the rest is its index.
const CIRCLE: u32 = 1 << 31;

/// Which primitive an entry names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Entry {
    Segment(usize),
    Circle(usize),
}

/// Cells in rows from the lower left corner; each lists the primitives that touch it.
#[derive(Debug, Clone)]
pub(crate) struct Grid {
    pub low: Point,
    pub cell_m: f64,
    pub inverse: f64,
    pub columns: i32,
    pub rows: i32,
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Grid {
    pub fn new(low: Point, high: Point, segments: &[Segment], circles: &[Circle]) -> Grid {
        let (width, height) = ((high.x_m - low.x_m).max(CELL_M), (high.y_m - low.y_m).max(CELL_M));
        let cell_m = CELL_M.max((width * height / MAX_CELLS).sqrt()).max(width.max(height) / MAX_CELLS);
        Grid::with_cells(cell_m, low, high, segments, circles)
    }

    /// A grid of cells of that edge [m].
    pub fn with_cells(cell_m: f64, low: Point, high: Point, segments: &[Segment], circles: &[Circle]) -> Grid {
        let (width, height) = ((high.x_m - low.x_m).max(CELL_M), (high.y_m - low.y_m).max(CELL_M));
        let columns = ((width / cell_m).floor() as i32).saturating_add(1);
        let rows = ((height / cell_m).floor() as i32).saturating_add(1);
        let (starts, entries) = (Vec::new(), Vec::new());
        let mut grid = Grid { low, cell_m, inverse: 1.0 / cell_m, columns, rows, starts, entries };
        let mut lists: Vec<(u32, u32)> = Vec::new();
        for (k, segment) in segments.iter().enumerate() {
            grid.each_cell_of_segment(segment, |cell| lists.push((cell, k as u32)));
        }
        for (k, circle) in circles.iter().enumerate() {
            grid.each_cell_of_circle(circle, |cell| lists.push((cell, k as u32 | CIRCLE)));
        }
        lists.sort_unstable();
        let cells = (columns as usize) * (rows as usize);
        grid.starts = Vec::with_capacity(cells + 1);
        grid.entries = Vec::with_capacity(lists.len());
        let mut next = lists.iter().peekable();
        for cell in 0..cells as u32 {
            grid.starts.push(grid.entries.len() as u32);
            while let Some((_, entry)) = next.next_if(|(owner, _)| *owner == cell) {
                grid.entries.push(*entry);
            }
        }
        grid.starts.push(grid.entries.len() as u32);
        grid
    }

    /// The primitives that touch a cell.
    pub fn cell(&self, column: i32, row: i32) -> impl Iterator<Item = Entry> + '_ {
        let at = (row * self.columns + column) as usize;
        let list = &self.entries[self.starts[at] as usize..self.starts[at + 1] as usize];
        list.iter().map(|entry| {
            if entry & CIRCLE == 0 {
                Entry::Segment(*entry as usize)
            } else {
                Entry::Circle((entry & !CIRCLE) as usize)
            }
        })
    }

    /// Columns of a row's part between two columns, both included, whose cells list anything.
    ///
    /// Most of a world is empty: the entries of a row lie in one piece, so that an empty part is told at once.
    pub fn filled(&self, row: i32, from: i32, to: i32) -> impl Iterator<Item = i32> + '_ {
        let at = |column: i32| (row * self.columns + column) as usize;
        let starts = &self.starts[at(from)..=at(to) + 1];
        let any = starts.first() != starts.last();
        starts
            .windows(2)
            .take(if any { starts.len() } else { 0 })
            .zip(from..)
            .filter(|(ends, _)| ends[0] != ends[1])
            .map(|(_, column)| column)
    }

    /// Column of the cell at `x_m`, clamped into the grid.
    pub fn column(&self, x_m: f64) -> i32 {
        (((x_m - self.low.x_m) * self.inverse).floor() as i32).clamp(0, self.columns - 1)
    }

    /// Row of the cell at `y_m`, clamped into the grid.
    pub fn row(&self, y_m: f64) -> i32 {
        (((y_m - self.low.y_m) * self.inverse).floor() as i32).clamp(0, self.rows - 1)
    }

    /// Centre of a cell.
    pub fn centre(&self, column: i32, row: i32) -> Point {
        let at = |index: i32| (index as f64 + 0.5) * self.cell_m;
        Point::new(self.low.x_m + at(column), self.low.y_m + at(row))
    }

    /// Row by row, so that a long slanted wall costs its cells and not the box around it.
    fn each_cell_of_segment(&self, segment: &Segment, mut enter: impl FnMut(u32)) {
        let Segment { a, b } =
            if segment.a.y_m <= segment.b.y_m { *segment } else { Segment::new(segment.b, segment.a) };
        for row in self.row(a.y_m - MARGIN_M)..=self.row(b.y_m + MARGIN_M) {
            let low = self.low.y_m + f64::from(row) * self.cell_m - MARGIN_M;
            let high = low + self.cell_m + 2.0 * MARGIN_M;
            // Where the wall enters and leaves the row; a level wall stays in it from end to end.
            let at = |y_m: f64| a.x_m + (b.x_m - a.x_m) * ((y_m - a.y_m) / (b.y_m - a.y_m)).clamp(0.0, 1.0);
            let level = b.y_m - a.y_m <= MARGIN_M;
            let (from, to) = if level { (a.x_m, b.x_m) } else { (at(low), at(high)) };
            for column in self.column(from.min(to) - MARGIN_M)..=self.column(from.max(to) + MARGIN_M) {
                enter((row * self.columns + column) as u32);
            }
        }
    }

    fn each_cell_of_circle(&self, circle: &Circle, mut enter: impl FnMut(u32)) {
        let Circle { centre, radius_m } = *circle;
        let half = 0.5 * self.cell_m;
        let reach = radius_m + MARGIN_M;
        for row in self.row(centre.y_m - reach)..=self.row(centre.y_m + reach) {
            for column in self.column(centre.x_m - reach)..=self.column(centre.x_m + reach) {
                let to = centre - self.centre(column, row);
                let outside = Point::new((to.x_m.abs() - half).max(0.0), (to.y_m.abs() - half).max(0.0));
                if outside.dot(outside) <= reach * reach {
                    enter((row * self.columns + column) as u32);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_primitive_is_listed_in_each_cell_that_it_touches() {
        let wall = Segment::new(Point::new(0.1, 0.1), Point::new(3.9, 2.9));
        let post = Circle::new(Point::new(3.0, 1.0), 0.4);
        let grid = Grid::new(Point::ZERO, Point::new(4.0, 3.0), &[wall], &[post]);
        for k in 0..=1000 {
            let on_wall = wall.a + (wall.b - wall.a) * (k as f64 / 1000.0);
            let mut cell = grid.cell(grid.column(on_wall.x_m), grid.row(on_wall.y_m));
            assert!(cell.any(|entry| entry == Entry::Segment(0)), "{on_wall:?}");
            let on_post = post.centre + Point::unit(k as f64 * 0.01) * post.radius_m;
            let mut cell = grid.cell(grid.column(on_post.x_m), grid.row(on_post.y_m));
            assert!(cell.any(|entry| entry == Entry::Circle(0)), "{on_post:?}");
        }
        assert_eq!(grid.cell(0, grid.rows - 1).count(), 0);
    }
}
