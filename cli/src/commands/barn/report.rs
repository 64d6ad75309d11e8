//! What a suite's runs come to.

use super::pace::Pace;
use super::suite::Suite;
use super::trial::{End, Trial};
use serde::{Deserialize, Serialize};
use std::io::Write;

/// Said with every result.
pub const NOTE: &str =
    "BARN geometry in planar kinematics with the challenge's start, goal, limits and score: no leaderboard score";

/// All runs together.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// What the figures are, and what they are not.
    pub note: &'static str,
    /// Runs that it is made of.
    pub runs: usize,
    /// Share of runs that got there.
    pub success: f64,
    /// Share of runs that touched something.
    pub collisions: f64,
    /// Share of runs that ran out of time.
    pub timeouts: f64,
    /// Mean time of the runs that got there; null without any [s].
    pub mean_time_s: Option<f64>,
    /// Mean score: over a world's runs, then over worlds.
    pub score: f64,
    /// Least distance from anything in a run that got there [m].
    pub least_clearance_m: Option<f64>,
    /// DynaBARN's classes; empty for BARN.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub classes: Vec<Class>,
    /// CPU time of the planner's steps; only when asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_times: Option<Pace>,
    /// Other planners through the same worlds; empty unless asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub peers: Vec<Peer>,
    /// Each world's runs.
    pub worlds: Vec<World>,
}

/// Another planner through the same worlds.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Peer {
    /// Which, and how fast.
    pub peer: String,
    /// Runs, one in each world.
    pub runs: usize,
    /// Share of runs that got there.
    pub success: f64,
    /// Share of runs that touched something.
    pub collisions: f64,
    /// Share of runs that ran out of time.
    pub timeouts: f64,
    /// Mean time of the runs that got there [s].
    pub mean_time_s: f64,
    /// Mean score.
    pub score: f64,
    /// Mean time of a step of its planner, without the laser's [ms].
    pub mean_step_ms: f64,
}

/// A class of worlds.
#[derive(Debug, Clone, Serialize)]
pub struct Class {
    /// easy, medium or hard.
    pub class: &'static str,
    /// Runs in it.
    pub runs: usize,
    /// Share of these that got there.
    pub success: f64,
}

/// One run.
#[derive(Debug, Clone, Serialize)]
pub struct World {
    /// Number of the world.
    pub world: u32,
    /// Seed of the run.
    pub seed: u64,
    /// How it ended.
    pub end: End,
    /// Time from the first motion to the end [s].
    pub time_s: f64,
    /// Its score.
    pub score: f64,
    /// Least distance from anything [m].
    pub least_clearance_m: f64,
    /// Way travelled [m].
    pub distance_m: f64,
}

impl Report {
    /// Sums up; `trials` are sorted by world.
    pub fn of(suite: &Suite, trials: &[Trial]) -> Report {
        let share = |end: End| ratio(trials.iter().filter(|trial| trial.end == end).count(), trials.len());
        let won = || trials.iter().filter(|trial| trial.end == End::Success);
        let times: Vec<f64> = won().map(|trial| trial.time_s).collect();
        let by_world: Vec<f64> = trials
            .chunk_by(|a, b| a.world == b.world)
            .map(|runs| runs.iter().map(|run| run.score).sum::<f64>() / runs.len() as f64)
            .collect();
        let least = won().map(|trial| trial.least_clearance_m).fold(f64::INFINITY, f64::min);
        let classes = ["easy", "medium", "hard"].into_iter().filter_map(|class| {
            let of: Vec<&Trial> = trials.iter().filter(|trial| suite.class(trial.world) == Some(class)).collect();
            let successes = of.iter().filter(|trial| trial.end == End::Success).count();
            (!of.is_empty()).then(|| Class { class, runs: of.len(), success: ratio(successes, of.len()) })
        });
        Report {
            note: NOTE,
            runs: trials.len(),
            success: share(End::Success),
            collisions: share(End::Collision),
            timeouts: share(End::Timeout),
            mean_time_s: (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64),
            score: by_world.iter().sum::<f64>() / by_world.len().max(1) as f64,
            least_clearance_m: least.is_finite().then_some(least),
            classes: classes.collect(),
            step_times: Pace::of(trials.iter().flat_map(|trial| trial.steps_us.iter().copied()).collect()),
            peers: Vec::new(),
            worlds: trials.iter().map(World::of).collect(),
        }
    }

    /// For people: what went wrong, then the sums.
    pub fn print(&self, out: &mut impl Write) -> std::io::Result<()> {
        for world in self.worlds.iter().filter(|world| world.end != End::Success) {
            let what = if world.end == End::Collision { "collision" } else { "timeout" };
            writeln!(out, "world {:>3}, seed {}: {what} after {:.1} s", world.world, world.seed, world.time_s)?;
        }
        writeln!(
            out,
            "{} runs: success {:.1} %, collisions {:.1} %, timeouts {:.1} %, mean time {}, score {:.4}",
            self.runs,
            100.0 * self.success,
            100.0 * self.collisions,
            100.0 * self.timeouts,
            self.mean_time_s.map_or("-".into(), |s| format!("{s:.2} s")),
            self.score
        )?;
        for class in &self.classes {
            writeln!(out, "  {:<6} {:>3} runs: success {:.1} %", class.class, class.runs, 100.0 * class.success)?;
        }
        if let Some(pace) = &self.step_times {
            writeln!(
                out,
                "  planner's step, CPU time: p50 {:.0} µs, p99 {:.0} µs, longest {:.0} µs, of {}",
                pace.p50_us, pace.p99_us, pace.max_us, pace.steps
            )?;
        }
        for peer in &self.peers {
            writeln!(
                out,
                "  {}: success {:.1} %, collisions {:.1} %, timeouts {:.1} %, mean time {:.2} s, score {:.4}",
                peer.peer,
                100.0 * peer.success,
                100.0 * peer.collisions,
                100.0 * peer.timeouts,
                peer.mean_time_s,
                peer.score
            )?;
        }
        writeln!(out, "{}", self.note)
    }
}

impl World {
    fn of(trial: &Trial) -> World {
        World {
            world: trial.world,
            seed: trial.seed,
            end: trial.end,
            time_s: trial.time_s,
            score: trial.score,
            least_clearance_m: trial.least_clearance_m,
            distance_m: trial.distance_m,
        }
    }
}

fn ratio(part: usize, whole: usize) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}
