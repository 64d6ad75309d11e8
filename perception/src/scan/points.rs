//! Beams as points in the body frame at one instant.
//!
//! p = o + r·u, with o the beam's origin, u = (cos β, sin β) its direction. The body moves while a scan is taken: a beam
//! of age a was fired where the body stood before, so p is carried on by the body's own velocity (v, ω), to first order
//! in ω·a: p ← R(−ω·a)·p − v·a. Directions are kept from scan to scan: a ranger's bearings rarely change, and
//! sines cost more than all the rest.

use messages::{Beam, Echo, Twist};
use runtime::math;

/// Where a beam hit something.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Point {
    /// Ahead, in the body frame at the stamp [m].
    pub x_m: f64,
    /// To the left [m].
    pub y_m: f64,
    /// Direction of the beam.
    pub u_x: f64,
    /// Direction of the beam.
    pub u_y: f64,
    /// Distance along the beam [m].
    pub range_m: f64,
    /// Index of the beam in the sample.
    pub beam: u32,
    /// What lies between this point and the one before (clockwise of it).
    pub before: Between,
}

/// What lies between two points that follow one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Between {
    /// They are of neighbouring beams, or of beams between which some failed: they may belong together.
    #[default]
    Nothing,
    /// A beam that saw nothing passed between them.
    Clear,
    /// So many beams between them failed that they do not belong together.
    Failed,
    /// Nobody looked between them: the field's edge, another origin, too large an angle between beams.
    Unseen,
}

/// The direction of a beam, kept while its bearing stays the same.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Direction {
    bearing_rad: f32,
    u_x: f64,
    u_y: f64,
}

/// The points of the newest scan, counter-clockwise, and what is needed to make them.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    points: Vec<Point>,
    directions: Vec<Direction>,
    most_gap_rad: f64,
    /// Angle between neighbouring beams [rad].
    spacing_rad: f64,
    closed: bool,
    /// What lies behind the last point.
    after: Between,
}

impl Points {
    /// Room for `most_beams`; points more than `most_gap_rad` apart never belong together.
    pub fn new(most_beams: usize, most_gap_rad: f64) -> Points {
        let unknown = Direction { bearing_rad: f32::NAN, u_x: 0.0, u_y: 0.0 };
        Points {
            points: Vec::with_capacity(most_beams),
            directions: vec![unknown; most_beams],
            most_gap_rad,
            spacing_rad: most_gap_rad,
            closed: false,
            after: Between::Unseen,
        }
    }

    /// Takes the points of a scan during which the body moved with `velocity`. Scans with more beams than there is room
    /// for are thinned out evenly.
    pub fn take(&mut self, beams: &[Beam], velocity: &Twist) {
        self.points.clear();
        let stride = beams.len().div_ceil(self.directions.len().max(1)).max(1);
        let count = beams.len() / stride;
        let backwards = count > 1 && beams[stride].bearing_rad < beams[0].bearing_rad;
        let (mut clear, mut failed) = (false, false);
        let mut last: Option<(&Beam, f64)> = None;
        for k in 0..count {
            let index = if backwards { count - 1 - k } else { k } * stride;
            let Some(beam) = beams.get(index) else { continue };
            if beam.echo == Echo::Clear as u32 {
                clear = true;
                continue;
            }
            let range_m = f64::from(beam.range_m);
            let numbers = [beam.bearing_rad, beam.range_m, beam.origin_x_m, beam.origin_y_m, beam.age_s];
            if beam.echo != Echo::Value as u32 || range_m <= 0.0 || !numbers.iter().all(|n| n.is_finite()) {
                failed = true;
                continue;
            }
            let bearing_rad = f64::from(beam.bearing_rad);
            let before = match last {
                None => nothing_seen(clear, failed),
                Some((other, at_rad)) => {
                    let gap_rad = bearing_rad - at_rad;
                    let elsewhere = (other.origin_x_m, other.origin_y_m) != (beam.origin_x_m, beam.origin_y_m);
                    if elsewhere || gap_rad <= 0.0 {
                        Between::Unseen
                    } else if clear || gap_rad > self.most_gap_rad {
                        nothing_seen(clear, failed)
                    } else {
                        Between::Nothing
                    }
                }
            };
            last = Some((beam, bearing_rad));
            (clear, failed) = (false, false);
            let direction = self.direction(k, beam.bearing_rad);
            self.points.push(point(beam, index, &direction, range_m, before, velocity));
        }
        self.after = nothing_seen(clear, failed);
        self.look_around(beams, stride, count);
    }

    /// The points, counter-clockwise.
    pub fn all(&self) -> &[Point] {
        &self.points
    }

    /// Angle between neighbouring beams [rad].
    pub fn spacing_rad(&self) -> f64 {
        self.spacing_rad
    }

    /// What lies behind the last point.
    pub fn after(&self) -> Between {
        self.after
    }

    /// Whether the scan closes the circle: its last point may belong to its first.
    pub fn closed(&self) -> bool {
        self.closed
    }

    /// Makes point `first` the first one. Only sensible where the scan is closed.
    pub fn rotate(&mut self, first: usize) {
        self.points.rotate_left(first);
    }

    fn direction(&mut self, k: usize, bearing_rad: f32) -> Direction {
        let kept = &mut self.directions[k];
        // By bits, so that the initial NaN counts as different from everything.
        if kept.bearing_rad.to_bits() != bearing_rad.to_bits() {
            let (u_y, u_x) = math::sin_cos(f64::from(bearing_rad));
            *kept = Direction { bearing_rad, u_x, u_y };
        }
        *kept
    }

    /// Spacing of the beams, and whether the last one has the first one as a neighbour.
    fn look_around(&mut self, beams: &[Beam], stride: usize, count: usize) {
        self.closed = false;
        if count < 2 {
            return;
        }
        let (first, last) = (&beams[0], &beams[(count - 1) * stride]);
        let field_rad = f64::from(last.bearing_rad - first.bearing_rad).abs();
        let spacing_rad = field_rad / (count - 1) as f64;
        if spacing_rad.is_finite() && spacing_rad > 0.0 {
            self.spacing_rad = spacing_rad;
            let rest_rad = std::f64::consts::TAU - field_rad;
            self.closed = rest_rad < 1.5 * spacing_rad && count > 8;
        }
        if let (true, Some(point)) = (self.closed, self.points.first_mut()) {
            let near_seam = |b: &Beam| b.echo == Echo::Clear as u32;
            point.before = if near_seam(first) || near_seam(last) { Between::Clear } else { Between::Nothing };
        }
    }
}

/// What lies where no point is, by the beams there.
fn nothing_seen(clear: bool, failed: bool) -> Between {
    match (clear, failed) {
        (true, _) => Between::Clear,
        (false, true) => Between::Failed,
        (false, false) => Between::Unseen,
    }
}

fn point(beam: &Beam, index: usize, at: &Direction, range_m: f64, before: Between, velocity: &Twist) -> Point {
    let x_m = f64::from(beam.origin_x_m) + range_m * at.u_x;
    let y_m = f64::from(beam.origin_y_m) + range_m * at.u_y;
    let here = Point { x_m, y_m, u_x: at.u_x, u_y: at.u_y, range_m, beam: index as u32, before };
    if beam.age_s == 0.0 {
        return here;
    }
    let age_s = f64::from(beam.age_s);
    let turned = -velocity.angular_z_rad_s * age_s;
    let cos = 1.0 - 0.5 * turned * turned;
    Point {
        x_m: cos * x_m - turned * y_m - velocity.linear_x_m_s * age_s,
        y_m: turned * x_m + cos * y_m - velocity.linear_y_m_s * age_s,
        u_x: cos * at.u_x - turned * at.u_y,
        u_y: turned * at.u_x + cos * at.u_y,
        ..here
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn beam(bearing_rad: f32, range_m: f32, echo: Echo) -> Beam {
        Beam { bearing_rad, range_m, echo: echo as u32, ..Beam::default() }
    }

    fn points(beams: &[Beam], velocity: Twist) -> Points {
        let mut points = Points::new(720, 0.1);
        points.take(beams, &velocity);
        points
    }

    #[test]
    fn a_beam_becomes_a_point_ahead_and_to_the_left() {
        let mounted = Beam { origin_x_m: 0.2, origin_y_m: -0.1, ..beam(0.5, 2.0, Echo::Value) };
        let points = points(&[mounted], Twist::default());
        let p = points.all()[0];
        assert!((p.x_m - (0.2 + 2.0 * math::cos(0.5))).abs() < 1e-7, "{p:?}");
        assert!((p.y_m - (-0.1 + 2.0 * math::sin(0.5))).abs() < 1e-7, "{p:?}");
    }

    #[test]
    fn what_lies_between_two_points_is_told() {
        let all = points(
            &[
                beam(0.00, 1.0, Echo::Value),
                beam(0.02, 0.0, Echo::Fault),
                beam(0.04, 1.0, Echo::Value),
                beam(0.06, 9.0, Echo::Clear),
                beam(0.08, 1.0, Echo::Value),
                beam(0.50, 1.0, Echo::Value),
            ],
            Twist::default(),
        );
        let between: Vec<Between> = all.all().iter().map(|p| p.before).collect();
        assert_eq!(between, [Between::Unseen, Between::Nothing, Between::Clear, Between::Unseen]);
    }

    #[test]
    fn a_scan_from_left_to_right_is_turned_round() {
        let beams: Vec<Beam> = (0..5).map(|k| beam(0.2 - 0.05 * k as f32, 1.0 + k as f32, Echo::Value)).collect();
        let order: Vec<u32> = points(&beams, Twist::default()).all().iter().map(|p| p.beam).collect();
        assert_eq!(order, [4, 3, 2, 1, 0]);
    }

    #[test]
    fn a_wall_stays_straight_while_the_body_turns_past_it() {
        // Beams fired one after another while the body turns and drives; the wall is x = 2 in the frame of the stamp.
        let velocity = Twist { linear_x_m_s: 1.0, angular_z_rad_s: 1.5, ..Twist::default() };
        let beams: Vec<Beam> = (0..100)
            .map(|k| {
                let age_s = 0.02 * (1.0 - k as f64 / 99.0);
                let heading = -velocity.angular_z_rad_s * age_s;
                let bearing = -0.5 + 0.01 * k as f64;
                let x = -velocity.linear_x_m_s * age_s;
                let range_m = (2.0 - x) / math::cos(heading + bearing);
                Beam { age_s: age_s as f32, ..beam(bearing as f32, range_m as f32, Echo::Value) }
            })
            .collect();
        for p in points(&beams, velocity).all() {
            assert!((p.x_m - 2.0).abs() < 2e-4, "{p:?}");
        }
        let worst = points(&beams, Twist::default()).all().iter().fold(0.0, |w: f64, p| w.max((p.x_m - 2.0).abs()));
        assert!(worst > 0.01, "without the body's velocity the wall is bent: {worst}");
    }

    #[test]
    fn a_full_circle_is_closed_and_half_a_one_is_not() {
        let ring = |field: f64| -> Vec<Beam> {
            (0..360).map(|k| beam((-PI + field * k as f64 / 360.0) as f32, 3.0, Echo::Value)).collect()
        };
        assert!(points(&ring(2.0 * PI), Twist::default()).closed());
        assert!(!points(&ring(PI), Twist::default()).closed());
    }

    #[test]
    fn too_many_beams_are_thinned_out_over_the_whole_field() {
        let beams: Vec<Beam> = (0..2000).map(|k| beam(0.001 * k as f32, 1.0, Echo::Value)).collect();
        let all = points(&beams, Twist::default());
        assert!(all.all().len() > 600 && all.all().len() <= 720);
        assert!(all.all().last().unwrap().beam > 1990);
    }

    proptest! {
        #[test]
        fn any_bytes_make_finite_points(
            beams in prop::collection::vec((any::<f32>(), any::<f32>(), any::<f32>(), any::<f32>(), 0u32..9), 0..800),
        ) {
            let beams: Vec<Beam> = beams
                .into_iter()
                .map(|(bearing_rad, range_m, origin_x_m, age_s, echo)| Beam { origin_x_m, origin_y_m: 0.0, bearing_rad, range_m, age_s, echo })
                .collect();
            let all = points(&beams, Twist { angular_z_rad_s: 1.0, ..Twist::default() });
            prop_assert!(all.all().iter().all(|p| p.x_m.is_finite() && p.y_m.is_finite()));
        }

        #[test]
        fn the_law_of_cosines_of_s2_gives_the_same_place(bearing in -1.57..1.57f64, range in 0.1..8.0f64, ahead in 0.0..0.5f64) {
            // d_obs = sqrt(d² + L² − 2·d·L·cos α′), α′ the interior angle at a sensor that stands L ahead of the axle.
            let interior = PI - bearing.abs();
            let by_law = (range * range + ahead * ahead - 2.0 * range * ahead * math::cos(interior)).sqrt();
            let mounted = Beam { origin_x_m: ahead as f32, ..beam(bearing as f32, range as f32, Echo::Value) };
            let p = points(&[mounted], Twist::default()).all()[0];
            prop_assert!((math::hypot(p.x_m, p.y_m) - by_law).abs() < 1e-6);
        }
    }
}
