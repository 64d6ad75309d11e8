//! One order on its way: what to do now, and whether it has arrived or cannot.

use super::config::GotoConfig;
use super::law::{Pace, Target, approach};
use super::route::Route;
use crate::place::Place;
use messages::{GotoGoal, GotoPath, GotoProgress, GotoResult, GotoState};
use runtime::{Time, math};

/// What follows from a look at the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Drive so.
    Go(Pace),
    /// The goal is reached.
    Arrived,
    /// It cannot be reached, for this reason.
    Failed(&'static str),
}

/// An accepted order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errand {
    route: Route,
    heading_rad: Option<f64>,
    tolerance_m: f64,
    begun: Time,
    turning: bool,
    lost: bool,
    place: Place,
    way_m: f64,
    /// Least way left so far, and when it became so.
    least_left_m: f64,
    nearer_at: Time,
    seen_at: Time,
    occupied_since: Option<Time>,
}

/// Progress of this much counts [m].
const PROGRESS_M: f64 = 0.05;

impl Errand {
    /// To the goal of an order, or why not.
    pub fn to(goal: &GotoGoal, place: Place, now: Time, config: &GotoConfig) -> Result<Errand, &'static str> {
        if !(goal.x_m.is_finite() && goal.y_m.is_finite()) {
            return Err("the goal is no number: give x_m and y_m in metres in the map frame");
        }
        let route = Route::to(goal.x_m, goal.y_m);
        Errand::new(route, goal.heading_rad, goal.tolerance_m, place, now, config)
    }

    /// Along the via points of an order, or why not.
    pub fn along(path: &GotoPath, place: Place, now: Time, config: &GotoConfig) -> Result<Errand, &'static str> {
        Errand::new(Route::along(path)?, path.heading_rad, path.tolerance_m, place, now, config)
    }

    fn new(
        route: Route,
        heading_rad: f64,
        tolerance_m: f64,
        place: Place,
        now: Time,
        config: &GotoConfig,
    ) -> Result<Errand, &'static str> {
        if heading_rad.is_infinite() {
            return Err("the final heading is infinite: give radians, or NaN for any heading");
        }
        if !(tolerance_m.is_finite() && tolerance_m >= 0.0) {
            return Err("the tolerance must be a number, zero or greater: 0 takes the node's own");
        }
        if let Some([x_min, y_min, x_max, y_max]) = config.bounds_m {
            let is_inside = |[x, y]: &[f64; 2]| (x_min..=x_max).contains(x) && (y_min..=y_max).contains(y);
            if !route.left().iter().all(is_inside) {
                return Err("the goal is off the map: see bounds_m of the node goto in the robot file");
            }
        }
        Ok(Errand {
            least_left_m: route.left_m(&place),
            route,
            heading_rad: (!heading_rad.is_nan()).then_some(heading_rad),
            tolerance_m: if tolerance_m > 0.0 { tolerance_m } else { config.tolerance_m },
            begun: now,
            turning: false,
            lost: false,
            place,
            way_m: 0.0,
            nearer_at: now,
            seen_at: now,
            occupied_since: None,
        })
    }

    /// The goal in the map frame [m].
    pub fn goal(&self) -> (f64, f64) {
        self.route.goal()
    }

    /// Takes in where the body is (`None` when nobody knows), and whether something makes it wait.
    pub fn advance(&mut self, now: Time, place: Option<Place>, waits: bool, config: &GotoConfig) -> Verdict {
        let Some(place) = place else {
            self.lost = true;
            if now.since(self.seen_at) > config.lost_after_s {
                return Verdict::Failed("nobody knows where the body is: no pose arrives");
            }
            return Verdict::Go(Pace::default());
        };
        self.lost = false;
        self.seen_at = now;
        self.way_m += place.distance_m(self.place.x_m, self.place.y_m);
        self.place = place;
        let left_m = self.route.left_m(&place);
        if waits || self.turning || left_m < self.least_left_m - PROGRESS_M {
            self.least_left_m = self.least_left_m.min(left_m);
            self.nearer_at = now;
        }
        if now.since(self.nearer_at) > config.give_up_s {
            return Verdict::Failed("no progress for longer than give_up_s: the way is blocked");
        }
        self.pursue(&place, config)
    }

    fn pursue(&mut self, place: &Place, config: &GotoConfig) -> Verdict {
        let (goal_x, goal_y) = self.route.goal();
        let away_m = place.distance_m(goal_x, goal_y);
        let is_last = self.route.left().len() == 1;
        // Once there it stays so, unless pushed away: the law is singular here, and turning moves the centre a little.
        self.turning = is_last && (away_m <= self.tolerance_m || self.turning && away_m <= 2.0 * self.tolerance_m);
        if self.turning {
            return match self.heading_error_rad() {
                Some(error) if error.abs() > config.heading_tolerance_rad => {
                    let wanted = config.gains.k_per_s * error;
                    let turn_rad_s = wanted.abs().max(config.least_turn_rad_s).min(config.max_turn_rad_s);
                    Verdict::Go(Pace { forward_m_s: 0.0, turn_rad_s: turn_rad_s.copysign(error) })
                }
                _ => Verdict::Arrived,
            };
        }
        let aim = self.route.aim(place, config.pass_m, config.via_points_ahead);
        let sight_rad = math::atan2(aim.y_m - place.y_m, aim.x_m - place.x_m);
        let target = Target {
            distance_m: place.distance_m(aim.x_m, aim.y_m),
            alpha_rad: math::wrap_angle(sight_rad - place.heading_rad),
            theta_rad: self.heading_rad.filter(|_| aim.is_goal).map(|heading| math::wrap_angle(sight_rad - heading)),
        };
        let pace = approach(&target, &config.gains, config.reverses);
        Verdict::Go(pace.within(config.max_speed_m_s, config.max_turn_rad_s))
    }

    /// Takes in whether something is seen to stand at the goal; true when it has been there too long.
    pub fn finds_goal_occupied(&mut self, now: Time, occupied: bool, config: &GotoConfig) -> bool {
        self.occupied_since = occupied.then(|| self.occupied_since.unwrap_or(now));
        self.occupied_since.is_some_and(|since| now.since(since) >= config.occupied_for_s)
    }

    fn heading_error_rad(&self) -> Option<f64> {
        self.heading_rad.map(|heading| math::wrap_angle(heading - self.place.heading_rad))
    }

    /// How far it is.
    pub fn progress(&mut self, now: Time, orders: u32, config: &GotoConfig) -> GotoProgress {
        let (goal_x_m, goal_y_m) = self.route.goal();
        let aim = self.route.aim(&self.place, config.pass_m, config.via_points_ahead);
        let (ahead, left) = self.place.body_from_map(aim.x_m, aim.y_m);
        let state = match (self.lost, self.turning) {
            (true, _) => GotoState::Lost,
            (_, true) => GotoState::Turning,
            _ => GotoState::Driving,
        };
        GotoProgress {
            goal_x_m,
            goal_y_m,
            distance_m: self.place.distance_m(goal_x_m, goal_y_m),
            bearing_rad: math::atan2(left, ahead),
            heading_error_rad: self.heading_error_rad().unwrap_or(f64::NAN),
            elapsed_s: now.since(self.begun),
            state: state as u32,
            orders,
        }
    }

    /// Where it ended.
    pub fn result(&self, now: Time) -> GotoResult {
        let (goal_x, goal_y) = self.route.goal();
        GotoResult {
            x_m: self.place.x_m,
            y_m: self.place.y_m,
            heading_rad: self.place.heading_rad,
            distance_m: self.place.distance_m(goal_x, goal_y),
            heading_error_rad: self.heading_error_rad().unwrap_or(f64::NAN),
            time_s: now.since(self.begun),
            way_m: self.way_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: Place = Place { x_m: 0.0, y_m: 0.0, heading_rad: 0.0 };

    fn at(seconds: f64) -> Time {
        Time::from_seconds(seconds)
    }

    fn goal(x_m: f64, y_m: f64, heading_rad: f64) -> GotoGoal {
        GotoGoal { x_m, y_m, heading_rad, tolerance_m: 0.0 }
    }

    fn errand(x_m: f64, y_m: f64, heading_rad: f64) -> Errand {
        Errand::to(&goal(x_m, y_m, heading_rad), HERE, at(0.0), &GotoConfig::default()).unwrap()
    }

    /// Moves a perfect body as the errand says; the last verdict, the place, and when.
    fn carry_out(errand: &mut Errand, config: &GotoConfig) -> (Verdict, Place, f64) {
        let mut place = HERE;
        for step in 0..5000 {
            let now = 0.02 * f64::from(step);
            match errand.advance(at(now), Some(place), false, config) {
                Verdict::Go(pace) => {
                    assert!(pace.forward_m_s.abs() <= config.max_speed_m_s + 1e-12);
                    place.heading_rad = math::wrap_angle(place.heading_rad + 0.02 * pace.turn_rad_s);
                    let (sin, cos) = math::sin_cos(place.heading_rad);
                    place.x_m += 0.02 * pace.forward_m_s * cos;
                    place.y_m += 0.02 * pace.forward_m_s * sin;
                }
                verdict => return (verdict, place, now),
            }
        }
        (Verdict::Go(Pace::default()), place, f64::INFINITY)
    }

    #[test]
    fn it_arrives_within_the_tolerance_with_the_final_heading() {
        let config = GotoConfig::default();
        for (x, y, heading) in [(2.0, 0.0, 0.0), (1.0, 1.5, -2.0), (-2.0, 0.3, 3.0), (0.0, 0.005, 1.5)] {
            let mut errand = errand(x, y, heading);
            let (verdict, place, after_s) = carry_out(&mut errand, &config);
            assert_eq!(verdict, Verdict::Arrived, "({x}, {y}) after {after_s} s at {place:?}");
            assert!(place.distance_m(x, y) <= 2.0 * config.tolerance_m);
            assert!(math::wrap_angle(place.heading_rad - heading).abs() <= config.heading_tolerance_rad);
            let result = errand.result(at(after_s));
            assert!(result.distance_m <= 2.0 * config.tolerance_m && result.way_m >= math::hypot(x, y) - 0.03);
        }
    }

    #[test]
    fn along_via_points_it_does_not_stop_before_the_last() {
        let config = GotoConfig::default();
        let mut path = GotoPath { count: 6, heading_rad: f64::NAN, ..bytemuck_zeroed() };
        for k in 0..6 {
            path.points_m[k] = [0.6 * (k as f64 + 1.0), 0.2 * (k as f64)];
        }
        let mut errand = Errand::along(&path, HERE, at(0.0), &config).unwrap();
        let (verdict, place, after_s) = carry_out(&mut errand, &config);
        assert_eq!(verdict, Verdict::Arrived);
        assert!(place.distance_m(3.6, 1.0) <= config.tolerance_m, "{place:?}");
        // 3.7 m: a stop at each of five via points would take some 4 s each.
        assert!(after_s < 16.0, "{after_s} s");
    }

    fn bytemuck_zeroed() -> GotoPath {
        GotoPath { points_m: [[0.0; 2]; messages::VIA_POINTS], count: 0, heading_rad: 0.0, tolerance_m: 0.0 }
    }

    #[test]
    fn orders_that_lead_nowhere_are_refused_with_the_reason() {
        let config = GotoConfig { bounds_m: Some([0.0, 0.0, 5.0, 5.0]), ..GotoConfig::default() };
        let refusal = |goal: GotoGoal| Errand::to(&goal, HERE, at(0.0), &config).unwrap_err();
        assert!(refusal(goal(f64::NAN, 0.0, 0.0)).contains("no number"));
        assert!(refusal(goal(1.0, f64::INFINITY, 0.0)).contains("no number"));
        assert!(refusal(goal(1.0, 6.0, 0.0)).contains("off the map"));
        assert!(refusal(goal(1.0, 1.0, f64::INFINITY)).contains("heading"));
        assert!(refusal(GotoGoal { tolerance_m: -1.0, ..goal(1.0, 1.0, 0.0) }).contains("tolerance"));
        assert!(Errand::to(&goal(1.0, 1.0, f64::NAN), HERE, at(0.0), &config).is_ok(), "any heading will do");
    }

    #[test]
    fn without_a_pose_it_stands_and_then_gives_up() {
        let config = GotoConfig::default();
        let mut errand = errand(2.0, 0.0, 0.0);
        assert!(matches!(errand.advance(at(0.1), Some(HERE), false, &config), Verdict::Go(p) if p.forward_m_s > 0.0));
        assert_eq!(errand.advance(at(0.2), None, false, &config), Verdict::Go(Pace::default()));
        assert_eq!(errand.progress(at(0.2), 1, &config).state, GotoState::Lost as u32);
        assert!(
            matches!(errand.advance(at(9.0), None, false, &config), Verdict::Failed(why) if why.contains("no pose"))
        );
    }

    #[test]
    fn a_blocked_way_is_given_up_but_a_protective_stop_is_waited_for() {
        let config = GotoConfig::default();
        let mut errand = errand(2.0, 0.0, 0.0);
        let later = config.give_up_s + 1.0;
        assert!(matches!(errand.advance(at(later), Some(HERE), true, &config), Verdict::Go(_)));
        let blocked = errand.advance(at(2.0 * later), Some(HERE), false, &config);
        assert!(matches!(blocked, Verdict::Failed(why) if why.contains("blocked")), "{blocked:?}");
    }

    #[test]
    fn a_goal_is_occupied_only_after_a_while_of_looking() {
        let config = GotoConfig::default();
        let mut errand = errand(2.0, 0.0, 0.0);
        assert!(!errand.finds_goal_occupied(at(1.0), true, &config));
        assert!(!errand.finds_goal_occupied(at(2.0), false, &config), "it was somebody passing by");
        assert!(!errand.finds_goal_occupied(at(3.0), true, &config));
        assert!(errand.finds_goal_occupied(at(3.0 + config.occupied_for_s), true, &config));
    }
}
