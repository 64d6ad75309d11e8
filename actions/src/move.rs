//! Drives at a velocity for a time, straight or with a difference between the wheels (S2, Move).
//!
//! Reads `pose` (optional: to tell how far it came); writes `proposal`. Answers the long order `move`. A difference d
//! between the right wheel's speed and the left one's is a turn rate of d over the wheels' distance. Ramps are motion's.

use messages::{Axis, MoveProgress, MoveRequest, Odometry, Proposal};
use runtime::calls::Order;
use runtime::{Fault, Layer, Node, OpenError, OrderPort, Ports, Reader, Time, Writer, math};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`Move`].
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MoveConfig {
    /// Distance between the driven wheels [m].
    pub wheel_distance_m: f64,
    /// Greatest speed that may be ordered, either way [m/s].
    pub max_speed_m_s: f64,
    /// Greatest difference between the wheels that may be ordered [m/s].
    pub max_wheel_difference_m_s: f64,
    /// Longest time that may be ordered [s].
    pub max_duration_s: f64,
    /// Urgency of the proposal, 0…1.
    pub urgency: f64,
    /// How long a proposal counts [s].
    pub valid_for_s: f64,
}

impl Default for MoveConfig {
    fn default() -> MoveConfig {
        MoveConfig {
            wheel_distance_m: 0.4,
            max_speed_m_s: 1.0,
            max_wheel_difference_m_s: 1.0,
            max_duration_s: 60.0,
            urgency: 0.5,
            valid_for_s: 0.2,
        }
    }
}

/// The node.
pub struct Move {
    pose: Reader<Odometry>,
    proposal: Writer<Proposal>,
    orders: OrderPort<MoveRequest, MoveProgress, MoveProgress>,
    under_way: Option<UnderWay>,
    config: MoveConfig,
}

/// An order that is carried out.
struct UnderWay {
    order: Order<MoveRequest, MoveProgress, MoveProgress>,
    begun: Time,
    reported: Time,
    travel: Travel,
}

/// Progress is told this often [s].
const REPORT_EVERY_S: f64 = 0.1;

impl Node for Move {
    const TYPE: &'static str = "move";
    const LAYER: Layer = Layer::Actions;
    type Config = MoveConfig;

    fn open(ports: &mut Ports, config: MoveConfig) -> Result<Move, OpenError> {
        check(&config).map_err(OpenError::config)?;
        Ok(Move {
            pose: ports.optional_reader("pose")?,
            proposal: ports.writer("proposal")?,
            orders: ports.order("move")?,
            under_way: None,
            config,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        while let Some(mut order) = self.orders.take() {
            if let Err(reason) = accepts(&order.message, &self.config) {
                order.refuse(reason);
                continue;
            }
            if let Some(former) = self.under_way.take() {
                former.order.failed("a newer order took its place");
            }
            order.accept();
            self.under_way = Some(UnderWay { order, begun: now, reported: Time::ZERO, travel: Travel::default() });
        }
        let Some(mut under_way) = self.under_way.take() else { return Ok(()) };
        if let Some(pose) = self.pose.fresh(now) {
            under_way.travel.advance(&pose, (pose.generation, pose.origin));
        }
        let elapsed_s = now.since(under_way.begun);
        let progress = MoveProgress { elapsed_s, ..under_way.travel.sum() };
        if under_way.order.is_cancelled() {
            under_way.order.cancelled();
        } else if elapsed_s >= under_way.order.message.duration_s {
            under_way.order.done(&progress);
        } else {
            self.proposal.write(now, &propose(&under_way.order.message, &self.config));
            if now.since(under_way.reported) >= REPORT_EVERY_S {
                under_way.reported = now;
                under_way.order.progress(&progress);
            }
            self.under_way = Some(under_way);
            return Ok(());
        }
        self.proposal.write(now, &Proposal { valid_for_s: self.config.valid_for_s, ..Proposal::default() });
        Ok(())
    }

    fn stop(&mut self, _now: Time) {
        if let Some(under_way) = self.under_way.take() {
            under_way.order.failed("the node move is stopped");
        }
    }
}

/// Way and turn by odometry.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Travel {
    last: Option<(Odometry, (u64, u64))>,
    way_m: f64,
    turned_rad: f64,
}

impl Travel {
    fn advance(&mut self, pose: &Odometry, frame: (u64, u64)) {
        if let Some((last, _)) = self.last.filter(|(_, before)| *before == frame) {
            let (dx, dy) = (pose.x_m - last.x_m, pose.y_m - last.y_m);
            let (sin, cos) = math::sin_cos(last.heading_rad);
            self.way_m += math::hypot(dx, dy).copysign(dx * cos + dy * sin);
            self.turned_rad += math::wrap_angle(pose.heading_rad - last.heading_rad);
        }
        self.last = Some((*pose, frame));
    }

    fn sum(&self) -> MoveProgress {
        match self.last {
            Some(_) => MoveProgress { elapsed_s: 0.0, way_m: self.way_m, turned_rad: self.turned_rad },
            None => MoveProgress { elapsed_s: 0.0, way_m: f64::NAN, turned_rad: f64::NAN },
        }
    }
}

fn accepts(request: &MoveRequest, config: &MoveConfig) -> Result<(), &'static str> {
    let MoveRequest { speed_m_s, wheel_difference_m_s, duration_s } = *request;
    if !(speed_m_s.is_finite() && wheel_difference_m_s.is_finite() && duration_s.is_finite()) {
        return Err("a value is no number: give speed_m_s, wheel_difference_m_s and duration_s");
    }
    if speed_m_s.abs() > config.max_speed_m_s {
        return Err("faster than max_speed_m_s of the node move");
    }
    if wheel_difference_m_s.abs() > config.max_wheel_difference_m_s {
        return Err("a greater difference between the wheels than max_wheel_difference_m_s of the node move");
    }
    if !(duration_s > 0.0 && duration_s <= config.max_duration_s) {
        return Err("duration_s must be above 0 and at most max_duration_s of the node move");
    }
    Ok(())
}

fn propose(request: &MoveRequest, config: &MoveConfig) -> Proposal {
    Proposal {
        forward: Axis::exact(request.speed_m_s),
        turn: Axis::exact(request.wheel_difference_m_s / config.wheel_distance_m),
        urgency: config.urgency,
        valid_for_s: config.valid_for_s,
        ..Proposal::default()
    }
}

fn check(config: &MoveConfig) -> Result<(), String> {
    for (key, value) in [
        ("wheel_distance_m", config.wheel_distance_m),
        ("max_speed_m_s", config.max_speed_m_s),
        ("max_wheel_difference_m_s", config.max_wheel_difference_m_s),
        ("max_duration_s", config.max_duration_s),
        ("urgency", config.urgency),
        ("valid_for_s", config.valid_for_s),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(format!("{key} = {value} must be a number above 0"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_between_the_wheels_is_a_turn_rate() {
        let request = MoveRequest { speed_m_s: 0.3, wheel_difference_m_s: 0.15, duration_s: 5.0 };
        let proposal = propose(&request, &MoveConfig::default());
        assert_eq!((proposal.forward, proposal.turn), (Axis::exact(0.3), Axis::exact(0.15 / 0.4)));
    }

    #[test]
    fn orders_beyond_the_bounds_are_refused_with_the_bound() {
        let config = MoveConfig::default();
        let good = MoveRequest { speed_m_s: -0.1, wheel_difference_m_s: 0.0, duration_s: 5.0 };
        let refusal = |request: MoveRequest| accepts(&request, &config).unwrap_err();
        assert_eq!(accepts(&good, &config), Ok(()));
        assert!(refusal(MoveRequest { speed_m_s: f64::NAN, ..good }).contains("no number"));
        assert!(refusal(MoveRequest { speed_m_s: -1.5, ..good }).contains("max_speed_m_s"));
        assert!(refusal(MoveRequest { wheel_difference_m_s: 1.5, ..good }).contains("max_wheel_difference_m_s"));
        assert!(refusal(MoveRequest { duration_s: 0.0, ..good }).contains("duration_s"));
    }

    #[test]
    fn way_and_turn_are_summed_within_one_frame() {
        let pose = |x_m, heading_rad| Odometry { x_m, heading_rad, ..Odometry::default() };
        let mut travel = Travel::default();
        assert!(travel.sum().way_m.is_nan());
        travel.advance(&pose(0.0, 3.1), (1, 0));
        travel.advance(&pose(-0.5, -3.1), (1, 0));
        travel.advance(&pose(7.0, 0.0), (2, 0));
        let sum = travel.sum();
        assert!((sum.way_m - 0.5).abs() < 1e-12 && (sum.turned_rad - 0.0832).abs() < 1e-3, "{sum:?}");
    }
}
