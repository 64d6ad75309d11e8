//! Combines the proposals of all actions into one wanted velocity, under a mode.
//!
//! Reads `proposals` (a set, `/actions/*/proposal`); optionally `room` (is an obstacle near?), `goal` (does it come nearer?),
//! `stop` (is something waited for?) and `governor` (which mode?). Writes `velocity`, `state` and `detour`. The mode's algorithm decides
//! ([`crate::mode::Algorithm`]); the caps of every proposal that has not expired apply afterwards, whatever its weight, and
//! so do the mode's own limits. An axis on which all abstain is zero. The calls `set_mode` and `get_mode` need no period:
//! a call releases a step. A mode that does not exist is refused, and nothing changes. In limp mode (`[limp]`, the
//! supervisor says when) only the wishes of the actions that it names count, and its limits apply.

use crate::arbitration::{Arbitration, LimpMode};
use crate::minimum::{Minimum, MinimumConfig};
use crate::mode::Mode;
use crate::opinion::Caps;
use messages::{
    CoordinatorState, Detour, GotoProgress, Governance, ModeState, Proposal, ProtectiveStop, Room, SetMode, Side,
    StopCause, SupervisorState, Trigger, Twist,
};
use runtime::{CallPort, Fault, Layer, Node, OpenError, Ports, Reader, Set, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`Arbiter`].
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ArbiterConfig {
    /// The modes; callers name them by their index, counted from 0.
    pub modes: Vec<Mode>,
    /// Name of the mode to begin with; the first one when left out.
    pub start_mode: Option<String>,
    /// When a goal that comes no nearer is in a local minimum.
    pub minimum: MinimumConfig,
    /// Speeds for the words 1, 2, 3 along x and y [m/s].
    pub speed_words_m_s: [f64; 3],
    /// Turn rates for the words 1, 2, 3 [rad/s].
    pub turn_words_rad_s: [f64; 3],
}

impl Default for ArbiterConfig {
    fn default() -> ArbiterConfig {
        ArbiterConfig {
            modes: vec![Mode::default()],
            start_mode: None,
            minimum: MinimumConfig::default(),
            speed_words_m_s: [0.1, 0.2, 0.3],
            turn_words_rad_s: [0.15, 0.35, 0.7],
        }
    }
}

/// The node.
pub struct Arbiter {
    supervision: Reader<SupervisorState>,
    proposals: Set<Proposal>,
    room: Reader<Room>,
    goal: Reader<GotoProgress>,
    stop: Reader<ProtectiveStop>,
    governor: Reader<Governance>,
    /// Generation of the governor, and its decision that was followed last.
    followed: (u64, u64),
    velocity: Writer<Twist>,
    state: Writer<CoordinatorState>,
    detour: Writer<Detour>,
    set_mode: CallPort<SetMode, ModeState>,
    get_mode: CallPort<Trigger, ModeState>,
    arbitration: Arbitration,
    minimum: Minimum,
    minimum_config: MinimumConfig,
}

impl Node for Arbiter {
    const TYPE: &'static str = "arbiter";
    const LAYER: Layer = Layer::Coordinator;
    type Config = ArbiterConfig;

    fn open(ports: &mut Ports, config: ArbiterConfig) -> Result<Arbiter, OpenError> {
        let start = check(&config).map_err(OpenError::config)?;
        let (speed, turn) = (config.speed_words_m_s, config.turn_words_rad_s);
        let limp = ports.limp().map(|limp| {
            let (speed, turn) = (limp.max_speed_m_s, limp.max_turn_rad_s.unwrap_or(f64::INFINITY));
            let limits = [Caps::new(speed, speed), Caps::new(speed, speed), Caps::new(turn, turn)];
            LimpMode { actions: limp.actions.clone(), limits }
        });
        let mut arbitration = Arbitration::new(config.modes, ports.body(), [speed, speed, turn]).with_limp(limp);
        arbitration.set_mode(start);
        Ok(Arbiter {
            supervision: ports.supervision(),
            proposals: ports.set("proposals")?,
            room: ports.optional_reader("room")?,
            goal: ports.optional_reader("goal")?,
            stop: ports.optional_reader("stop")?,
            governor: ports.optional_reader("governor")?,
            followed: (0, 0),
            velocity: ports.writer("velocity")?,
            state: ports.writer("state")?,
            detour: ports.writer("detour")?,
            set_mode: ports.call("set_mode")?,
            get_mode: ports.call("get_mode")?,
            arbitration,
            minimum: Minimum::default(),
            minimum_config: config.minimum,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        self.follow();
        self.answer();
        let limping = self.supervision.latest().is_some_and(|state| state.limp != 0);
        let arbitration = &mut self.arbitration;
        arbitration.begin(limping);
        self.proposals.each(|path, sample| arbitration.hear(instance(path), now.since(sample.stamp), sample.message));
        let room = self.room.fresh(now).map(|room| *room.message);
        let mut detour = Detour::default();
        if arbitration.mode().leaves_minima {
            let goal = self.goal.fresh(now).map(|goal| *goal.message);
            let waits = self.stop.fresh(now).is_some_and(|stop| waits(&stop));
            detour = self.minimum.update(now, goal.as_ref(), room.as_ref(), waits, &self.minimum_config);
        } else {
            self.minimum = Minimum::default();
        }
        // Without a word on the room, the actions that take over say by themselves when they do.
        let switch_m = arbitration.mode().switch_m;
        let near = detour.side != Side::None as u32 || room.is_none_or(|room| room.nearest_m < switch_m);
        let (velocity, state) = arbitration.decide(near);
        self.velocity.write(now, &velocity);
        self.state.write(now, &state);
        self.detour.write(now, &detour);
        Ok(())
    }
}

impl Arbiter {
    /// Takes over the mode of a new decision of the governor. What a call has set since stands until the next one.
    fn follow(&mut self) {
        let Some(wish) = self.governor.latest() else { return };
        let decision = (wish.generation, wish.message.decisions);
        if wish.message.decisions > 0 && decision != self.followed {
            self.followed = decision;
            self.arbitration.set_mode_by_name(wish.message.mode);
        }
    }

    fn answer(&mut self) {
        while let Some(request) = self.set_mode.take() {
            if self.arbitration.set_mode(request.message.mode) {
                let state = self.mode_state();
                self.set_mode.answer(request, &state);
            } else {
                self.set_mode
                    .refuse(request, "there is no such mode: modes are counted from 0 in the robot file's list");
            }
        }
        while let Some(request) = self.get_mode.take() {
            let state = self.mode_state();
            self.get_mode.answer(request, &state);
        }
    }

    fn mode_state(&self) -> ModeState {
        let (mode, modes) = self.arbitration.mode_index();
        ModeState { mode: mode as u64, modes: modes as u64 }
    }
}

/// Whether a protective stop waits for somebody to go away or to let go; a thing in the zone may be passed.
fn waits(stop: &ProtectiveStop) -> bool {
    stop.cause == StopCause::Bumper as u32 || stop.cause == StopCause::Held as u32
}

/// The instance that writes `path`: `forward` for `/actions/forward/proposal`.
fn instance(path: &str) -> &str {
    path.rsplit('/').nth(1).unwrap_or("")
}

/// Says what is wrong, or the index of the mode to begin with.
fn check(config: &ArbiterConfig) -> Result<u64, String> {
    if config.modes.is_empty() {
        return Err("modes is empty: give at least one".into());
    }
    for (index, mode) in config.modes.iter().enumerate() {
        mode.check(&format!("modes[{index}]"))?;
        if config.modes[..index].iter().any(|other| other.name == mode.name) {
            return Err(format!(
                "modes[{index}] is called \"{}\" like one before: give it a name of its own",
                mode.name
            ));
        }
    }
    config.minimum.check()?;
    for (key, words) in [("speed_words_m_s", &config.speed_words_m_s), ("turn_words_rad_s", &config.turn_words_rad_s)] {
        if !(words[0] >= 0.0 && words[0] <= words[1] && words[1] <= words[2] && words[2].is_finite()) {
            return Err(format!(
                "{key} = {words:?} must be three numbers, zero or greater, none smaller than the one before"
            ));
        }
    }
    let Some(start) = &config.start_mode else { return Ok(0) };
    match config.modes.iter().position(|mode| mode.name == *start) {
        Some(index) => Ok(index as u64),
        None => {
            let names: Vec<&str> = config.modes.iter().map(|mode| mode.name.as_str()).collect();
            Err(format!("start_mode = \"{start}\" is no mode; modes are {}", names.join(", ")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_instance_is_the_folder_of_the_path() {
        assert_eq!(instance("/actions/forward/proposal"), "forward");
        assert_eq!(instance("/actions/group/steer_clear/proposal"), "steer_clear");
    }

    #[test]
    fn a_setting_out_of_bounds_is_named() {
        let mut config = ArbiterConfig::default();
        config.modes[0].weights.insert("forward".into(), -1.0);
        assert!(check(&config).unwrap_err().starts_with("modes[0].weights.forward = -1"));
        let config = ArbiterConfig { start_mode: Some("fast".into()), ..ArbiterConfig::default() };
        assert_eq!(check(&config).unwrap_err(), "start_mode = \"fast\" is no mode; modes are default");
        assert!(check(&ArbiterConfig { modes: vec![], ..ArbiterConfig::default() }).unwrap_err().contains("empty"));
        let config = ArbiterConfig { turn_words_rad_s: [0.3, 0.2, 0.1], ..ArbiterConfig::default() };
        assert!(check(&config).unwrap_err().starts_with("turn_words_rad_s"));
        assert_eq!(check(&ArbiterConfig::default()), Ok(0));
    }
}
