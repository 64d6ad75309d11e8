//! Plans worth judging: what was planned before, the way of the guide at several speeds, arcs and S-curves, turns in
//! place, stops, a way back; and changes to the best of them, drawn once from a seed.

use super::pose::Point;
use super::rollout::{INTERVALS, Limits, Plan, State};
use runtime::math;

/// Curvatures of arcs [1/m].
const CURVATURES: [f64; 9] = [0.0, 0.35, -0.35, 0.9, -0.9, 1.8, -1.8, 3.5, -3.5];
/// Shares of the greatest speed that arcs are driven at.
const SPEEDS: [f64; 5] = [1.0, 0.75, 0.5, 0.3, 0.12];
/// Looks ahead of the guide's follower [m].
const LOOKS_M: [f64; 3] = [0.35, 0.6, 1.0];
/// Steps of the follower within an interval.
const FOLLOWER_STEPS: usize = 3;

/// Standard plans: independent of where the robot is.
#[derive(Debug)]
pub struct Candidates {
    fixed: Vec<Plan>,
    /// Changes of (forward, turn) per interval, as shares of a spread; zero mean.
    changes: Vec<[(f64, f64); INTERVALS]>,
}

impl Candidates {
    /// All plans within `limits`, and `changes` drawn from `seed`.
    pub fn new(limits: &Limits, changes: usize, seed: u64) -> Candidates {
        let top = limits.forward_m_s;
        let turn = |w: f64| w.clamp(-limits.turn_rad_s, limits.turn_rad_s);
        let mut fixed: Vec<Plan> = vec![[(0.0, 0.0); INTERVALS]];
        for share in SPEEDS {
            for first in CURVATURES {
                for second in [first, 0.0, -first] {
                    let v = top * share;
                    let mut plan = [(v, turn(v * second)); INTERVALS];
                    for interval in plan.iter_mut().take(INTERVALS / 2) {
                        *interval = (v, turn(v * first));
                    }
                    let known = fixed.contains(&plan);
                    if !known {
                        fixed.push(plan);
                    }
                }
            }
        }
        for share in [0.25, 0.6, 1.0] {
            for side in [-1.0, 1.0] {
                let w = limits.turn_rad_s * share * side;
                fixed.push([(0.0, w); INTERVALS]);
                // A turn in place, then off.
                let mut off = [(0.4 * top, 0.0); INTERVALS];
                off[0] = (0.0, w);
                off[1] = (0.0, w);
                fixed.push(off);
            }
        }
        for w in [-0.8, 0.0, 0.8] {
            fixed.push([(-limits.backward_m_s, turn(w)); INTERVALS]);
        }
        let mut chance = Chance(seed ^ 0x9E37_79B9_7F4A_7C15);
        let changes = (0..changes)
            .map(|_| {
                // A change that lasts over intervals moves the path; one that flickers does not.
                let (mut v, mut w) = (chance.normal(), chance.normal());
                std::array::from_fn(|_| {
                    v = 0.6 * v + 0.8 * chance.normal();
                    w = 0.6 * w + 0.8 * chance.normal();
                    (v, w)
                })
            })
            .collect();
        Candidates { fixed, changes }
    }

    /// The standard plans.
    pub fn fixed(&self) -> &[Plan] {
        &self.fixed
    }

    /// Number of changes.
    pub fn changes(&self) -> usize {
        self.changes.len()
    }

    /// `plan` changed in the way `index`, by `spread` of (forward, turn), within `limits`.
    pub fn changed(&self, plan: &Plan, index: usize, spread: (f64, f64), limits: &Limits) -> Plan {
        let change = &self.changes[index];
        std::array::from_fn(|k| {
            let v = plan[k].0 + spread.0 * change[k].0;
            let w = plan[k].1 + spread.1 * change[k].1;
            (v.clamp(-limits.backward_m_s, limits.forward_m_s), w.clamp(-limits.turn_rad_s, limits.turn_rad_s))
        })
    }
}

/// The plan of before, `shift` (0…1) of an interval later.
pub fn shifted(plan: &Plan, shift: f64) -> Plan {
    std::array::from_fn(|k| {
        let (a, b) = (plan[k], plan[(k + 1).min(INTERVALS - 1)]);
        (a.0 + (b.0 - a.0) * shift, a.1 + (b.1 - a.1) * shift)
    })
}

/// Plans that follow the guide's `path` by pure pursuit (Coulter, 1992), one per speed and look ahead, into `plans`.
pub fn followers(state: State, path: &[Point], limits: &Limits, interval_s: f64, plans: &mut Vec<Plan>) {
    for share in SPEEDS {
        for look_m in LOOKS_M {
            if plans.len() < plans.capacity() {
                plans.push(follower(state, path, limits, interval_s, limits.forward_m_s * share, look_m));
            }
        }
    }
}

fn follower(state: State, path: &[Point], limits: &Limits, interval_s: f64, speed_m_s: f64, look_m: f64) -> Plan {
    let mut here = state;
    let mut at = 0;
    let mut plan = [(0.0, 0.0); INTERVALS];
    let step_s = interval_s / FOLLOWER_STEPS as f64;
    for interval in &mut plan {
        let mut sum = (0.0, 0.0);
        for _ in 0..FOLLOWER_STEPS {
            while at + 1 < path.len() && here.pose.place.to(path[at]).length_m() < look_m {
                at += 1;
            }
            let wanted = match path.get(at) {
                Some(target) => pursue(&here, *target, speed_m_s, limits),
                None => (0.0, 0.0),
            };
            here = here.towards(wanted, limits, step_s);
            sum = (sum.0 + wanted.0, sum.1 + wanted.1);
        }
        *interval = (sum.0 / FOLLOWER_STEPS as f64, sum.1 / FOLLOWER_STEPS as f64);
    }
    plan
}

fn pursue(here: &State, target: Point, speed_m_s: f64, limits: &Limits) -> (f64, f64) {
    let local = here.pose.frame().inner(target);
    let bearing = math::atan2(local.y_m, local.x_m);
    let turn = |w: f64| w.clamp(-limits.turn_rad_s, limits.turn_rad_s);
    if bearing.abs() > 1.2 {
        return (0.0, turn(3.0 * bearing));
    }
    let curvature = 2.0 * local.y_m / local.squared().max(1e-4);
    let wanted = speed_m_s * (1.0 - bearing.abs() / 1.6);
    // Slower where the turn rate would not do.
    let v = wanted.min(0.9 * limits.turn_rad_s / curvature.abs().max(1e-6));
    (v, turn(v * curvature))
}

/// A small generator for the table of changes (xorshift*, Marsaglia 2003; Vigna 2016).
struct Chance(u64);

impl Chance {
    fn share(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 40) as f64 / f64::from(1 << 24)
    }

    /// Mean 0, variance 1: the sum of four even numbers.
    fn normal(&mut self) -> f64 {
        ((0..4).map(|_| self.share()).sum::<f64>() - 2.0) * 1.732_050_807_568_877_2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        forward_m_s: 2.0,
        backward_m_s: 0.2,
        turn_rad_s: 2.5,
        acceleration_m_s2: 2.0,
        deceleration_m_s2: 4.0,
        turn_acceleration_rad_s2: 8.0,
    };

    #[test]
    fn every_plan_is_within_the_limits_and_the_same_for_the_same_seed() {
        let (a, b) = (Candidates::new(&LIMITS, 64, 7), Candidates::new(&LIMITS, 64, 7));
        let within = |plan: &Plan| plan.iter().all(|(v, w)| (-0.2..=2.0).contains(v) && w.abs() <= 2.5);
        assert!(a.fixed().iter().all(within));
        for k in 0..64 {
            let changed = a.changed(&a.fixed()[5], k, (0.5, 1.0), &LIMITS);
            assert!(within(&changed));
            assert_eq!(changed, b.changed(&b.fixed()[5], k, (0.5, 1.0), &LIMITS));
        }
    }

    #[test]
    fn a_follower_turns_towards_a_path_that_bends_and_in_place_towards_one_behind() {
        let bend: Vec<Point> = (0..40).map(|k| Point::new(0.1 * f64::from(k), 0.01 * f64::from(k * k))).collect();
        let plan = follower(State::default(), &bend, &LIMITS, 0.35, 1.0, 0.6);
        assert!(plan[2].1 > 0.1 && plan[2].0 > 0.3, "{plan:?}");
        let behind: Vec<Point> = (0..40).map(|k| Point::new(-0.1 * f64::from(k), 0.001)).collect();
        let plan = follower(State::default(), &behind, &LIMITS, 0.35, 1.0, 0.6);
        assert!(plan[0].0 == 0.0 && plan[0].1.abs() > 1.0, "{plan:?}");
    }
}
