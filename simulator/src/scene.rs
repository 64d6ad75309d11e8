//! What one body can touch and hear at an instant: what stands still, the people, the other bodies.

use crate::geometry::{Circle, Cone, ConeHit, Placed, Point, Segment};
use crate::world::{Map, Nearest};

/// A thing that a body can touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Thing {
    /// Anything that stands still.
    Static,
    /// The person of this index.
    Person(usize),
    /// The body of this index.
    Body(usize),
}

/// The surroundings of one body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub map: &'a Map,
    pub persons: &'a [Circle],
    pub bodies: &'a [Placed],
    /// The body that looks; it neither touches nor hears itself.
    pub own: usize,
}

impl Scene<'_> {
    fn others(&self) -> impl Iterator<Item = (usize, &Placed)> {
        self.bodies.iter().enumerate().filter(|(index, _)| *index != self.own)
    }

    /// The moving thing nearest to `body`, if one is within `within_m`.
    pub fn nearest_mover(&self, body: &Placed, within_m: f64) -> Option<(Nearest, Thing)> {
        let mut best: Option<(Nearest, Thing)> = None;
        let mut wanted = within_m;
        let mut offer = |gap: (f64, Point, Point), thing: Thing| {
            if gap.0 <= wanted && best.is_none_or(|(best, _)| gap.0 < best.distance_m) {
                wanted = gap.0;
                best = Some((Nearest { distance_m: gap.0, on_body: gap.1, on_thing: gap.2 }, thing));
            }
        };
        for (index, person) in self.persons.iter().enumerate() {
            if apart_m(body, person.centre, person.radius_m) <= within_m {
                offer(body.gap_to_circle(person), Thing::Person(index));
            }
        }
        for (index, other) in self.others() {
            if apart_m(body, other.centre, other.radius_m) <= within_m {
                offer(body.gap_to_placed(other), Thing::Body(index));
            }
        }
        best
    }

    /// Least distance at which a moving thing can be, by circles alone: cheap, never too large [m].
    pub fn mover_bound_m(&self, body: &Placed) -> f64 {
        let persons = self.persons.iter().map(|person| apart_m(body, person.centre, person.radius_m));
        let bodies = self.others().map(|(_, other)| apart_m(body, other.centre, other.radius_m));
        persons.chain(bodies).fold(f64::INFINITY, f64::min)
    }

    /// Distance along a ray to the first surface of anything, if it is nearer than `reach_m`.
    pub fn cast(&self, origin: Point, direction: Point, reach_m: f64) -> Option<f64> {
        let mut best = self.map.cast(origin, direction, reach_m);
        let mut offer = |distance: Option<f64>| {
            if let Some(distance) = distance.filter(|distance| *distance <= best.unwrap_or(reach_m)) {
                best = Some(distance);
            }
        };
        for person in self.persons {
            offer(person.cast(origin, direction));
        }
        for (_, other) in self.others() {
            for side in other.sides() {
                offer(side.cast(origin, direction));
            }
        }
        best
    }

    /// Hands every surface in a cone to `hear`, with whether it is rough; see [`Map::listen`]. Clothes and machines
    /// scatter sound whatever its incidence.
    pub fn listen(&self, cone: &Cone, mut hear: impl FnMut(ConeHit, bool) -> f64) {
        for person in self.persons {
            if let Some(hit) = cone.meet_circle(person) {
                hear(hit, true);
            }
        }
        for (_, other) in self.others() {
            let far = cone.reach_m + other.radius_m;
            let to = other.centre - cone.apex;
            if to.dot(to) < far * far {
                for hit in other.sides().filter_map(|side: Segment| cone.meet_segment(&side)) {
                    hear(hit, true);
                }
            }
        }
        self.map.listen(cone, hear);
    }
}

fn apart_m(body: &Placed, centre: Point, radius_m: f64) -> f64 {
    (centre - body.centre).norm() - radius_m - body.radius_m
}
