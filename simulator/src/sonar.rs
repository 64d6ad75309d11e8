//! What a sonar disc reads.
//!
//! The disc hears the nearest surface inside its cone. A smooth surface that the sound meets at more than
//! `specular_deg` from its normal reflects it away and is not heard, but still hides what is behind it; edges, round
//! things, people and rough surfaces always answer. On top: noise of the reading, lost echoes, and crosstalk with the
//! disc of the other array that fires at the same time. Nothing within reach reads as the greatest range.

use crate::geometry::{Cone, ConeHit, Point, Pose};
use crate::noise::Chance;
use crate::realism::SonarRealism;
use crate::scene::Scene;
use drivers::p2os::model::SonarPose;
use runtime::math;
use std::f64::consts::PI;

/// Answering surfaces that are kept in case the nearest are hidden behind a mirror.
const CANDIDATES: usize = 4;
/// A surface hides another one only from this much nearer: neighbours share their edges [m].
const HIDES_M: f64 = 0.001;

/// Everything about a ring of discs that does not change.
#[derive(Debug, Clone)]
pub(crate) struct Ears {
    discs: Vec<Disc>,
    cos_half: f64,
    sin_half: f64,
    cos_specular: f64,
    min_range_m: f64,
    max_range_m: f64,
    unit_m: f64,
    realism: SonarRealism,
}

#[derive(Debug, Clone, Copy)]
struct Disc {
    place: Point,
    axis: Point,
}

impl Ears {
    /// Discs at `poses`, that read whole units of `unit_m` between their least and greatest range.
    pub fn new(poses: &[SonarPose], range_m: (f64, f64), unit_m: f64, realism: SonarRealism) -> Ears {
        let disc =
            |pose: &SonarPose| Disc { place: Point::new(pose.x_m, pose.y_m), axis: Point::unit(pose.bearing_rad) };
        let (sin_half, cos_half) = math::sin_cos(realism.half_angle_deg * PI / 180.0);
        Ears {
            discs: poses.iter().map(disc).collect(),
            cos_half,
            sin_half,
            // At 90° nothing is lost; rounding must not bring the limit above zero.
            cos_specular: if realism.specular_deg >= 90.0 { 0.0 } else { math::cos(realism.specular_deg * PI / 180.0) },
            min_range_m: range_m.0,
            max_range_m: range_m.1,
            unit_m,
            realism,
        }
    }

    /// The reading of `disc` on a body at `pose` [units]. `other` is whether another array fires with it.
    pub fn reading(&self, scene: &Scene, pose: Pose, disc: usize, other: bool, chance: &mut Chance) -> u16 {
        let mut range_m = self.range_m(scene, pose, disc).unwrap_or(f64::INFINITY);
        let realism = &self.realism;
        if chance.happens(realism.lost) {
            range_m = f64::INFINITY;
        }
        if other && chance.happens(realism.crosstalk) {
            let own_m = range_m.min(self.max_range_m);
            range_m = self.min_range_m + (own_m - self.min_range_m).max(0.0) * chance.share();
        }
        if range_m < self.max_range_m && (realism.noise_m > 0.0 || realism.noise_share > 0.0) {
            range_m += chance.normal() * (realism.noise_m + realism.noise_share * range_m);
        }
        (range_m.clamp(self.min_range_m, self.max_range_m) / self.unit_m).round() as u16
    }

    /// Distance of the nearest surface that answers, `None` when none does within the greatest range [m].
    pub fn range_m(&self, scene: &Scene, pose: Pose, disc: usize) -> Option<f64> {
        let Disc { place, axis } = *self.discs.get(disc)?;
        let (sin, cos) = math::sin_cos(pose.heading_rad);
        let axis = axis.turned(cos, sin);
        let cone = Cone {
            apex: pose.place() + place.turned(cos, sin),
            axis,
            left: axis.turned(self.cos_half, self.sin_half),
            right: axis.turned(self.cos_half, -self.sin_half),
            cos_half: self.cos_half,
            reach_m: self.max_range_m,
        };
        // The first pass stops listening at the nearest answer. Where that turns out to be hidden behind a mirror, the
        // second one listens to the end.
        for patient in [false, true] {
            let mut heard = Heard { candidates: [None; CANDIDATES], mirror_m: f64::INFINITY };
            scene.listen(&cone, |hit, rough| {
                heard.take(hit, rough || hit.cos_incidence >= self.cos_specular);
                if patient { cone.reach_m } else { heard.nearest_m().min(cone.reach_m) }
            });
            let hidden = |hit: &ConeHit| {
                let to = hit.point - cone.apex;
                hit.distance_m > heard.mirror_m + HIDES_M
                    && scene.cast(cone.apex, to * (1.0 / hit.distance_m), hit.distance_m - HIDES_M).is_some()
            };
            let answer = heard.candidates.iter().flatten().find(|hit| !hidden(hit)).map(|hit| hit.distance_m);
            if answer.is_some() || heard.candidates[0].is_none() {
                return answer;
            }
        }
        None
    }
}

/// The nearest answering surfaces in order, and how near a mirror is.
struct Heard {
    candidates: [Option<ConeHit>; CANDIDATES],
    mirror_m: f64,
}

impl Heard {
    fn take(&mut self, hit: ConeHit, answers: bool) {
        if !answers {
            self.mirror_m = self.mirror_m.min(hit.distance_m);
            return;
        }
        let mut next = Some(hit);
        for place in &mut self.candidates {
            match (*place, next) {
                // The index may hand over a surface twice.
                (Some(kept), Some(new)) if kept.point == new.point => return,
                (Some(kept), Some(new)) if new.distance_m < kept.distance_m => std::mem::swap(place, &mut next),
                (None, Some(_)) => std::mem::swap(place, &mut next),
                _ => {}
            }
        }
    }

    fn nearest_m(&self) -> f64 {
        self.candidates[0].map_or(f64::INFINITY, |hit| hit.distance_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Circle, Footprint, Placed, Segment};
    use crate::noise::Purpose;
    use crate::realism::Realism;
    use crate::world::{Map, Post, Wall};
    use drivers::p2os::model;

    const DEG: f64 = PI / 180.0;

    fn ears(realism: SonarRealism) -> Ears {
        let p3dx = model::named("p3dx-sh").unwrap();
        Ears::new(&p3dx.sonar, (p3dx.min_range_m, p3dx.max_range_m), p3dx.range_m_per_unit, realism)
    }

    /// A smooth wall of 4 m, `away_m` ahead of the origin, turned by `turned_deg` from square.
    fn wall(away_m: f64, turned_deg: f64, rough: bool) -> Wall {
        let middle = Point::new(away_m, 0.0);
        let along = Point::unit((90.0 + turned_deg) * DEG) * 2.0;
        Wall { segment: Segment::new(middle - along, middle + along), rough }
    }

    fn heard(ears: &Ears, map: &Map, persons: &[Circle], pose: Pose, disc: usize) -> Option<f64> {
        ears.range_m(&Scene { map, persons, bodies: &[], own: 0 }, pose, disc)
    }

    #[test]
    fn a_wall_abeam_is_read_from_the_discs_own_place() {
        let map =
            Map::new(&[Wall { segment: Segment::new(Point::new(-5.0, 1.0), Point::new(5.0, 1.0)), rough: false }], &[]);
        let range = heard(&ears(Realism::none().sonar), &map, &[], Pose::default(), 0).unwrap();
        assert!((range - (1.0 - 0.136)).abs() < 1e-9, "{range}");
    }

    #[test]
    fn each_disc_reads_what_a_fan_of_rays_reads() {
        let map = Map::new(
            &[wall(1.5, 20.0, true), wall(-2.0, -35.0, true)],
            &[Post { circle: Circle::new(Point::new(0.4, 1.3), 0.1), rough: true }],
        );
        let ears = ears(Realism::none().sonar);
        let pose = Pose::new(0.1, -0.2, 0.4);
        for (disc, mount) in model::named("p3dx-sh").unwrap().sonar.iter().enumerate() {
            let apex = pose.world_from_body(Point::new(mount.x_m, mount.y_m));
            let fan = (-3000..=3000).filter_map(|k| {
                let bearing = pose.heading_rad + mount.bearing_rad + k as f64 * 15.0 * DEG / 3000.0;
                map.cast(apex, Point::unit(bearing), 5.0)
            });
            let expected = fan.fold(f64::INFINITY, f64::min);
            let range = heard(&ears, &map, &[], pose, disc).unwrap_or(f64::INFINITY);
            assert!(range == expected || (range - expected).abs() < 1e-3, "disc {disc}: {range} {expected}");
        }
    }

    #[test]
    fn a_smooth_wall_met_at_a_slant_is_silent_and_hides_what_is_behind() {
        let smooth = Map::new(&[wall(1.0, 70.0, false), wall(2.0, 0.0, false)], &[]);
        let rough = Map::new(&[wall(1.0, 70.0, true), wall(2.0, 0.0, false)], &[]);
        let specular = ears(SonarRealism { specular_deg: 50.0, ..Realism::none().sonar });
        let pose = Pose::new(0.0, 0.0, 10.0 * DEG);
        let near = heard(&specular, &rough, &[], pose, 4).unwrap();
        assert!(near < 0.9, "{near}");
        assert_eq!(heard(&ears(Realism::none().sonar), &smooth, &[], pose, 4), Some(near));
        // The mirror is not heard; of the wall behind only what it leaves free.
        let behind = heard(&specular, &smooth, &[], pose, 4);
        assert!(behind.is_none_or(|range| range > 1.5), "{behind:?}");
    }

    #[test]
    fn square_walls_round_things_and_edges_answer_however_smooth() {
        let ears = ears(SonarRealism { specular_deg: 10.0, ..Realism::none().sonar });
        let square = Map::new(&[wall(2.0, 0.0, false)], &[]);
        assert!(heard(&ears, &square, &[], Pose::new(0.0, 0.0, 10.0 * DEG), 4).is_some());
        let post = Map::new(&[], &[Post { circle: Circle::new(Point::new(1.5, 0.0), 0.03), rough: false }]);
        assert!(heard(&ears, &post, &[], Pose::new(0.0, 0.0, 10.0 * DEG), 4).is_some());
        let edge = Wall { segment: Segment::new(Point::new(1.0, 0.0), Point::new(4.0, 0.3)), rough: false };
        assert!(heard(&ears, &Map::new(&[edge], &[]), &[], Pose::new(0.0, 0.0, 10.0 * DEG), 4).is_some());
    }

    #[test]
    fn people_and_other_bodies_are_heard_and_the_body_does_not_hear_itself() {
        let ears = ears(Realism::none().sonar);
        let map = Map::default();
        let outline = Footprint::cut_rectangle(0.2, 0.3, 0.2, 0.0).unwrap();
        let bodies: Vec<Placed> = [0.0, 2.0].map(|x| outline.placed(Pose::new(x, 0.0, 0.0))).to_vec();
        let pose = Pose::new(0.0, 0.0, 0.0);
        let scene = Scene { map: &map, persons: &[], bodies: &bodies, own: 0 };
        let range = ears.range_m(&scene, pose, 3).unwrap();
        assert!((range - (1.7 - 0.166)).abs() < 0.01, "{range}");
        let person = [Circle::new(Point::new(1.0, 0.0), 0.25)];
        let range = heard(&ears, &map, &person, pose, 3).unwrap();
        assert!((range - (0.75 - 0.166)).abs() < 0.01, "{range}");
    }

    #[test]
    fn readings_are_whole_millimetres_within_bounds_and_repeat_under_the_same_seed() {
        let near = Map::new(&[wall(0.2, 0.0, true)], &[]);
        let scene = |map| Scene { map, persons: &[], bodies: &[], own: 0 };
        let ears = ears(SonarRealism { lost: 0.1, crosstalk: 0.1, ..SonarRealism::default() });
        let empty = Map::default();
        let mut chance = Chance::new(3, Purpose::Sonar, 0);
        assert_eq!(ears.reading(&scene(&empty), Pose::default(), 0, false, &mut chance), 5000);
        let all = |seed| -> Vec<u16> {
            let mut chance = Chance::new(seed, Purpose::Sonar, 0);
            (0..500)
                .map(|k| {
                    ears.reading(
                        &scene(if k % 2 == 0 { &near } else { &empty }),
                        Pose::default(),
                        k % 16,
                        true,
                        &mut chance,
                    )
                })
                .collect()
        };
        assert_eq!(all(1), all(1));
        assert_ne!(all(1), all(2));
        assert!(all(1).iter().all(|range| (100..=5000).contains(range)));
    }
}
