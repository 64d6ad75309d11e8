//! What stands still: walls and posts, and the three questions that sensors and bodies ask of them.

use super::grid::{Entry, Grid};
use super::rays::Rays;
use super::sweep::View;
use crate::geometry::{Circle, Cone, ConeHit, Placed, Point, Segment};

/// A piece of surface and how it answers sound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// Where it is.
    pub segment: Segment,
    /// A rough surface scatters sound at any incidence; a smooth one reflects it away like a mirror.
    pub rough: bool,
}

/// A round obstacle that stands still.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Post {
    /// Where it is.
    pub circle: Circle,
    /// As for [`Wall`].
    pub rough: bool,
}

/// All that stands still in a world, indexed by place.
#[derive(Debug, Clone)]
pub struct Map {
    segments: Vec<Segment>,
    circles: Vec<Circle>,
    rough_segments: Vec<bool>,
    rough_circles: Vec<bool>,
    low: Point,
    high: Point,
    grid: Grid,
    rays: Rays,
}

/// A gap between a body and what is nearest to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Width of the gap; 0 when they overlap [m].
    pub distance_m: f64,
    /// Its end on the body, in the world.
    pub on_body: Point,
    /// Its end on the other thing, in the world.
    pub on_thing: Point,
}

impl Default for Map {
    fn default() -> Map {
        Map::new(&[], &[])
    }
}

impl Map {
    /// A map of walls and posts.
    pub fn new(walls: &[Wall], posts: &[Post]) -> Map {
        let segments: Vec<Segment> = walls.iter().map(|wall| wall.segment).collect();
        let circles: Vec<Circle> = posts.iter().map(|post| post.circle).collect();
        let mut low = Point::new(f64::INFINITY, f64::INFINITY);
        let mut high = -low;
        let mut include = |x: f64, y: f64| {
            low = Point::new(low.x_m.min(x), low.y_m.min(y));
            high = Point::new(high.x_m.max(x), high.y_m.max(y));
        };
        for segment in &segments {
            include(segment.a.x_m, segment.a.y_m);
            include(segment.b.x_m, segment.b.y_m);
        }
        for circle in &circles {
            include(circle.centre.x_m - circle.radius_m, circle.centre.y_m - circle.radius_m);
            include(circle.centre.x_m + circle.radius_m, circle.centre.y_m + circle.radius_m);
        }
        if segments.is_empty() && circles.is_empty() {
            (low, high) = (Point::ZERO, Point::ZERO);
        }
        let grid = Grid::new(low, high, &segments, &circles);
        let rays = Rays::new(low, high, &segments, &circles);
        let rough_segments = walls.iter().map(|wall| wall.rough).collect();
        let rough_circles = posts.iter().map(|post| post.rough).collect();
        Map { segments, circles, rough_segments, rough_circles, low, high, grid, rays }
    }

    /// Straight surfaces.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Round obstacles.
    pub fn circles(&self) -> &[Circle] {
        &self.circles
    }

    /// Lower left and upper right corner of everything.
    pub fn extent(&self) -> (Point, Point) {
        (self.low, self.high)
    }

    /// Distance along a ray to the first surface, if one is nearer than `reach_m`. `direction` is a unit vector.
    pub fn cast(&self, origin: Point, direction: Point, reach_m: f64) -> Option<f64> {
        self.rays.cast(origin, direction, reach_m)
    }

    /// Shortens each of `ranges_m` to where its ray of a fan meets a surface, if it does so before.
    pub(crate) fn sweep(&self, view: &View, ranges_m: &mut [f32]) {
        self.rays.sweep(view, ranges_m);
    }

    /// Hands every surface that a cone may meet within its reach to `hear`, with whether it is rough.
    ///
    /// `hear` answers how far it still wants to listen [m]; cells beyond are left out. A surface may come twice.
    pub(crate) fn listen(&self, cone: &Cone, mut hear: impl FnMut(ConeHit, bool) -> f64) {
        let grid = &self.grid;
        let half_diagonal = grid.cell_m * std::f64::consts::FRAC_1_SQRT_2;
        let mut inner = 0.0;
        let mut wanted = cone.reach_m;
        // A long wall is listed in many cells, most often one after the other.
        let mut last = usize::MAX;
        // Near bands first: most echoes are near, and then the far cells are never looked at.
        for outer in [1.0, 2.5, f64::INFINITY] {
            let outer = wanted.min(outer);
            if inner >= outer {
                return;
            }
            let (low, high) = sector_box(cone, inner, outer);
            let (left, right) = (grid.column(low.x_m), grid.column(high.x_m));
            for row in grid.row(low.y_m)..=grid.row(high.y_m) {
                for column in grid.filled(row, left, right) {
                    let to = grid.centre(column, row) - cone.apex;
                    let away2 = to.dot(to);
                    let farthest = wanted.min(outer) + half_diagonal;
                    let nearest = inner - half_diagonal;
                    if away2 > farthest * farthest
                        || (nearest > 0.0 && away2 < nearest * nearest)
                        || cone.right.cross(to) < -half_diagonal
                        || to.cross(cone.left) < -half_diagonal
                    {
                        continue;
                    }
                    for entry in grid.cell(column, row) {
                        let (hit, rough) = match entry {
                            Entry::Segment(k) if k == last => continue,
                            Entry::Segment(k) => {
                                last = k;
                                (cone.meet_segment(&self.segments[k]), self.rough_segments[k])
                            }
                            Entry::Circle(k) => (cone.meet_circle(&self.circles[k]), self.rough_circles[k]),
                        };
                        if let Some(hit) = hit {
                            wanted = wanted.min(hear(hit, rough));
                        }
                    }
                }
            }
            inner = outer;
        }
    }

    /// The surface nearest to an outline, if there is one within `within_m`.
    pub fn nearest(&self, body: &Placed, within_m: f64) -> Option<Nearest> {
        let grid = &self.grid;
        let half_diagonal = grid.cell_m * std::f64::consts::FRAC_1_SQRT_2;
        let mut best: Option<Nearest> = None;
        let mut wanted = within_m;
        let reach = body.radius_m + within_m;
        let centre = body.centre;
        // A long wall is listed in many cells; the walls of the last few need no second look.
        let mut looked_at = [usize::MAX; 4];
        let mut turn = 0;
        let (left, right) = (grid.column(centre.x_m - reach), grid.column(centre.x_m + reach));
        for row in grid.row(centre.y_m - reach)..=grid.row(centre.y_m + reach) {
            for column in grid.filled(row, left, right) {
                let to = grid.centre(column, row) - centre;
                let farthest = body.radius_m + wanted + half_diagonal;
                if to.dot(to) > farthest * farthest {
                    continue;
                }
                for entry in grid.cell(column, row) {
                    let gap = match entry {
                        Entry::Segment(k) => {
                            if looked_at.contains(&k) {
                                continue;
                            }
                            looked_at[turn] = k;
                            turn = (turn + 1) % looked_at.len();
                            let segment = &self.segments[k];
                            let apart = segment.nearest_to(centre) - centre;
                            let far = body.radius_m + wanted;
                            if apart.dot(apart) > far * far {
                                continue;
                            }
                            body.gap_to_segment(segment)
                        }
                        Entry::Circle(k) => {
                            let circle = &self.circles[k];
                            let apart = circle.centre - centre;
                            let far = body.radius_m + wanted + circle.radius_m;
                            if apart.dot(apart) > far * far {
                                continue;
                            }
                            body.gap_to_circle(circle)
                        }
                    };
                    if gap.0 <= wanted && best.is_none_or(|best| gap.0 < best.distance_m) {
                        wanted = gap.0;
                        best = Some(Nearest { distance_m: gap.0, on_body: gap.1, on_thing: gap.2 });
                    }
                }
            }
        }
        best
    }

    /// Hands the nearest point of every surface within `within_m` of `place`, as seen from there, to `each`. A surface
    /// that lies in several cells may come more than once.
    pub fn near(&self, place: Point, within_m: f64, mut each: impl FnMut(Point)) {
        let grid = &self.grid;
        let mut offer = |to: Point| {
            if to.dot(to) <= within_m * within_m {
                each(to);
            }
        };
        for row in grid.row(place.y_m - within_m)..=grid.row(place.y_m + within_m) {
            for column in grid.column(place.x_m - within_m)..=grid.column(place.x_m + within_m) {
                for entry in grid.cell(column, row) {
                    match entry {
                        Entry::Segment(k) => offer(self.segments[k].nearest_to(place) - place),
                        Entry::Circle(k) => {
                            let to = self.circles[k].centre - place;
                            let away_m = to.norm();
                            let share =
                                if away_m > 0.0 { (1.0 - self.circles[k].radius_m / away_m).max(0.0) } else { 0.0 };
                            offer(to * share);
                        }
                    }
                }
            }
        }
    }
}

/// Box around the part of a cone between two distances.
fn sector_box(cone: &Cone, inner_m: f64, outer_m: f64) -> (Point, Point) {
    // The tangent at the arc's middle closes the sector: its corners lie on the boundaries at outer / cos(half).
    let far = outer_m / cone.cos_half;
    let near = inner_m;
    let mut low = Point::new(f64::INFINITY, f64::INFINITY);
    let mut high = -low;
    for corner in [cone.left * far, cone.right * far, cone.left * near, cone.right * near] {
        low = Point::new(low.x_m.min(corner.x_m), low.y_m.min(corner.y_m));
        high = Point::new(high.x_m.max(corner.x_m), high.y_m.max(corner.y_m));
    }
    (cone.apex + low, cone.apex + high)
}
