//! Overload: too little time on the processors for what all nodes ask for, and what is given up for it.
//!
//! The load is what the nodes take at their present periods ([`super::demand`]). What others take on the machine is told
//! with it, but is no overload by itself: the nodes go first, and where they do not, their deadlines show it.
//! Above `most`, or where important nodes go on missing deadlines on a busy machine, periods are stretched until `aim`
//! is kept; then nodes are suspended; then the robot limps. When there would be room at `aim` for all of `calm_s`, it is
//! given back, and `calm_s` doubles each time that this was too early, so that nothing flaps.

use super::Bounded;
use super::demand::{Demand, Given, Planner};
use messages::{Load, NodeLoad, NodePeriod, Shortage};
use runtime::Time;
use schemars::JsonSchema;
use serde::Deserialize;
use std::fmt::Write;

/// Looks in a row that must tell of an overload: a single stall is none.
const LOOKS: u32 = 2;
/// Less is wanted by this factor where deadlines are missed all the same, and more again in its steps.
const SQUEEZE: f64 = 0.8;
/// But not less than this share.
const LEAST: f64 = 0.3;
/// A machine of which less is busy is not why deadlines are missed.
const BUSY: f64 = 0.5;
/// A period must become shorter by this share to be worth a change.
const WORTH: f64 = 0.05;
/// What was given back is taken away again within so many calm spells: that was too early.
const TOO_EARLY: f64 = 5.0;
/// The longest calm spell that is waited for [s].
const LONGEST_CALM_S: f64 = 60.0;

/// How the governor shares out the processors.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LoadConfig {
    /// Share of the processors above which there is an overload, 0 to 1.
    pub most: f64,
    /// Share that is aimed at when something must be given up, 0 to 1.
    pub aim: f64,
    /// How long there must be room before something is given back [s].
    pub calm_s: f64,
    /// Nodes of this importance and above must keep their deadlines.
    pub critical: u32,
    /// Nodes less important than this may be suspended.
    pub suspend_below: u32,
    /// Whether the robot limps when all that is not enough.
    pub limp: bool,
    /// … for so long [s].
    pub limp_after_s: f64,
}

impl Default for LoadConfig {
    fn default() -> LoadConfig {
        LoadConfig { most: 0.85, aim: 0.7, calm_s: 2.0, critical: 75, suspend_below: 50, limp: true, limp_after_s: 1.0 }
    }
}

impl LoadConfig {
    /// Says what is wrong.
    pub fn check(&self) -> Result<(), String> {
        if !(0.0 < self.aim && self.aim < self.most && self.most <= 1.0) {
            let (aim, most) = (self.aim, self.most);
            return Err(format!("load: aim = {aim} must lie above 0 and below most = {most}, and that not above 1"));
        }
        for (key, value) in [("calm_s", self.calm_s), ("limp_after_s", self.limp_after_s)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(format!("load.{key} = {value} must be a number, zero or greater"));
            }
        }
        Ok(())
    }
}

/// What is remembered from look to look.
#[derive(Debug, Clone)]
pub struct Overload {
    config: LoadConfig,
    demands: Vec<Demand>,
    planner: Planner,
    looked: Option<Time>,
    /// Looks in a row with too much load, and with missed deadlines.
    over: u32,
    missing: u32,
    squeeze: f64,
    room_since: Option<Time>,
    short_since: Option<Time>,
    calm_s: f64,
    given_back: Option<Time>,
    shortage: Shortage,
    decisions: u64,
    reason: String,
}

impl Overload {
    /// For up to `nodes` nodes, with reasons of up to `reason_bytes`.
    pub fn new(config: LoadConfig, nodes: usize, reason_bytes: usize) -> Overload {
        Overload {
            demands: Vec::with_capacity(nodes),
            planner: Planner::new(nodes),
            looked: None,
            over: 0,
            missing: 0,
            squeeze: 1.0,
            room_since: None,
            short_since: None,
            calm_s: config.calm_s,
            given_back: None,
            shortage: Shortage::None,
            decisions: 0,
            reason: String::with_capacity(reason_bytes),
            config,
        }
    }

    /// Decisions so far.
    pub fn decisions(&self) -> u64 {
        self.decisions
    }

    /// Why the newest one was taken.
    pub fn reason(&self) -> &str {
        &self.reason
    }

    /// How far it had to go.
    pub fn shortage(&self) -> Shortage {
        self.shortage
    }

    /// The nodes that have not their own period now.
    pub fn given(&self) -> impl Iterator<Item = NodePeriod> + '_ {
        let others = self.demands.iter().filter(|node| node.suspended || node.period_s > node.shortest_s);
        others.map(|node| NodePeriod {
            node: node.node,
            suspended: u32::from(node.suspended),
            period_ns: (node.period_s * 1e9).round() as u64,
        })
    }

    /// Looks at a new sample of the load; `asked` are periods that the present rule asks for, by instance name [s].
    pub fn look(&mut self, now: Time, load: &Load, nodes: &[NodeLoad], asked: &[(String, f64)]) {
        let dt_s = self.looked.replace(now).map_or(0.0, |looked| now.since(looked));
        let rule_changed = self.measure(nodes, asked, dt_s);
        let used: f64 = nodes.iter().map(|node| node.processors).sum();
        let foreign = Some(load.busy_processors - used).filter(|foreign| *foreign > 0.0).unwrap_or(0.0);
        let present: f64 = self.demands.iter().map(Demand::present).sum();
        let all = load.processors.max(1.0);
        let most = all * self.config.most;
        self.over = if present > most { self.over + 1 } else { 0 };
        let critical = self.demands.iter().filter(|node| node.importance >= self.config.critical);
        let misses = critical.map(|node| node.misses).sum::<u64>() > 0 && present + foreign > BUSY * all;
        self.missing = if misses { self.missing + 1 } else { 0 };
        if self.over >= LOOKS || self.missing >= LOOKS {
            if self.over < LOOKS {
                self.squeeze = (self.squeeze * SQUEEZE).max(LEAST);
            }
            let cause = if self.over >= LOOKS { "load" } else { "missed deadlines at load" };
            (self.over, self.missing) = (0, 0);
            self.take_away(now, cause, present + foreign, all);
        } else if rule_changed {
            self.plan(all, self.squeeze);
            self.decide(format_args!("asked by the rule"));
        } else {
            self.give_back(now, present + foreign, all, misses);
        }
        self.limp(now, most);
    }

    /// Takes in the counters; whether the rule now asks for other periods.
    fn measure(&mut self, nodes: &[NodeLoad], asked: &[(String, f64)], dt_s: f64) -> bool {
        // Nodes that are gone, and new ones.
        self.demands.retain(|known| nodes.iter().any(|node| node.node == known.node));
        for node in nodes {
            let known = self.demands.iter().position(|known| known.node == node.node);
            match known {
                Some(known) => self.demands[known].measure(node, dt_s),
                None if self.demands.len() < self.demands.capacity() => self.demands.push(Demand::new(node)),
                None => {}
            }
        }
        let mut changed = false;
        for demand in &mut self.demands {
            let wish = asked.iter().find(|(node, _)| node == demand.name()).map_or(demand.shortest_s, |(_, s)| *s);
            let asked_s = wish.clamp(demand.shortest_s, demand.longest_s);
            changed |= std::mem::replace(&mut demand.asked_s, asked_s) != asked_s;
            if demand.suspended && self.calm_s > 0.0 {
                // Nobody knows what it would take now: it is tried again, later and later.
                demand.cost_s *= 1.0 - (0.5 * dt_s / self.calm_s).min(0.5);
            }
        }
        changed
    }

    fn plan(&mut self, all: f64, squeeze: f64) -> f64 {
        self.planner.plan(&self.demands, all * self.config.aim * squeeze, self.config.suspend_below)
    }

    fn take_away(&mut self, now: Time, cause: &str, load: f64, all: f64) {
        self.plan(all, self.squeeze);
        if self.decide(format_args!("{cause} {load:.2} of {all:.0}")) {
            let early = self.given_back.is_some_and(|back| now.since(back) < TOO_EARLY * self.calm_s);
            self.calm_s = if early { (2.0 * self.calm_s).min(LONGEST_CALM_S) } else { self.config.calm_s };
        }
        self.room_since = None;
    }

    fn give_back(&mut self, now: Time, load: f64, all: f64, misses: bool) {
        let squeeze = (self.squeeze / SQUEEZE).min(1.0);
        self.plan(all, squeeze);
        let given = self.demands.iter().zip(&self.planner.given);
        let shorter = |(node, given): (&Demand, &Given)| {
            !given.suspended && (node.suspended || given.period_s < (1.0 - WORTH) * node.period_s)
                || given.period_s < node.period_s && given.period_s == node.asked_s
        };
        let longer =
            self.demands.iter().zip(&self.planner.given).any(|(node, given)| given.suspended && !node.suspended);
        if misses || longer || !given.into_iter().any(shorter) && self.squeeze == squeeze {
            self.room_since = None;
            return;
        }
        let since = *self.room_since.get_or_insert(now);
        if now.since(since) >= self.calm_s {
            self.squeeze = squeeze;
            self.room_since = None;
            if self.decide(format_args!("room again, load {load:.2} of {all:.0}")) {
                self.given_back = Some(now);
            }
        }
    }

    /// Has the nodes keep to the plan, and says so; false when nothing changes.
    fn decide(&mut self, why: std::fmt::Arguments<'_>) -> bool {
        let is_same = |(node, given): (&Demand, &Given)| {
            node.suspended == given.suspended && (given.suspended || node.period_s == given.period_s)
        };
        if self.demands.iter().zip(&self.planner.given).all(is_same) {
            return false;
        }
        self.reason.clear();
        let room = self.reason.capacity();
        let mut text = Bounded { text: &mut self.reason, room };
        // What finds no room is left out on purpose.
        let _ = text.write_fmt(why);
        let mut sign = ':';
        for (node, given) in self.demands.iter_mut().zip(&self.planner.given) {
            if is_same((node, given)) {
                continue;
            }
            let period_s = std::mem::replace(&mut node.period_s, given.period_s);
            node.suspended = given.suspended;
            let (before, after, cost_ms) = (period_s * 1e3, given.period_s * 1e3, node.cost_s * 1e3);
            let _ = match given.suspended {
                true => write!(text, "{sign} {} suspended", node.name()),
                false => write!(text, "{sign} {} {before:.1} → {after:.1} ms (costs {cost_ms:.2} ms)", node.name()),
            };
            sign = ',';
        }
        self.decisions += 1;
        self.tell();
        true
    }

    /// The rung, from what is given now.
    fn tell(&mut self) {
        let limps = self.shortage == Shortage::Limp;
        let stretched = self.demands.iter().any(|node| node.period_s > node.asked_s);
        self.shortage = match self.demands.iter().any(|node| node.suspended) {
            _ if limps => Shortage::Limp,
            true => Shortage::Suspended,
            false if stretched => Shortage::Stretched,
            false => Shortage::None,
        };
    }

    /// Limps when what is left is still too much, and no more when it has not been for a while.
    fn limp(&mut self, now: Time, most: f64) {
        let present: f64 = self.demands.iter().map(Demand::present).sum();
        let limps = self.shortage == Shortage::Limp;
        // Each state has to be left for as long as it takes.
        if (present > most) == limps || !self.config.limp {
            self.short_since = None;
            return;
        }
        let since = *self.short_since.get_or_insert(now);
        if now.since(since) < if limps { self.calm_s } else { self.config.limp_after_s } {
            return;
        }
        self.short_since = None;
        self.reason.clear();
        let room = self.reason.capacity();
        let what = if limps { "limps no more" } else { "limps: nothing is left to be stretched or suspended" };
        let _ = write!(Bounded { text: &mut self.reason, room }, "{what}, load {present:.2} of at most {most:.2}");
        self.shortage = if limps { Shortage::None } else { Shortage::Limp };
        self.decisions += 1;
        self.tell();
    }
}
