//! Distance to the nearest obstacle point, over a square raster that moves with the robot.
//!
//! Each cell holds the obstacle point that is nearest to its centre: vector distance transform by two sweeps (Danielsson,
//! "Euclidean distance mapping", 1980, with the eight neighbours of Leymarie and Levine). The points themselves are kept,
//! not their cells, so that distances are not rounded to cells.

use super::pose::Point;

/// Where there is no point at all, as a coordinate.
const NOWHERE: f32 = 1e6;

/// The nearest obstacle point of a cell, and its squared distance from the cell's centre.
#[derive(Debug, Clone, Copy)]
struct Near {
    x_m: f32,
    y_m: f32,
    squared: f32,
}

const NOTHING: Near = Near { x_m: NOWHERE, y_m: NOWHERE, squared: f32::INFINITY };

impl Near {
    /// Takes another cell's point over where it is nearer to the centre (`x_m`, `y_m`).
    #[inline(always)]
    fn pull(&mut self, x_m: f32, y_m: f32, other: &Near) {
        let (dx, dy) = (other.x_m - x_m, other.y_m - y_m);
        let squared = dx * dx + dy * dy;
        if squared < self.squared {
            *self = Near { squared, ..*other };
        }
    }
}

/// The raster. A rim of empty cells around it spares every look beside one the question whether it is inside.
#[derive(Debug)]
pub struct Clearance {
    cells: usize,
    cell_m: f32,
    left_m: f32,
    bottom_m: f32,
    near: Vec<Near>,
}

impl Clearance {
    /// A raster of `cells` × `cells` cells of `cell_m`.
    pub fn new(cells: usize, cell_m: f64) -> Clearance {
        let near = vec![NOTHING; (cells + 2) * (cells + 2)];
        Clearance { cells, cell_m: cell_m as f32, left_m: 0.0, bottom_m: 0.0, near }
    }

    /// Cells along a side.
    pub fn cells(&self) -> usize {
        self.cells
    }

    /// Side of a cell [m].
    pub fn cell_m(&self) -> f64 {
        f64::from(self.cell_m)
    }

    /// Lower left corner of the raster.
    pub fn corner(&self) -> Point {
        Point::new(f64::from(self.left_m), f64::from(self.bottom_m))
    }

    /// Distance of a cell's centre from the nearest point; huge where there is none [m].
    pub fn distance_m(&self, column: usize, row: usize) -> f32 {
        self.near[self.index(column, row)].squared.sqrt()
    }

    fn index(&self, column: usize, row: usize) -> usize {
        (row + 1) * (self.cells + 2) + column + 1
    }

    /// Works the raster out anew about `centre`, snapped to whole cells, for these obstacle points.
    pub fn rebuild(&mut self, centre: Point, points: &[Point]) {
        let (n, cell) = (self.cells, self.cell_m);
        let half = 0.5 * n as f32 * cell;
        self.left_m = ((centre.x_m as f32 - half) / cell).round() * cell;
        self.bottom_m = ((centre.y_m as f32 - half) / cell).round() * cell;
        self.near.fill(NOTHING);
        for point in points {
            let (x_m, y_m) = (point.x_m as f32, point.y_m as f32);
            let (column, row) = ((x_m - self.left_m) / cell, (y_m - self.bottom_m) / cell);
            let inside = column >= 0.0 && row >= 0.0 && column < n as f32 && row < n as f32;
            if inside {
                let (column, row) = (column as usize, row as usize);
                let index = self.index(column, row);
                let [cx, cy] = self.centre_of(column, row);
                self.near[index].pull(cx, cy, &Near { x_m, y_m, squared: 0.0 });
            }
        }
        let width = n + 2;
        for row in 0..n {
            let (before, after) = self.near.split_at_mut((row + 1) * width);
            let y_m = self.bottom_m + (row as f32 + 0.5) * cell;
            sweep(&mut after[..width], &before[row * width..], self.left_m, y_m, cell);
        }
        for row in (0..n).rev() {
            let (before, after) = self.near.split_at_mut((row + 2) * width);
            let y_m = self.bottom_m + (row as f32 + 0.5) * cell;
            sweep(&mut before[(row + 1) * width..], &after[..width], self.left_m, y_m, cell);
        }
    }

    fn centre_of(&self, column: usize, row: usize) -> [f32; 2] {
        let cell = self.cell_m;
        [self.left_m + (column as f32 + 0.5) * cell, self.bottom_m + (row as f32 + 0.5) * cell]
    }

    /// The obstacle point nearest to the centre of the cell that holds `point`; `None` outside and where there is none.
    pub fn nearest(&self, point: Point) -> Option<Point> {
        let column = (point.x_m as f32 - self.left_m) / self.cell_m;
        let row = (point.y_m as f32 - self.bottom_m) / self.cell_m;
        let n = self.cells as f32;
        let inside = column >= 0.0 && row >= 0.0 && column < n && row < n;
        if !inside {
            return None;
        }
        let near = &self.near[self.index(column as usize, row as usize)];
        (near.x_m < NOWHERE).then_some(Point::new(f64::from(near.x_m), f64::from(near.y_m)))
    }
}

/// Takes over what the row `beside` this one knows, then lets it run along the row both ways. Both rows have a rim cell at
/// either end.
fn sweep(row: &mut [Near], beside: &[Near], left_m: f32, y_m: f32, cell_m: f32) {
    let n = row.len() - 2;
    let beside = &beside[..row.len()];
    let mut x_m = left_m + 0.5 * cell_m;
    let mut last = row[0];
    for (cell, other) in row[1..=n].iter_mut().zip(beside.windows(3)) {
        let mut here = *cell;
        here.pull(x_m, y_m, &other[0]);
        here.pull(x_m, y_m, &other[1]);
        here.pull(x_m, y_m, &other[2]);
        here.pull(x_m, y_m, &last);
        (*cell, last) = (here, here);
        x_m += cell_m;
    }
    let mut last = row[n + 1];
    for cell in row[1..=n].iter_mut().rev() {
        x_m -= cell_m;
        cell.pull(x_m, y_m, &last);
        last = *cell;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_cell_knows_the_nearest_point(
            points in prop::collection::vec((-1.4..1.4f64, -1.4..1.4f64), 1..30),
        ) {
            let points: Vec<Point> = points.into_iter().map(|(x, y)| Point::new(x, y)).collect();
            let mut raster = Clearance::new(60, 0.05);
            raster.rebuild(Point::default(), &points);
            for row in 0..60 {
                for column in 0..60 {
                    let [x, y] = raster.centre_of(column, row);
                    let here = Point::new(f64::from(x), f64::from(y));
                    let exact = points.iter().map(|p| here.to(*p).length_m()).fold(f64::INFINITY, f64::min);
                    let found = f64::from(raster.distance_m(column, row));
                    // Of two points in one cell one is kept: they are at most its diagonal apart.
                    prop_assert!(found >= exact - 1e-3 && found <= exact + 0.0725, "{found} {exact}");
                }
            }
        }
    }

    #[test]
    fn an_empty_raster_knows_no_point() {
        let mut raster = Clearance::new(10, 0.1);
        raster.rebuild(Point::default(), &[]);
        assert_eq!(raster.nearest(Point::default()), None);
        raster.rebuild(Point::default(), &[Point::new(9.0, 0.0)]);
        assert_eq!(raster.nearest(Point::default()), None);
        assert_eq!(raster.nearest(Point::new(9.0, 0.0)), None);
    }
}
