//! Where the people were in a run of which only the robot's track was kept.
//!
//! A track does not tell where the people went; the world, the seed and the track do: the people are walked once more
//! past a robot that is put where it was. That is the run again but for what lies between two points of the track.

use super::{BodySetup, STEP_S, Setup, SetupError, Simulation};
use crate::geometry::{Circle, Point, Pose};
use crate::realism::Realism;
use crate::world::World;
use messages::Twist;

/// Steps from one point of a way to the next.
const EVERY: usize = 10;

/// Somebody's way, and where it ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// Every tenth of a second.
    pub points: Vec<Point>,
    /// The disc at the end.
    pub end: Circle,
}

/// The ways of the people of `world` while a robot drove along `track` (times in rising order [s], poses).
pub fn people_along(world: World, seed: u64, body: BodySetup, track: &[(f64, Pose)]) -> Result<Vec<Way>, SetupError> {
    let Some((_, first)) = track.first() else { return Ok(Vec::new()) };
    let body = BodySetup { start: Some(*first), lasers: Vec::new(), ..body };
    let setup = Setup { bodies: vec![body], seed, realism: Realism::default() };
    let mut simulation = Simulation::new(world, &setup)?;
    let mut ways: Vec<Way> =
        simulation.discs.iter().map(|disc| Way { points: vec![disc.centre], end: *disc }).collect();
    let steps = (track.last().map_or(0.0, |(time_s, _)| *time_s) / STEP_S) as usize;
    let mut after = 0;
    for step in 0..steps {
        let now_s = step as f64 * STEP_S;
        while after + 1 < track.len() && track[after].0 < now_s {
            after += 1;
        }
        simulation.put(between(&track[after.saturating_sub(1)], &track[after], now_s));
        simulation.feel();
        for person in 0..simulation.walks.len() {
            simulation.walk(person);
        }
        if step % EVERY == EVERY - 1 {
            for (way, disc) in ways.iter_mut().zip(&simulation.discs) {
                way.points.push(disc.centre);
                way.end = *disc;
            }
        }
    }
    Ok(ways)
}

impl Simulation {
    /// Puts the first body somewhere, moving as if it had driven there in a step.
    fn put(&mut self, pose: Pose) {
        let actor = &mut self.actors[0];
        let before = actor.body.pose;
        let way = before.body_from_world(pose.place());
        let turned_rad = runtime::math::wrap_angle(pose.heading_rad - before.heading_rad);
        actor.place(pose);
        actor.body.velocity =
            Twist { linear_x_m_s: way.x_m / STEP_S, angular_z_rad_s: turned_rad / STEP_S, ..Twist::default() };
        self.placed[0] = actor.placed;
    }
}

fn between(before: &(f64, Pose), after: &(f64, Pose), now_s: f64) -> Pose {
    let long_s = after.0 - before.0;
    let share = if long_s > 0.0 { ((now_s - before.0) / long_s).clamp(0.0, 1.0) } else { 1.0 };
    let place = before.1.place() + (after.1.place() - before.1.place()) * share;
    let turn_rad = runtime::math::wrap_angle(after.1.heading_rad - before.1.heading_rad);
    Pose::new(place.x_m, place.y_m, runtime::math::wrap_angle(before.1.heading_rad + share * turn_rad))
}
