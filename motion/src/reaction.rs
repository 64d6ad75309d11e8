//! How long this robot takes, in this run, from a sample to the wheels' first slowing.
//!
//! t = t_step + R_drive + R_driver + t_actuate, where t_step is the longest time between two of the last steps (a sample
//! that just missed one waits for the next), R the response times (release to end of step, 99.9 %) that the runtime
//! measured of this node and of the driver in this run, t_actuate what the device takes. Never less than what the robot
//! file reckons with: a measured time makes the robot slower, not faster.

use messages::NodeStatistics;

/// Steps whose distances are remembered: at 20 Hz the last three seconds.
const REMEMBERED: usize = 64;

/// The reaction time of this run.
#[derive(Debug, Clone)]
pub struct Reaction {
    floor_s: f64,
    actuate_s: f64,
    gaps_s: [f64; REMEMBERED],
    next: usize,
    own_s: f64,
    driver_s: f64,
}

impl Reaction {
    /// Nothing measured yet; `floor_s` is what the robot file reckons with from a sample to the first slowing.
    pub fn new(floor_s: f64, actuate_s: f64) -> Reaction {
        Reaction { floor_s, actuate_s, gaps_s: [0.0; REMEMBERED], next: 0, own_s: 0.0, driver_s: 0.0 }
    }

    /// Takes in the time since the last step.
    pub fn stepped(&mut self, gap_s: f64) {
        self.gaps_s[self.next] = gap_s;
        self.next = (self.next + 1) % REMEMBERED;
    }

    /// Takes in how this node kept time.
    pub fn own(&mut self, statistics: &NodeStatistics) {
        self.own_s = response_s(statistics);
    }

    /// Takes in how the driver kept time.
    pub fn driver(&mut self, statistics: &NodeStatistics) {
        self.driver_s = response_s(statistics);
    }

    /// What was measured, without the floor [s].
    pub fn measured_s(&self) -> f64 {
        let gap_s = self.gaps_s.iter().copied().fold(0.0, f64::max);
        gap_s + self.own_s + self.driver_s + self.actuate_s
    }

    /// What is to be reckoned with [s].
    pub fn seconds(&self) -> f64 {
        self.measured_s().max(self.floor_s)
    }
}

/// The 99.9 % of the responses; what is no time counts as none.
fn response_s(statistics: &NodeStatistics) -> f64 {
    let response_s = statistics.response_s[2];
    if response_s.is_finite() && response_s > 0.0 { response_s } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statistics(p999_s: f64) -> NodeStatistics {
        NodeStatistics { response_s: [0.0, 0.0, p999_s, 1.0], ..NodeStatistics::default() }
    }

    #[test]
    fn a_punctual_robot_reckons_with_what_its_file_says() {
        let mut reaction = Reaction::new(0.2, 0.02);
        reaction.stepped(0.05);
        reaction.own(&statistics(0.001));
        assert_eq!(reaction.seconds(), 0.2);
    }

    #[test]
    fn each_late_part_of_the_way_adds_to_the_time() {
        let mut reaction = Reaction::new(0.2, 0.02);
        reaction.stepped(0.1);
        reaction.own(&statistics(0.08));
        reaction.driver(&statistics(0.05));
        assert!((reaction.seconds() - 0.25).abs() < 1e-12);
        reaction.driver(&statistics(f64::NAN));
        assert!((reaction.seconds() - 0.2).abs() < 1e-12, "what is no number does not count");
    }

    #[test]
    fn a_long_pause_counts_until_it_is_forgotten() {
        let mut reaction = Reaction::new(0.1, 0.0);
        reaction.stepped(0.5);
        assert_eq!(reaction.seconds(), 0.5);
        for _ in 0..REMEMBERED {
            reaction.stepped(0.05);
        }
        assert_eq!(reaction.seconds(), 0.1);
    }
}
