//! People: discs that walk along way-points at constant speed.
//!
//! A person walks from way-point to way-point, round and round or back and forth, and waits `pause_s` at the ends. One
//! A timed one is at each way-point at a given time instead, whatever the speed, and begins anew at the last time;
//! while something blocks the way, that person's clock stands still. One
//! who yields stands still while a robot is ahead and nearer than `yields_within_m`: nobody steps into a machine that
//! they see. One who does not yield walks on until touching it, and the contact counts as suffered. A social one keeps
//! off walls and people, and off robots where they are seen, and makes for the way-points as that allows.

use crate::geometry::{Circle, Placed, Point};

/// How a path continues at its last way-point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Course {
    /// Back along the same way.
    #[default]
    BackAndForth,
    /// On to the first way-point.
    Loop,
    /// At each way-point at a given time, in a straight line between two; from the last one the person is back at the
    /// first at once.
    Timed,
}

/// Who walks where. Given by the world, never changed while it runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Person {
    /// Way-points; at least two.
    pub path: Vec<Point>,
    /// How the path continues at its end.
    pub course: Course,
    /// Walking speed [m/s].
    pub speed_m_s: f64,
    /// Radius of the disc that stands for the person [m].
    pub radius_m: f64,
    /// Stands still while a robot ahead is nearer than this; never when `None` [m].
    pub yields_within_m: Option<f64>,
    /// Waits so long at each end of a back-and-forth path, once per round of a loop [s].
    pub pause_s: f64,
    /// Where on the path the person starts, as a share of one round; drawn from the seed when `None`.
    pub phase: Option<f64>,
    /// When a timed person is at each way-point, strictly rising from zero; empty for others [s].
    pub times_s: Vec<f64>,
    /// Gives way by social force; walks straight on when `None`.
    pub social: Option<Social>,
}

/// How a person gives way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Social {
    /// Keeps off robots too; runs into them otherwise.
    pub sees_robots: bool,
}

/// A social person who is so near to a way-point makes for the next one [m].
const REACHED_M: f64 = 0.4;

/// Where a person is and how they move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walk {
    /// The person's disc.
    pub disc: Circle,
    /// Wanted velocity, also while something blocks the way [m/s].
    pub velocity: Point,
    /// Way-point that the person walks towards.
    towards: usize,
    /// Walking the path backwards.
    returning: bool,
    waits_s: f64,
    /// A timed person's time within the round [s].
    clock_s: f64,
    /// The person is somewhere else at once: a timed round began anew.
    pub jumped: bool,
}

impl Person {
    /// Length of one round: there and back, or once around [m].
    pub fn round_m(&self) -> f64 {
        let there: f64 = self.path.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        match (self.course, self.path.first(), self.path.last()) {
            (Course::Loop, Some(first), Some(last)) => there + (*first - *last).norm(),
            (Course::Timed, ..) => there,
            _ => 2.0 * there,
        }
    }

    /// The person at `phase` (0…1) of a round.
    pub fn start(&self, phase: f64) -> Walk {
        let disc = Circle::new(self.path.first().copied().unwrap_or_default(), self.radius_m);
        let mut walk = Walk {
            disc,
            velocity: Point::ZERO,
            towards: 1,
            returning: false,
            waits_s: 0.0,
            clock_s: 0.0,
            jumped: false,
        };
        if self.course == Course::Timed {
            self.be_on_time(&mut walk, phase.clamp(0.0, 1.0) * self.period_s());
            walk.jumped = false;
            return walk;
        }
        // No way is walked twice here: the pauses are left out, so that the phase is a share of the way.
        self.stroll(&mut walk, self.round_m() * phase.clamp(0.0, 1.0), 0.0);
        walk.velocity = self.wanted(&walk);
        walk
    }

    /// Whether the person stands still because one of `bodies` is ahead and near.
    pub fn yields(&self, walk: &Walk, bodies: &[Placed]) -> bool {
        let Some(within_m) = self.yields_within_m else { return false };
        bodies.iter().any(|body| {
            let far = within_m + self.radius_m + body.radius_m;
            let to = body.centre - walk.disc.centre;
            if to.dot(to) > far * far {
                return false;
            }
            let gap = body.gap_to_circle(&walk.disc);
            gap.0 < within_m && (gap.1 - walk.disc.centre).dot(walk.velocity) > 0.0
        })
    }

    /// The walk after another `dt_s`, if nothing is in the way.
    pub fn walked(&self, walk: &Walk, dt_s: f64) -> Walk {
        let mut next = *walk;
        if self.course == Course::Timed {
            self.be_on_time(&mut next, walk.clock_s + dt_s);
            return next;
        }
        if next.waits_s > 0.0 {
            next.waits_s = (next.waits_s - dt_s).max(0.0);
            next.velocity = Point::ZERO;
        } else {
            self.stroll(&mut next, self.speed_m_s * dt_s, self.pause_s);
            next.velocity = if next.waits_s > 0.0 { Point::ZERO } else { self.wanted(&next) };
        }
        next
    }

    /// Lets a social person wait, or make for the next way-point where this one is reached.
    pub(crate) fn look_where_to_go(&self, walk: &mut Walk, dt_s: f64) {
        if walk.waits_s > 0.0 {
            walk.waits_s = (walk.waits_s - dt_s).max(0.0);
            return;
        }
        let Some(target) = self.path.get(walk.towards) else { return };
        if (*target - walk.disc.centre).norm() < REACHED_M && self.turn_at_way_point(walk) {
            walk.waits_s = self.pause_s;
        }
    }

    /// Length of a timed round [s].
    fn period_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// Puts a timed person where the timetable says for `clock_s`.
    fn be_on_time(&self, walk: &mut Walk, clock_s: f64) {
        let period_s = self.period_s();
        walk.jumped = clock_s >= period_s && walk.clock_s < period_s;
        walk.clock_s = if walk.jumped { clock_s - period_s } else { clock_s };
        let after = self.times_s.iter().position(|time| *time > walk.clock_s).unwrap_or(self.times_s.len() - 1).max(1);
        let (from_s, to_s) = (self.times_s[after - 1], self.times_s[after]);
        let (from, to) = (self.path[after - 1], self.path[after]);
        let share = ((walk.clock_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
        walk.towards = after;
        walk.disc.centre = from + (to - from) * share;
        walk.velocity = (to - from) * (1.0 / (to_s - from_s));
    }

    /// Moves along the path; stops early where a pause begins.
    fn stroll(&self, walk: &mut Walk, way_m: f64, pause_s: f64) {
        let mut left_m = way_m;
        // Each turn of the loop reaches a way-point; a path of coinciding points ends it too.
        for _ in 0..self.path.len() * 4 {
            let Some(target) = self.path.get(walk.towards) else { return };
            let to = *target - walk.disc.centre;
            let away = to.norm();
            if away > left_m {
                walk.disc.centre = walk.disc.centre + to * (left_m / away);
                return;
            }
            walk.disc.centre = *target;
            left_m -= away;
            if self.turn_at_way_point(walk) && pause_s > 0.0 {
                walk.waits_s = pause_s;
                return;
            }
        }
    }

    /// Chooses the next way-point; answers whether this one is an end of the path.
    fn turn_at_way_point(&self, walk: &mut Walk) -> bool {
        let last = self.path.len() - 1;
        match self.course {
            Course::Loop => {
                let end = walk.towards == 0;
                walk.towards = if walk.towards == last { 0 } else { walk.towards + 1 };
                end
            }
            Course::BackAndForth => {
                let end = if walk.returning { walk.towards == 0 } else { walk.towards == last };
                walk.returning ^= end;
                walk.towards = if walk.returning { walk.towards.saturating_sub(1) } else { walk.towards + 1 };
                end
            }
            // Goes by the clock, never by way-points.
            Course::Timed => true,
        }
    }

    /// Velocity at which the person would like to walk [m/s].
    pub(crate) fn wanted(&self, walk: &Walk) -> Point {
        if self.social.is_some() && walk.waits_s > 0.0 {
            return Point::ZERO;
        }
        let Some(target) = self.path.get(walk.towards) else { return Point::ZERO };
        let to = *target - walk.disc.centre;
        let away = to.norm();
        if away > 0.0 { to * (self.speed_m_s / away) } else { walk.velocity }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Footprint, Pose};

    fn walker(course: Course) -> Person {
        Person {
            path: vec![Point::new(0.0, 0.0), Point::new(4.0, 0.0), Point::new(4.0, 3.0)],
            course,
            speed_m_s: 1.0,
            radius_m: 0.25,
            yields_within_m: None,
            pause_s: 0.0,
            phase: Some(0.0),
            times_s: Vec::new(),
            social: None,
        }
    }

    fn after(person: &Person, steps: usize) -> Walk {
        (0..steps).fold(person.start(0.0), |walk, _| person.walked(&walk, 0.01))
    }

    #[test]
    fn a_person_goes_there_and_back() {
        let person = walker(Course::BackAndForth);
        assert_eq!(person.round_m(), 14.0);
        assert!((after(&person, 500).disc.centre - Point::new(4.0, 1.0)).norm() < 1e-9);
        assert!((after(&person, 800).disc.centre - Point::new(4.0, 2.0)).norm() < 1e-9);
        assert!((after(&person, 1400).disc.centre).norm() < 1e-9);
        assert!((after(&person, 1500).disc.centre - Point::new(1.0, 0.0)).norm() < 1e-9);
        assert!((person.start(0.5).disc.centre - Point::new(4.0, 3.0)).norm() < 1e-9);
    }

    #[test]
    fn a_loop_closes() {
        let person = walker(Course::Loop);
        assert_eq!(person.round_m(), 12.0);
        assert!((after(&person, 950).disc.centre - Point::new(2.0, 1.5)).norm() < 1e-9);
        assert!((after(&person, 1300).disc.centre - Point::new(1.0, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn a_person_waits_at_the_ends() {
        let person = Person { pause_s: 2.0, ..walker(Course::BackAndForth) };
        let waiting = after(&person, 850);
        assert!((waiting.disc.centre - Point::new(4.0, 3.0)).norm() < 1e-9);
        assert_eq!(waiting.velocity, Point::ZERO);
        assert!(after(&person, 1000).disc.centre.y_m < 2.9);
    }

    #[test]
    fn a_person_yields_to_a_robot_ahead_but_not_to_one_behind() {
        let person = Person { yields_within_m: Some(0.5), ..walker(Course::Loop) };
        let walk = after(&person, 200);
        let body = Footprint::cut_rectangle(0.2, 0.2, 0.2, 0.0).unwrap();
        assert!(person.yields(&walk, &[body.placed(Pose::new(2.9, 0.0, 0.0))]));
        assert!(!person.yields(&walk, &[body.placed(Pose::new(3.2, 0.0, 0.0))]));
        assert!(!person.yields(&walk, &[body.placed(Pose::new(1.2, 0.0, 0.0))]));
        assert!(!walker(Course::Loop).yields(&walk, &[body.placed(Pose::new(2.9, 0.0, 0.0))]));
    }
}
