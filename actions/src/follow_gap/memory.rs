//! What the laser has seen lately: an occupancy raster in the odometry frame that moves with the robot.
//!
//! A beam's end marks its cell with the very point that was hit; every cell that a beam passes through before its end
//! loses evidence and is free after a few such beams. What nobody looks at any more is kept for `memory_s`. There is no
//! map: what is farther than the raster reaches, or older, is forgotten.

use super::pose::{Frame, Point};

/// Evidence of a fresh hit.
const HIT: u8 = 3;
/// A beam clears no nearer than this to its own end [m].
const BEFORE_END_M: f64 = 0.10;
/// The raster is moved when the robot is so many cells off its middle.
const OFF_CENTRE: i64 = 16;

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Cell {
    x_m: f32,
    y_m: f32,
    /// Time of the last hit, in milliseconds since the planner's beginning.
    hit_ms: u32,
    /// Since when it has been hit without a pause.
    since_ms: u32,
    evidence: u8,
}

/// A cell that is not hit for so long has been free in between [ms].
const PAUSE_MS: u32 = 150;

/// The raster.
#[derive(Debug)]
pub struct Memory {
    cells: i64,
    cell_m: f64,
    memory_ms: u32,
    /// Indices of the lower left cell in the endless raster of the odometry frame.
    left: i64,
    bottom: i64,
    raster: Vec<Cell>,
}

impl Memory {
    /// A raster of `cells` × `cells` cells of `cell_m` that keeps what nobody looks at for `memory_s`.
    pub fn new(cells: usize, cell_m: f64, memory_s: f64) -> Memory {
        let half = cells as i64 / 2;
        Memory {
            cells: cells as i64,
            cell_m,
            memory_ms: (memory_s * 1e3) as u32,
            left: -half,
            bottom: -half,
            raster: vec![Cell::default(); cells * cells],
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.raster.fill(Cell::default());
    }

    fn index(&self, column: i64, row: i64) -> Option<usize> {
        let (column, row) = (column - self.left, row - self.bottom);
        let inside = column >= 0 && row >= 0 && column < self.cells && row < self.cells;
        inside.then(|| (row * self.cells + column) as usize)
    }

    fn cell_of(&self, point: Point) -> (i64, i64) {
        ((point.x_m / self.cell_m).floor() as i64, (point.y_m / self.cell_m).floor() as i64)
    }

    /// Moves the raster along with the robot; what it leaves behind is forgotten.
    pub fn follow(&mut self, place: Point) {
        let (column, row) = self.cell_of(place);
        let half = self.cells / 2;
        let (dx, dy) = (column - half - self.left, row - half - self.bottom);
        if dx.abs() <= OFF_CENTRE && dy.abs() <= OFF_CENTRE {
            return;
        }
        let n = self.cells;
        (self.left, self.bottom) = (self.left + dx, self.bottom + dy);
        if dx.abs() >= n || dy.abs() >= n {
            return self.clear();
        }
        // Row by row, in the order in which no row is overwritten before it was moved.
        for step in 0..n {
            let to = if dy >= 0 { step } else { n - 1 - step };
            let from = to + dy;
            let (to_begin, from_begin) = (to * n, from * n);
            if from < 0 || from >= n {
                self.raster[to_begin as usize..(to_begin + n) as usize].fill(Cell::default());
                continue;
            }
            let (skip, free) = (dx.max(0), (-dx).max(0));
            let source = (from_begin + skip) as usize..(from_begin + n - free) as usize;
            self.raster.copy_within(source, (to_begin + free) as usize);
            self.raster[to_begin as usize..(to_begin + free) as usize].fill(Cell::default());
            self.raster[(to_begin + n - skip) as usize..(to_begin + n) as usize].fill(Cell::default());
        }
    }

    /// Takes evidence from the cells between a beam's origin and its end.
    pub fn pass(&mut self, from: Point, to: Point) {
        let way = from.to(to);
        let length_m = way.length_m();
        let free_m = length_m - BEFORE_END_M;
        if free_m <= 0.0 {
            return;
        }
        // Amanatides and Woo's traversal.
        let (mut column, mut row) = self.cell_of(from);
        let (ux, uy) = (way.x_m / length_m, way.y_m / length_m);
        let crossing = |u: f64, at: f64, cell: i64| {
            let edge = if u > 0.0 { cell + 1 } else { cell } as f64 * self.cell_m;
            if u == 0.0 { f64::INFINITY } else { (edge - at) / u }
        };
        let (mut next_x, mut next_y) = (crossing(ux, from.x_m, column), crossing(uy, from.y_m, row));
        let (step_x, step_y) = (self.cell_m / ux.abs(), self.cell_m / uy.abs());
        let mut travelled_m = 0.0;
        while travelled_m < free_m {
            let Some(index) = self.index(column, row) else { return };
            let cell = &mut self.raster[index];
            cell.evidence = cell.evidence.saturating_sub(1);
            if next_x < next_y {
                travelled_m = next_x;
                next_x += step_x;
                column += if ux > 0.0 { 1 } else { -1 };
            } else {
                travelled_m = next_y;
                next_y += step_y;
                row += if uy > 0.0 { 1 } else { -1 };
            }
        }
    }

    /// Marks where a beam ended.
    pub fn hit(&mut self, at: Point, now_ms: u32) {
        let (column, row) = self.cell_of(at);
        if let Some(index) = self.index(column, row) {
            let before = self.raster[index];
            // A beam beside the surface may have cleared the cell within this very scan: only a pause is one.
            let pause_ms = now_ms.saturating_sub(before.hit_ms);
            let since_ms = if before.hit_ms > 0 && pause_ms < PAUSE_MS { before.since_ms } else { now_ms };
            let (x_m, y_m) = (at.x_m as f32, at.y_m as f32);
            self.raster[index] = Cell { x_m, y_m, hit_ms: now_ms, since_ms, evidence: HIT };
        }
    }

    /// For how long the place of a hit has been hit without a pause; `None` outside the raster [ms].
    pub fn age_ms(&self, at: Point, now_ms: u32) -> Option<u32> {
        let (column, row) = self.cell_of(at);
        self.index(column, row).map(|index| now_ms.saturating_sub(self.raster[index].since_ms))
    }

    /// Puts all points that are remembered at `now_ms` into `points`, as many as it has room for. Those within the
    /// `shape` of the robot, in its `frame`, are no obstacles: it stands there.
    pub fn collect(&self, now_ms: u32, frame: &Frame, shape: (f64, f64, f64), points: &mut Vec<Point>) {
        let (ahead_m, behind_m, half_width_m) = shape;
        let reach = (ahead_m.max(behind_m) + half_width_m) * (ahead_m.max(behind_m) + half_width_m);
        for cell in &self.raster {
            if cell.evidence == 0 || now_ms.saturating_sub(cell.hit_ms) > self.memory_ms {
                continue;
            }
            let point = Point::new(f64::from(cell.x_m), f64::from(cell.y_m));
            if frame.place.to(point).squared() < reach {
                let own = frame.inner(point);
                if own.x_m < ahead_m && own.x_m > -behind_m && own.y_m.abs() < half_width_m {
                    continue;
                }
            }
            if points.len() < points.capacity() {
                points.push(point);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pose::Pose;
    use super::*;

    fn seen(memory: &Memory, now_ms: u32) -> Vec<Point> {
        let mut points = Vec::with_capacity(100);
        memory.collect(now_ms, &Pose::new(50.0, 50.0, 0.0).frame(), (0.2, 0.2, 0.2), &mut points);
        points
    }

    #[test]
    fn a_hit_is_remembered_as_the_point_that_it_was_and_forgotten_in_time() {
        let mut memory = Memory::new(100, 0.05, 5.0);
        memory.hit(Point::new(1.013, -0.42), 100);
        let points = seen(&memory, 4000);
        assert!(points.len() == 1 && points[0].to(Point::new(1.013, -0.42)).length_m() < 1e-6);
        assert!(seen(&memory, 5200).is_empty());
    }

    #[test]
    fn beams_that_pass_clear_a_cell_and_a_beam_spares_its_own_end() {
        let mut memory = Memory::new(100, 0.05, 5.0);
        memory.hit(Point::new(1.0, 0.01), 0);
        for _ in 0..10 {
            memory.pass(Point::new(0.0, 0.01), Point::new(1.0, 0.01));
        }
        assert_eq!(seen(&memory, 0).len(), 1);
        for _ in 0..HIT {
            memory.pass(Point::new(0.0, 0.01), Point::new(2.0, 0.01));
        }
        assert!(seen(&memory, 0).is_empty());
    }

    #[test]
    fn the_raster_moves_along_and_keeps_what_is_still_in_it() {
        for (dx, dy) in [(1.2, 0.0), (-1.2, 0.3), (0.4, 1.5), (-0.9, -1.1)] {
            let mut memory = Memory::new(100, 0.05, 5.0);
            let kept = Point::new(0.3, -0.6);
            memory.hit(kept, 0);
            memory.hit(Point::new(-2.49 * f64::signum(dx), -2.49 * f64::signum(dy)), 0);
            memory.follow(Point::new(dx, dy));
            let points = seen(&memory, 0);
            assert!(points.len() == 1 && points[0].to(kept).length_m() < 1e-6, "{dx} {dy} {points:?}");
        }
        let mut memory = Memory::new(100, 0.05, 5.0);
        memory.hit(Point::default(), 0);
        memory.follow(Point::new(40.0, 0.0));
        assert!(seen(&memory, 0).is_empty());
    }

    #[test]
    fn a_place_s_age_counts_from_the_last_pause() {
        let mut memory = Memory::new(100, 0.05, 5.0);
        let place = Point::new(1.01, 0.01);
        for k in 0..50 {
            memory.hit(place, 1000 + 20 * k);
        }
        assert_eq!(memory.age_ms(place, 2000), Some(1000));
        memory.hit(place, 3000);
        assert_eq!(memory.age_ms(place, 3000), Some(0), "a second without a hit is a pause");
        assert_eq!(memory.age_ms(Point::new(9.0, 0.0), 3000), None);
    }

    #[test]
    fn what_lies_within_the_robot_is_no_obstacle() {
        let mut memory = Memory::new(100, 0.05, 5.0);
        memory.hit(Point::new(0.1, 0.1), 0);
        let mut points = Vec::with_capacity(10);
        memory.collect(0, &Pose::default().frame(), (0.25, 0.25, 0.2), &mut points);
        assert!(points.is_empty());
    }
}
