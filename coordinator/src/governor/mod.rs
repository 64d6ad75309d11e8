//! The governor: a slow node that picks the coordinator's mode by a table of rules (S4's decision maker).
//!
//! ```toml
//! [nodes.governor]
//! type = "governor"
//! period_ms = 200
//! reads.motion = "/motion/drive/state"
//! config.rules = [
//!     { when = "limp >= 1", mode = "crawl" },
//!     { when = "danger > 0.6", mode = "avoid", dwell_s = 3.0 },
//!     { when = "always", mode = "wander" },
//! ]
//!
//! [nodes.arbiter]
//! reads.governor = "/coordinator/governor/state"
//! ```
//!
//! A rule may ask for periods beside its mode, `periods_ms = { tracks = 200 }`, within the `period_ms = { min, max }` of
//! those nodes. Where the processors are too few for all, periods are stretched, the least important nodes first, then
//! nodes are suspended, then the robot limps ([`overload`]; `config.load` says how). Hosts keep to what is announced.
//!
//! Reads `motion`, `base`, `room` and `goal` as far as they are wired, and what the supervisor says; writes `state`: the
//! mode, the rule that asks for it, and in words why; and `periods`: which nodes have not their own period. A rule that speaks of a signal whose port is not wired is refused
//! when the node opens; one of a mode that the arbiter does not have, when the robot file is read. Signals are in
//! [`signal::Signal`], conditions in [`condition`], first match and dwell times in [`rules`].

pub mod check;
pub mod condition;
pub mod demand;
pub mod elastic;
pub mod overload;
pub mod rules;
pub mod signal;

use messages::{BaseState, GotoProgress, GotoState, Governance, Load, Message, MotionState, NodePeriod, Periods, Room};
use messages::{Stop, SupervisorState, path_number};
use overload::{LoadConfig, Overload};
use rules::{RuleConfig, Rules};
use runtime::{Fault, GOVERNOR, LOAD_NODES, Layer, Node, OpenError, PERIODS, Ports, Reader, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;
use signal::{Signal, Signals};
use std::fmt::Write;

/// Longest name of a mode [byte].
const LONGEST_NAME: usize = 64;
/// Longest reason [byte].
const LONGEST_REASON: usize = 512;

/// Settings of [`Governor`].
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GovernorConfig {
    /// The rules; the first one that holds is obeyed. May be left out where `load` is given.
    pub rules: Vec<RuleConfig>,
    /// How the processors are shared out.
    pub load: Option<LoadConfig>,
}

/// The node.
pub struct Governor {
    supervision: Reader<SupervisorState>,
    motion: Reader<MotionState>,
    base: Reader<BaseState>,
    room: Reader<Room>,
    goal: Reader<GotoProgress>,
    state: Writer<Governance>,
    periods: Writer<Periods>,
    load: Reader<Load>,
    /// Newest sample of the load that was looked at.
    looked: (u64, u64),
    overload: Overload,
    given: Vec<NodePeriod>,
    rules: Rules,
    decisions: u64,
    reason: String,
    told: String,
    full_speed_m_s: f64,
}

impl Node for Governor {
    const TYPE: &'static str = GOVERNOR;
    const LAYER: Layer = Layer::Coordinator;
    type Config = GovernorConfig;

    fn open(ports: &mut Ports, config: GovernorConfig) -> Result<Governor, OpenError> {
        let load = config.load.clone().unwrap_or_default();
        load.check().map_err(OpenError::config)?;
        if config.rules.is_empty() && config.load.is_none() {
            return Err(OpenError::config(
                "rules is empty: give at least one, as in { when = \"always\", mode = \"…\" }",
            ));
        }
        let rules = Rules::parse(&config.rules, LONGEST_NAME).map_err(OpenError::config)?;
        Ok(Governor {
            supervision: ports.supervision(),
            motion: asked(ports, &rules, "motion")?,
            base: asked(ports, &rules, "base")?,
            room: asked(ports, &rules, "room")?,
            goal: asked(ports, &rules, "goal")?,
            state: ports.writer_with_tail("state", LONGEST_REASON)?,
            periods: ports.writer_with_tail(PERIODS, LOAD_NODES)?,
            load: ports.load(),
            looked: (0, 0),
            overload: Overload::new(load, LOAD_NODES, LONGEST_REASON / 2),
            given: Vec::with_capacity(LOAD_NODES),
            rules,
            decisions: 0,
            reason: String::with_capacity(LONGEST_REASON / 2),
            told: String::with_capacity(LONGEST_REASON),
            full_speed_m_s: ports.body().max_forward_m_s,
        })
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let signals = self.look(now);
        if self.rules.update(now, &signals) {
            self.decisions += 1;
            if let Some((_, rule)) = self.rules.present() {
                explain(&mut self.reason, &rule.when, &rule.mode, &signals);
            }
        }
        let (rule, mode) = self.rules.present().map_or((0, 0), |(index, rule)| (index as u32, path_number(&rule.mode)));
        self.share_out(now);
        self.told.clear();
        self.told.push_str(&self.reason);
        if self.overload.decisions() > 0 {
            // Half the room each, but for the sign between them.
            let room = self.told.capacity();
            let between = if self.told.is_empty() { "" } else { "; " };
            let _ = write!(Bounded { text: &mut self.told, room }, "{between}{}", self.overload.reason());
        }
        let state = Governance { decisions: self.decisions, rule, mode, period_decisions: self.overload.decisions() };
        self.state.write_with_tail(now, &state, self.told.as_bytes());
        Ok(())
    }
}

/// The port that a signal comes from: it must be wired when a rule speaks of one of its signals.
fn asked<M: Message>(ports: &mut Ports, rules: &Rules, port: &'static str) -> Result<Reader<M>, OpenError> {
    let mut signals = rules.rules().iter().flat_map(|rule| rule.when.signals());
    if signals.any(|signal| signal.port() == Some(port)) { ports.reader(port) } else { ports.optional_reader(port) }
}

impl Governor {
    /// Decides on periods when there is news of the load, and announces them.
    fn share_out(&mut self, now: Time) {
        let asked = self.rules.present().map_or(&[][..], |(_, rule)| &rule.periods_s);
        if let Some(load) = self.load.latest()
            && self.looked != (load.generation, load.sequence)
        {
            self.looked = (load.generation, load.sequence);
            self.overload.look(load.stamp, load.message, load.tail, asked);
        }
        self.given.clear();
        self.given.extend(self.overload.given().take(LOAD_NODES));
        let (decisions, shortage) = (self.overload.decisions(), self.overload.shortage() as u32);
        let periods = Periods { decisions, shortage, nodes: self.given.len() as u32 };
        self.periods.write_with_tail(now, &periods, &self.given);
    }

    fn look(&mut self, now: Time) -> Signals {
        let flag = |is: bool| f64::from(u8::from(is));
        let mut signals = Signals::default();
        if let Some(motion) = self.motion.fresh(now) {
            let motion = motion.message;
            let free = motion.forward_limit_m_s / self.full_speed_m_s;
            signals[Signal::Danger] = 1.0 - free.clamp(0.0, 1.0);
            signals[Signal::ClearM] = motion.clear_m;
            signals[Signal::SpeedMS] = motion.sent.linear_x_m_s.abs();
            signals[Signal::Stopped] = flag(motion.stop != Stop::None as u32);
        }
        if let Some(base) = self.base.fresh(now) {
            let base = base.message;
            signals[Signal::BatteryV] = base.battery_v;
            signals[Signal::Charge] = base.charge;
            signals[Signal::Bumped] = flag(base.front_bumpers | base.rear_bumpers != 0);
        }
        if let Some(room) = self.room.fresh(now) {
            signals[Signal::NearestM] = room.message.nearest_m;
        }
        if let Some(goal) = self.goal.fresh(now) {
            let driven_to = goal.message.state != GotoState::Idle as u32;
            signals[Signal::Goal] = flag(driven_to);
            signals[Signal::GoalM] = if driven_to { goal.message.distance_m } else { f64::NAN };
        }
        // Before the supervisor has said anything, nothing is the matter.
        let supervision = self.supervision.latest().map_or(SupervisorState::default(), |state| *state.message);
        signals[Signal::Limp] = flag(supervision.limp != 0);
        signals[Signal::Severity] = f64::from(supervision.severity);
        signals
    }
}

/// Puts into words why a mode was chosen; what finds no room is left out.
fn explain(reason: &mut String, when: &condition::Condition, mode: &str, signals: &Signals) {
    reason.clear();
    let room = reason.capacity();
    let mut say = |text: std::fmt::Arguments<'_>| {
        let mut bounded = Bounded { text: reason, room };
        // What does not fit was left out on purpose.
        let _ = bounded.write_fmt(text);
    };
    say(format_args!("{mode}: {}", when.text()));
    let mut sign = " (";
    for signal in when.signals() {
        say(format_args!("{sign}{} = {:.3}", signal.name(), signals[signal]));
        sign = ", ";
    }
    if sign == ", " {
        say(format_args!(")"));
    }
}

/// A text that never grows beyond its room.
struct Bounded<'a> {
    text: &'a mut String,
    room: usize,
}

impl Write for Bounded<'_> {
    fn write_str(&mut self, more: &str) -> std::fmt::Result {
        if self.text.len() + more.len() > self.room {
            return Err(std::fmt::Error);
        }
        self.text.push_str(more);
        Ok(())
    }
}
