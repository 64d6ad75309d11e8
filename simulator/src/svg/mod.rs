//! A run as a picture: map, people's ways, track coloured by speed, contacts, sonar, and S1's display of forces.
//!
//! Pure: data in, SVG text out. [`render`] lays the picture out: the map on the left, beside it the display of forces
//! (a triangle per sonar whose length is the force M, the threshold M = 1 as a ring) and the run's facts, below it the
//! legend with colour bar and scale bar.

mod canvas;
mod force;
mod legend;
mod map;
mod track;

use crate::geometry::{Circle, Footprint, Point, Pose};
use crate::world::World;
use canvas::Canvas;
use messages::Contact;

/// Where a body was, and how fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPoint {
    /// In the world [m].
    pub x_m: f64,
    /// In the world [m].
    pub y_m: f64,
    /// Magnitude of the forward speed [m/s].
    pub speed_m_s: f64,
}

/// A sonar beam in the body's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SonarBeam {
    /// Where the disc sits, ahead [m].
    pub origin_x_m: f64,
    /// Where the disc sits, to the left [m].
    pub origin_y_m: f64,
    /// Direction of its axis [rad].
    pub bearing_rad: f64,
    /// What it read; `None` without an echo [m].
    pub range_m: Option<f64>,
}

/// The force that one sonar exerts (S1: M = (a − b·d)/T_s; above 1 it is acted upon).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SonarForce {
    /// Direction of the sonar's axis in the body's frame [rad].
    pub bearing_rad: f64,
    /// M.
    pub force: f64,
}

/// The robot at the end of the run.
#[derive(Debug, Clone, Copy)]
pub struct RobotPicture<'a> {
    /// Its pose in the world.
    pub pose: Pose,
    /// Its outline.
    pub footprint: &'a Footprint,
    /// Its sonar beams; empty for none.
    pub beams: &'a [SonarBeam],
    /// The forces that its sonars exert; empty for no display of forces.
    pub forces: &'a [SonarForce],
}

/// Everything in a picture.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// The world.
    pub world: &'a World,
    /// The people as they stand at the end.
    pub persons: &'a [Circle],
    /// Where each of them went; empty where that is not known.
    pub ways: &'a [Vec<Point>],
    /// Where the robot was, in order.
    pub track: &'a [TrackPoint],
    /// What it touched.
    pub contacts: &'a [Contact],
    /// The robot itself.
    pub robot: Option<RobotPicture<'a>>,
    /// One line above the picture.
    pub title: &'a str,
    /// Name and value of each fact beside the map.
    pub facts: &'a [(&'a str, String)],
}

/// Longer side of the map [px], and the space around everything [px].
const MAP_PX: f64 = 900.0;
const MARGIN_PX: f64 = 28.0;
/// Height of the title and of the legend [px].
const TITLE_PX: f64 = 34.0;
const LEGEND_PX: f64 = 66.0;
/// Width of what stands beside the map [px].
const SIDE_PX: f64 = 270.0;
/// Space around the world within the map [m].
const EDGE_M: f64 = 0.25;

/// Draws the picture.
pub fn render(picture: &Picture) -> String {
    let (low, high) = extent(picture);
    let (width_m, height_m) = (high.x_m - low.x_m, high.y_m - low.y_m);
    let scale = MAP_PX / width_m.max(height_m);
    let (map_width, map_height) = (width_m * scale, height_m * scale);
    let forces = picture.robot.map_or(&[][..], |robot| robot.forces);
    let beside = !forces.is_empty() || !picture.facts.is_empty();
    let side = if beside { SIDE_PX + MARGIN_PX } else { 0.0 };
    // A narrow map still needs room for its legend.
    let width = 2.0 * MARGIN_PX + map_width.max(legend::WIDTH_PX) + side;
    let force_height = if forces.is_empty() { 0.0 } else { force::HEIGHT_PX };
    let facts_height = picture.facts.len() as f64 * legend::FACT_PX + 20.0;
    let height = 2.0 * MARGIN_PX + TITLE_PX + (map_height + LEGEND_PX).max(force_height + facts_height);

    let mut canvas = Canvas::new(width, height);
    canvas.text((MARGIN_PX, MARGIN_PX + 14.0), "title", picture.title);
    canvas.open_group((MARGIN_PX, MARGIN_PX + TITLE_PX));
    let view = canvas::View { low, scale, height_px: map_height };
    map::draw(&mut canvas, &view, picture, (map_width, map_height));
    map::draw_ways(&mut canvas, &view, picture);
    let fastest_m_s = track::draw(&mut canvas, &view, picture.track);
    map::draw_persons(&mut canvas, &view, picture);
    track::draw_start(&mut canvas, &view, picture.track);
    if let Some(robot) = &picture.robot {
        map::draw_robot(&mut canvas, &view, robot);
    }
    map::draw_contacts(&mut canvas, &view, picture.contacts);
    canvas.close_group();
    canvas.open_group((MARGIN_PX, MARGIN_PX + TITLE_PX + map_height));
    legend::draw(&mut canvas, scale, fastest_m_s, picture);
    canvas.close_group();
    let side_x = 2.0 * MARGIN_PX + map_width.max(legend::WIDTH_PX);
    canvas.open_group((side_x, MARGIN_PX + TITLE_PX));
    if let Some(robot) = picture.robot.filter(|_| !forces.is_empty()) {
        force::draw(&mut canvas, SIDE_PX, &robot);
    }
    canvas.close_group();
    canvas.open_group((side_x, MARGIN_PX + TITLE_PX + force_height));
    legend::draw_facts(&mut canvas, SIDE_PX, picture.facts);
    canvas.close_group();
    canvas.finish()
}

/// Lower left and upper right corner of all that is drawn on the map.
fn extent(picture: &Picture) -> (Point, Point) {
    let (mut low, mut high) = picture.world.map.extent();
    if picture.world.map.segments().is_empty() && picture.world.map.circles().is_empty() {
        let start = picture.track.first().map_or(Point::ZERO, |point| Point::new(point.x_m, point.y_m));
        (low, high) = (start - Point::new(1.0, 1.0), start + Point::new(1.0, 1.0));
    }
    let gone = picture.ways.iter().flatten().copied();
    let ways = picture.world.persons.iter().flat_map(|person| person.path.iter().copied()).chain(gone);
    let track = picture.track.iter().map(|point| Point::new(point.x_m, point.y_m));
    for Point { x_m, y_m } in ways.chain(track) {
        low = Point::new(low.x_m.min(x_m), low.y_m.min(y_m));
        high = Point::new(high.x_m.max(x_m), high.y_m.max(y_m));
    }
    (low - Point::new(EDGE_M, EDGE_M), high + Point::new(EDGE_M, EDGE_M))
}
