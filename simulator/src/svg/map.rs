//! The map's own layer: floor, obstacles, people, robot with its sonar, contacts.

use super::canvas::{Canvas, View};
use super::{Picture, RobotPicture};
use crate::geometry::Point;
use crate::world::Course;
use messages::{Contact, ContactCause};

/// Distance between the grid's lines [m].
const GRID_M: f64 = 1.0;
/// Half angle at which a sonar's cone is drawn [rad], and its length where nothing answered [m].
const CONE_RAD: f64 = 0.2618;
const SILENT_M: f64 = 1.5;

pub(super) fn draw(canvas: &mut Canvas, view: &View, picture: &Picture, size: (f64, f64)) {
    canvas.rect((0.0, 0.0), size, "floor");
    let right_m = view.low.x_m + size.0 / view.scale;
    let top_m = view.low.y_m + size.1 / view.scale;
    for k in (view.low.x_m / GRID_M).ceil() as i64..=(right_m / GRID_M).floor() as i64 {
        let (x, _) = view.at(Point::new(k as f64 * GRID_M, 0.0));
        canvas.line((x, 0.0), (x, size.1), "grid");
    }
    for k in (view.low.y_m / GRID_M).ceil() as i64..=(top_m / GRID_M).floor() as i64 {
        let (_, y) = view.at(Point::new(0.0, k as f64 * GRID_M));
        canvas.line((0.0, y), (size.0, y), "grid");
    }
    let world = picture.world;
    for solid in &world.solids {
        canvas.polygon(solid.outline.iter().map(|point| view.at(*point)), "solid");
    }
    for segment in world.map.segments() {
        canvas.line(view.at(segment.a), view.at(segment.b), "wall");
    }
    for circle in world.map.circles() {
        canvas.circle(view.at(circle.centre), circle.radius_m * view.scale, "post");
    }
    // Where the ways are known, the paths that were meant would only hide them.
    for person in world.persons.iter().filter(|_| picture.ways.is_empty()) {
        let closing = person.path.first().copied().filter(|_| person.course == Course::Loop);
        canvas.polyline(person.path.iter().copied().chain(closing).map(|point| view.at(point)), "way", "");
    }
}

/// Draws where the people went, a ring where each began.
pub(super) fn draw_ways(canvas: &mut Canvas, view: &View, picture: &Picture) {
    for way in picture.ways {
        canvas.polyline(way.iter().map(|point| view.at(*point)), "trace", "");
        if let Some(first) = way.first() {
            canvas.circle(view.at(*first), 3.0, "begun");
        }
    }
}

pub(super) fn draw_persons(canvas: &mut Canvas, view: &View, picture: &Picture) {
    for disc in picture.persons {
        canvas.circle(view.at(disc.centre), disc.radius_m * view.scale, "person");
    }
}

pub(super) fn draw_robot(canvas: &mut Canvas, view: &View, robot: &RobotPicture) {
    let at = |point: Point| view.at(robot.pose.world_from_body(point));
    for beam in robot.beams {
        let origin = Point::new(beam.origin_x_m, beam.origin_y_m);
        let side = |aside: f64, far: f64| at(origin + Point::unit(beam.bearing_rad + aside) * far);
        let (far, class) = beam.range_m.map_or((SILENT_M, "silent"), |range| (range, "beam"));
        canvas.polygon([at(origin), side(-CONE_RAD, far), side(CONE_RAD, far)].into_iter(), class);
    }
    canvas.polygon(robot.footprint.corners().iter().map(|corner| at(*corner)), "robot");
    let ahead_m = robot.footprint.corners().iter().map(|corner| corner.x_m).fold(0.0, f64::max);
    let nose = [(0.85, 0.0), (0.25, 0.45), (0.25, -0.45)].map(|(x, y)| at(Point::new(x, y) * ahead_m));
    canvas.polygon(nose.into_iter(), "nose");
}

pub(super) fn draw_contacts(canvas: &mut Canvas, view: &View, contacts: &[Contact]) {
    for contact in contacts {
        mark(canvas, view.at(Point::new(contact.x_m, contact.y_m)), contact.cause == ContactCause::Suffered as u64);
    }
}

/// A cross for a contact that the robot caused, a ring for one that it suffered.
pub(super) fn mark(canvas: &mut Canvas, (x, y): (f64, f64), suffered: bool) {
    const ARM_PX: f64 = 5.0;
    if suffered {
        canvas.circle((x, y), ARM_PX + 1.0, "suffered");
    } else {
        canvas.line((x - ARM_PX, y - ARM_PX), (x + ARM_PX, y + ARM_PX), "caused");
        canvas.line((x - ARM_PX, y + ARM_PX), (x + ARM_PX, y - ARM_PX), "caused");
    }
}
