//! What a robot file says, as the policy's plan: a process per node or per group of nodes that share one, its care, its
//! fate, its reactions. The same for the live and the simulated host.

use runtime::Layer;
use runtime::robot::Strategy as FileStrategy;
use runtime::robot::{
    CareTable, Do, GroupTable, Leave, Limp, NodeSpec, ReactionTable, Restart as Wish, Robot, Rung, When,
};

use crate::backoff::{Backoff, Intensity};
use crate::beats::BEATS_PER_LIMIT;
use crate::care::{Act, Care, Condition, Group, Reaction, Strategy, Supervision};
use crate::rule::{Restart, Rule};
use crate::severity::{Clear, Severity};

/// One process of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Crew {
    /// Its name: the path of its only node, or the word that its nodes share.
    pub name: String,
    /// Its nodes, by their place in the robot file.
    pub nodes: Vec<usize>,
    /// Their paths, `/drivers/base`.
    pub paths: Vec<String>,
    /// Paths that it must keep fresh, and their greatest age [ns].
    pub fresh: Vec<(String, u64)>,
}

/// A robot's processes and everything that the policy must know of them.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotPlan {
    /// The processes; the policy numbers its nodes like them.
    pub crews: Vec<Crew>,
    /// What the policy is made from.
    pub supervision: Supervision,
    /// Commands of reactions, by number.
    pub commands: Vec<Vec<String>>,
    /// Paths that reactions wait for, by number.
    pub paths: Vec<String>,
}

/// Priority that a late node may be given above the robot file's, where that says nothing.
const RAISE_MOST: u8 = 5;
/// A node that is not ready after this long hangs, where the robot file says nothing [ms].
const START_DEADLINE_MS: f64 = 5_000.0;

impl RobotPlan {
    /// The plan of `robot`, whose file has been checked.
    pub fn of(robot: &Robot) -> RobotPlan {
        let mut crews: Vec<Crew> = Vec::new();
        for (index, node) in robot.nodes.iter().enumerate() {
            let name = node.process.clone().unwrap_or_else(|| node.path());
            match crews.iter_mut().find(|crew| crew.name == name && node.process.is_some()) {
                Some(crew) => crew.nodes.push(index),
                None => crews.push(Crew { name, nodes: vec![index], paths: Vec::new(), fresh: Vec::new() }),
            }
        }
        let mut nodes = Vec::new();
        for crew in &mut crews {
            let members: Vec<&NodeSpec> = crew.nodes.iter().map(|&index| &robot.nodes[index]).collect();
            crew.paths = members.iter().map(|member| member.path()).collect();
            for member in &members {
                let ports = member.care.fresh_ms.iter();
                crew.fresh.extend(ports.map(|(port, ms)| (member.port_path(port), (ms * 1e6) as u64)));
            }
            nodes.push(care(&members, robot.limp.as_ref()));
        }
        let place = |instance: &str| {
            let of = |crew: &Crew| crew.nodes.iter().any(|&index| robot.nodes[index].instance == instance);
            crews.iter().position(of)
        };
        let groups = robot.supervision.groups.iter().map(|table| group(table, &place)).collect();
        let (mut commands, mut paths) = (Vec::new(), Vec::new());
        let tables = robot.supervision.reactions.iter();
        let reactions = tables.map(|table| reaction(table, &place, &mut commands, &mut paths)).collect();
        RobotPlan { crews, supervision: Supervision { nodes, groups, reactions }, commands, paths }
    }
}

/// Groups stop in ascending and start in descending order: a driver outlives those who command it, so that its last
/// order to the wheels is its own, and the simulated device outlives the driver.
fn stop_group(layer: Layer) -> u8 {
    match layer {
        Layer::Simulator => 2,
        Layer::Drivers => 1,
        _ => 0,
    }
}

fn care(members: &[&NodeSpec], limp: Option<&Limp>) -> Care {
    let wish = |node: &&NodeSpec| match node.restart {
        Wish::Always => Restart::Always,
        Wish::OnFailure => Restart::OnFailure,
        Wish::Never => Restart::Never,
    };
    let said = members.iter().map(|node| &node.care).find(|care| **care != CareTable::default());
    let silent = CareTable::default();
    let table = said.unwrap_or(&silent);
    let seconds = |ms: Option<f64>, or_s: f64| ms.map_or(or_s, |ms| ms / 1e3);
    let (backoff, intensity, rule) = (Backoff::default(), Intensity::default(), Rule::default());
    let plain = Care::plain(Rule {
        restart: members.iter().map(wish).min_by_key(|restart| *restart as u8).unwrap_or_default(),
        stop_group: members.iter().map(|node| stop_group(node.kind.layer)).max().unwrap_or(0),
        ready_within_s: seconds(table.ready_within_ms, rule.ready_within_s),
        grace_s: seconds(table.grace_ms, rule.grace_s),
        intensity: Intensity {
            restarts: table.restarts.unwrap_or(intensity.restarts),
            window_s: table.within_s.unwrap_or(intensity.window_s),
        },
        backoff: Backoff {
            first_s: seconds(table.first_delay_ms, backoff.first_s),
            step_s: seconds(table.delay_ms, backoff.step_s),
            longest_s: seconds(table.longest_delay_ms, backoff.longest_s),
            healthy_s: table.healthy_s.unwrap_or(backoff.healthy_s),
        },
        ..rule
    });
    let loss = table.loss.map_or(plain.loss, severity);
    let limps = [Some(loss), table.silence.map(severity)].contains(&Some(Severity::Limp));
    let leave = table.clear.or(limp.filter(|_| limps).map(|limp| limp.leave)).unwrap_or_default();
    let after_ms = table.clear_after_ms.or(limp.filter(|_| limps).map(|limp| limp.after_ms)).unwrap_or(0.0);
    Care {
        loss,
        clear: clear(leave, after_ms),
        absent_after_s: seconds(table.absent_after_ms, plain.absent_after_s),
        start_deadline_s: table.start_deadline_ms.unwrap_or(START_DEADLINE_MS) / 1e3,
        beats_low: table.missed_low.unwrap_or(BEATS_PER_LIMIT - 1),
        beats_high: table.missed_high.unwrap_or(BEATS_PER_LIMIT),
        silence: table.silence.map_or(plain.silence, severity),
        restart_when_silent: table.restart_when_silent,
        lateness: table.lateness.map_or(plain.lateness, severity),
        raise_most: table.raise_most.unwrap_or(RAISE_MOST),
        calm_s: table.calm_s.unwrap_or(plain.calm_s),
        standby: table.standby,
        trial_s: table.trial_s.unwrap_or(plain.trial_s),
        ..plain
    }
}

fn severity(rung: Rung) -> Severity {
    match rung {
        Rung::None => Severity::None,
        Rung::Warn => Severity::Warn,
        Rung::Limp => Severity::Limp,
        Rung::Hold => Severity::Hold,
        Rung::Stop => Severity::Stop,
    }
}

fn clear(leave: Leave, after_ms: f64) -> Clear {
    match leave {
        Leave::Recovered => Clear::Gone { after_s: after_ms / 1e3 },
        Leave::Reset => Clear::Reset,
        Leave::Never => Clear::Never,
    }
}

fn group(table: &GroupTable, place: &dyn Fn(&str) -> Option<usize>) -> Group {
    let mut members: Vec<usize> = Vec::new();
    for node in table.nodes.iter().filter_map(|node| place(node)) {
        // Nodes of one process have one place.
        if !members.contains(&node) {
            members.push(node);
        }
    }
    Group {
        members,
        strategy: match table.strategy {
            FileStrategy::OneForOne => Strategy::OneForOne,
            FileStrategy::OneForAll => Strategy::OneForAll,
            FileStrategy::RestForOne => Strategy::RestForOne,
        },
        intensity: Intensity { restarts: table.restarts, window_s: table.within_s },
    }
}

fn reaction(
    table: &ReactionTable,
    place: &dyn Fn(&str) -> Option<usize>,
    commands: &mut Vec<Vec<String>>,
    paths: &mut Vec<String>,
) -> Reaction {
    let mut act = |act: &Do| match act {
        Do::Restart(node) => place(node).map(|node| Act::Restart { node }),
        Do::Execute(words) => {
            commands.push(words.clone());
            Some(Act::Execute { command: commands.len() - 1 })
        }
        Do::WaitFor { path, within_ms } => {
            paths.push(path.clone());
            Some(Act::Await { path: paths.len() - 1, within_s: within_ms / 1e3 })
        }
        Do::WaitMs(ms) => Some(Act::Wait(ms / 1e3)),
        Do::Notify => Some(Act::Notify),
        Do::Log => Some(Act::Log),
        Do::Heal => Some(Act::Heal),
        Do::Rung(rung) => Some(Act::Raise(severity(*rung))),
    };
    Reaction {
        node: table.node.as_deref().and_then(place),
        when: match table.when {
            When::Death => Condition::Death,
            When::AbnormalDeath => Condition::AbnormalDeath,
            When::MissedLow => Condition::MissedLow,
            When::MissedHigh => Condition::MissedHigh,
            When::Attach => Condition::Attach,
            When::Detach => Condition::Detach,
            When::Restart => Condition::Restart,
            When::Raised => Condition::Raised(table.code),
            When::Silent => Condition::Silent,
            When::Late => Condition::Late,
            When::NotReady => Condition::NotReady,
            When::GivenUp => Condition::GivenUp,
        },
        acts: table.acts.iter().filter_map(&mut act).collect(),
        fallback: table.otherwise.iter().filter_map(&mut act).collect(),
        again: !table.once,
        clear: clear(table.clear, 0.0),
    }
}
