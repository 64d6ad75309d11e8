//! How long the planner's steps take: the very node of the robot, with a clock around its step.
//!
//! CPU time of the thread, so that other programs on the machine do not count. It changes from run to run, and so the
//! figures are printed only when asked for: all else of a report is the same for the same seeds.

use actions::follow_gap::{FollowGap, FollowGapConfig};
use runtime::{Fault, Layer, Node, NodeType, OpenError, Ports, Time};
use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;
use std::cell::RefCell;

thread_local! {
    /// Steps of the run that this thread is at [µs].
    static STEPS_US: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// The planner with a clock around it.
struct Clocked(FollowGap);

impl Node for Clocked {
    const TYPE: &'static str = FollowGap::TYPE;
    const LAYER: Layer = FollowGap::LAYER;
    type Config = FollowGapConfig;

    fn open(ports: &mut Ports, config: FollowGapConfig) -> Result<Clocked, OpenError> {
        FollowGap::open(ports, config).map(Clocked)
    }

    fn start(&mut self, now: Time) -> Result<(), Fault> {
        self.0.start(now)
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let began_us = thread_us();
        let result = self.0.step(now);
        STEPS_US.with_borrow_mut(|steps| steps.push(thread_us() - began_us));
        result
    }

    fn stop(&mut self, now: Time) {
        self.0.stop(now);
    }
}

/// The types with the planner's clocked.
pub fn clocked(types: &[NodeType]) -> Vec<NodeType> {
    let clocked = |kind: &NodeType| if kind.name == FollowGap::TYPE { NodeType::of::<Clocked>() } else { *kind };
    types.iter().map(clocked).collect()
}

/// Takes the steps of the run that has just ended on this thread [µs].
pub fn take() -> Vec<f64> {
    STEPS_US.take()
}

fn thread_us() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 * 1e6 + now.tv_nsec as f64 * 1e-3
}

/// CPU time of the planner's steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pace {
    /// Steps that it is made of.
    pub steps: usize,
    /// Half of them took no longer [µs].
    pub p50_us: f64,
    /// 99 of 100 took no longer [µs].
    pub p99_us: f64,
    /// The longest [µs].
    pub max_us: f64,
}

impl Pace {
    /// Of all steps together; `None` without any.
    pub fn of(mut steps_us: Vec<f64>) -> Option<Pace> {
        steps_us.sort_by(f64::total_cmp);
        let last = steps_us.len().checked_sub(1)?;
        let at = |share: f64| steps_us[(last as f64 * share) as usize];
        Some(Pace { steps: steps_us.len(), p50_us: at(0.5), p99_us: at(0.99), max_us: at(1.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_the_sorted_steps_and_none_is_no_pace() {
        let pace = Pace::of((0..=100).rev().map(f64::from).collect()).unwrap();
        assert_eq!(pace, Pace { steps: 101, p50_us: 50.0, p99_us: 99.0, max_us: 100.0 });
        assert_eq!(Pace::of(Vec::new()), None);
    }

    #[test]
    fn the_clocked_planner_takes_the_place_of_the_plain_one_and_of_nothing_else() {
        let types = clocked(&[NodeType::of::<FollowGap>(), NodeType::of::<actions::goto::Goto>()]);
        assert_eq!(types.iter().map(|kind| kind.name).collect::<Vec<_>>(), ["follow_gap", "goto"]);
    }
}
