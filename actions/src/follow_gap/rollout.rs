//! One plan, carried out in thought: where the robot gets to, what it comes near, and what that is worth.
//!
//! A plan is a wanted velocity (v, ω) per interval. The robot follows it with its accelerations; every step is checked
//! by the whole footprint, against what stands and against where each mover will be at that time. Its cost is
//!
//! J = U(end) + ∫ near(t) dt + effort + collision,
//!
//! with U the guide's cost to go, at the end and a little ahead of it (so that the end's heading counts), near(t) =
//! w·(1 − c/c₀)² where the gap c to the outline is below c₀(v), which grows with the speed, and a collision's cost the
//! higher the sooner it comes. So any plan that collides is worse than any that does not.

use super::clearance::Clearance;
use super::guide::Guide;
use super::pose::{Frame, Point, Pose};

/// Intervals of a plan.
pub const INTERVALS: usize = 6;

/// Wanted velocities by interval: (forward [m/s], turn [rad/s]).
pub type Plan = [(f64, f64); INTERVALS];

/// Outline of the robot, from its centre of rotation [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// To the front edge [m].
    pub ahead_m: f64,
    /// To the rear edge [m].
    pub behind_m: f64,
    /// To either side [m].
    pub half_width_m: f64,
}

impl Outline {
    /// Distance of a point, in the robot's frame, from the outline; negative within, by the depth [m].
    pub fn gap_m(&self, point: Point) -> f64 {
        let ahead = if point.x_m >= 0.0 { point.x_m - self.ahead_m } else { -point.x_m - self.behind_m };
        let aside = point.y_m.abs() - self.half_width_m;
        if ahead > 0.0 && aside > 0.0 { (ahead * ahead + aside * aside).sqrt() } else { ahead.max(aside) }
    }

    /// Radius of the circle about the centre of rotation that holds it [m].
    pub fn radius_m(&self) -> f64 {
        let far = self.ahead_m.max(self.behind_m);
        (far * far + self.half_width_m * self.half_width_m).sqrt()
    }
}

/// Something that moves, as a disc with a constant velocity in the odometry frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mover {
    /// Tells it from others, from step to step.
    pub id: u64,
    /// Whether the newest scan shows it; otherwise it is carried on by its velocity.
    pub seen: bool,
    /// Where its centre is now.
    pub place: Point,
    /// Its velocity [m/s].
    pub velocity: Point,
    /// Its radius [m].
    pub radius_m: f64,
}

/// How fast the robot may be and become.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Greatest forward speed [m/s].
    pub forward_m_s: f64,
    /// Greatest backward speed [m/s].
    pub backward_m_s: f64,
    /// Greatest turn rate [rad/s].
    pub turn_rad_s: f64,
    /// Greatest gain of speed [m/s²].
    pub acceleration_m_s2: f64,
    /// Greatest loss of speed [m/s²].
    pub deceleration_m_s2: f64,
    /// Greatest change of the turn rate [rad/s²].
    pub turn_acceleration_rad_s2: f64,
}

/// What counts how much.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Weights {
    /// Steps of a plan.
    pub steps: usize,
    /// Length of a step [s].
    pub step_s: f64,
    /// A gap below this is a collision [m].
    pub margin_m: f64,
    /// Added to the margin per speed [m per m/s].
    pub margin_per_speed_s: f64,
    /// A gap below this costs [m].
    pub near_m: f64,
    /// Added to that per speed [m per m/s].
    pub near_per_speed_s: f64,
    /// What a gap of nothing costs per second.
    pub near_weight: f64,
    /// What a gap to a mover below `mover_near_m` costs per second, at nothing.
    pub mover_weight: f64,
    /// A gap to a mover below this costs [m].
    pub mover_near_m: f64,
    /// A gap to a mover below this is a collision [m].
    pub mover_margin_m: f64,
    /// A mover's disc grows by this per second of prediction [m/s].
    pub mover_growth_m_s: f64,
    /// Cost of changing the turn rate by 1 rad/s between intervals.
    pub turn_change_weight: f64,
    /// Cost of driving backwards, per metre.
    pub backward_weight: f64,
    /// How far ahead of the end the cost to go is looked up as well [m].
    pub look_ahead_m: f64,
}

/// Where the robot is and how it moves, at a plan's beginning or on its way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    /// Pose in the odometry frame.
    pub pose: Pose,
    /// Forward speed [m/s].
    pub forward_m_s: f64,
    /// Turn rate [rad/s].
    pub turn_rad_s: f64,
}

impl State {
    /// The state after `dt_s` on the way to the wanted velocity.
    pub fn towards(&self, wanted: (f64, f64), limits: &Limits, dt_s: f64) -> State {
        let rate = if wanted.0.abs() < self.forward_m_s.abs() || wanted.0 * self.forward_m_s < 0.0 {
            limits.deceleration_m_s2
        } else {
            limits.acceleration_m_s2
        };
        let (dv, dw) = (rate * dt_s, limits.turn_acceleration_rad_s2 * dt_s);
        let forward_m_s = self.forward_m_s + (wanted.0 - self.forward_m_s).clamp(-dv, dv);
        let turn_rad_s = self.turn_rad_s + (wanted.1 - self.turn_rad_s).clamp(-dw, dw);
        let mean = (0.5 * (self.forward_m_s + forward_m_s), 0.5 * (self.turn_rad_s + turn_rad_s));
        State { pose: self.pose.after(mean.0, mean.1, dt_s), forward_m_s, turn_rad_s }
    }
}

/// All that plans are judged by.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// What stands.
    pub clearance: &'a Clearance,
    /// The way to the goal.
    pub guide: &'a Guide,
    /// What moves.
    pub movers: &'a [Mover],
    /// The robot's outline.
    pub outline: Outline,
    /// Its limits.
    pub limits: Limits,
    /// What counts how much.
    pub weights: Weights,
    /// Where it should get to.
    pub goal: Point,
}

/// What became of a plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Its cost.
    pub cost: f64,
    /// When it collides; +∞ when it does not [s].
    pub collides_s: f64,
    /// The least gap on the way [m].
    pub least_gap_m: f64,
}

/// From this gap on it need not be known exactly [m].
const FAR_M: f64 = 0.6;
/// What any collision costs at least.
pub const COLLISION: f64 = 1e3;

impl Scene<'_> {
    /// Gap between the outline at `frame` and what stands; +∞ in the open [m].
    pub fn gap_m(&self, frame: &Frame) -> f64 {
        let outline = &self.outline;
        let Some(middle) = self.clearance.nearest(frame.place) else { return f64::INFINITY };
        // Far from everything the circle about the outline does: nothing is nearer to it than this.
        let away_m = frame.place.to(middle).length_m() - outline.radius_m();
        if away_m > FAR_M {
            return away_m;
        }
        // The point nearest to the outline is nearest to one of three places along its middle line, nearly always.
        let (front, rear) =
            (outline.ahead_m - outline.half_width_m * 0.5, outline.half_width_m * 0.5 - outline.behind_m);
        [front, rear]
            .into_iter()
            .filter_map(|x_m| self.clearance.nearest(frame.outer(x_m, 0.0)))
            .map(|point| outline.gap_m(frame.inner(point)))
            .fold(outline.gap_m(frame.inner(middle)), f64::min)
    }

    /// Gap between the outline at `frame` and the nearest mover `after_s` from now; +∞ where none is nearer than counts [m].
    pub fn mover_gap_m(&self, frame: &Frame, after_s: f64) -> f64 {
        let grown_m = self.weights.mover_growth_m_s * after_s;
        let radius_m = self.outline.radius_m();
        let mut least_m = self.weights.mover_near_m.max(self.weights.mover_margin_m);
        let mut gap_m = f64::INFINITY;
        for mover in self.movers {
            let place = mover.place.plus(mover.velocity, after_s);
            // The circle about the outline is nearer than the outline: beyond this it need not be known exactly.
            let reach_m = least_m + radius_m + mover.radius_m + grown_m;
            if frame.place.to(place).squared() >= reach_m * reach_m {
                continue;
            }
            let found_m = self.outline.gap_m(frame.inner(place)) - mover.radius_m - grown_m;
            if found_m < least_m {
                (least_m, gap_m) = (found_m, found_m);
            }
        }
        gap_m
    }

    /// Carries `plan` out from `state`, which holds `delay_s` from now.
    pub fn judge(&self, state: State, delay_s: f64, plan: &Plan) -> Outcome {
        let w = &self.weights;
        let start = state.pose.frame();
        // Where it stands too near already, what does not make it worse is allowed.
        let gap_now_m = self.gap_m(&start);
        let mover_gap_now_m = self.mover_gap_m(&start, delay_s);
        let mut least_gap_m = f64::INFINITY;
        let mut cost = 0.0;
        let mut here = state;
        let mut turn_before = state.turn_rad_s;
        let mut collides_s = f64::INFINITY;
        for step in 0..w.steps {
            let interval = step * INTERVALS / w.steps;
            let wanted = plan[interval];
            if (step * INTERVALS).is_multiple_of(w.steps) || step == 0 {
                let change = wanted.1 - turn_before;
                cost += w.turn_change_weight * change * change;
                turn_before = wanted.1;
            }
            here = here.towards(wanted, &self.limits, w.step_s);
            let frame = here.pose.frame();
            let speed = here.forward_m_s.abs();
            let gap_m = self.gap_m(&frame);
            let margin_m = (w.margin_m + w.margin_per_speed_s * speed).min(gap_now_m - 1e-3);
            let near_m = w.near_m + w.near_per_speed_s * speed;
            least_gap_m = least_gap_m.min(gap_m);
            let time_s = delay_s + (step + 1) as f64 * w.step_s;
            let mover_gap_m = if self.movers.is_empty() { f64::INFINITY } else { self.mover_gap_m(&frame, time_s) };
            let mover_margin_m = w.mover_margin_m.min(mover_gap_now_m - 1e-3);
            if gap_m < margin_m || mover_gap_m < mover_margin_m {
                collides_s = time_s;
                break;
            }
            if gap_m < near_m {
                let share = 1.0 - gap_m / near_m;
                cost += w.near_weight * share * share * w.step_s;
            }
            if mover_gap_m < w.mover_near_m {
                let share = 1.0 - mover_gap_m / w.mover_near_m;
                cost += w.mover_weight * share * share * w.step_s;
            }
            if here.forward_m_s < 0.0 {
                cost -= w.backward_weight * here.forward_m_s * w.step_s;
            }
            // Whoever is at the goal has arrived.
            if here.pose.place.to(self.goal).length_m() < 0.1 {
                return Outcome { cost, collides_s, least_gap_m };
            }
        }
        let end = here.pose.frame();
        let ahead = end.outer(w.look_ahead_m, 0.0);
        cost += 0.5 * (self.guide.cost(end.place) + self.guide.cost(ahead));
        if collides_s.is_finite() {
            let horizon_s = w.steps as f64 * w.step_s;
            cost += COLLISION * (2.0 - collides_s.min(horizon_s) / horizon_s);
        }
        Outcome { cost, collides_s, least_gap_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JACKAL: Outline = Outline { ahead_m: 0.254, behind_m: 0.254, half_width_m: 0.215 };

    #[test]
    fn the_gap_to_a_rectangle_is_exact_at_sides_and_corners() {
        for (x, y, gap) in
            [(0.354, 0.0, 0.1), (-0.304, 0.1, 0.05), (0.1, -0.315, 0.1), (0.284, 0.255, 0.05), (0.0, 0.2, -0.015)]
        {
            assert!((JACKAL.gap_m(Point::new(x, y)) - gap).abs() < 1e-12, "{x} {y}");
        }
    }

    #[test]
    fn the_gap_to_movers_is_exact_where_it_counts_and_infinite_beyond() {
        let weights = Weights { mover_near_m: 0.6, mover_growth_m_s: 0.1, ..Weights::default() };
        let movers: Vec<Mover> = (0..12)
            .map(|k| {
                let (sin, cos) = runtime::math::sin_cos(0.7 * f64::from(k));
                let (place, velocity) =
                    (Point::new(0.3 * f64::from(k) * cos, 0.3 * f64::from(k) * sin), Point::new(-sin, cos));
                Mover { place, velocity, radius_m: 0.1 + 0.03 * f64::from(k), ..Mover::default() }
            })
            .collect();
        let (clearance, guide) = (Clearance::new(8, 0.1), Guide::new(8));
        let (mut near, mut far) = (0, 0);
        for step in 0..400 {
            let (x_m, y_m) = (0.4 * f64::from(step % 20) - 4.0, 0.4 * f64::from(step / 20) - 4.0);
            let (frame, after_s) = (Pose::new(x_m, y_m, 0.1 * f64::from(step)).frame(), 0.004 * f64::from(step));
            let scene = Scene {
                clearance: &clearance,
                guide: &guide,
                movers: &movers,
                outline: JACKAL,
                limits: Limits::default(),
                weights,
                goal: Point::default(),
            };
            let exact = movers
                .iter()
                .map(|m| JACKAL.gap_m(frame.inner(m.place.plus(m.velocity, after_s))) - m.radius_m - 0.1 * after_s)
                .fold(f64::INFINITY, f64::min);
            let found = scene.mover_gap_m(&frame, after_s);
            if exact < weights.mover_near_m {
                assert_eq!(found, exact);
                near += 1;
            } else {
                assert_eq!(found, f64::INFINITY, "{exact}");
                far += 1;
            }
        }
        assert!(near > 50 && far > 50, "{near} {far}");
    }

    #[test]
    fn a_state_gains_and_loses_speed_within_its_limits() {
        let limits = Limits {
            forward_m_s: 2.0,
            backward_m_s: 0.2,
            turn_rad_s: 2.0,
            acceleration_m_s2: 2.0,
            deceleration_m_s2: 4.0,
            turn_acceleration_rad_s2: 8.0,
        };
        let state = State { forward_m_s: 1.0, ..State::default() };
        assert_eq!(state.towards((2.0, 0.0), &limits, 0.1).forward_m_s, 1.2);
        assert_eq!(state.towards((0.0, 0.0), &limits, 0.1).forward_m_s, 0.6);
        assert_eq!(state.towards((1.0, -3.0), &limits, 0.1).turn_rad_s, -0.8);
    }
}
