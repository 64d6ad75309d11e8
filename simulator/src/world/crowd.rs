//! Crowds: people drawn from a seed, each with a way of their own.
//!
//! A way goes from place to place, each in sight of the one before with room for a person on the whole line, so that
//! nobody has to find a way around a corner. Everybody begins at one of the world's starts and wanders a few places on
//! before the way proper begins. Walking speeds are nearly normal: 1.34 ± 0.26 m/s (Helbing and Molnár 1995).

use super::{Course, Person, Social, World};
use crate::geometry::Point;
use crate::noise::{Chance, Purpose};

/// A crowd to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crowd {
    pub count: usize,
    pub seed: u64,
    pub sees_robots: bool,
}

/// Greatest number of people in a world.
pub(super) const MOST: usize = 1000;
/// Places of a way, and places wandered on before it begins.
const PLACES: usize = 6;
const BEFORE: usize = 4;
/// Draws for a place, and for a way.
const DRAWS: usize = 80;
const WAYS: usize = 24;
/// A place lies so far from the one before [m].
const HOP_M: (f64, f64) = (1.5, 15.0);
/// Room to either side of a way, and around its places [m].
const ROOM_M: f64 = 0.35;
const RADIUS_M: f64 = 0.25;
const SPEED_M_S: (f64, f64) = (1.34, 0.26);
const LEAST_M_S: f64 = 0.5;

/// The people of a crowd who found a way; fewer than wanted where there is no room.
pub(super) fn draw(world: &World, crowd: &Crowd) -> Vec<Person> {
    (0..crowd.count)
        .filter_map(|index| {
            let mut chance = Chance::new(crowd.seed, Purpose::Crowd, index);
            let path = (0..WAYS).find_map(|_| way(world, &mut chance))?;
            let speed_m_s = (SPEED_M_S.0 + SPEED_M_S.1 * chance.normal()).max(LEAST_M_S);
            Some(Person {
                path,
                course: Course::BackAndForth,
                speed_m_s,
                radius_m: RADIUS_M,
                yields_within_m: None,
                pause_s: 0.0,
                phase: None,
                times_s: Vec::new(),
                social: Some(Social { sees_robots: crowd.sees_robots }),
            })
        })
        .collect()
}

fn way(world: &World, chance: &mut Chance) -> Option<Vec<Point>> {
    let starts = &world.starts;
    let mut place = match starts.len() {
        0 => (0..DRAWS).map(|_| anywhere(world, chance)).find(|place| is_free(world, *place))?,
        count => starts[((chance.share() * count as f64) as usize).min(count - 1)].pose.place(),
    };
    let mut path = Vec::new();
    for k in 0..BEFORE + PLACES {
        if k >= BEFORE {
            path.push(place);
        }
        let next = (0..DRAWS).map(|_| anywhere(world, chance)).find(|next| {
            let away_m = (*next - place).norm();
            away_m > HOP_M.0 && away_m < HOP_M.1 && is_free(world, *next) && is_open(world, place, *next)
        });
        match next {
            Some(next) => place = next,
            None => break,
        }
    }
    (path.len() >= 2).then_some(path)
}

fn anywhere(world: &World, chance: &mut Chance) -> Point {
    let (low, high) = world.map.extent();
    Point::new(low.x_m + (high.x_m - low.x_m) * chance.share(), low.y_m + (high.y_m - low.y_m) * chance.share())
}

fn is_free(world: &World, place: Point) -> bool {
    let mut free = true;
    world.map.near(place, ROOM_M, |_| free = false);
    free && !world.is_solid(place)
}

/// Whether a person can walk from `from` to `to` in a straight line.
fn is_open(world: &World, from: Point, to: Point) -> bool {
    let along = to - from;
    let length_m = along.norm();
    let ahead = along * (1.0 / length_m);
    [-1.0, -0.5, 0.0, 0.5, 1.0].iter().all(|share| {
        let aside = ahead.left() * (ROOM_M * share);
        world.map.cast(from + aside, ahead, length_m).is_none()
    })
}
