//! Rays per second of the simulated laser's ray caster beside a hierarchy of boxes, on BARN worlds.
//!
//! `cargo run --release -p sinew-simulator --example rays -- [grids.txt] [worlds]`

use simulator::geometry::{Circle, Point};
use simulator::world::World;
use std::hint::black_box;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../robots/barn/worlds/barn_1.txt");
    let file = arguments.next().unwrap_or_else(|| shipped.to_owned());
    let text = std::fs::read_to_string(&file)?;
    let numbers: Vec<String> =
        text.lines().filter_map(|line| line.strip_prefix("world ").map(|n| n.trim().to_owned())).collect();
    let mut total = [0.0_f64; 2];
    let mut rays = 0.0;
    for number in numbers.iter().take(10) {
        let world = World::load(&format!("{file}#{number}"), &mut |_| Ok(text.clone().into_bytes()))?;
        let origins = places(&world);
        let beams: Vec<Point> =
            (0..720).map(|k| Point::unit((-135.0 + 270.0 * k as f64 / 719.0_f64).to_radians() + 1.57)).collect();
        let mut sum = 0.0;
        let before = cpu_s()?;
        for origin in &origins {
            for beam in &beams {
                sum += black_box(&world.map).cast(*origin, *beam, 30.0).unwrap_or(30.0);
            }
        }
        total[0] += cpu_s()? - before;
        rays += (origins.len() * beams.len()) as f64;
        let bvh = Boxes::new(world.map.circles());
        let mut other = 0.0;
        let before = cpu_s()?;
        for origin in &origins {
            for beam in &beams {
                other += black_box(&bvh).cast(*origin, *beam, 30.0).unwrap_or(30.0);
            }
        }
        total[1] += cpu_s()? - before;
        assert!((sum - other).abs() < 1e-6, "{sum} {other}");
        total[0] += 0.0;
        println!("{number}: mean range {:.2} m", sum / (origins.len() * beams.len()) as f64);
    }
    println!("grid {:.2} M rays/s, boxes {:.2} M rays/s", rays / total[0] * 1e-6, rays / total[1] * 1e-6);
    Ok(())
}

/// Free places of the walled run-up and the field, as a robot passes them.
fn places(world: &World) -> Vec<Point> {
    let mut found = Vec::new();
    for i in 0..20 {
        for j in 0..40 {
            let point = Point::new(-4.2 + 0.2 * i as f64, 0.5 + 0.25 * j as f64);
            let near = world.map.circles().iter().any(|c| (c.centre - point).norm() < c.radius_m + 0.25);
            if !near {
                found.push(point);
            }
        }
    }
    found
}

fn cpu_s() -> Result<f64, Box<dyn std::error::Error>> {
    let statistics = std::fs::read_to_string("/proc/self/schedstat")?;
    let nanoseconds: f64 = statistics.split_whitespace().next().unwrap_or_default().parse()?;
    Ok(nanoseconds * 1e-9)
}

/// A binary tree of boxes over circles, split at the median of the longer axis, near child first.
struct Boxes {
    nodes: Vec<Branch>,
    circles: Vec<Circle>,
}

struct Branch {
    low: Point,
    high: Point,
    /// First circle and count, or (count 0) the index of the right child.
    first: u32,
    count: u32,
}

impl Boxes {
    fn new(circles: &[Circle]) -> Boxes {
        let mut boxes = Boxes { nodes: Vec::new(), circles: circles.to_vec() };
        boxes.split(0, circles.len());
        boxes
    }

    fn split(&mut self, from: usize, to: usize) {
        let (mut low, mut high) = (Point::new(1e9, 1e9), Point::new(-1e9, -1e9));
        for circle in &self.circles[from..to] {
            low = Point::new(
                low.x_m.min(circle.centre.x_m - circle.radius_m),
                low.y_m.min(circle.centre.y_m - circle.radius_m),
            );
            high = Point::new(
                high.x_m.max(circle.centre.x_m + circle.radius_m),
                high.y_m.max(circle.centre.y_m + circle.radius_m),
            );
        }
        let at = self.nodes.len();
        self.nodes.push(Branch { low, high, first: from as u32, count: (to - from) as u32 });
        if to - from <= 3 {
            return;
        }
        let by_x = high.x_m - low.x_m > high.y_m - low.y_m;
        self.circles[from..to].sort_by(|a, b| {
            if by_x { a.centre.x_m.total_cmp(&b.centre.x_m) } else { a.centre.y_m.total_cmp(&b.centre.y_m) }
        });
        let middle = (from + to) / 2;
        self.split(from, middle);
        self.nodes[at].first = self.nodes.len() as u32;
        self.nodes[at].count = 0;
        self.split(middle, to);
    }

    fn cast(&self, origin: Point, direction: Point, reach_m: f64) -> Option<f64> {
        let inverse = Point::new(1.0 / direction.x_m, 1.0 / direction.y_m);
        let enter = |node: &Branch| {
            let (x1, x2) = ((node.low.x_m - origin.x_m) * inverse.x_m, (node.high.x_m - origin.x_m) * inverse.x_m);
            let (y1, y2) = ((node.low.y_m - origin.y_m) * inverse.y_m, (node.high.y_m - origin.y_m) * inverse.y_m);
            let near = x1.min(x2).max(y1.min(y2)).max(0.0);
            if near <= x1.max(x2).min(y1.max(y2)) { near } else { f64::INFINITY }
        };
        let mut stack = [(0u32, 0.0f64); 32];
        let mut top = 1;
        stack[0] = (0, enter(&self.nodes[0]));
        let mut best = reach_m;
        while top > 0 {
            top -= 1;
            let (index, near) = stack[top];
            if near >= best {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for circle in &self.circles[node.first as usize..(node.first + node.count) as usize] {
                    if let Some(distance) = circle.cast(origin, direction) {
                        best = best.min(distance);
                    }
                }
                continue;
            }
            let (left, right) = (index + 1, node.first);
            let (dl, dr) = (enter(&self.nodes[left as usize]), enter(&self.nodes[right as usize]));
            let (first, second) = if dl <= dr { ((left, dl), (right, dr)) } else { ((right, dr), (left, dl)) };
            if second.1 < best {
                stack[top] = second;
                top += 1;
            }
            if first.1 < best {
                stack[top] = first;
                top += 1;
            }
        }
        (best < reach_m).then_some(best)
    }
}
