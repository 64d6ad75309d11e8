//! Where the robots of a swarm begin: free places, drawn from the seed.
//!
//! Where the world has starts, only what can be reached from the first one counts: a flood over square cells as wide as
//! a robot's radius (wider in worlds of more than a million of them) tells.

use super::SwarmError;
use crate::geometry::{Point, Pose};
use crate::noise::{Chance, Purpose};
use crate::world::World;
use std::f64::consts::PI;

/// Draws for each robot before the world counts as full.
const DRAWS: usize = 400;
/// Cells of the flood.
const MAX_CELLS: f64 = 1e6;
/// Room that a robot keeps at the beginning beyond its radius [m].
const ROOM_M: f64 = 0.01;

/// `count` poses.
pub(super) fn draw(world: &World, radius_m: f64, count: usize, seed: u64) -> Result<Vec<Pose>, SwarmError> {
    if count == 0 {
        return Err(SwarmError::NoRobots);
    }
    let (low, high) = world.map.extent();
    let size = high - low;
    if !(size.x_m > 2.0 * radius_m && size.y_m > 2.0 * radius_m) {
        return Err(SwarmError::NoArea { world: world.name.clone() });
    }
    let reached = Flood::new(world, radius_m);
    let insides = Insides::new(world);
    let mut chance = Chance::new(seed, Purpose::Swarm, usize::MAX >> 33);
    let mut taken = Taken::new(low, size, radius_m, count);
    let mut poses = Vec::with_capacity(count);
    for _ in 0..count {
        let found = (0..DRAWS).find_map(|_| {
            let place = Point::new(low.x_m + size.x_m * chance.share(), low.y_m + size.y_m * chance.share());
            let heading_rad = PI * chance.either_way();
            let free = reached.holds(place)
                && is_clear(world, place, radius_m + ROOM_M)
                && taken.is_free(place)
                && !insides.hold(place);
            free.then_some(Pose::new(place.x_m, place.y_m, heading_rad))
        });
        let Some(pose) = found else {
            let (placed, world) = (poses.len(), world.name.clone());
            return Err(SwarmError::Full { wanted: count, placed, radius_m, world });
        };
        taken.add(pose.place());
        poses.push(pose);
    }
    // Who is near in space is near in memory: one after the other they look at the same walls and at each other.
    poses.sort_by_key(|pose| along_the_curve(pose.place() - low));
    Ok(poses)
}

/// Place of a point on the Z-order curve through square metres (Morton 1966): x and y with their bits interleaved.
fn along_the_curve(to: Point) -> u64 {
    let (x, y) = (to.x_m as u64, to.y_m as u64);
    (0..16).fold(0, |key, bit| key | (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1))
}

/// Refuses poses that are taken.
pub(super) fn check(world: &World, radius_m: f64, poses: &[Pose]) -> Result<(), SwarmError> {
    if poses.is_empty() {
        return Err(SwarmError::NoRobots);
    }
    let (mut low, mut high) = (poses[0].place(), poses[0].place());
    for pose in poses {
        low = Point::new(low.x_m.min(pose.x_m), low.y_m.min(pose.y_m));
        high = Point::new(high.x_m.max(pose.x_m), high.y_m.max(pose.y_m));
    }
    let mut taken = Taken::new(low, high - low, radius_m, poses.len());
    for (robot, pose) in poses.iter().enumerate() {
        let is_number = [pose.x_m, pose.y_m, pose.heading_rad].iter().all(|value| value.is_finite());
        if !(is_number && is_free(world, pose.place(), radius_m) && taken.is_free(pose.place())) {
            return Err(SwarmError::Occupied { robot, x_m: pose.x_m, y_m: pose.y_m });
        }
        taken.add(pose.place());
    }
    Ok(())
}

fn is_free(world: &World, place: Point, radius_m: f64) -> bool {
    is_clear(world, place, radius_m) && !world.is_solid(place)
}

/// Whether no surface is within `radius_m`.
fn is_clear(world: &World, place: Point, radius_m: f64) -> bool {
    let mut clear = true;
    world.map.near(place, radius_m, |_| clear = false);
    clear
}

/// Insides of obstacles by columns of the world: a large one has thousands of them.
struct Insides<'a> {
    world: &'a World,
    low_m: f64,
    per_m: f64,
    columns: Vec<Vec<u32>>,
}

impl<'a> Insides<'a> {
    fn new(world: &'a World) -> Insides<'a> {
        let (low, high) = world.map.extent();
        let count = world.solids.len().clamp(1, 4096);
        let per_m = count as f64 / (high.x_m - low.x_m).max(1e-3);
        let mut insides = Insides { world, low_m: low.x_m, per_m, columns: vec![Vec::new(); count] };
        for (index, solid) in world.solids.iter().enumerate() {
            let along = solid.outline.iter().map(|corner| corner.x_m);
            let (from, to) = (along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max));
            for column in insides.column(from)..=insides.column(to) {
                insides.columns[column].push(index as u32);
            }
        }
        insides
    }

    fn column(&self, x_m: f64) -> usize {
        (((x_m - self.low_m) * self.per_m) as usize).min(self.columns.len() - 1)
    }

    /// What [`World::is_solid`] says of a place that is clear of all surfaces.
    fn hold(&self, place: Point) -> bool {
        // Nobody who is clear of a post's surface is within it.
        self.columns[self.column(place.x_m)].iter().any(|index| self.world.solids[*index as usize].contains(place))
    }
}

/// Places of the robots so far, by cells of a robot's width.
struct Taken {
    low: Point,
    cell_m: f64,
    columns: i64,
    cells: std::collections::BTreeMap<i64, Vec<Point>>,
    apart_m: f64,
}

impl Taken {
    fn new(low: Point, size: Point, radius_m: f64, _count: usize) -> Taken {
        let cell_m = (2.0 * radius_m).max(1e-3);
        Taken {
            low,
            cell_m,
            columns: (size.x_m / cell_m) as i64 + 3,
            cells: Default::default(),
            apart_m: 2.0 * radius_m,
        }
    }

    fn cell(&self, place: Point) -> (i64, i64) {
        let at = |value: f64| (value / self.cell_m).floor() as i64 + 1;
        (at(place.x_m - self.low.x_m), at(place.y_m - self.low.y_m))
    }

    fn is_free(&self, place: Point) -> bool {
        let (column, row) = self.cell(place);
        let around = (-1..=1).flat_map(|up| (-1..=1).map(move |right| (column + right, row + up)));
        around.filter_map(|(column, row)| self.cells.get(&(row * self.columns + column))).flatten().all(|other| {
            let apart = *other - place;
            apart.dot(apart) >= self.apart_m * self.apart_m
        })
    }

    fn add(&mut self, place: Point) {
        let (column, row) = self.cell(place);
        self.cells.entry(row * self.columns + column).or_default().push(place);
    }
}

/// What can be reached.
struct Flood {
    low: Point,
    cell_m: f64,
    columns: usize,
    reached: Vec<bool>,
}

impl Flood {
    fn new(world: &World, radius_m: f64) -> Flood {
        let (low, high) = world.map.extent();
        let size = high - low;
        let cell_m = radius_m.max((size.x_m * size.y_m / MAX_CELLS).sqrt());
        let (columns, rows) = ((size.x_m / cell_m) as usize + 1, (size.y_m / cell_m) as usize + 1);
        let mut flood = Flood { low, cell_m, columns, reached: vec![world.starts.is_empty(); columns * rows] };
        let Some(start) = world.starts.first() else { return flood };
        let mut stack: Vec<usize> = flood.cell(start.pose.place()).into_iter().collect();
        let mut seen = vec![false; columns * rows];
        while let Some(cell) = stack.pop() {
            if std::mem::replace(&mut seen[cell], true) {
                continue;
            }
            let (column, row) = (cell % columns, cell / columns);
            let middle = low + Point::new((column as f64 + 0.5) * cell_m, (row as f64 + 0.5) * cell_m);
            // Solids are closed by walls: what is not inside at the start is never entered.
            if !is_clear(world, middle, radius_m) {
                continue;
            }
            flood.reached[cell] = true;
            stack.extend((column > 0).then(|| cell - 1));
            stack.extend((column + 1 < columns).then_some(cell + 1));
            stack.extend((row > 0).then(|| cell - columns));
            stack.extend((row + 1 < rows).then_some(cell + columns));
        }
        flood
    }

    fn cell(&self, place: Point) -> Option<usize> {
        let to = place - self.low;
        let (column, row) = (to.x_m / self.cell_m, to.y_m / self.cell_m);
        if column < 0.0 || row < 0.0 || column as usize >= self.columns {
            return None;
        }
        let cell = row as usize * self.columns + column as usize;
        (cell < self.reached.len()).then_some(cell)
    }

    fn holds(&self, place: Point) -> bool {
        self.cell(place).is_some_and(|cell| self.reached[cell])
    }
}
