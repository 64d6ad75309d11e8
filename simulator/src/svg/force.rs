//! S1's display: the robot with a triangle per sonar whose length is the force M, and the threshold M = 1 as a ring.

use super::RobotPicture;
use super::canvas::Canvas;
use crate::geometry::Point;
use std::f64::consts::FRAC_PI_2;

/// Height of the panel with its caption [px].
pub(super) const HEIGHT_PX: f64 = 352.0;
/// Radius on which the triangles stand, around the robot's outline [px].
const HUB_PX: f64 = 34.0;
/// Length of a triangle of M = 1 [px].
const UNIT_PX: f64 = 58.0;
/// The triangles grow with M up to this and are cut there.
const MOST: f64 = 1.6;
/// Half of a triangle's width at its base [px].
const HALF_BASE_PX: f64 = 6.5;
/// Size of the robot's outline [px/m].
const ROBOT_SCALE: f64 = 112.0;

pub(super) fn draw(canvas: &mut Canvas, width_px: f64, robot: &RobotPicture) {
    canvas.rect((0.0, 0.0), (width_px, HEIGHT_PX - 16.0), "panel");
    canvas.text((12.0, 20.0), "", "Forces on the robot");
    let centre = (0.5 * width_px, 0.5 * HEIGHT_PX - 4.0);
    // The robot looks upwards in this panel.
    let at = |point: Point, scale: f64| (centre.0 - point.y_m * scale, centre.1 - point.x_m * scale);
    canvas.circle(centre, HUB_PX + UNIT_PX, "ring");
    // Whatever the robot's shape, its middle stands in the middle.
    let lengths = robot.footprint.corners().iter().map(|corner| corner.x_m);
    let middle_m = 0.5 * (lengths.clone().fold(f64::INFINITY, f64::min) + lengths.fold(f64::NEG_INFINITY, f64::max));
    let middle = Point::new(middle_m, 0.0);
    canvas.polygon(robot.footprint.corners().iter().map(|corner| at(*corner - middle, ROBOT_SCALE)), "robot");
    let nose = [(0.15, 0.0), (0.05, 0.07), (0.05, -0.07)].map(|(x, y)| at(Point::new(x, y), ROBOT_SCALE));
    canvas.polygon(nose.into_iter(), "nose");
    for force in robot.forces.iter().filter(|force| force.force > 0.0) {
        let along = Point::unit(force.bearing_rad);
        let aside = Point::unit(force.bearing_rad + FRAC_PI_2) * HALF_BASE_PX;
        let tip = along * (HUB_PX + force.force.min(MOST) * UNIT_PX);
        let corners = [along * HUB_PX + aside, tip, along * HUB_PX - aside].map(|point| at(point, 1.0));
        canvas.polygon(corners.into_iter(), if force.force > 1.0 { "strong" } else { "calm" });
    }
    canvas.text((12.0, HEIGHT_PX - 42.0), "small", "triangle: force M of a sonar · ring: M = 1;");
    canvas.text((12.0, HEIGHT_PX - 27.0), "small", "beyond the ring it is acted upon");
}
