//! A fan of rays against all that stands still, at once: an angular depth buffer over the cells around its origin.
//!
//! The cells are visited ring by ring outwards. A cell lies across few of the rays; when all of those end before it, it
//! is hidden and left out. What is in the others is drawn into the ranges: in the fan's frame a piece of wall from a to
//! b, b to the left of a, meets the ray along the unit vector u where
//!
//! t = a × (b − a) / u × (b − a),   if a × u ≥ 0 and u × b ≥ 0.
//!
//! Both conditions look at corners alone, so that no ray slips through where two walls share one. The sweep ends at the
//! ring that is farther than the longest range. The cost follows what is seen, not the rays times the cells on their way.

use super::rays::{LISTED, OUTSIDE, Rays};
use crate::geometry::{Circle, Fan, Point, Segment, bearing_rad, sides_rad};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Twice the area of the triangle between the origin and a wall that counts as seen end on [m²].
const END_ON_M2: f64 = 1e-9;

/// A fan where it stands.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    pub fan: &'a Fan,
    /// The fan's place in the world.
    pub origin: Point,
    /// Cosine and sine of the heading of the fan's frame.
    pub cos: f64,
    pub sin: f64,
}

/// An end of a wall.
#[derive(Debug, Clone, Copy)]
struct Corner {
    place: Point,
    /// In the fan's frame.
    seen: Point,
    bearing_rad: f64,
}

impl Corner {
    #[inline]
    fn new(view: &View, place: Point) -> Corner {
        let seen = view.seen_from_here(place);
        Corner { place, seen, bearing_rad: bearing_rad(seen) }
    }
}

/// A cell as it is seen.
struct Window {
    from_rad: f64,
    to_rad: f64,
    /// It is all around: nothing is to be cut off at its sides.
    around: bool,
}

impl Rays {
    /// Shortens each of `ranges_m` to where its ray meets a surface, if it does so before.
    pub fn sweep(&self, view: &View, ranges_m: &mut [f32]) {
        let rows = self.cells.len() as i32 / self.columns;
        let at = (view.origin - self.low) * self.inverse;
        let (column, row) = (at.x_m as i32, at.y_m as i32);
        let is_inside = at.x_m >= 1.0 && at.y_m >= 1.0 && column < self.columns - 1 && row < rows - 1;
        if !is_inside {
            return self.cast_each(view, ranges_m);
        }
        // From the origin to the four sides of its own cell [cells].
        let (right, up) = (f64::from(column + 1) - at.x_m, f64::from(row + 1) - at.y_m);
        let sides = [1.0 - right, right, 1.0 - up, up];
        let middle = self.cells[(row * self.columns + column) as usize];
        // Nothing is in the cells that are nearer than the first one that holds something.
        let first = if middle < LISTED { middle as i32 } else { 0 };
        let last = [column - 1, self.columns - 2 - column, row - 1, rows - 2 - row].into_iter().max().unwrap_or(0);
        let mut farthest_m = longest(ranges_m);
        for ring in first..=last {
            let gap_m = sides.map(|side| (f64::from(ring - 1) + side).max(0.0) * self.cell_m);
            if gap_m.into_iter().fold(f64::INFINITY, f64::min) > farthest_m {
                break;
            }
            let mut drawn = false;
            let columns = (column - ring).max(1)..(column + ring + 1).min(self.columns - 1);
            for (row, gap_m) in [(row - ring, gap_m[2]), (row + ring, gap_m[3])] {
                if row >= 1 && row < rows - 1 && gap_m <= farthest_m {
                    let from = row * self.columns;
                    drawn |= self.side(view, from + columns.start..from + columns.end, 1, ranges_m);
                }
                if ring == 0 {
                    break;
                }
            }
            let inner = (row - ring + 1).max(1)..(row + ring).min(rows - 1);
            for (column, gap_m) in [(column - ring, gap_m[0]), (column + ring, gap_m[1])] {
                if column >= 1 && column < self.columns - 1 && gap_m <= farthest_m && !inner.is_empty() {
                    let cells = inner.start * self.columns + column..(inner.end - 1) * self.columns + column + 1;
                    drawn |= self.side(view, cells, self.columns, ranges_m);
                }
            }
            if drawn {
                farthest_m = longest(ranges_m);
            }
        }
    }

    fn cast_each(&self, view: &View, ranges_m: &mut [f32]) {
        for (range_m, direction) in ranges_m.iter_mut().zip(&view.fan.directions) {
            let reach_m = f64::from(*range_m);
            if let Some(hit_m) = self.cast(view.origin, direction.turned(view.cos, view.sin), reach_m) {
                *range_m = range_m.min(hit_m as f32);
            }
        }
    }

    /// One side of a ring: every `step`th of `cells`. Answers whether anything was drawn.
    #[inline]
    fn side(&self, view: &View, cells: Range<i32>, step: i32, ranges_m: &mut [f32]) -> bool {
        let mut drawn = false;
        let mut cell = cells.start;
        while cell < cells.end {
            let code = self.cells[cell as usize];
            if code < LISTED {
                // All cells less than `code` away are empty.
                cell = cell.saturating_add(step.saturating_mul(code.max(1) as i32));
                continue;
            }
            if code != OUTSIDE {
                drawn |= self.draw(view, cell, code, ranges_m);
            }
            cell += step;
        }
        drawn
    }

    /// Draws what a cell holds, unless it is hidden.
    fn draw(&self, view: &View, cell: i32, code: u32, ranges_m: &mut [f32]) -> bool {
        let half_m = 0.5 * self.cell_m;
        let (column, row) = (cell % self.columns, cell / self.columns);
        let middle = Point::new(f64::from(column) + 0.5, f64::from(row) + 0.5) * self.cell_m + self.low - view.origin;
        let beside = Point::new((middle.x_m.abs() - half_m).max(0.0), (middle.y_m.abs() - half_m).max(0.0));
        let nearest_m = beside.norm() as f32;
        let to = middle.turned(view.cos, -view.sin);
        if view.fan.is_behind(to, self.cell_m * std::f64::consts::FRAC_1_SQRT_2) {
            return false;
        }
        let (from_rad, to_rad) = sides_rad(to, self.cell_m * std::f64::consts::FRAC_1_SQRT_2);
        let mut seen = false;
        view.fan.between(from_rad, to_rad, |run| seen |= ranges_m[run].iter().any(|range_m| *range_m >= nearest_m));
        if !seen {
            return false;
        }
        let window = Window { from_rad, to_rad, around: to_rad - from_rad >= TAU - 1e-9 };
        let list = self.lists[(code & !LISTED) as usize];
        // Walls follow one another in the list: the next one begins where the last one has ended.
        let mut last = Corner::new(view, Point::new(f64::NAN, f64::NAN));
        for segment in &self.segments[list.segments.0 as usize..list.segments.1 as usize] {
            let first = if segment.a == last.place { last } else { Corner::new(view, segment.a) };
            last = Corner::new(view, segment.b);
            view.draw_segment(first, last, &window, self.cell_m, ranges_m);
        }
        for circle in &self.circles[list.circles.0 as usize..list.circles.1 as usize] {
            view.draw_circle(circle, ranges_m);
        }
        true
    }
}

impl View<'_> {
    fn seen_from_here(&self, point: Point) -> Point {
        (point - self.origin).turned(self.cos, -self.sin)
    }

    #[inline]
    fn draw_segment(&self, first: Corner, last: Corner, window: &Window, cell_m: f64, ranges_m: &mut [f32]) {
        if self.fan.is_behind(first.seen, 0.0) && self.fan.is_behind(last.seen, 0.0) {
            return;
        }
        let (right, left) = if first.seen.cross(last.seen) < 0.0 { (last, first) } else { (first, last) };
        let (a, b) = (right.seen, left.seen);
        let along = b - a;
        let area = a.cross(along);
        if area < END_ON_M2 {
            // Seen end on, or from its own line: each ray has to say for itself.
            let seen = Segment::new(a, b);
            for (range_m, u) in ranges_m.iter_mut().zip(&self.fan.directions) {
                if let Some(hit_m) = seen.cast(Point::ZERO, *u) {
                    *range_m = range_m.min(hit_m as f32);
                }
            }
            return;
        }
        let (from_rad, mut to_rad) = (right.bearing_rad, left.bearing_rad);
        if to_rad < from_rad {
            // The two are exchanged by the error of the bearings, or lie on both sides of the frame's back.
            to_rad = if from_rad - to_rad < 1e-3 { from_rad } else { to_rad + TAU };
        }
        let meet = |run: Range<usize>| {
            for (range_m, u) in ranges_m[run.clone()].iter_mut().zip(&self.fan.directions[run]) {
                let across = u.cross(along);
                if a.cross(*u) >= 0.0 && u.cross(b) >= 0.0 && across > 0.0 {
                    *range_m = range_m.min((area / across) as f32);
                }
            }
        };
        self.clipped(from_rad, to_rad, window, along.dot(along) > cell_m * cell_m, meet);
    }

    /// The rays between two bearings; those within the window alone where that pays.
    #[inline]
    fn clipped(&self, from_rad: f64, to_rad: f64, window: &Window, long: bool, mut each: impl FnMut(Range<usize>)) {
        if !long || window.around || to_rad - from_rad > PI - 1e-3 {
            return self.fan.between(from_rad, to_rad, each);
        }
        for turn in [-TAU, 0.0, TAU] {
            let (from_rad, to_rad) = ((from_rad + turn).max(window.from_rad), (to_rad + turn).min(window.to_rad));
            if from_rad <= to_rad {
                self.fan.between(from_rad, to_rad, &mut each);
            }
        }
    }

    #[inline]
    fn draw_circle(&self, circle: &Circle, ranges_m: &mut [f32]) {
        let seen = Circle::new(self.seen_from_here(circle.centre), circle.radius_m);
        self.fan.across(seen.centre, seen.radius_m, |run| {
            for (range_m, u) in ranges_m[run.clone()].iter_mut().zip(&self.fan.directions[run]) {
                if let Some(hit_m) = seen.cast(Point::ZERO, *u) {
                    *range_m = range_m.min(hit_m as f32);
                }
            }
        });
    }
}

/// The greatest of the ranges [m].
fn longest(ranges_m: &[f32]) -> f64 {
    // Eight at a time: one after the other they would wait for each other.
    let mut lanes = [0.0_f32; 8];
    let chunks = ranges_m.chunks_exact(lanes.len());
    let mut most = chunks.remainder().iter().fold(0.0_f32, |most, range_m| most.max(*range_m));
    for chunk in chunks {
        for (lane, range_m) in lanes.iter_mut().zip(chunk) {
            *lane = if *range_m > *lane { *range_m } else { *lane };
        }
    }
    for lane in lanes {
        most = most.max(lane);
    }
    f64::from(most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Chance, Purpose};
    use crate::world::{Map, Post, Wall, World};

    /// Fans over all widths, from a quarter to all around, in frames turned every way.
    fn fans(chance: &mut Chance) -> Fan {
        let rays = 2 + (chance.share() * 400.0) as usize;
        let wide_rad = TAU * (0.1 + 0.9 * chance.share());
        Fan::new(Point::ZERO, PI * chance.either_way(), wide_rad / rays as f64, rays)
    }

    fn assert_all_met(map: &Map, fan: &Fan, origin: Point, heading_rad: f64, reach_m: f32, what: &str) {
        let heading = Point::unit(heading_rad);
        let view = View { fan, origin, cos: heading.x_m, sin: heading.y_m };
        let mut ranges_m = vec![reach_m; fan.directions.len()];
        map.sweep(&view, &mut ranges_m);
        for (range_m, direction) in ranges_m.iter().zip(&fan.directions) {
            let direction = direction.turned(view.cos, view.sin);
            let walls = map.segments().iter().filter_map(|wall| wall.cast(origin, direction));
            let posts = map.circles().iter().filter_map(|post| post.cast(origin, direction));
            let wanted_m = walls.chain(posts).fold(f64::from(reach_m), f64::min);
            let off_m = (f64::from(*range_m) - wanted_m).abs();
            assert!(off_m < 1e-5 * wanted_m.max(0.1), "{what}: {range_m} {wanted_m} along {direction:?}");
        }
    }

    #[test]
    fn a_sweep_reads_what_asking_every_wall_and_post_with_every_ray_reads() {
        for seed in 0..300 {
            let mut chance = Chance::new(seed, Purpose::Layout, 99);
            let size_m = 2.0 + 28.0 * chance.share();
            let point = |chance: &mut Chance| Point::new(size_m * chance.share(), size_m * chance.share());
            let walls: Vec<Wall> = (0..(chance.share() * 80.0) as usize)
                .map(|k| {
                    let a = point(&mut chance);
                    // Long ones and short ones, and some along the axes.
                    let to = point(&mut chance) - a;
                    let b = match k % 4 {
                        0 => a + to,
                        1 => a + Point::new(to.x_m, 0.0),
                        _ => a + to * (0.3 / to.norm()),
                    };
                    Wall { segment: Segment::new(a, b), rough: false }
                })
                .collect();
            let posts: Vec<Post> = (0..(chance.share() * 60.0) as usize)
                .map(|_| {
                    let radius_m = 0.02 + chance.share();
                    Post { circle: Circle::new(point(&mut chance), radius_m), rough: false }
                })
                .collect();
            let map = Map::new(&walls, &posts);
            for turn in 0..4 {
                let fan = fans(&mut chance);
                // The last one looks from outside.
                let origin = if turn == 3 { Point::new(-1.0, 1.3 * size_m) } else { point(&mut chance) };
                let reach_m = 1.0 + 30.0 * chance.share() as f32;
                let heading_rad = PI * chance.either_way();
                assert_all_met(&map, &fan, origin, heading_rad, reach_m, &format!("seed {seed} turn {turn}"));
            }
        }
    }

    #[test]
    fn a_sweep_is_exact_in_made_worlds_too() {
        for name in ["cave:3", "office:7", "rooms:2", "corridors:5:60x40"] {
            let world = World::load(name, &mut |_| Err("it is made".into())).unwrap();
            let mut chance = Chance::new(1, Purpose::Layout, 98);
            let (low, high) = world.map.extent();
            let size = high - low;
            for _ in 0..20 {
                let origin = low + Point::new(size.x_m * chance.share(), size.y_m * chance.share());
                let fan = fans(&mut chance);
                assert_all_met(&world.map, &fan, origin, PI * chance.either_way(), 8.0, name);
            }
        }
    }

    #[test]
    fn no_ray_slips_through_a_corner_and_walls_seen_from_their_own_line_are_met() {
        let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(x, y)| Point::new(x, y));
        let side = |k: usize| Wall { segment: Segment::new(corners[k], corners[(k + 1) % 4]), rough: false };
        let map = Map::new(&[side(0), side(1), side(2), side(3)], &[]);
        // Rays through all four corners.
        let fan = Fan::new(Point::ZERO, -PI, TAU / 64.0, 64);
        assert_all_met(&map, &fan, Point::ZERO, 0.0, 9.0, "corners");
        let line =
            Map::new(&[Wall { segment: Segment::new(Point::new(1.0, 0.0), Point::new(2.0, 0.0)), rough: false }], &[]);
        let mut ranges_m = vec![9.0; 64];
        line.sweep(&View { fan: &fan, origin: Point::ZERO, cos: 1.0, sin: 0.0 }, &mut ranges_m);
        assert_eq!(ranges_m.iter().filter(|range_m| **range_m < 9.0).count(), 1, "end on: {ranges_m:?}");
        let mut ranges_m = vec![9.0; 64];
        line.sweep(&View { fan: &fan, origin: Point::new(1.5, 0.0), cos: 1.0, sin: 0.0 }, &mut ranges_m);
        assert!(ranges_m.iter().all(|range_m| *range_m == 0.0), "from the wall itself: {ranges_m:?}");
    }
}
