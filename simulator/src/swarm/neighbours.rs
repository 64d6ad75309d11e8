//! Who is near: robots sorted by the cell that they stand in (counting sort), anew in every step.
//!
//! The robots of a row of cells lie side by side in memory, so a query reads one run of numbers per row.

use crate::geometry::Point;

/// Robots by place.
#[derive(Debug)]
pub(super) struct Neighbours {
    low: Point,
    inverse: f64,
    columns: usize,
    rows: usize,
    /// Where each cell's robots begin in the sorted arrays; one more than there are cells.
    starts: Vec<u32>,
    cells: Vec<u32>,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    robot: Vec<u32>,
}

impl Neighbours {
    /// For `count` robots in a world of this extent, with cells of at least `cell_m`.
    pub fn new((low, high): (Point, Point), count: usize, cell_m: f64) -> Neighbours {
        let size = high - low;
        let area_m2 = size.x_m * size.y_m;
        // Not many more cells than robots: empty ones cost time too.
        let cell_m = cell_m.max((area_m2 / (4 * count + 1024) as f64).sqrt()).max(1e-3);
        let columns = (size.x_m / cell_m) as usize + 1;
        let rows = (size.y_m / cell_m) as usize + 1;
        Neighbours {
            low,
            inverse: 1.0 / cell_m,
            columns,
            rows,
            starts: vec![0; columns * rows + 1],
            cells: vec![0; count],
            x_m: vec![0.0; count],
            y_m: vec![0.0; count],
            robot: vec![0; count],
        }
    }

    /// Takes note of where the robots are.
    pub fn fill(&mut self, x_m: &[f64], y_m: &[f64]) {
        self.starts.fill(0);
        for robot in 0..x_m.len() {
            let cell = self.row(y_m[robot]) * self.columns + self.column(x_m[robot]);
            self.cells[robot] = cell as u32;
            self.starts[cell + 1] += 1;
        }
        for cell in 1..self.starts.len() {
            self.starts[cell] += self.starts[cell - 1];
        }
        // Backwards, with each cell's end as its cursor: afterwards every cursor is its cell's beginning again.
        for robot in (0..x_m.len()).rev() {
            let cursor = &mut self.starts[self.cells[robot] as usize + 1];
            *cursor -= 1;
            let at = *cursor as usize;
            (self.x_m[at], self.y_m[at], self.robot[at]) = (x_m[robot], y_m[robot], robot as u32);
        }
        // The cursors have moved every beginning one place up.
        self.starts.rotate_left(1);
        if let Some(end) = self.starts.last_mut() {
            *end = x_m.len() as u32;
        }
    }

    /// Hands every robot other than `own` whose centre is within `reach_m` of `centre` to `each`: index, and centre as
    /// seen from there.
    pub fn each_within(&self, own: usize, centre: Point, reach_m: f64, mut each: impl FnMut(usize, Point)) {
        let (left, right) = (self.column(centre.x_m - reach_m), self.column(centre.x_m + reach_m));
        for row in self.row(centre.y_m - reach_m)..=self.row(centre.y_m + reach_m) {
            let from = self.starts[row * self.columns + left] as usize;
            let to = self.starts[row * self.columns + right + 1] as usize;
            for at in from..to {
                let apart = Point::new(self.x_m[at] - centre.x_m, self.y_m[at] - centre.y_m);
                if apart.dot(apart) <= reach_m * reach_m && self.robot[at] as usize != own {
                    each(self.robot[at] as usize, apart);
                }
            }
        }
    }

    /// Clamped: who is outside counts as in the outermost cell, also when somebody looks for them there.
    fn column(&self, x_m: f64) -> usize {
        (((x_m - self.low.x_m) * self.inverse) as usize).min(self.columns - 1)
    }

    fn row(&self, y_m: f64) -> usize {
        (((y_m - self.low.y_m) * self.inverse) as usize).min(self.rows - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Chance, Purpose};

    #[test]
    fn everybody_within_reach_is_found_once_inside_and_outside_the_extent() {
        let mut chance = Chance::new(1, Purpose::Swarm, 0);
        // Some stand outside the extent of 10 m × 6 m.
        let x_m: Vec<f64> = (0..200).map(|_| 14.0 * chance.share() - 2.0).collect();
        let y_m: Vec<f64> = (0..200).map(|_| 10.0 * chance.share() - 2.0).collect();
        let mut neighbours = Neighbours::new((Point::ZERO, Point::new(10.0, 6.0)), 200, 0.7);
        for _ in 0..2 {
            neighbours.fill(&x_m, &y_m);
        }
        for own in 0..200 {
            let centre = Point::new(x_m[own], y_m[own]);
            let mut found = Vec::new();
            neighbours.each_within(own, centre, 1.5, |robot, apart| {
                assert_eq!(apart, Point::new(x_m[robot], y_m[robot]) - centre);
                found.push(robot);
            });
            found.sort_unstable();
            let near = |k: &usize| *k != own && (Point::new(x_m[*k], y_m[*k]) - centre).norm() <= 1.5;
            let wanted: Vec<usize> = (0..200).filter(near).collect();
            assert_eq!(found, wanted, "robot {own}");
        }
    }
}
