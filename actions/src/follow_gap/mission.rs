//! An order under way: where to, for whom, since when.

use super::pose::{Point, Pose};
use messages::{GotoGoal, GotoProgress, GotoResult, GotoState};
use runtime::calls::Order;
use runtime::{Time, math};

/// An order, or a goal that was sent.
pub(super) struct Mission {
    pub goal: Point,
    pub tolerance_m: f64,
    pub reported: Time,
    began: Time,
    /// Nobody waits for a goal that was sent.
    order: Option<Order<GotoGoal, GotoProgress, GotoResult>>,
    last: Option<Point>,
    way_m: f64,
}

impl Mission {
    /// A goal whose end somebody waits for.
    pub fn ordered(
        now: Time,
        goal: Point,
        tolerance_m: f64,
        mut order: Order<GotoGoal, GotoProgress, GotoResult>,
    ) -> Mission {
        order.accept();
        Mission { order: Some(order), ..Mission::sent(now, goal, tolerance_m) }
    }

    /// A goal that nobody waits for.
    pub fn sent(now: Time, goal: Point, tolerance_m: f64) -> Mission {
        Mission { goal, tolerance_m, reported: Time::ZERO, began: now, order: None, last: None, way_m: 0.0 }
    }

    pub fn is_cancelled(&self) -> bool {
        self.order.as_ref().is_some_and(Order::is_cancelled)
    }

    pub fn cancelled(self) {
        if let Some(order) = self.order {
            order.cancelled();
        }
    }

    pub fn failed(self, reason: &'static str) {
        if let Some(order) = self.order {
            order.failed(reason);
        }
    }

    pub fn arrived(mut self, now: Time, pose: Pose) {
        self.travelled(pose.place);
        let result = GotoResult {
            x_m: pose.place.x_m,
            y_m: pose.place.y_m,
            heading_rad: math::wrap_angle(pose.heading_rad),
            distance_m: pose.place.to(self.goal).length_m(),
            heading_error_rad: f64::NAN,
            time_s: now.since(self.began),
            way_m: self.way_m,
        };
        if let Some(order) = self.order {
            order.done(&result);
        }
    }

    /// How far it is; also told to whoever waits.
    pub fn progress(&mut self, now: Time, pose: Option<Pose>, orders: u32) -> GotoProgress {
        self.reported = now;
        if let Some(pose) = pose {
            self.travelled(pose.place);
        }
        let local = pose.map(|pose| pose.frame().inner(self.goal));
        let progress = GotoProgress {
            goal_x_m: self.goal.x_m,
            goal_y_m: self.goal.y_m,
            distance_m: local.map_or(f64::NAN, Point::length_m),
            bearing_rad: local.map_or(f64::NAN, |local| math::atan2(local.y_m, local.x_m)),
            heading_error_rad: f64::NAN,
            elapsed_s: now.since(self.began),
            state: if pose.is_some() { GotoState::Driving } else { GotoState::Lost } as u32,
            orders,
        };
        if let Some(order) = &mut self.order {
            order.progress(&progress);
        }
        progress
    }

    fn travelled(&mut self, place: Point) {
        self.way_m += self.last.replace(place).map_or(0.0, |last| last.to(place).length_m());
    }
}
