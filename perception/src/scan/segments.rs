//! Cuts a scan into segments (Dietmayer 2001) and lays a circle through each.
//!
//! Two neighbouring points belong together while ‖Pᵢ − Pᵢ₊₁‖ ≤ C₀ + C₁·min(rᵢ, rᵢ₊₁), C₁ = √(2(1 − cos Δα)): the chord
//! between the two beams' unit vectors, so it costs no cosine. C₀ allows for noise and for surfaces that are looked at
//! askance: at incidence ψ they hold together while r·Δα(1/cos ψ − 1) < C₀. A scan all round is joined at its seam.
//!
//! A segment's end is *hidden* where the neighbouring point is nearer, where nobody looked, and at the field's edge;
//! elsewhere it is the thing's own edge, which tells more about its place than the points do ([`super::circles`]).

use super::circles::{self, Circle, Knowledge};
use super::points::{Between, Point, Points};
use messages::{Beam, Segment, SegmentShape, Twist};
use runtime::math;
use schemars::JsonSchema;
use serde::Deserialize;

/// How circles are laid through segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// Through first, nearest and last point (S2).
    ThreePoint,
    /// Least squares of all points.
    LeastSquares,
    /// Least squares of all points and of the edges that nothing hides.
    #[default]
    Edges,
}

/// How a scan is taken apart.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SegmentsConfig {
    /// Most beams; a scan with more is thinned out.
    pub most_beams: usize,
    /// Most segments; those behind are left out, and counted.
    pub most_segments: usize,
    /// C₀: how much farther apart than the beams two points of one thing may be [m].
    pub noise_m: f64,
    /// Points farther apart than this, seen from the ranger, never belong together [rad].
    pub most_gap_rad: f64,
    /// Standard deviation of a range [m].
    pub range_sigma_m: f64,
    /// How circles are laid.
    pub fit: Fit,
    /// What has a greater radius is a wall [m].
    pub most_radius_m: f64,
}

impl Default for SegmentsConfig {
    fn default() -> SegmentsConfig {
        SegmentsConfig {
            most_beams: 1200,
            most_segments: 256,
            noise_m: 0.1,
            most_gap_rad: 0.1,
            range_sigma_m: 0.01,
            fit: Fit::default(),
            most_radius_m: 1.0,
        }
    }
}

impl SegmentsConfig {
    /// Whether every setting is within its bounds; else which is not.
    pub fn check(&self) -> Result<(), String> {
        for (key, value) in [
            ("noise_m", self.noise_m),
            ("most_gap_rad", self.most_gap_rad),
            ("range_sigma_m", self.range_sigma_m),
            ("most_radius_m", self.most_radius_m),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{key} = {value} must be a number greater than zero"));
            }
        }
        for (key, value) in [("most_beams", self.most_beams), ("most_segments", self.most_segments)] {
            if !(8..=8192).contains(&value) {
                return Err(format!("{key} = {value} must be 8 to 8192"));
            }
        }
        Ok(())
    }
}

/// What is no wider than this is a thing, however straight or bent it looks: two legs, a box [m].
const THING_M: f64 = 0.7;
/// A circle that misses the points by more than this share of the chord is none of theirs.
const ODD_SHARE: f64 = 0.08;
/// Where beams beside an edge failed, most of them saw nothing to send them back: so many may have been on the thing.
const FAILED_BEAMS: f64 = 3.0;
/// A speck's centre is known to half its width and this [m].
const SPECK_SIGMA_M: f64 = 0.03;

/// The newest scan in pieces.
#[derive(Debug, Clone)]
pub struct Segmenter {
    config: SegmentsConfig,
    points: Points,
    spans: Vec<(usize, usize)>,
    segments: Vec<Segment>,
    circles: Vec<Circle>,
    no_room: u64,
}

impl Segmenter {
    /// A segmenter with room for what the settings say.
    pub fn new(config: SegmentsConfig) -> Segmenter {
        Segmenter {
            points: Points::new(config.most_beams, config.most_gap_rad),
            spans: Vec::with_capacity(config.most_segments),
            segments: Vec::with_capacity(config.most_segments),
            circles: Vec::with_capacity(config.most_segments),
            no_room: 0,
            config,
        }
    }

    /// Takes a scan apart that was taken while the body moved with `velocity`.
    pub fn take(&mut self, beams: &[Beam], velocity: &Twist) {
        self.points.take(beams, velocity);
        let noise_m = self.config.noise_m;
        if self.points.closed() {
            // Begin behind a cut, so that no segment goes across the seam.
            let all = self.points.all();
            let cut = (0..all.len()).find(|&k| !together(&all[(k + all.len() - 1) % all.len()], &all[k], noise_m));
            self.points.rotate(cut.unwrap_or(0));
        }
        self.spans.clear();
        let all = self.points.all();
        let mut first = 0;
        for k in 1..=all.len() {
            if k < all.len() && together(&all[k - 1], &all[k], noise_m) {
                continue;
            }
            if self.spans.len() == self.spans.capacity() {
                self.no_room += 1;
            } else {
                self.spans.push((first, k));
            }
            first = k;
        }
        self.segments.clear();
        self.circles.clear();
        for index in 0..self.spans.len() {
            let (segment, circle) = self.describe(index);
            self.segments.push(segment);
            self.circles.push(circle);
        }
    }

    /// The segments, counter-clockwise.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The circle of segment `index`, with its covariance.
    pub fn circle(&self, index: usize) -> &Circle {
        &self.circles[index]
    }

    /// The points of segment `index`.
    pub fn points_of(&self, index: usize) -> &[Point] {
        let (first, end) = self.spans[index];
        &self.points.all()[first..end]
    }

    /// All points.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// Segments for which there was no room, so far.
    pub fn no_room(&self) -> u64 {
        self.no_room
    }

    /// What a fit of segment `index` may use beside its points.
    fn knowledge(&self, index: usize) -> Knowledge {
        let edges = self.config.fit == Fit::Edges;
        let edge = |edge: Option<f64>| edge.filter(|_| edges);
        let (first, last) = self.edges(index);
        let range_sigma_m = self.config.range_sigma_m;
        Knowledge { range_sigma_m, first_edge_rad: edge(first), last_edge_rad: edge(last), radius: None }
    }

    /// How far the edges of segment `index` may lie beyond its first and last point [rad]; `None` where they are hidden.
    fn edges(&self, index: usize) -> (Option<f64>, Option<f64>) {
        let (begin, end) = self.spans[index];
        let (all, closed) = (self.points.all(), self.points.closed());
        let spacing = self.points.spacing_rad();
        let before = if begin > 0 { all.get(begin - 1) } else { all.last().filter(|_| closed) };
        let behind = all.get(end).or(if closed { all.first() } else { None });
        let alone = |between| beyond(between, spacing);
        let (first, last) = (&all[begin], &all[end - 1]);
        (
            before.map_or_else(|| alone(first.before), |other| edge(first, other, first.before, spacing)),
            behind.map_or_else(|| alone(self.points.after()), |other| edge(last, other, other.before, spacing)),
        )
    }

    /// The circle of segment `index` if its radius is `radius_m`, give or take `sigma_m`.
    pub fn refit(&self, index: usize, radius_m: f64, sigma_m: f64) -> Circle {
        if self.config.fit == Fit::ThreePoint {
            return self.circles[index];
        }
        let known = Knowledge { radius: Some((radius_m, sigma_m)), ..self.knowledge(index) };
        let points = self.points_of(index);
        let refitted = circles::least_squares(points, &known)
            .map(|circle| widened(circles::residual_m(points, &circle), circle, self.config.range_sigma_m));
        refitted.unwrap_or(self.circles[index])
    }

    fn describe(&self, index: usize) -> (Segment, Circle) {
        let points = self.points_of(index);
        let (first, last) = (points[0], points[points.len() - 1]);
        let near = points[circles::nearest(points)];
        let (first_edge, last_edge) = self.edges(index);
        let mut segment = Segment {
            first_beam: first.beam,
            last_beam: last.beam,
            points: points.len() as u32,
            shape: SegmentShape::Straight as u32,
            first_hidden: u32::from(first_edge.is_none()),
            last_hidden: u32::from(last_edge.is_none()),
            first_x_m: first.x_m,
            first_y_m: first.y_m,
            last_x_m: last.x_m,
            last_y_m: last.y_m,
            nearest_x_m: near.x_m,
            nearest_y_m: near.y_m,
            ..Segment::default()
        };
        let (shape, circle) = self.circularise(points, &self.knowledge(index));
        segment.shape = shape as u32;
        segment.centre_x_m = circle.x_m;
        segment.centre_y_m = circle.y_m;
        segment.radius_m = circle.radius_m;
        segment.radius_sigma_m =
            if shape == SegmentShape::Round { circle.covariance[2][2].sqrt() } else { f64::INFINITY };
        (segment, circle)
    }

    fn circularise(&self, points: &[Point], known: &Knowledge) -> (SegmentShape, Circle) {
        let config = &self.config;
        let (first, last) = (points[0], points[points.len() - 1]);
        let chord_m = math::hypot(last.x_m - first.x_m, last.y_m - first.y_m);
        let speck = speck(&first, &last, chord_m);
        if chord_m > 2.0 * config.most_radius_m || (chord_m > THING_M && opens(points, chord_m)) {
            return (SegmentShape::Straight, speck);
        }
        let fitted = match config.fit {
            Fit::ThreePoint => circles::three_point(points, config.range_sigma_m),
            Fit::LeastSquares if points.len() < 3 => None,
            Fit::LeastSquares | Fit::Edges => circles::least_squares(points, known),
        };
        let residual = fitted.map(|circle| circles::residual_m(points, &circle));
        match (fitted, residual) {
            (Some(circle), _) if circle.radius_m > config.most_radius_m && chord_m > THING_M => {
                (SegmentShape::Straight, speck)
            }
            // Two legs side by side are no circle.
            (Some(circle), Some(residual_m))
                if circle.radius_m <= config.most_radius_m
                    && residual_m < 2.0 * config.range_sigma_m + ODD_SHARE * chord_m =>
            {
                let measured = points.len() >= 3 && circle.covariance[2][2].sqrt() < circle.radius_m;
                let shape = if measured { SegmentShape::Round } else { SegmentShape::Speck };
                (shape, widened(residual_m, circle, config.range_sigma_m))
            }
            _ => (SegmentShape::Speck, speck),
        }
    }
}

/// Dietmayer's criterion.
fn together(a: &Point, b: &Point, noise_m: f64) -> bool {
    if b.before != Between::Nothing {
        return false;
    }
    let chord = math::hypot(b.u_x - a.u_x, b.u_y - a.u_y);
    let most_m = noise_m + chord * a.range_m.min(b.range_m);
    let (dx, dy) = (b.x_m - a.x_m, b.y_m - a.y_m);
    dx * dx + dy * dy <= most_m * most_m
}

/// How far the edge of the thing that `end` belongs to may lie beyond it, towards its neighbour `other` [rad]; `None` where
/// more of the thing may hide behind something nearer, or beyond where anybody looked.
fn edge(end: &Point, other: &Point, between: Between, spacing_rad: f64) -> Option<f64> {
    match between {
        Between::Clear | Between::Failed | Between::Unseen => beyond(between, spacing_rad),
        // Beams that failed between the two leave the edge anywhere between them; the chord is the angle, nearly.
        Between::Nothing => {
            let gap = math::hypot(end.u_x - other.u_x, end.u_y - other.u_y);
            (other.range_m > end.range_m).then_some(gap.min(FAILED_BEAMS * spacing_rad))
        }
    }
}

/// The same where no neighbour is near.
fn beyond(between: Between, spacing_rad: f64) -> Option<f64> {
    match between {
        Between::Clear => Some(spacing_rad),
        Between::Failed => Some(FAILED_BEAMS * spacing_rad),
        Between::Nothing | Between::Unseen => None,
    }
}

/// Whether the points bend away from the sensor in their middle: an inner corner.
fn opens(points: &[Point], chord_m: f64) -> bool {
    if points.len() < 3 {
        return false;
    }
    let (first, middle, last) = (points[0], points[points.len() / 2], points[points.len() - 1]);
    // Counter-clockwise order: what bulges towards the sensor lies to the left of first → last.
    let cross = (last.x_m - first.x_m) * (middle.y_m - first.y_m) - (last.y_m - first.y_m) * (middle.x_m - first.x_m);
    -cross / chord_m > 0.05 * chord_m
}

/// The smallest circle about a chord.
fn speck(first: &Point, last: &Point, chord_m: f64) -> Circle {
    let variance = (0.5 * chord_m + SPECK_SIGMA_M) * (0.5 * chord_m + SPECK_SIGMA_M);
    Circle {
        x_m: 0.5 * (first.x_m + last.x_m),
        y_m: 0.5 * (first.y_m + last.y_m),
        radius_m: (0.5 * chord_m).max(0.01),
        covariance: [[variance, 0.0, 0.0], [0.0, variance, 0.0], [0.0, 0.0, variance]],
    }
}

/// What does not look like its circle is not known as well as the noise alone would have it.
fn widened(residual_m: f64, circle: Circle, sigma_m: f64) -> Circle {
    let factor = (residual_m / sigma_m).max(1.0);
    let factor = factor * factor;
    Circle { covariance: circle.covariance.map(|row| row.map(|c| factor * c)), ..circle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::Echo;
    use proptest::prelude::*;

    fn beam(bearing_rad: f64, range_m: f64) -> Beam {
        let echo = if range_m < 10.0 { Echo::Value } else { Echo::Clear } as u32;
        Beam { bearing_rad: bearing_rad as f32, range_m: range_m as f32, echo, ..Beam::default() }
    }

    /// A scan of `count` beams over `field` [rad] about straight ahead; `range` gives the distance by bearing.
    fn scan(count: usize, field: f64, range: impl Fn(f64) -> f64) -> Segmenter {
        let beams: Vec<Beam> = (0..count)
            .map(|k| -0.5 * field + field * k as f64 / (count - 1) as f64)
            .map(|bearing| beam(bearing, range(bearing)))
            .collect();
        let mut segmenter = Segmenter::new(SegmentsConfig { range_sigma_m: 0.001, ..SegmentsConfig::default() });
        segmenter.take(&beams, &Twist::default());
        segmenter
    }

    fn disc(bearing: f64, x: f64, y: f64, r: f64) -> f64 {
        let (u_y, u_x) = math::sin_cos(bearing);
        let (along, aside) = (u_x * x + u_y * y, u_x * y - u_y * x);
        if along > 0.0 && aside.abs() < r { along - (r * r - aside * aside).sqrt() } else { f64::INFINITY }
    }

    #[test]
    fn two_discs_before_a_wall_are_found_with_their_circles() {
        let range = |b: f64| disc(b, 2.0, 0.5, 0.2).min(disc(b, 2.0, -0.5, 0.3)).min(4.0 / math::cos(b));
        let found = scan(361, 2.0, range);
        let round: Vec<&Segment> = found.segments().iter().filter(|s| s.shape == SegmentShape::Round as u32).collect();
        assert_eq!(round.len(), 2, "{:?}", found.segments());
        for (segment, (x, y, r)) in round.iter().zip([(2.0, -0.5, 0.3), (2.0, 0.5, 0.2)]) {
            assert!((segment.centre_x_m - x).abs() < 0.02 && (segment.centre_y_m - y).abs() < 0.02, "{segment:?}");
            assert!((segment.radius_m - r).abs() < 0.02, "{segment:?}");
            assert_eq!((segment.first_hidden, segment.last_hidden), (0, 0));
        }
    }

    #[test]
    fn the_end_behind_something_nearer_is_hidden_and_so_is_the_fields_edge() {
        let range = |b: f64| disc(b, 1.0, 0.0, 0.1).min(disc(b, 2.0, 0.25, 0.2));
        let found = scan(361, 2.0, range);
        assert_eq!(found.segments().len(), 2, "{:?}", found.segments());
        let behind = &found.segments()[1];
        assert_eq!((behind.first_hidden, behind.last_hidden), (1, 0));
        let wall = scan(361, 2.0, |b| 2.0 / math::cos(b));
        assert_eq!((wall.segments()[0].first_hidden, wall.segments()[0].last_hidden), (1, 1));
        assert_eq!(wall.segments()[0].shape, SegmentShape::Straight as u32);
    }

    #[test]
    fn points_are_cut_exactly_where_they_are_farther_apart_than_the_threshold() {
        // Two beams 0.01 rad apart at 2 m and 2 m + step: the chord is 0.02 m.
        for (step, segments) in [(0.117, 1), (0.123, 2)] {
            let mut segmenter = Segmenter::new(SegmentsConfig { noise_m: 0.1, ..SegmentsConfig::default() });
            segmenter.take(&[beam(0.0, 2.0), beam(0.01, 2.0 + step)], &Twist::default());
            assert_eq!(segmenter.segments().len(), segments, "{step}");
        }
    }

    #[test]
    fn a_disc_across_the_seam_of_a_full_circle_is_one_segment() {
        let full = std::f64::consts::TAU * 719.0 / 720.0;
        let found = scan(720, full, |b| disc(b, -2.0, 0.0, 0.3));
        assert_eq!(found.segments().len(), 1, "{:?}", found.segments());
        let segment = &found.segments()[0];
        assert!((segment.centre_x_m + 2.0).abs() < 0.01 && segment.centre_y_m.abs() < 0.01, "{segment:?}");
    }

    #[test]
    fn an_inner_corner_is_a_wall() {
        let found = scan(361, 1.2, |b| 2.0 / (math::cos(b) + math::sin(b.abs())));
        assert!(found.segments().iter().all(|s| s.shape == SegmentShape::Straight as u32), "{:?}", found.segments());
    }

    #[test]
    fn segments_without_room_are_counted() {
        let mut segmenter = Segmenter::new(SegmentsConfig { most_segments: 8, ..SegmentsConfig::default() });
        let beams: Vec<Beam> = (0..20).map(|k| beam(0.05 * f64::from(k), if k % 2 == 0 { 1.0 } else { 3.0 })).collect();
        segmenter.take(&beams, &Twist::default());
        assert_eq!((segmenter.segments().len(), segmenter.no_room()), (8, 12));
    }

    proptest! {
        #[test]
        fn every_point_is_in_exactly_one_segment(ranges in prop::collection::vec(0.05..12.0f64, 0..400), full in any::<bool>()) {
            let count = ranges.len();
            let field = if full { std::f64::consts::TAU } else { 3.0 };
            let beams: Vec<Beam> =
                ranges.iter().enumerate().map(|(k, r)| beam(-0.5 * field + field * k as f64 / count as f64, *r)).collect();
            let mut segmenter =
                Segmenter::new(SegmentsConfig { most_segments: 512, ..SegmentsConfig::default() });
            segmenter.take(&beams, &Twist::default());
            let points: u32 = segmenter.segments().iter().map(|s| s.points).sum();
            prop_assert_eq!(points as usize, segmenter.points().all().len());
            for segment in segmenter.segments() {
                prop_assert!(segment.centre_x_m.is_finite() && segment.radius_m > 0.0);
            }
        }
    }
}
