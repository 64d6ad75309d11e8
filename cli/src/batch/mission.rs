//! One mission judged: did it succeed, why not, and its metrics.
//!
//! From the true track at 10 Hz: speed v, acceleration a = Δv/Δt, jerk j = Δa/Δt. The energy is a model's, the
//! mechanical work at the wheels: E = Σ (m · max(a·v, 0) + c · m · g · |v|) Δt with m = 9 kg (a Pioneer 3-DX) and rolling
//! resistance c = 0.03; electronics and sensors draw more, the same in every mission.

use super::scenario::Scenario;
use crate::output::count;
use crate::simulation::{FaultResult, Run, TrackPoint};
use messages::NodeStatistics;

const MASS_KG: f64 = 9.0;
const ROLLING: f64 = 0.03;
const GRAVITY_M_S2: f64 = 9.81;

/// What became of a mission.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mission {
    /// Its seed.
    pub seed: u64,
    /// Empty for a success, else the reason.
    pub failure: String,
    /// Until the last goal, or until the end [s].
    pub time_s: f64,
    /// Goals reached.
    pub goals: u64,
    /// Contacts caused and suffered.
    pub contacts: [u64; 2],
    /// Way [m].
    pub distance_m: f64,
    /// Mean while moving, and greatest [m/s].
    pub speed_m_s: [f64; 2],
    /// Root mean square of the jerk [m/s³].
    pub jerk_m_s3: f64,
    /// Least, and mean over the time [m].
    pub clearance_m: [f64; 2],
    /// See the module's text [J].
    pub energy_j: f64,
    /// Faults that happened, and restarts of processes.
    pub faults: [u64; 2],
    /// What each node cost.
    pub nodes: Vec<NodeCost>,
    /// Hash of the run.
    pub hash: String,
}

/// What a node cost in a mission.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NodeCost {
    /// Its path.
    pub path: String,
    /// Share of a core: steps times the median of their execution time, by the simulated host's model of execution.
    pub cpu: f64,
    /// Deadlines missed.
    pub missed_deadlines: u64,
}

impl Mission {
    /// Judges a run.
    pub fn judge(scenario: &Scenario, run: &Run) -> Mission {
        let result = &run.result;
        let (goals, reached_s, late) = goals(scenario, &run.track);
        let motion = Motion::of(&run.track);
        let end_s = run.track.last().map_or(0.0, |point| point.time_s);
        let faults = result.faults.as_ref();
        let cost = |(path, told): &(String, NodeStatistics)| NodeCost {
            path: path.clone(),
            // To the millionth: what a table says is then what was measured.
            cpu: (told.execution_s[0] * told.steps as f64 / scenario.timeout_s * 1e6).round() / 1e6,
            missed_deadlines: told.missed_deadlines,
        };
        let mut mission = Mission {
            seed: result.seed,
            failure: String::new(),
            time_s: reached_s.unwrap_or(end_s),
            goals,
            contacts: [result.contacts_caused, result.contacts_suffered],
            distance_m: result.distance_m,
            speed_m_s: [result.mean_speed_m_s, motion.greatest_m_s],
            jerk_m_s3: motion.jerk_m_s3,
            clearance_m: [result.least_clearance_m, motion.clearance_m],
            energy_j: motion.energy_j,
            faults: faults.map_or([0; 2], |told| [told.injected.iter().sum(), told.restarts]),
            nodes: run.nodes.iter().map(cost).collect(),
            hash: result.hash.clone(),
        };
        let unsafe_stop = faults.and_then(unsafe_stop);
        mission.failure =
            mission.contact(scenario).or(unsafe_stop).or(late).or_else(|| mission.flaw(scenario)).unwrap_or_default();
        mission
    }

    /// Whether all conditions were met.
    pub fn succeeded(&self) -> bool {
        self.failure.is_empty()
    }

    /// Deadlines missed by all nodes together.
    pub fn missed_deadlines(&self) -> u64 {
        self.nodes.iter().map(|node| node.missed_deadlines).sum()
    }

    /// Share of a core that all nodes had.
    pub fn cpu(&self) -> f64 {
        self.nodes.iter().map(|node| node.cpu).sum()
    }

    /// Whether both failed, and for the same reason, whatever its numbers.
    pub fn fails_like(&self, other: &Mission) -> bool {
        let words = |failure: &str| {
            let letters = failure.chars().filter(|c| c.is_alphabetic()).collect::<String>();
            // One contact or two: the same reason.
            letters.replace("contacts", "contact").replace("stops", "stop").replace("commands", "command")
        };
        !self.succeeded() && words(&self.failure) == words(&other.failure)
    }

    fn contact(&self, scenario: &Scenario) -> Option<String> {
        let success = &scenario.success;
        let [caused, suffered] = self.contacts;
        if caused > success.max_contacts_caused {
            return Some(format!("{} caused", count(caused as usize, "contact")));
        }
        if success.max_contacts_suffered.is_some_and(|most| suffered > most) {
            return Some(format!("{} suffered", count(suffered as usize, "contact")));
        }
        None
    }

    fn flaw(&self, scenario: &Scenario) -> Option<String> {
        let success = &scenario.success;
        let below = |least: Option<f64>, value: f64| least.filter(|least| value < *least);
        if let Some(least) = below(success.min_distance_m, self.distance_m) {
            return Some(format!("drove {:.2} m of {least} m", self.distance_m));
        }
        if let Some(least) = below(success.min_clearance_m, self.clearance_m[0]) {
            return Some(format!("clearance {:.3} m below {least} m", self.clearance_m[0]));
        }
        let least = below(success.min_mean_speed_m_s, self.speed_m_s[0])?;
        Some(format!("mean speed {:.3} m/s below {least} m/s", self.speed_m_s[0]))
    }
}

/// What must not follow from any fault.
fn unsafe_stop(faults: &FaultResult) -> Option<String> {
    if faults.stops_let_go > 0 {
        return Some(format!("{} ended without a reset", count(faults.stops_let_go as usize, "emergency stop")));
    }
    let moves = faults.moves_while_stopped;
    (moves > 0).then(|| format!("{} to move under an emergency stop", count(moves as usize, "command")))
}

/// Goals reached in order, when the last one was, and why the rest was not.
fn goals(scenario: &Scenario, track: &[TrackPoint]) -> (u64, Option<f64>, Option<String>) {
    let mut points = track.iter();
    let mut reached_s = 0.0;
    for (index, goal) in scenario.goals.iter().enumerate() {
        let until_s = goal.timeout_s.map_or(f64::INFINITY, |timeout_s| reached_s + timeout_s);
        let there = |point: &&TrackPoint| {
            let (x_m, y_m) = (point.truth.x_m - goal.x_m, point.truth.y_m - goal.y_m);
            x_m * x_m + y_m * y_m <= goal.within_m * goal.within_m
        };
        match points.find(there).filter(|point| point.time_s <= until_s) {
            Some(point) => reached_s = point.time_s,
            None => return (index as u64, None, Some(format!("goal {} not reached in time", index + 1))),
        }
    }
    let count = scenario.goals.len() as u64;
    (count, (count > 0).then_some(reached_s), None)
}

/// What a track says of the motion.
#[derive(Default)]
struct Motion {
    greatest_m_s: f64,
    jerk_m_s3: f64,
    clearance_m: f64,
    energy_j: f64,
}

impl Motion {
    fn of(track: &[TrackPoint]) -> Motion {
        let mut motion = Motion::default();
        let (mut jerk2, mut jerks, mut clearance_m) = (0.0, 0_u64, 0.0);
        let mut before_m_s2 = None;
        for pair in track.windows(2) {
            let dt_s = (pair[1].time_s - pair[0].time_s).max(1e-6);
            let [from_m_s, to_m_s] = [&pair[0], &pair[1]].map(|point| point.truth.velocity.linear_x_m_s);
            let acceleration_m_s2 = (to_m_s - from_m_s) / dt_s;
            if let Some(before_m_s2) = before_m_s2.replace(acceleration_m_s2) {
                let jerk_m_s3: f64 = (acceleration_m_s2 - before_m_s2) / dt_s;
                jerk2 += jerk_m_s3 * jerk_m_s3;
                jerks += 1;
            }
            let power_w =
                MASS_KG * (acceleration_m_s2 * to_m_s).max(0.0) + ROLLING * MASS_KG * GRAVITY_M_S2 * to_m_s.abs();
            motion.energy_j += power_w * dt_s;
            motion.greatest_m_s = motion.greatest_m_s.max(to_m_s.abs());
        }
        let finite = track.iter().map(|point| point.truth.clearance_m).filter(|clearance_m| clearance_m.is_finite());
        let mut count = 0_u64;
        for value in finite {
            clearance_m += value;
            count += 1;
        }
        motion.clearance_m = clearance_m / count.max(1) as f64;
        motion.jerk_m_s3 = (jerk2 / jerks.max(1) as f64).sqrt();
        motion
    }
}
