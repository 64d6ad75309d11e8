//! Circles through the points of a segment.
//!
//! **Three points** (S2): perpendicular bisectors of first, nearest and last point, as determinants. With q = x² + y² and
//! D = 2[x₁(y₂−y₃) + x₂(y₃−y₁) + x₃(y₁−y₂)]: x_c = [q₁(y₂−y₃) + q₂(y₃−y₁) + q₃(y₁−y₂)]/D, y_c likewise, R = |p₁ − c|.
//! |D| small: a straight line. With chord c and sagitta s, R = c²/(8s) + s/2, so σ_R ≈ σ·√1.5·|½ − c²/(8s²)|: for a thin
//! arc three points know next to nothing.
//!
//! **Least squares**: minimises Σ(|p−c|−R)²/σ² by Gauss–Newton and, where asked, adds what a scan knows beside its
//! points: a beam that passes an *edge* which nothing hides is a tangent, so the centre's distance from the last hitting
//! beam is R − h with h uniform in [0, r·Δα], Δα the angle to the next beam that saw past it; and a radius known from before. The inverse normal matrix is the
//! covariance of (x, y, R).

use super::points::Point;
use runtime::math;

/// A circle in the frame of its points, with the covariance of (x, y, radius).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Circle {
    /// Centre, ahead [m].
    pub x_m: f64,
    /// Centre, to the left [m].
    pub y_m: f64,
    /// Radius [m].
    pub radius_m: f64,
    /// Covariance of centre and radius [m²].
    pub covariance: [[f64; 3]; 3],
}

/// What a fit may use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knowledge {
    /// Standard deviation of a range [m].
    pub range_sigma_m: f64,
    /// The angle clockwise of the first point within which the thing's edge lies; `None` where something may hide it [rad].
    pub first_edge_rad: Option<f64>,
    /// The same, counter-clockwise of the last point [rad].
    pub last_edge_rad: Option<f64>,
    /// Radius from elsewhere and its standard deviation [m].
    pub radius: Option<(f64, f64)>,
}

/// Below this the determinant is that of a straight line: twice the triangle's area over the square of its longest side.
const STRAIGHT: f64 = 1e-3;
/// Most points that a fit looks at: more say little more.
const MOST_POINTS: usize = 32;
/// Steps of Gauss–Newton.
const STEPS: usize = 4;
/// A thing of which nothing is known has a radius of about this share of what is seen of it …
const USUAL_SHARE: f64 = 0.6;
/// … give or take this share …
const USUAL_SIGMA_SHARE: f64 = 0.5;
/// … and this [m].
const USUAL_SIGMA_M: f64 = 0.1;
/// How far the centre may lie to the side of the points' middle when nothing else says so [m].
const SIDEWAYS_SIGMA_M: f64 = 0.5;
/// Circles do not get smaller than this [m].
const LEAST_RADIUS_M: f64 = 0.01;

/// The circle through three points: centre and radius; `None` when they are (almost) in line.
pub fn through_three([a, b, c]: [(f64, f64); 3]) -> Option<(f64, f64, f64)> {
    // Differences to the first point keep the digits.
    let (bx, by) = (b.0 - a.0, b.1 - a.1);
    let (cx, cy) = (c.0 - a.0, c.1 - a.1);
    let (q_b, q_c) = (bx * bx + by * by, cx * cx + cy * cy);
    let longest = q_b.max(q_c).max((bx - cx) * (bx - cx) + (by - cy) * (by - cy));
    let cross = bx * cy - by * cx;
    // Asked this way round, a NaN is no circle either.
    let bends = cross.abs() > STRAIGHT * longest;
    if !bends {
        return None;
    }
    let d = 2.0 * cross;
    let x = (cy * q_b - by * q_c) / d;
    let y = (bx * q_c - cx * q_b) / d;
    Some((a.0 + x, a.1 + y, math::hypot(x, y)))
}

/// S2's circle: through first, nearest and last point; the middle one where the nearest is an end. `None` for fewer than
/// three points, points in line, and arcs that open towards the sensor.
pub fn three_point(points: &[Point], range_sigma_m: f64) -> Option<Circle> {
    let count = points.len();
    if count < 3 {
        return None;
    }
    let nearest = nearest(points);
    let between = if nearest == 0 || nearest == count - 1 { count / 2 } else { nearest };
    let three = [points[0], points[between], points[count - 1]];
    let (x_m, y_m, radius_m) = through_three(three.map(|p| (p.x_m, p.y_m)))?;
    // The beam goes on from the surface into the thing.
    let middle = &three[1];
    if (x_m - middle.x_m) * middle.u_x + (y_m - middle.y_m) * middle.u_y <= 0.0 {
        return None;
    }
    // Three points and three unknowns: the least squares' covariance is that of the exact circle.
    let mut normal = Normal::default();
    let weight = 1.0 / (range_sigma_m * range_sigma_m);
    for p in &three {
        normal.add(radial(p, x_m, y_m, radius_m), weight);
    }
    let covariance = normal.inverse()?;
    Some(Circle { x_m, y_m, radius_m, covariance })
}

/// The most likely circle by all that is known; `None` when even that is too little or the numbers are none.
pub fn least_squares(points: &[Point], known: &Knowledge) -> Option<Circle> {
    let (first, last) = (points.first()?, points.last()?);
    let stride = points.len().div_ceil(MOST_POINTS);
    let near = points[nearest(points)];
    let to_left = half_step(last, known.last_edge_rad);
    let to_right = half_step(first, known.first_edge_rad);
    // The edges' half angle gives a first radius: sin h = R/(d + R).
    let chord_m = math::hypot(last.x_m - first.x_m, last.y_m - first.y_m);
    let half_width_m = 0.5 * (chord_m + to_left + to_right);
    let sine = (half_width_m / near.range_m).min(0.7);
    let usual = (USUAL_SHARE * chord_m + 0.2 * USUAL_SIGMA_M, USUAL_SIGMA_SHARE * chord_m + USUAL_SIGMA_M);
    let (usual_m, usual_sigma_m) = known.radius.unwrap_or(usual);
    let mut radius_m = if known.radius.is_some() { usual_m } else { near.range_m * sine / (1.0 - sine) };
    // In the middle of what was seen, so far behind the nearest point.
    let middle = points[points.len() / 2];
    let (mut x_m, mut y_m) = (middle.x_m + radius_m * middle.u_x, middle.y_m + radius_m * middle.u_y);
    let weight = 1.0 / (known.range_sigma_m * known.range_sigma_m);
    let (centre_x, centre_y) = (0.5 * (first.x_m + last.x_m), 0.5 * (first.y_m + last.y_m));
    let mut normal = Normal::default();
    for _ in 0..STEPS {
        normal = Normal::of_points(points.iter().step_by(stride), x_m, y_m, radius_m, weight * stride as f64);
        if known.last_edge_rad.is_some() {
            normal.add(tangent(last, -1.0, to_left, x_m, y_m, radius_m), edge_weight(to_left));
        }
        if known.first_edge_rad.is_some() {
            normal.add(tangent(first, 1.0, to_right, x_m, y_m, radius_m), edge_weight(to_right));
        }
        normal.add(([0.0, 0.0, 1.0], radius_m - usual_m), 1.0 / (usual_sigma_m * usual_sigma_m));
        let aside = middle.u_x * (y_m - centre_y) - middle.u_y * (x_m - centre_x);
        normal.add(([-middle.u_y, middle.u_x, 0.0], aside), 1.0 / (SIDEWAYS_SIGMA_M * SIDEWAYS_SIGMA_M));
        let step = normal.solve()?;
        // No farther than the thing is large: far from the solution the circle is not linear at all.
        let most = radius_m.max(0.1);
        let length = (step[0] * step[0] + step[1] * step[1] + step[2] * step[2]).sqrt();
        let share = if length > most { most / length } else { 1.0 };
        x_m += share * step[0];
        y_m += share * step[1];
        radius_m = (radius_m + share * step[2]).max(LEAST_RADIUS_M);
        if length < 1e-5 {
            break;
        }
    }
    let covariance = normal.inverse()?;
    let numbers = [x_m, y_m, radius_m, covariance[0][0], covariance[1][1], covariance[2][2]];
    // The centre lies behind the surface.
    let behind = (x_m - middle.x_m) * middle.u_x + (y_m - middle.y_m) * middle.u_y > 0.0;
    (behind && numbers.iter().all(|n| n.is_finite())).then_some(Circle { x_m, y_m, radius_m, covariance })
}

/// Root mean square of the points' distances from the circle [m].
pub fn residual_m(points: &[Point], circle: &Circle) -> f64 {
    let square = |p: &Point| {
        let off = length(p.x_m - circle.x_m, p.y_m - circle.y_m) - circle.radius_m;
        off * off
    };
    let stride = points.len().div_ceil(MOST_POINTS).max(1);
    let (sum, count) = points.iter().step_by(stride).fold((0.0, 0.0), |(s, n), p| (s + square(p), n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Index of the point nearest to the ranger.
pub fn nearest(points: &[Point]) -> usize {
    let mut best = 0;
    for (k, p) in points.iter().enumerate() {
        if p.range_m < points[best].range_m {
            best = k;
        }
    }
    best
}

/// Of a vector of metres: no square of it overflows, so it needs none of hypot's care, which costs more than the rest.
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// Half the way to the next beam that saw past the edge, at the point's range; 0 without an edge [m].
fn half_step(p: &Point, edge_rad: Option<f64>) -> f64 {
    0.5 * edge_rad.unwrap_or(0.0) * p.range_m
}

/// The edge lies somewhere between the last beam that hit and the next; a point of it may have been lost.
fn edge_weight(half_step_m: f64) -> f64 {
    1.0 / (half_step_m * half_step_m).max(1e-6)
}

/// A row of the linearised problem: derivatives by (x, y, R), and the residual.
type Row = ([f64; 3], f64);

/// |p − c| − R.
fn radial(p: &Point, x_m: f64, y_m: f64, radius_m: f64) -> Row {
    let (dx, dy) = (p.x_m - x_m, p.y_m - y_m);
    let distance = length(dx, dy).max(1e-9);
    ([-dx / distance, -dy / distance, -1.0], distance - radius_m)
}

/// R − (distance of the centre from the beam) − half a step. `side` is 1 where the centre lies to the left of the beam.
fn tangent(p: &Point, side: f64, half_step_m: f64, x_m: f64, y_m: f64, radius_m: f64) -> Row {
    let distance = side * (p.u_x * (y_m - p.y_m) - p.u_y * (x_m - p.x_m));
    ([side * p.u_y, -side * p.u_x, 1.0], radius_m - distance - half_step_m)
}

/// JᵀWJ and −JᵀWf of three unknowns.
#[derive(Debug, Clone, Copy, Default)]
struct Normal {
    a: [[f64; 3]; 3],
    b: [f64; 3],
}

impl Normal {
    /// The rows of [`radial`] for all `points`, each of the same weight: only the upper triangle is summed, and the
    /// weight is multiplied once.
    fn of_points<'a>(
        points: impl Iterator<Item = &'a Point>,
        x_m: f64,
        y_m: f64,
        radius_m: f64,
        weight: f64,
    ) -> Normal {
        let (mut xx, mut xy, mut yy, mut x, mut y, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut along_x, mut along_y, mut sum) = (0.0, 0.0, 0.0);
        for p in points {
            let (dx, dy) = (p.x_m - x_m, p.y_m - y_m);
            let distance = length(dx, dy).max(1e-9);
            let inverse = 1.0 / distance;
            let (ux, uy, residual) = (dx * inverse, dy * inverse, distance - radius_m);
            xx += ux * ux;
            xy += ux * uy;
            yy += uy * uy;
            x += ux;
            y += uy;
            count += 1.0;
            along_x += ux * residual;
            along_y += uy * residual;
            sum += residual;
        }
        Normal {
            a: [[xx, xy, x], [xy, yy, y], [x, y, count]].map(|row| row.map(|value| weight * value)),
            b: [weight * along_x, weight * along_y, weight * sum],
        }
    }

    fn add(&mut self, (j, residual): Row, weight: f64) {
        for r in 0..3 {
            let w = weight * j[r];
            for (c, column) in j.iter().enumerate() {
                self.a[r][c] += w * column;
            }
            self.b[r] -= w * residual;
        }
    }

    fn inverse(&self) -> Option<[[f64; 3]; 3]> {
        let [[a, b, c], [_, d, e], [_, _, f]] = self.a;
        let (i, j, k) = (d * f - e * e, c * e - b * f, b * e - c * d);
        let det = a * i + b * j + c * k;
        // Relative to the diagonal, so that units do not matter.
        let regular = det > 1e-12 * a * d * f;
        if !regular {
            return None;
        }
        let n = 1.0 / det;
        let (l, m, o) = (a * f - c * c, b * c - a * e, a * d - b * b);
        Some([[i * n, j * n, k * n], [j * n, l * n, m * n], [k * n, m * n, o * n]])
    }

    fn solve(&self) -> Option<[f64; 3]> {
        let inverse = self.inverse()?;
        Some(inverse.map(|row| row[0] * self.b[0] + row[1] * self.b[1] + row[2] * self.b[2]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What a ranger at the origin with `spacing_rad` sees of a circle, exactly.
    fn arc(x_m: f64, y_m: f64, radius_m: f64, spacing_rad: f64) -> Vec<Point> {
        let mut points = Vec::new();
        let mut bearing = -3.0;
        while bearing < 3.0 {
            let (u_y, u_x) = math::sin_cos(bearing);
            let along = u_x * x_m + u_y * y_m;
            let aside = u_x * y_m - u_y * x_m;
            if along > 0.0 && aside.abs() < radius_m {
                let range_m = along - (radius_m * radius_m - aside * aside).sqrt();
                let point = Point { x_m: range_m * u_x, y_m: range_m * u_y, u_x, u_y, range_m, ..Point::default() };
                points.push(point);
            }
            bearing += spacing_rad;
        }
        points
    }

    fn noisy(points: &[Point], sigma_m: f64, seed: &mut u64) -> Vec<Point> {
        let mut normal = || {
            // Sum of twelve uniform numbers: enough of a bell for a test.
            let sum: f64 = (0..12)
                .map(|_| {
                    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    (*seed >> 11) as f64 / (1u64 << 53) as f64
                })
                .sum();
            sum - 6.0
        };
        points
            .iter()
            .map(|p| {
                let more = sigma_m * normal();
                Point { x_m: p.x_m + more * p.u_x, y_m: p.y_m + more * p.u_y, range_m: p.range_m + more, ..*p }
            })
            .collect()
    }

    fn open(range_sigma_m: f64, spacing_rad: f64) -> Knowledge {
        Knowledge { range_sigma_m, first_edge_rad: Some(spacing_rad), last_edge_rad: Some(spacing_rad), radius: None }
    }

    #[test]
    fn three_points_in_line_are_no_circle_whatever_their_direction() {
        assert_eq!(through_three([(1.0, 0.0), (1.0, 1.0), (1.0, 2.0)]), None);
        assert_eq!(through_three([(0.0, 1.0), (1.0, 1.0), (2.0, 1.0)]), None);
        assert_eq!(through_three([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0001)]), None);
        assert_eq!(through_three([(1.0, 1.0); 3]), None);
        assert_eq!(through_three([(f64::NAN, 1.0), (0.0, 0.0), (1.0, 0.0)]), None);
    }

    #[test]
    fn fewer_than_three_points_are_no_circle_of_s2_but_have_a_likely_one() {
        let points = arc(2.0, 0.0, 0.1, 0.04);
        let (two, known) = (&points[..2], open(0.01, 0.04));
        assert_eq!(three_point(two, 0.01), None);
        let circle = least_squares(two, &known).unwrap();
        assert!(math::hypot(circle.x_m - 2.0, circle.y_m) < 0.15, "{circle:?}");
    }

    #[test]
    fn an_inner_corner_is_no_circle_of_s2() {
        let points: Vec<Point> = arc(2.0, 0.0, 0.5, 0.01)
            .into_iter()
            // Mirrored at the plane x = 2: it opens towards the sensor.
            .map(|p| Point { x_m: 4.0 - p.x_m, range_m: math::hypot(4.0 - p.x_m, p.y_m), ..p })
            .collect();
        assert_eq!(three_point(&points, 0.01), None);
    }

    #[test]
    fn a_radius_known_before_moves_the_centre_to_its_place() {
        // One quarter of the arc, both ends hidden: the points alone hardly know the radius.
        let whole = arc(4.0, 1.0, 0.5, 0.01);
        let mut seed = 7;
        let part = noisy(&whole[10..18], 0.01, &mut seed);
        let hidden = Knowledge { first_edge_rad: None, last_edge_rad: None, ..open(0.01, 0.01) };
        let unknown = least_squares(&part, &hidden).unwrap();
        let known = least_squares(&part, &Knowledge { radius: Some((0.5, 0.01)), ..hidden }).unwrap();
        let off = |c: &Circle| math::hypot(c.x_m - 4.0, c.y_m - 1.0);
        assert!(off(&known) < 0.15 && off(&known) < off(&unknown), "{} {}", off(&known), off(&unknown));
    }

    /// Root mean square error of the radius and of the centre over many noises.
    fn errors(
        fit: impl Fn(&[Point]) -> Option<Circle>,
        exact: &[Point],
        truth: (f64, f64, f64),
        sigma_m: f64,
    ) -> (f64, f64) {
        let (mut seed, mut radius, mut centre, mut n) = (1, 0.0, 0.0, 0.0);
        for _ in 0..300 {
            if let Some(circle) = fit(&noisy(exact, sigma_m, &mut seed)) {
                radius += (circle.radius_m - truth.2) * (circle.radius_m - truth.2);
                let off = math::hypot(circle.x_m - truth.0, circle.y_m - truth.1);
                centre += off * off;
                n += 1.0;
            }
        }
        ((radius / n).sqrt(), (centre / n).sqrt())
    }

    #[test]
    fn least_squares_beats_three_points_on_the_cylinders_of_both_yardsticks() {
        // BARN (0.075 m at 1.5 m) and DynaBARN (0.5 m at 5 m), beams of a Jackal, 1 mm and 10 mm of noise.
        let spacing = 270.0_f64.to_radians() / 719.0;
        for (x, r) in [(1.5, 0.075), (5.0, 0.5)] {
            let exact = arc(x, 0.3, r, spacing);
            for sigma in [0.001, 0.01] {
                let truth = (x, 0.3, r);
                let (three_r, three_c) = errors(|p| three_point(p, sigma), &exact, truth, sigma);
                let (least_r, least_c) = errors(|p| least_squares(p, &open(sigma, spacing)), &exact, truth, sigma);
                assert!(least_r < three_r && least_c < three_c, "{r} {sigma}: {least_r} {three_r} {least_c} {three_c}");
                assert!(least_c < 0.1 * r + sigma, "{r} {sigma}: {least_c}");
            }
        }
    }

    #[test]
    fn the_spread_of_three_point_radii_is_the_one_that_the_sagitta_predicts() {
        let exact = arc(3.0, 0.0, 0.5, 0.005);
        let part = &exact[15..exact.len() - 15];
        let sigma = 0.001;
        let (first, last) = (part[0], part[part.len() - 1]);
        let chord = math::hypot(first.x_m - last.x_m, first.y_m - last.y_m);
        let sagitta = 0.5 - (0.25 - 0.25 * chord * chord).sqrt();
        let predicted = sigma * 1.5_f64.sqrt() * (0.5 - chord * chord / (8.0 * sagitta * sagitta)).abs();
        let (measured, _) = errors(|p| three_point(p, sigma), part, (3.0, 0.0, 0.5), sigma);
        let own = three_point(part, sigma).unwrap().covariance[2][2].sqrt();
        assert!((measured / predicted - 1.0).abs() < 0.25, "{measured} {predicted}");
        assert!((own / predicted - 1.0).abs() < 0.25, "{own} {predicted}");
    }

    proptest! {
        #[test]
        fn the_circle_through_three_of_its_points_is_the_circle(
            x in -10.0..10.0f64, y in -10.0..10.0f64, r in 0.05..2.0f64, from in -3.0..3.0f64, a in 0.3..1.5f64, b in 0.3..1.5f64,
        ) {
            let on = |angle: f64| (x + r * math::cos(angle), y + r * math::sin(angle));
            let (cx, cy, radius) = through_three([on(from), on(from + a), on(from + a + b)]).unwrap();
            prop_assert!((cx - x).abs() < 1e-6 && (cy - y).abs() < 1e-6 && (radius - r).abs() < 1e-6);
        }

        #[test]
        fn without_noise_both_fits_find_the_circle(bearing in -2.5..2.5f64, distance in 1.0..5.0f64, r in 0.1..0.6f64) {
            let (x, y) = (distance * math::cos(bearing), distance * math::sin(bearing));
            let points = arc(x, y, r, 0.006);
            prop_assume!(points.len() > 8 && distance > 1.5 * r);
            let three = three_point(&points, 0.001).unwrap();
            prop_assert!(math::hypot(three.x_m - x, three.y_m - y) < 1e-6, "{three:?}");
            let least = least_squares(&points, &open(0.001, 0.006)).unwrap();
            prop_assert!(math::hypot(least.x_m - x, least.y_m - y) < 0.01, "{least:?} {x} {y} {r}");
        }

        #[test]
        fn any_points_give_a_finite_circle_or_none(
            raw in prop::collection::vec((-20.0..20.0f64, -20.0..20.0f64), 0..40), first in any::<bool>(), last in any::<bool>(),
        ) {
            let points: Vec<Point> = raw
                .iter()
                .map(|&(x_m, y_m)| {
                    let range_m = math::hypot(x_m, y_m).max(1e-3);
                    Point { x_m, y_m, range_m, u_x: x_m / range_m, u_y: y_m / range_m, ..Point::default() }
                })
                .collect();
            let known = Knowledge { first_edge_rad: first.then_some(0.006), last_edge_rad: last.then_some(0.006), ..open(0.01, 0.006) };
            for circle in [three_point(&points, 0.01), least_squares(&points, &known)].into_iter().flatten() {
                prop_assert!(circle.x_m.is_finite() && circle.y_m.is_finite() && circle.radius_m > 0.0);
                prop_assert!(circle.covariance[0][0] > 0.0 && circle.covariance[1][1] > 0.0 && circle.covariance[2][2] > 0.0);
            }
        }
    }
}
