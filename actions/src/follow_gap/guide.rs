//! The cost to go to the goal from every cell of a coarse raster, and the way down it.
//!
//! The time of arrival T of a front that starts at the goal obeys |∇T| = c(d), with c a cost per metre that rises where
//! the clearance d is small (the Eikonal equation). It is solved by fast marching (Sethian, 1996) with the untidy queue
//! of Yatziv, Bartesaghi and Sapiro (2006): buckets instead of a heap, O(n). What nobody has seen counts as free. A goal
//! beyond the raster is reached from the raster's edge in a straight line.

use super::clearance::Clearance;
use super::pose::Point;

/// Buckets of the queue.
const BUCKETS: usize = 1024;
/// Width of a bucket [m of free way].
const BUCKET: f32 = 0.02;
/// No entry.
const NONE: u32 = u32::MAX;

/// What a metre costs, by the clearance of the robot's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Price {
    /// From here on a metre costs one [m].
    pub free_m: f64,
    /// Nearer than this the robot does not fit [m].
    pub blocked_m: f64,
    /// What a metre costs just before that.
    pub narrow: f64,
    /// What a metre costs where the robot does not fit: never infinite, so that every place has a way.
    pub blocked: f64,
}

impl Price {
    fn of(&self, clearance_m: f32) -> f32 {
        let (d, free, blocked) = (clearance_m, self.free_m as f32, self.blocked_m as f32);
        if d >= free {
            1.0
        } else if d <= blocked {
            self.blocked as f32
        } else {
            let narrow = (free - d) / (free - blocked);
            1.0 + (self.narrow as f32 - 1.0) * narrow * narrow
        }
    }
}

/// The costs to go.
#[derive(Debug)]
pub struct Guide {
    cells: usize,
    cell_m: f64,
    corner: Point,
    /// Final costs; infinite where none is known yet, and on a rim around the raster.
    cost: Vec<f32>,
    /// The least cost found so far.
    tentative: Vec<f32>,
    /// What a cell costs to cross.
    step: Vec<f32>,
    heads: Vec<u32>,
    next: Vec<u32>,
    what: Vec<u32>,
    entries: usize,
}

/// A queue entry per cell and this many more are kept; an entry beyond is left out, its cell keeps a worse one.
const ENTRIES_PER_CELL: usize = 4;

impl Guide {
    /// Costs over a raster of `cells` × `cells`.
    pub fn new(cells: usize) -> Guide {
        let count = (cells + 2) * (cells + 2);
        Guide {
            cells,
            cell_m: 1.0,
            corner: Point::default(),
            cost: vec![f32::INFINITY; count],
            tentative: vec![f32::INFINITY; count],
            step: vec![f32::INFINITY; count],
            heads: vec![NONE; BUCKETS],
            next: vec![NONE; count * ENTRIES_PER_CELL],
            what: vec![0; count * ENTRIES_PER_CELL],
            entries: 0,
        }
    }

    /// Works the costs out anew. The front stops `beyond` after it has passed `robot`: farther places keep that cost.
    pub fn rebuild(&mut self, clearance: &Clearance, price: &Price, goal: Point, robot: Point, beyond: f32) {
        let n = self.cells;
        (self.cell_m, self.corner) = (clearance.cell_m(), clearance.corner());
        self.cost.fill(f32::INFINITY);
        self.tentative.fill(f32::INFINITY);
        self.heads.fill(NONE);
        self.entries = 0;
        for row in 0..n {
            for column in 0..n {
                let index = self.index(column, row);
                self.step[index] = price.of(clearance.distance_m(column, row)) * self.cell_m as f32;
            }
        }
        let (column, row) = self.place(goal);
        if column >= 0.0 && row >= 0.0 && column < n as f64 && row < n as f64 {
            self.offer(self.index(column as usize, row as usize), 0.0, 0);
        } else {
            self.seed_edge(goal);
        }
        let (column, row) = self.place(robot);
        let within = |cell: f64| cell.clamp(0.0, n as f64 - 1.0) as usize;
        let target = self.index(within(column), within(row));
        let mut last = f32::INFINITY;
        let (mut tick, mut empty) = (0, 0);
        while empty < BUCKETS && tick as f32 * BUCKET <= last {
            let entry = self.heads[tick % BUCKETS];
            if entry == NONE {
                tick += 1;
                empty += 1;
                continue;
            }
            empty = 0;
            self.heads[tick % BUCKETS] = self.next[entry as usize];
            let index = self.what[entry as usize] as usize;
            if self.cost[index] < f32::INFINITY {
                continue;
            }
            self.cost[index] = self.tentative[index];
            if index == target {
                last = tick as f32 * BUCKET + beyond;
            }
            self.spread(index, tick);
        }
        let most = if last.is_finite() { last } else { tick as f32 * BUCKET };
        for cost in &mut self.cost {
            *cost = cost.min(most);
        }
    }

    fn index(&self, column: usize, row: usize) -> usize {
        (row + 1) * (self.cells + 2) + column + 1
    }

    fn place(&self, point: Point) -> (f64, f64) {
        ((point.x_m - self.corner.x_m) / self.cell_m, (point.y_m - self.corner.y_m) / self.cell_m)
    }

    fn seed_edge(&mut self, goal: Point) {
        let n = self.cells;
        let edge = (0..n).flat_map(|k| [(k, 0), (k, n - 1), (0, k), (n - 1, k)]);
        let (cell_m, corner) = (self.cell_m, self.corner);
        let centre_of = |(column, row): (usize, usize)| {
            Point::new(corner.x_m + (column as f64 + 0.5) * cell_m, corner.y_m + (row as f64 + 0.5) * cell_m)
        };
        let least = edge.clone().map(|cell| centre_of(cell).to(goal).length_m()).fold(f64::INFINITY, f64::min);
        for (column, row) in edge {
            // Every way ends at the goal: what all share is left out, and the queue begins at zero.
            let rest = (centre_of((column, row)).to(goal).length_m() - least) as f32;
            let index = self.index(column, row);
            self.offer(index, rest + self.step[index], 0);
        }
    }

    /// Takes over a cost that is less than the one so far, and puts the cell into the queue.
    fn offer(&mut self, index: usize, cost: f32, tick: usize) {
        if cost >= self.tentative[index] || self.entries == self.what.len() {
            return;
        }
        self.tentative[index] = cost;
        // What lies farther ahead than the queue reaches waits in its last bucket: it comes a little early.
        let bucket = ((cost / BUCKET) as usize).clamp(tick, tick + BUCKETS - 1) % BUCKETS;
        let entry = self.entries;
        self.entries += 1;
        self.what[entry] = index as u32;
        self.next[entry] = self.heads[bucket];
        self.heads[bucket] = entry as u32;
    }

    fn spread(&mut self, index: usize, tick: usize) {
        let width = self.cells + 2;
        for neighbour in [index + 1, index - 1, index + width, index - width] {
            let step = self.step[neighbour];
            // The rim costs infinitely much and stays outside.
            if self.cost[neighbour] < f32::INFINITY || step == f32::INFINITY {
                continue;
            }
            let a = self.cost[neighbour - 1].min(self.cost[neighbour + 1]);
            let b = self.cost[neighbour - width].min(self.cost[neighbour + width]);
            self.offer(neighbour, arrival(a, b, step), tick);
        }
    }

    /// Cost to go from `point`, between the cells' centres by interpolation.
    pub fn cost(&self, point: Point) -> f64 {
        let n = self.cells as f64;
        let (column, row) = self.place(point);
        let (column, row) = ((column - 0.5).clamp(0.0, n - 1.001), (row - 0.5).clamp(0.0, n - 1.001));
        let (x, y) = (column as usize, row as usize);
        let (fx, fy) = (column - x as f64, row - y as f64);
        let at = |x: usize, y: usize| f64::from(self.cost[self.index(x, y)]);
        let lower = at(x, y) * (1.0 - fx) + at(x + 1, y) * fx;
        let upper = at(x, y + 1) * (1.0 - fx) + at(x + 1, y + 1) * fx;
        lower * (1.0 - fy) + upper * fy
    }

    /// Follows the steepest descent from `from` in steps of `step_m` into `path`, as far as it has room.
    pub fn descend(&self, from: Point, goal: Point, step_m: f64, path: &mut Vec<Point>) {
        path.clear();
        let mut here = from;
        let mut cost = self.cost(here);
        while path.len() < path.capacity() {
            path.push(here);
            if here.to(goal).length_m() <= step_m {
                break;
            }
            let probe = self.cell_m;
            let gx =
                self.cost(here.plus(Point::new(1.0, 0.0), probe)) - self.cost(here.plus(Point::new(-1.0, 0.0), probe));
            let gy =
                self.cost(here.plus(Point::new(0.0, 1.0), probe)) - self.cost(here.plus(Point::new(0.0, -1.0), probe));
            let slope = (gx * gx + gy * gy).sqrt();
            if slope < 1e-9 {
                break;
            }
            let next = Point::new(here.x_m - gx / slope * step_m, here.y_m - gy / slope * step_m);
            let after = self.cost(next);
            if after > cost + 0.5 * step_m {
                break;
            }
            (here, cost) = (next, after);
        }
    }
}

/// The upwind solution of |∇T| = step per cell from the neighbours' T.
fn arrival(a: f32, b: f32, step: f32) -> f32 {
    let least = a.min(b);
    let apart = (a - b).abs();
    if apart < step { 0.5 * (a + b + (2.0 * step * step - apart * apart).sqrt()) } else { least + step }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRICE: Price = Price { free_m: 0.4, blocked_m: 0.2, narrow: 4.0, blocked: 60.0 };

    fn guide(points: &[Point], goal: Point, robot: Point) -> Guide {
        let mut clearance = Clearance::new(80, 0.1);
        clearance.rebuild(Point::default(), points);
        let mut guide = Guide::new(80);
        guide.rebuild(&clearance, &PRICE, goal, robot, 4.0);
        guide
    }

    fn wall(from: Point, to: Point) -> impl Iterator<Item = Point> {
        (0..=100).map(move |k| from.plus(from.to(to), f64::from(k) / 100.0))
    }

    #[test]
    fn in_the_open_the_cost_is_the_distance() {
        let goal = Point::new(3.0, 2.0);
        let guide = guide(&[], goal, Point::new(-3.0, -3.0));
        for from in [Point::new(-3.0, -3.0), Point::new(0.0, 2.0), Point::new(2.0, -1.0)] {
            let (cost, exact) = (guide.cost(from), from.to(goal).length_m());
            assert!((cost - exact).abs() < 0.06 * exact + 0.1, "{cost} {exact}");
        }
    }

    #[test]
    fn the_way_leads_round_a_wall_with_room_to_spare() {
        let points: Vec<Point> = wall(Point::new(0.0, -4.0), Point::new(0.0, 1.5)).collect();
        let (from, goal) = (Point::new(-2.0, 0.0), Point::new(2.0, 0.0));
        let guide = guide(&points, goal, from);
        let mut path = Vec::with_capacity(200);
        guide.descend(from, goal, 0.05, &mut path);
        let last = path[path.len() - 1];
        assert!(last.to(goal).length_m() < 0.2, "{last:?}");
        let nearest = path.iter().flat_map(|p| points.iter().map(|q| p.to(*q).length_m())).fold(9.0, f64::min);
        assert!(nearest > 0.3, "{nearest}");
        assert!(guide.cost(from) > 4.9, "{}", guide.cost(from));
    }

    #[test]
    fn a_goal_beyond_the_raster_is_reached_over_its_edge() {
        let goal = Point::new(20.0, 0.0);
        let guide = guide(&[], goal, Point::default());
        let saved = guide.cost(Point::new(0.0, 0.0)) - guide.cost(Point::new(1.0, 0.0));
        assert!((saved - 1.0).abs() < 0.05, "{saved}");
    }

    #[test]
    fn a_robot_walled_in_is_led_through_the_thinnest_part_rather_than_nowhere() {
        let corner = |x, y| Point::new(x, y);
        let mut points: Vec<Point> = Vec::new();
        for (a, b) in [
            ((-1.0, -1.0), (1.0, -1.0)),
            ((1.0, -1.0), (1.0, 1.0)),
            ((1.0, 1.0), (-1.0, 1.0)),
            ((-1.0, 1.0), (-1.0, -1.0)),
        ] {
            points.extend(wall(corner(a.0, a.1), corner(b.0, b.1)));
        }
        let guide = guide(&points, Point::new(3.0, 0.0), Point::default());
        let cost = guide.cost(Point::default());
        assert!(cost.is_finite() && cost > guide.cost(Point::new(0.5, 0.0)));
    }
}
