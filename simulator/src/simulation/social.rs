//! People who give way: the social force model.
//!
//! A person at x with velocity v who wants to go along the unit vector e at the speed v⁰ feels, per mass,
//!
//! dv/dt = (v⁰·e − v)/τ + Σ w·(−∇V(b)) + Σ (−∇U(r))
//!
//! | | | |
//! |---|---|---|
//! | other people | V(b) = V⁰·exp(−b/σ), b = ½√((‖r‖ + ‖r − s‖)² − ‖s‖²), s = v_other·Δt | V⁰ = 2.1 m²/s², σ = 0.3 m, Δt = 2 s |
//! | walls | U(r) = U⁰·exp(−‖r‖/R), r from the nearest point | U⁰ = 10 m²/s², R = 0.2 m |
//! | sight | w = 1 for what lies within 100° of e, else c | c = 0.5 |
//! | greed | τ; nobody is faster than 1.3·v⁰ | τ = 0.5 s |
//!
//! with r from the other to the person. Source of equations and numbers: Helbing and Molnár, "Social force model for
//! pedestrian dynamics", Physical Review E 51, 4282 (1995).
//!
//! Added here: a robot that is seen is a person whose edge is where its outline is nearest, and nobody walks nearer to it
//! than 0.15 m; one that is not seen is felt when it touches, and then slid along. People step aside to the right (a push
//! is turned by 20°) where the paper lets chance decide. Walls brake nobody by more than half the greed, so that a door of
//! 0.9 m lets people through. The forces alone do not keep people apart: nobody's disc is let into a wall or deeper into
//! another disc.

use super::actor::SKIN_M;
use super::{STEP_S, Simulation};
use crate::geometry::Point;
use crate::world::{Person, Walk};
use runtime::math;

const RELAXES_S: f64 = 0.5;
const PEOPLE_M2_S2: f64 = 2.1;
const PEOPLE_M: f64 = 0.3;
const STRIDE_S: f64 = 2.0;
const WALLS_M2_S2: f64 = 10.0;
const WALLS_M: f64 = 0.2;
/// Cosine of the angle of sight, 100°.
const COS_SIGHT: f64 = -0.173_648_177_666_930_35;
const BEHIND: f64 = 0.5;
const FASTEST: f64 = 1.3;
/// Cosine and sine of the turn of a push, 20° to the left: who is pushed back goes to the right.
const ASIDE: (f64, f64) = (0.939_692_620_785_908_4, 0.342_020_143_325_668_7);
/// Farther away than this nobody and nothing is felt [m].
const PEOPLE_WITHIN_M: f64 = 5.0;
const WALLS_WITHIN_M: f64 = 1.5;
/// A robot that is not seen is felt when it is so near: at the skin, where a touch has been counted [m].
const TOUCH_M: f64 = SKIN_M + 1e-4;
/// Who gives way to a robot goes no nearer to its outline [m].
const KEEP_M: f64 = 0.15;

impl Simulation {
    /// What each social person feels at the beginning of a step [m/s²].
    pub(super) fn feel(&mut self) {
        for index in 0..self.walks.len() {
            if self.world.persons[index].social.is_some() {
                self.pushes[index] = self.push(index);
            }
        }
    }

    fn push(&self, own: usize) -> Point {
        let (person, walk) = (&self.world.persons[own], &self.walks[own]);
        let centre = walk.disc.centre;
        let wanted = person.wanted(walk);
        let ahead = wanted * (1.0 / wanted.norm().max(1e-9));
        let mut push = (wanted - walk.velocity) * (1.0 / RELAXES_S);
        for (other, disc) in self.discs.iter().enumerate() {
            let apart = centre - disc.centre;
            if other != own && apart.dot(apart) < PEOPLE_WITHIN_M * PEOPLE_WITHIN_M {
                push = push + seen(ahead, repulsion(apart, self.disc_velocities[other]));
            }
        }
        let sees_robots = person.social.is_some_and(|social| social.sees_robots);
        for (body, placed) in self.placed.iter().enumerate() {
            let to = centre - placed.centre;
            let far = PEOPLE_WITHIN_M + placed.radius_m;
            if to.dot(to) >= far * far {
                continue;
            }
            let (gap_m, on_body, on_person) = placed.gap_to_circle(&walk.disc);
            if !sees_robots && gap_m > TOUCH_M {
                continue;
            }
            // As if a person of the same size stood where the robot is nearest.
            let between = on_person - on_body;
            let away = if between.norm() > 1e-6 { between } else { to };
            let apart = away * ((gap_m + 2.0 * walk.disc.radius_m) / away.norm().max(1e-9));
            let actor = &self.actors[body];
            let velocity = actor.velocity_at(actor.body.velocity, on_body);
            push = push + seen(ahead, repulsion(apart, velocity));
        }
        push + self.walls_push(centre, ahead, wanted.norm() / RELAXES_S)
    }

    /// The push of the nearest wall and of the nearest one on the other side.
    fn walls_push(&self, centre: Point, ahead: Point, greed_m_s2: f64) -> Point {
        let nearest = |accept: &dyn Fn(Point) -> bool| {
            let mut best: Option<Point> = None;
            self.world.map.near(centre, WALLS_WITHIN_M, |to| {
                if accept(to) && best.is_none_or(|best| to.dot(to) < best.dot(best)) {
                    best = Some(to);
                }
            });
            best
        };
        let Some(first) = nearest(&|_| true) else { return Point::ZERO };
        let second = nearest(&|to| to.dot(first) < 0.0);
        let mut push = Point::ZERO;
        for to in [Some(first), second].into_iter().flatten() {
            let away_m = to.norm().max(1e-6);
            push = push - to * (WALLS_M2_S2 / WALLS_M * math::exp(-away_m / WALLS_M) / away_m);
        }
        let brake = -push.dot(ahead);
        if brake > 0.5 * greed_m_s2 { push + ahead * (brake - 0.5 * greed_m_s2) } else { push }
    }

    /// Where a social person is after the step, if no robot is in the way.
    pub(super) fn pushed(&self, own: usize, person: &Person, walk: &Walk) -> Walk {
        let mut next = *walk;
        person.look_where_to_go(&mut next, STEP_S);
        let velocity = walk.velocity + self.pushes[own] * STEP_S;
        let (speed_m_s, most_m_s) = (velocity.norm(), FASTEST * person.speed_m_s);
        next.velocity = if speed_m_s > most_m_s { velocity * (most_m_s / speed_m_s) } else { velocity };
        let radius_m = walk.disc.radius_m;
        let mut centre = walk.disc.centre + next.velocity * STEP_S;
        // Others first: what they push into a wall, the wall pushes out.
        for (other, disc) in self.discs.iter().enumerate() {
            let apart = centre - disc.centre;
            let least_m = radius_m + disc.radius_m;
            if other != own && apart.dot(apart) < least_m * least_m && apart.norm() > 1e-6 {
                // Nobody goes deeper into somebody than they are.
                let before_m = (walk.disc.centre - disc.centre).norm();
                let allowed_m = least_m.min(before_m + SEPARATE_M_S * STEP_S);
                push_out(&mut centre, &mut next.velocity, apart, allowed_m);
            }
        }
        self.keep_off_robots(person, walk, &mut centre, &mut next.velocity);
        for _ in 0..2 {
            let mut nearest: Option<Point> = None;
            self.world.map.near(centre, radius_m, |to| {
                if nearest.is_none_or(|nearest| to.dot(to) < nearest.dot(nearest)) {
                    nearest = Some(to);
                }
            });
            if let Some(to) = nearest {
                push_out(&mut centre, &mut next.velocity, -to, radius_m);
            }
        }
        // A place where walls on two sides push is too narrow: better not to move.
        let mut squeezed = false;
        self.world.map.near(centre, radius_m - 1e-3, |_| squeezed = true);
        if squeezed {
            (centre, next.velocity) = (walk.disc.centre, Point::ZERO);
        }
        next.disc.centre = centre;
        next
    }
}

impl Simulation {
    /// Keeps a person's disc out of the robots that are seen or touched: each side of a line at its outline.
    fn keep_off_robots(&self, person: &Person, walk: &Walk, centre: &mut Point, velocity: &mut Point) {
        let sees_robots = person.social.is_some_and(|social| social.sees_robots);
        let before = walk.disc.centre;
        for placed in &self.placed {
            let near_m = placed.radius_m + walk.disc.radius_m + 0.1;
            let to = before - placed.centre;
            if to.dot(to) > near_m * near_m {
                continue;
            }
            let (gap_m, on_body, _) = placed.gap_to_circle(&walk.disc);
            let away = before - on_body;
            if (sees_robots || gap_m <= TOUCH_M) && away.norm() > 1e-6 {
                let normal = away * (1.0 / away.norm());
                let least_m = walk.disc.radius_m + gap_m.min(KEEP_M);
                let beyond_m = (*centre - on_body).dot(normal);
                if beyond_m < least_m {
                    *centre = *centre + normal * (least_m - beyond_m);
                    *velocity = *velocity - normal * velocity.dot(normal).min(0.0);
                }
            }
        }
    }
}

/// Discs that overlap part at this speed [m/s].
const SEPARATE_M_S: f64 = 0.5;

/// Moves `centre` along `apart`, which points to it, until it is `least_m` long; what moves against it is stopped.
fn push_out(centre: &mut Point, velocity: &mut Point, apart: Point, least_m: f64) {
    let away_m = apart.norm();
    if away_m < 1e-9 || away_m >= least_m {
        return;
    }
    let normal = apart * (1.0 / away_m);
    *centre = *centre + normal * (least_m - away_m);
    let against = velocity.dot(normal).min(0.0);
    *velocity = *velocity - normal * against;
}

/// −∇V: `apart` points from the other, who moves with `velocity`, to the person.
fn repulsion(apart: Point, velocity: Point) -> Point {
    let s = velocity * STRIDE_S;
    let behind = apart - s;
    let (near, far) = (apart.norm().max(1e-6), behind.norm().max(1e-6));
    let sum = near + far;
    let b = 0.5 * (sum * sum - s.dot(s)).max(1e-6).sqrt();
    let gradient = (apart * (1.0 / near) + behind * (1.0 / far)) * (sum / (4.0 * b));
    gradient * (PEOPLE_M2_S2 / PEOPLE_M * math::exp(-b / PEOPLE_M))
}

/// A push as it is felt: less from behind, and to the right.
fn seen(ahead: Point, push: Point) -> Point {
    let in_sight = -ahead.dot(push) >= push.norm() * COS_SIGHT;
    push.turned(ASIDE.0, ASIDE.1) * if in_sight { 1.0 } else { BEHIND }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_force_is_the_slope_of_the_potential() {
        let potential = |apart: Point, velocity: Point| {
            let s = velocity * STRIDE_S;
            let sum = apart.norm() + (apart - s).norm();
            PEOPLE_M2_S2 * math::exp(-0.5 * (sum * sum - s.dot(s)).sqrt() / PEOPLE_M)
        };
        for (apart, velocity) in [
            (Point::new(0.8, 0.3), Point::ZERO),
            (Point::new(-0.5, 0.9), Point::new(0.4, -0.7)),
            (Point::new(2.0, 0.1), Point::new(1.2, 0.0)),
        ] {
            let step = 1e-6;
            let slope = |to: Point| (potential(apart - to, velocity) - potential(apart + to, velocity)) / (2.0 * step);
            let wanted = Point::new(slope(Point::new(step, 0.0)), slope(Point::new(0.0, step)));
            let off = repulsion(apart, velocity) - wanted;
            assert!(off.norm() < 1e-6 * wanted.norm().max(1.0), "{apart:?} {off:?}");
        }
        // 7 m/s² · e^(−1/0.3) at a metre from somebody who stands.
        assert!((repulsion(Point::new(1.0, 0.0), Point::ZERO).x_m - 7.0 * math::exp(-1.0 / 0.3)).abs() < 1e-12);
    }
}
