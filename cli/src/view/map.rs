//! The map: walls, the robot with its heading, its track, what its rangers hear, where it was touched. Dots of braille,
//! two by four in a cell, so that a metre is as wide as it is high.

use super::watch::Picture;
use crate::simulation::TrackPoint;
use messages::{Beam, Echo};
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Span;
use ratatui::widgets::canvas::{Canvas, Context, Line, Points};
use runtime::robot::Body;
use simulator::geometry::{Point, Pose};
use simulator::world::World;

/// More beams than this are drawn as points alone.
const FEW_BEAMS: usize = 64;
/// Pieces of an echo's arc.
const ARC: usize = 6;
/// Corners of a drawn circle.
const ROUND: usize = 24;

/// Which part of the plane a map shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    centre: Point,
    /// Size of a dot [m].
    dot_m: f64,
    x: [f64; 2],
    y: [f64; 2],
}

impl Extent {
    /// All between two corners, as large as `area` allows.
    pub fn fit(low: Point, high: Point, area: Rect) -> Extent {
        let (columns, rows) = dots(area);
        let margin = 1.04;
        let size = high - low;
        let dot_m = (size.x_m * margin / columns).max(size.y_m * margin / rows).max(1e-3);
        Extent::of((low + high) * 0.5, dot_m, area)
    }

    /// What lies within `radius_m` of `centre`.
    pub fn around(centre: Point, radius_m: f64, area: Rect) -> Extent {
        let corner = Point::new(radius_m, radius_m);
        Extent::fit(centre - corner, centre + corner, area)
    }

    fn of(centre: Point, dot_m: f64, area: Rect) -> Extent {
        let (columns, rows) = dots(area);
        let half = Point::new(0.5 * dot_m * (columns - 1.0), 0.5 * dot_m * (rows - 1.0));
        Extent {
            centre,
            dot_m,
            x: [centre.x_m - half.x_m, centre.x_m + half.x_m],
            y: [centre.y_m - half.y_m, centre.y_m + half.y_m],
        }
    }
}

fn dots(area: Rect) -> (f64, f64) {
    (f64::from(area.width.max(1)) * 2.0, f64::from(area.height.max(1)) * 4.0)
}

/// What is drawn.
pub struct Map<'a> {
    /// Walls, where they are known.
    pub world: Option<&'a World>,
    /// The robot's outline.
    pub body: &'a Body,
    /// Where it is and what it hears.
    pub picture: &'a Picture,
    /// Where it was.
    pub track: &'a [TrackPoint],
    /// Whether beams are drawn.
    pub beams: bool,
}

impl Map<'_> {
    /// Corners of everything that there is to show.
    pub fn corners(&self) -> (Point, Point) {
        match self.world {
            Some(world) => world.map.extent(),
            None => {
                let mut low = Point::new(-2.0, -2.0);
                let mut high = Point::new(2.0, 2.0);
                for point in self.track {
                    let Point { x_m, y_m } = Point::new(point.truth.x_m, point.truth.y_m);
                    low = Point::new(low.x_m.min(x_m - 1.0), low.y_m.min(y_m - 1.0));
                    high = Point::new(high.x_m.max(x_m + 1.0), high.y_m.max(y_m + 1.0));
                }
                (low, high)
            }
        }
    }

    /// Draws the part `extent` into `area`.
    pub fn render(&self, frame: &mut ratatui::Frame<'_>, area: Rect, extent: Extent) {
        let canvas = Canvas::default()
            .marker(Marker::Braille)
            .x_bounds(extent.x)
            .y_bounds(extent.y)
            .paint(|context| self.paint(context, &extent));
        frame.render_widget(canvas, area);
    }

    fn paint(&self, context: &mut Context<'_>, extent: &Extent) {
        // What is painted later gives a cell its colour: the robot last.
        if let Some(world) = self.world {
            walls(context, world);
        }
        if let Some(pose) = self.picture.pose {
            if self.beams {
                self.paint_beams(context, pose);
            }
            self.paint_track(context);
            self.paint_robot(context, pose, extent);
        }
        for contact in &self.picture.contacts {
            let mark = Span::styled("×", Style::new().fg(Color::Red));
            context.print(contact.x_m, contact.y_m, mark);
        }
    }

    fn paint_track(&self, context: &mut Context<'_>) {
        let points: Vec<(f64, f64)> = self.track.iter().map(|point| (point.truth.x_m, point.truth.y_m)).collect();
        context.draw(&Points { coords: &points, color: Color::Blue });
    }

    fn paint_beams(&self, context: &mut Context<'_>, pose: Pose) {
        let few = self.picture.beams.len() <= FEW_BEAMS;
        let mut echoes: Vec<(f64, f64)> = Vec::new();
        for (beam, max_range_m, width_rad) in &self.picture.beams {
            let Some(range_m) = heard_m(beam) else { continue };
            let origin = Point::new(f64::from(beam.origin_x_m), f64::from(beam.origin_y_m));
            let at = |angle_rad: f64| {
                let place = pose.world_from_body(origin + Point::unit(angle_rad) * range_m);
                (place.x_m, place.y_m)
            };
            let bearing_rad = f64::from(beam.bearing_rad);
            if few && range_m < *max_range_m {
                let (from, to) = (pose.world_from_body(origin), at(bearing_rad));
                let line = Line { x1: from.x_m, y1: from.y_m, x2: to.0, y2: to.1, color: Color::DarkGray };
                context.draw(&line);
            }
            if *width_rad == 0.0 {
                echoes.push(at(bearing_rad));
                continue;
            }
            // Somewhere on this arc: a cone does not tell where.
            let end = |k: usize| at(bearing_rad + (k as f64 / ARC as f64 - 0.5) * width_rad);
            for k in 0..ARC {
                let (from, to) = (end(k), end(k + 1));
                context.draw(&Line { x1: from.0, y1: from.1, x2: to.0, y2: to.1, color: Color::Yellow });
            }
        }
        context.draw(&Points { coords: &echoes, color: Color::Yellow });
    }

    fn paint_robot(&self, context: &mut Context<'_>, pose: Pose, extent: &Extent) {
        let Body { length_ahead_m: ahead, length_behind_m: behind, half_width_m: side, .. } = *self.body;
        let held = self.picture.motion.is_some_and(|motion| motion.stop != 0);
        let color = if held { Color::LightRed } else { Color::LightGreen };
        let corners = [(ahead, side), (-behind, side), (-behind, -side), (ahead, -side)];
        let corners = corners.map(|(x, y)| pose.world_from_body(Point::new(x, y)));
        for (k, from) in corners.iter().enumerate() {
            draw(context, *from, corners[(k + 1) % corners.len()], color);
        }
        // Long enough to be seen on a map of a whole building.
        let nose = pose.world_from_body(Point::new((2.0 * ahead).max(6.0 * extent.dot_m), 0.0));
        draw(context, pose.place(), nose, color);
    }
}

/// The distance that a beam reports.
fn heard_m(beam: &Beam) -> Option<f64> {
    (beam.echo == Echo::Value as u32 && beam.range_m.is_finite()).then_some(f64::from(beam.range_m))
}

fn walls(context: &mut Context<'_>, world: &World) {
    for segment in world.map.segments() {
        draw(context, segment.a, segment.b, Color::Reset);
    }
    for circle in world.map.circles() {
        let at = |k: usize| {
            let angle_rad = std::f64::consts::TAU * k as f64 / ROUND as f64;
            circle.centre + Point::unit(angle_rad) * circle.radius_m
        };
        (0..ROUND).for_each(|k| draw(context, at(k), at(k + 1), Color::Reset));
    }
}

fn draw(context: &mut Context<'_>, from: Point, to: Point, color: Color) {
    context.draw(&Line { x1: from.x_m, y1: from.y_m, x2: to.x_m, y2: to.y_m, color });
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn drawn(map: &Map<'_>, columns: u16, rows: u16) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(columns, rows)).unwrap();
        let area = Rect::new(0, 0, columns, rows);
        let (low, high) = map.corners();
        terminal.draw(|frame| map.render(frame, area, Extent::fit(low, high, area))).unwrap();
        let buffer = terminal.backend().buffer().clone();
        (0..rows).map(|y| (0..columns).map(|x| buffer[(x, y)].symbol().to_owned()).collect()).collect()
    }

    fn empty() -> Picture {
        Picture { pose: Some(Pose::new(0.0, 0.0, 0.0)), ..Picture::default() }
    }

    #[test]
    fn a_metre_is_as_wide_as_it_is_high() {
        let area = Rect::new(0, 0, 40, 10);
        let extent = Extent::fit(Point::new(0.0, 0.0), Point::new(10.0, 10.0), area);
        let (width, height) = (extent.x[1] - extent.x[0], extent.y[1] - extent.y[0]);
        assert!((width / 79.0 - height / 39.0).abs() < 1e-12, "{extent:?}");
        assert!(height >= 10.0 && (extent.centre.x_m - 5.0).abs() < 1e-12, "{extent:?}");
    }

    #[test]
    fn the_robot_points_where_it_heads() {
        let body = Body { length_ahead_m: 0.5, ..Body::default() };
        let (ahead, back) = (empty(), Picture { pose: Some(Pose::new(0.0, 0.0, 3.0)), ..empty() });
        // Cells from the middle to the first and to the last one that is not blank.
        let reach = |picture: &Picture| {
            let map = Map { world: None, body: &body, picture, track: &[], beams: false };
            let lines = drawn(&map, 40, 20);
            let columns =
                || lines.iter().flat_map(|line| line.chars().enumerate()).filter(|(_, c)| *c != ' ' && *c != '⠀');
            let first = columns().map(|(column, _)| column).min().unwrap();
            let last = columns().map(|(column, _)| column).max().unwrap();
            (20 - first, last - 19)
        };
        assert!(reach(&ahead).0 < reach(&ahead).1, "{:?}", reach(&ahead));
        assert!(reach(&back).0 > reach(&back).1, "{:?}", reach(&back));
    }

    #[test]
    fn walls_appear_where_the_world_has_them() {
        use simulator::geometry::Segment;
        use simulator::world::Wall;
        let corners = [Point::new(0.0, 0.0), Point::new(8.0, 0.0), Point::new(8.0, 8.0), Point::new(0.0, 8.0)];
        let walls: Vec<Wall> =
            (0..4).map(|k| Wall { segment: Segment::new(corners[k], corners[(k + 1) % 4]), rough: false }).collect();
        let (world, body, picture) = (World::of(&walls, &[]), Body::default(), Picture::default());
        let lines =
            drawn(&Map { world: Some(&world), body: &body, picture: &picture, track: &[], beams: true }, 30, 15);
        let blank = |line: &String| line.chars().all(|c| c == ' ' || c == '⠀');
        assert!(!blank(&lines[0]) && !blank(&lines[14]), "{lines:#?}");
        let middle: Vec<char> = lines[7].chars().filter(|c| *c != ' ' && *c != '⠀').collect();
        assert_eq!(middle.len(), 2, "{lines:#?}");
    }

    #[test]
    fn only_beams_that_heard_something_are_drawn() {
        let beam = |echo: Echo| Beam { range_m: 1.5, echo: echo as u32, ..Beam::default() };
        assert_eq!(heard_m(&beam(Echo::Value)), Some(1.5));
        assert_eq!(heard_m(&beam(Echo::Clear)), None);
        assert_eq!(heard_m(&Beam { range_m: f32::NAN, ..beam(Echo::Value) }), None);
    }
}
