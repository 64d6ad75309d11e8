//! What rules speak of: numbers by name.

use std::ops::{Index, IndexMut};

/// What a rule can ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// How much of its full speed the body may not use, for what stands ahead: 0 in the open, 1 before a wall.
    Danger,
    /// Clear way along the swept footprint [m].
    ClearM,
    /// Nearest thing in the region ahead [m].
    NearestM,
    /// Forward speed that is sent to the wheels, without its sign [m/s].
    SpeedMS,
    /// 1 while motion holds the body back.
    Stopped,
    /// Battery [V].
    BatteryV,
    /// Battery charge, 0 to 1.
    Charge,
    /// 1 while a bumper is pressed.
    Bumped,
    /// 1 while a goal is driven to.
    Goal,
    /// Way to the goal [m].
    GoalM,
    /// 1 in limp mode.
    Limp,
    /// Rung of the severity ladder: 0 none, 1 warn, 2 limp, 3 hold, 4 stop.
    Severity,
}

/// A signal's name, its range, and the read port that brings it.
struct Row(Signal, &'static str, f64, f64, &'static str);

const TABLE: [Row; 12] = {
    use Signal::*;
    const MUCH: f64 = f64::INFINITY;
    [
        Row(Danger, "danger", 0.0, 1.0, "motion"),
        Row(ClearM, "clear_m", 0.0, MUCH, "motion"),
        Row(NearestM, "nearest_m", 0.0, MUCH, "room"),
        Row(SpeedMS, "speed_m_s", 0.0, MUCH, "motion"),
        Row(Stopped, "stopped", 0.0, 1.0, "motion"),
        Row(BatteryV, "battery_v", 0.0, MUCH, "base"),
        Row(Charge, "charge", 0.0, 1.0, "base"),
        Row(Bumped, "bumped", 0.0, 1.0, "base"),
        Row(Goal, "goal", 0.0, 1.0, "goal"),
        Row(GoalM, "goal_m", 0.0, MUCH, "goal"),
        Row(Limp, "limp", 0.0, 1.0, ""),
        Row(Severity, "severity", 0.0, 4.0, ""),
    ]
};

/// Number of signals.
pub const SIGNALS: usize = TABLE.len();

impl Signal {
    /// All of them.
    pub fn all() -> impl Iterator<Item = Signal> {
        TABLE.iter().map(|row| row.0)
    }

    /// The one of that name.
    pub fn named(name: &str) -> Option<Signal> {
        TABLE.iter().find(|row| row.1 == name).map(|row| row.0)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        TABLE[self as usize].1
    }

    /// The values that it can have.
    pub fn range(self) -> (f64, f64) {
        (TABLE[self as usize].2, TABLE[self as usize].3)
    }

    /// The read port that it comes from; none for what the supervisor says, which is always wired.
    pub fn port(self) -> Option<&'static str> {
        Some(TABLE[self as usize].4).filter(|port| !port.is_empty())
    }
}

/// The value of every signal; NaN for what is not known.
#[derive(Debug, Clone, Copy)]
pub struct Signals([f64; SIGNALS]);

impl Default for Signals {
    fn default() -> Signals {
        Signals([f64::NAN; SIGNALS])
    }
}

impl Index<Signal> for Signals {
    type Output = f64;

    fn index(&self, signal: Signal) -> &f64 {
        &self.0[signal as usize]
    }
}

impl IndexMut<Signal> for Signals {
    fn index_mut(&mut self, signal: Signal) -> &mut f64 {
        &mut self.0[signal as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_signal_stands_at_its_own_row() {
        for (row, signal) in Signal::all().enumerate() {
            assert_eq!(signal as usize, row, "{}", signal.name());
            assert_eq!(Signal::named(signal.name()), Some(signal));
        }
    }
}
