//! S1's display: the robot with a triangle per sonar whose length is the force M, and the threshold M = 1 as a ring.

use super::RobotPicture;
use super::canvas::Canvas;
use crate::geometry::Point;
use std::f64::consts::FRAC_PI_2;

/// Height of the panel with its caption [px].
pub(super) const HEIGHT_PX: f64 = 312.0;
/// Radius of the threshold's ring [px].
const RING_PX: f64 = 66.0;
/// The triangles grow with M up to this and are cut there.
const MOST: f64 = 1.75;
/// Half of a triangle's width at its base [px].
const HALF_BASE_PX: f64 = 9.0;
/// Size of the robot's outline [px/m].
const ROBOT_SCALE: f64 = 110.0;

pub(super) fn draw(canvas: &mut Canvas, width_px: f64, robot: &RobotPicture) {
    canvas.rect((0.0, 0.0), (width_px, HEIGHT_PX - 16.0), "panel");
    canvas.text((12.0, 20.0), "", "Forces on the robot");
    let centre = (0.5 * width_px, 0.5 * HEIGHT_PX + 4.0);
    // The robot looks upwards in this panel.
    let at = |point: Point, scale: f64| (centre.0 - point.y_m * scale, centre.1 - point.x_m * scale);
    for force in robot.forces.iter().filter(|force| force.force > 0.0) {
        let length_px = force.force.min(MOST) * RING_PX;
        let along = Point::unit(force.bearing_rad);
        let aside = Point::unit(force.bearing_rad + FRAC_PI_2) * HALF_BASE_PX;
        let corners = [aside, along * length_px, -aside].map(|point| at(point, 1.0));
        canvas.polygon(corners.into_iter(), if force.force > 1.0 { "strong" } else { "calm" });
    }
    canvas.circle(centre, RING_PX, "ring");
    canvas.polygon(robot.footprint.corners().iter().map(|corner| at(*corner * 0.6, ROBOT_SCALE)), "robot");
    let nose = [(0.12, 0.0), (0.04, 0.06), (0.04, -0.06)].map(|(x, y)| at(Point::new(x, y), ROBOT_SCALE));
    canvas.polygon(nose.into_iter(), "nose");
    canvas.text((12.0, HEIGHT_PX - 42.0), "small", "triangle: force M of a sonar · ring: M = 1;");
    canvas.text((12.0, HEIGHT_PX - 27.0), "small", "beyond the ring it is acted upon");
}
