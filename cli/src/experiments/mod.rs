//! S2's experiments, repeated in simulation on virtual time: the figures that the service robot is held to.
//!
//! Every run is a whole robot (driver, perception, actions, coordinator, motion) in the simulated host, ordered by call as
//! a person would; its end is judged by the simulator's truth. Same seeds, same figures, on any machine.

pub mod chart;
mod emergency_stop;
mod goto;
mod goto_avoid;
mod moves;
mod profiles;
pub mod rig;

use crate::exit::Failure;
use runtime::robot::Robot;
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How much is run.
#[derive(Debug, Clone)]
pub struct Extent {
    /// Share of the whole: 1 for the figures, less for a look.
    pub part: f64,
    /// Threads.
    pub jobs: usize,
    /// A robot in the service robot's stead, with its nodes, for a trial of other settings.
    pub robot: Option<Robot>,
}

impl Extent {
    /// So many of `whole` runs, at least one.
    fn of(&self, whole: usize) -> usize {
        ((whole as f64 * self.part).ceil() as usize).max(1)
    }

    /// The service robot in `world`, or what stands in its stead.
    fn service(&self, world: &str) -> Result<Robot, Failure> {
        self.variant("robot.toml", world)
    }

    /// The same as one of its files has it.
    fn variant(&self, file: &str, world: &str) -> Result<Robot, Failure> {
        match &self.robot {
            Some(robot) => Ok(rig::placed(robot.clone(), world)),
            None => rig::variant(file, world),
        }
    }
}

/// What a figure must be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
}

/// One number that an experiment found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// What it is.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// What it must be, if it must be anything.
    pub target: Option<Target>,
}

impl Figure {
    fn new(name: &'static str, value: f64, unit: &'static str) -> Figure {
        Figure { name, value, unit, target: None }
    }

    fn at_most(mut self, bound: f64) -> Figure {
        self.target = Some(Target::AtMost(bound));
        self
    }

    fn at_least(mut self, bound: f64) -> Figure {
        self.target = Some(Target::AtLeast(bound));
        self
    }

    /// Whether it is what it must be; a value that is no number never is.
    pub fn holds(&self) -> bool {
        match self.target {
            Some(Target::AtMost(bound)) => self.value <= bound,
            Some(Target::AtLeast(bound)) => self.value >= bound,
            None => true,
        }
    }
}

/// What an experiment found.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// The experiment.
    pub experiment: &'static str,
    /// How it was done.
    pub conditions: &'static str,
    /// Number of runs.
    pub runs: usize,
    /// What was found.
    pub figures: Vec<Figure>,
    /// What went wrong in single runs, at most a few.
    pub remarks: Vec<String>,
    /// Pictures: file name and SVG.
    #[serde(skip)]
    pub pictures: Vec<(String, String)>,
}

impl Outcome {
    /// Whether every figure is what it must be.
    pub fn holds(&self) -> bool {
        self.figures.iter().all(Figure::holds)
    }

    /// The figure called `name`; NaN when there is none.
    pub fn value(&self, name: &str) -> f64 {
        self.figures.iter().find(|figure| figure.name == name).map_or(f64::NAN, |figure| figure.value)
    }
}

/// An experiment's name and what carries it out.
pub type Experiment = (&'static str, fn(&Extent) -> Result<Outcome, Failure>);

/// All experiments, in the order of the source.
pub const ALL: &[Experiment] = &[
    ("goto", goto::run),
    ("goto_avoid", goto_avoid::with_sonar),
    ("goto_avoid_laser", goto_avoid::with_laser),
    ("emergency_stop", emergency_stop::run),
    ("move", moves::run),
    ("profiles", profiles::run),
];

/// Does `work` for 0…count on some threads; the results in order.
fn in_parallel<T: Send>(
    count: usize,
    jobs: usize,
    work: impl Fn(usize) -> Result<T, Failure> + Sync,
) -> Result<Vec<T>, Failure> {
    let next = AtomicUsize::new(0);
    let one = || {
        let mut done = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return done;
            }
            done.push((index, work(index)));
        }
    };
    let mut all: Vec<(usize, Result<T, Failure>)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..jobs.clamp(1, count.max(1))).map(|_| scope.spawn(one)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(|e| std::panic::resume_unwind(e))).collect()
    });
    all.sort_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, result)| result).collect()
}

/// The value that `share` of all do not exceed; NaN of none.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = ((sorted.len() as f64 * share).ceil() as usize).max(1) - 1;
    sorted.get(at).copied().unwrap_or(f64::NAN)
}

/// The greatest; NaN of none.
fn greatest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NAN, f64::max)
}

/// A number in [0, 1) that depends on nothing but `seed` and `index` (SplitMix64).
fn chance(seed: u64, index: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(index.wrapping_mul(0xd1b5_4a32_d192_ed03));
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_is_a_value_that_was_seen() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0, 4.0], 0.5), 2.0);
        assert_eq!(quantile(&[3.0, 1.0, 2.0, 4.0], 0.95), 4.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn a_figure_that_is_no_number_never_holds() {
        assert!(Figure::new("error", 0.01, "m").at_most(0.1).holds());
        assert!(!Figure::new("error", f64::NAN, "m").at_most(0.1).holds());
        assert!(!Figure::new("reached", 0.9, "share").at_least(1.0).holds());
    }

    #[test]
    fn chance_is_spread_and_the_same_every_time() {
        let all: Vec<f64> = (0..1000).map(|k| chance(k / 10, k % 10)).collect();
        let mean = all.iter().sum::<f64>() / 1000.0;
        assert!((mean - 0.5).abs() < 0.05 && all.iter().all(|x| (0.0..1.0).contains(x)));
        assert_eq!(chance(3, 4), chance(3, 4));
    }

    #[test]
    fn results_come_in_order_whatever_the_number_of_threads() {
        for jobs in [1, 3] {
            assert_eq!(in_parallel(7, jobs, Ok).ok(), Some((0..7).collect()));
        }
    }
}
