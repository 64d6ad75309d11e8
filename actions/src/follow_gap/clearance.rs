//! Distance to the nearest obstacle point, over a square raster that moves with the robot.
//!
//! Each cell holds the obstacle point that is nearest to its centre: vector distance transform by two sweeps (Danielsson,
//! "Euclidean distance mapping", 1980, with the eight neighbours of Leymarie and Levine). The points themselves are kept,
//! not their cells, so that distances are not rounded to cells.

use super::pose::Point;

/// Where there is no point at all, as a coordinate.
const NOWHERE: f32 = 1e6;

/// The raster.
#[derive(Debug)]
pub struct Clearance {
    cells: usize,
    cell_m: f32,
    left_m: f32,
    bottom_m: f32,
    nearest: Vec<[f32; 2]>,
    distance: Vec<f32>,
}

impl Clearance {
    /// A raster of `cells` × `cells` cells of `cell_m`.
    pub fn new(cells: usize, cell_m: f64) -> Clearance {
        Clearance {
            cells,
            cell_m: cell_m as f32,
            left_m: 0.0,
            bottom_m: 0.0,
            nearest: vec![[NOWHERE; 2]; cells * cells],
            distance: vec![f32::INFINITY; cells * cells],
        }
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

    /// Distance of each cell's centre from the nearest point, row by row from the bottom [m].
    pub fn distances(&self) -> &[f32] {
        &self.distance
    }

    /// Works the raster out anew about `centre`, snapped to whole cells, for these obstacle points.
    pub fn rebuild(&mut self, centre: Point, points: &[Point]) {
        let (n, cell) = (self.cells, self.cell_m);
        let half = 0.5 * n as f32 * cell;
        self.left_m = ((centre.x_m as f32 - half) / cell).round() * cell;
        self.bottom_m = ((centre.y_m as f32 - half) / cell).round() * cell;
        self.nearest.fill([NOWHERE; 2]);
        self.distance.fill(f32::INFINITY);
        for point in points {
            let (x, y) = (point.x_m as f32, point.y_m as f32);
            let (column, row) = ((x - self.left_m) / cell, (y - self.bottom_m) / cell);
            let inside = column >= 0.0 && row >= 0.0 && column < n as f32 && row < n as f32;
            if inside {
                let (column, row) = (column as usize, row as usize);
                self.offer(row * n + column, self.centre_of(column, row), [x, y]);
            }
        }
        for row in 0..n {
            self.sweep_row(row, row.checked_sub(1));
        }
        for row in (0..n).rev() {
            self.sweep_row(row, (row + 1 < n).then_some(row + 1));
        }
        for distance in &mut self.distance {
            *distance = distance.sqrt();
        }
    }

    fn centre_of(&self, column: usize, row: usize) -> [f32; 2] {
        let cell = self.cell_m;
        [self.left_m + (column as f32 + 0.5) * cell, self.bottom_m + (row as f32 + 0.5) * cell]
    }

    /// Takes `point` over where it is nearer; the distances are squared meanwhile.
    fn offer(&mut self, index: usize, centre: [f32; 2], point: [f32; 2]) {
        let (dx, dy) = (point[0] - centre[0], point[1] - centre[1]);
        let squared = dx * dx + dy * dy;
        if squared < self.distance[index] {
            self.distance[index] = squared;
            self.nearest[index] = point;
        }
    }

    /// Takes over what the row `other` beside this one knows, then lets it run along the row both ways.
    fn sweep_row(&mut self, row: usize, other: Option<usize>) {
        let n = self.cells;
        for column in 0..n {
            let (index, centre) = (row * n + column, self.centre_of(column, row));
            if let Some(other) = other {
                let beside = other * n + column;
                self.pull(index, centre, beside);
                if column > 0 {
                    self.pull(index, centre, beside - 1);
                }
                if column + 1 < n {
                    self.pull(index, centre, beside + 1);
                }
            }
            if column > 0 {
                self.pull(index, centre, index - 1);
            }
        }
        for column in (0..n.saturating_sub(1)).rev() {
            let index = row * n + column;
            self.pull(index, self.centre_of(column, row), index + 1);
        }
    }

    fn pull(&mut self, index: usize, centre: [f32; 2], from: usize) {
        if self.distance[from] < f32::INFINITY {
            self.offer(index, centre, self.nearest[from]);
        }
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
        let [x, y] = self.nearest[row as usize * self.cells + column as usize];
        (x < NOWHERE).then_some(Point::new(f64::from(x), f64::from(y)))
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
                    let found = f64::from(raster.distances()[row * 60 + column]);
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
