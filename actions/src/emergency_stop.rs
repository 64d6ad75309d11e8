//! Holds the body when a bumper is pressed or something is in the danger zone (S2, EmergencyStop: a *protective* stop).
//!
//! Reads `base` (optional: bumpers) and `ranges` (optional); writes `proposal`, caps alone, and `state`. A bumper holds
//! everything but the way back; the danger zone, a strip ahead as wide as the body, holds the way ahead, so that another
//! action may turn away. It waits, and when the cause has been gone for a while it lets go by itself, and the mission goes
//! on; where `release_by_itself` is false only after the call `reset`. Stopping before anything is touched is motion's
//! duty; the latched emergency stop is the guard's.

use messages::{Axis, BaseState, Beam, Done, Echo, Proposal, ProtectiveStop, Ranges, StopCause, Trigger};
use runtime::{Body, CallPort, Fault, Layer, Node, OpenError, Ports, Reader, Time, Writer, math};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`EmergencyStop`].
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EmergencyStopConfig {
    /// Length of the danger zone, from the body's front edge [m].
    pub danger_m: f64,
    /// How much wider than the body the danger zone is, on either side [m].
    pub side_margin_m: f64,
    /// The cause must have been gone for this long [s].
    pub release_after_s: f64,
    /// Whether that is enough; otherwise somebody must call `reset`.
    pub release_by_itself: bool,
    /// How long a proposal counts [s].
    pub valid_for_s: f64,
}

impl Default for EmergencyStopConfig {
    fn default() -> EmergencyStopConfig {
        EmergencyStopConfig {
            danger_m: 0.1,
            side_margin_m: 0.0,
            release_after_s: 1.0,
            release_by_itself: true,
            valid_for_s: 0.3,
        }
    }
}

/// The node.
pub struct EmergencyStop {
    base: Reader<BaseState>,
    ranges: Reader<Ranges>,
    proposal: Writer<Proposal>,
    state: Writer<ProtectiveStop>,
    reset: CallPort<Trigger, Done>,
    hold: Hold,
    zone: Zone,
    config: EmergencyStopConfig,
}

impl Node for EmergencyStop {
    const TYPE: &'static str = "emergency_stop";
    const LAYER: Layer = Layer::Actions;
    type Config = EmergencyStopConfig;

    fn open(ports: &mut Ports, config: EmergencyStopConfig) -> Result<EmergencyStop, OpenError> {
        check(&config).map_err(OpenError::config)?;
        Ok(EmergencyStop {
            zone: Zone::of(ports.body(), &config),
            base: ports.optional_reader("base")?,
            ranges: ports.optional_reader("ranges")?,
            proposal: ports.writer("proposal")?,
            state: ports.writer("state")?,
            reset: ports.call("reset")?,
            hold: Hold::default(),
            config,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let bumped = self.base.fresh(now).is_some_and(|base| base.front_bumpers | base.rear_bumpers != 0);
        let zone = &self.zone;
        let nearest_m =
            self.ranges.fresh(now).map_or(f64::INFINITY, |ranges| zone.nearest_m(ranges.message, ranges.tail));
        let mut reset = false;
        while let Some(request) = self.reset.take() {
            reset = true;
            self.reset.answer(request, &Done { at_ns: now.nanos() });
        }
        let state = self.hold.update(now, bumped, nearest_m, reset, &self.config);
        self.proposal.write(now, &propose(state.cause, self.config.valid_for_s));
        self.state.write(now, &state);
        Ok(())
    }
}

fn check(config: &EmergencyStopConfig) -> Result<(), String> {
    for (key, value) in [
        ("danger_m", config.danger_m),
        ("side_margin_m", config.side_margin_m),
        ("release_after_s", config.release_after_s),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(format!("{key} = {value} must be a number, zero or greater"));
        }
    }
    if !(config.valid_for_s > 0.0 && config.valid_for_s.is_finite()) {
        return Err(format!("valid_for_s = {} must be a number above 0", config.valid_for_s));
    }
    Ok(())
}

/// The strip ahead of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zone {
    front_m: f64,
    length_m: f64,
    half_width_m: f64,
}

impl Zone {
    /// Ahead of `body`.
    pub fn of(body: &Body, config: &EmergencyStopConfig) -> Zone {
        let half_width_m = body.half_width_m + config.side_margin_m;
        Zone { front_m: body.length_ahead_m, length_m: config.danger_m, half_width_m }
    }

    /// Distance from the front edge to the nearest thing in the zone, at least 0; +∞ when it is empty [m].
    pub fn nearest_m(&self, ranges: &Ranges, beams: &[Beam]) -> f64 {
        let in_zone = beams.iter().filter_map(|beam| {
            let range_m = match beam.echo {
                e if e == Echo::Value as u32 => f64::from(beam.range_m),
                e if e == Echo::TooNear as u32 => 0.5 * f64::from(ranges.min_range_m),
                _ => return None,
            };
            let (sin, cos) = math::sin_cos(f64::from(beam.bearing_rad));
            let x_m = f64::from(beam.origin_x_m) + range_m * cos;
            let y_m = f64::from(beam.origin_y_m) + range_m * sin;
            let ahead_m = x_m - self.front_m;
            (x_m > 0.0 && ahead_m <= self.length_m && y_m.abs() <= self.half_width_m).then_some(ahead_m.max(0.0))
        });
        in_zone.fold(f64::INFINITY, f64::min)
    }
}

/// Whether the body is held, why and since when.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Hold {
    /// Cause, when it was last there, and when the hold began.
    held: Option<(StopCause, Time, Time)>,
    stops: u32,
}

impl Hold {
    /// Takes in what is pressed and what is near; `reset` lets go of what only waits for it.
    pub fn update(
        &mut self,
        now: Time,
        bumped: bool,
        nearest_m: f64,
        reset: bool,
        config: &EmergencyStopConfig,
    ) -> ProtectiveStop {
        let cause = match (bumped, nearest_m.is_finite()) {
            (true, _) => Some(StopCause::Bumper),
            (false, true) => Some(StopCause::Zone),
            (false, false) => None,
        };
        self.held = match (cause, self.held) {
            // While a bumper's hold lasts it stays one, whatever else is there.
            (Some(_), Some((StopCause::Bumper, last, since)))
                if !bumped && now.since(last) < config.release_after_s =>
            {
                Some((StopCause::Bumper, last, since))
            }
            (Some(cause), Some((_, _, since))) => Some((cause, now, since)),
            (Some(cause), None) => {
                self.stops = self.stops.wrapping_add(1);
                Some((cause, now, now))
            }
            (None, Some((cause, last, since)))
                if cause == StopCause::Held || now.since(last) >= config.release_after_s =>
            {
                let free = config.release_by_itself || reset;
                (!free).then_some((StopCause::Held, last, since))
            }
            (None, held) => held,
        };
        let (cause, since) = self.held.map_or((StopCause::None, now), |(cause, _, since)| (cause, since));
        ProtectiveStop { nearest_m, held_s: now.since(since), cause: cause as u32, stops: self.stops }
    }
}

/// Caps alone: no wish of its own.
fn propose(cause: u32, valid_for_s: f64) -> Proposal {
    let mut proposal = Proposal { urgency: 1.0, valid_for_s, ..Proposal::default() };
    if cause != StopCause::None as u32 {
        proposal.forward = Axis { cap_positive: 0.0, ..Axis::NONE };
    }
    if cause == StopCause::Bumper as u32 || cause == StopCause::Held as u32 {
        proposal.turn = Axis::capped(0.0);
    }
    proposal
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: EmergencyStopConfig = EmergencyStopConfig {
        danger_m: 0.1,
        side_margin_m: 0.0,
        release_after_s: 1.0,
        release_by_itself: true,
        valid_for_s: 0.3,
    };
    const FAR: f64 = f64::INFINITY;

    fn at(seconds: f64) -> Time {
        Time::from_seconds(seconds)
    }

    #[test]
    fn a_bumper_holds_everything_but_the_way_back() {
        let state = Hold::default().update(at(1.0), true, FAR, false, &CONFIG);
        assert_eq!((state.cause, state.stops), (StopCause::Bumper as u32, 1));
        let proposal = propose(state.cause, 0.3);
        assert_eq!(
            (proposal.forward.cap_positive, proposal.turn.cap_positive, proposal.turn.cap_negative),
            (0.0, 0.0, 0.0)
        );
        assert_eq!(proposal.forward.cap_negative, f64::INFINITY);
        assert_eq!(proposal.forward.wish, Axis::NONE.wish, "it wishes nothing");
    }

    #[test]
    fn the_zone_holds_the_way_ahead_and_leaves_the_turn_to_others() {
        let state = Hold::default().update(at(1.0), false, 0.05, false, &CONFIG);
        assert_eq!(state.cause, StopCause::Zone as u32);
        let proposal = propose(state.cause, 0.3);
        assert_eq!((proposal.forward.cap_positive, proposal.turn), (0.0, Axis::NONE));
    }

    #[test]
    fn it_lets_go_by_itself_when_the_cause_has_been_gone_for_a_while() {
        let mut hold = Hold::default();
        hold.update(at(1.0), true, FAR, false, &CONFIG);
        assert_eq!(hold.update(at(1.9), false, FAR, false, &CONFIG).cause, StopCause::Bumper as u32);
        let state = hold.update(at(2.0), false, FAR, false, &CONFIG);
        assert_eq!((state.cause, state.held_s), (StopCause::None as u32, 0.0));
        assert_eq!(hold.update(at(3.0), false, 0.0, false, &CONFIG).stops, 2);
    }

    #[test]
    fn where_the_robot_file_says_so_somebody_must_let_go() {
        let mut hold = Hold::default();
        let config = EmergencyStopConfig { release_by_itself: false, ..CONFIG };
        hold.update(at(1.0), true, FAR, false, &config);
        assert_eq!(hold.update(at(1.5), true, FAR, true, &config).cause, StopCause::Bumper as u32, "still pressed");
        let state = hold.update(at(9.0), false, FAR, false, &config);
        assert_eq!((state.cause, state.held_s), (StopCause::Held as u32, 8.0));
        assert_eq!(propose(state.cause, 0.3).turn, Axis::capped(0.0));
        assert_eq!(hold.update(at(9.1), false, FAR, true, &config).cause, StopCause::None as u32);
    }

    #[test]
    fn only_what_is_ahead_and_as_near_as_that_is_in_the_zone() {
        let body = Body { length_ahead_m: 0.25, half_width_m: 0.25, ..Body::default() };
        let zone = Zone::of(&body, &CONFIG);
        let ranges = Ranges { min_range_m: 0.05, ..Ranges::default() };
        let beam = |bearing_rad: f32, range_m: f32, echo: Echo| Beam {
            bearing_rad,
            range_m,
            echo: echo as u32,
            ..Beam::default()
        };
        assert!((zone.nearest_m(&ranges, &[beam(0.0, 0.3, Echo::Value)]) - 0.05).abs() < 1e-6);
        assert_eq!(zone.nearest_m(&ranges, &[beam(0.0, 0.4, Echo::Value)]), FAR);
        assert_eq!(zone.nearest_m(&ranges, &[beam(1.5, 0.3, Echo::Value)]), FAR, "beside the body");
        assert_eq!(zone.nearest_m(&ranges, &[beam(3.1, 0.3, Echo::Value)]), FAR, "behind it");
        assert_eq!(zone.nearest_m(&ranges, &[beam(0.0, 0.0, Echo::TooNear)]), 0.0);
        assert_eq!(zone.nearest_m(&ranges, &[beam(0.0, f32::NAN, Echo::Value), beam(0.0, 0.3, Echo::Clear)]), FAR);
    }
}
