//! All that an algorithm decides by: what every action wants and forbids, now.

use crate::opinion::{Caps, Decision, Opinion, Words};

/// The decision on each axis (forward, sideways, turn); `None` where nobody has an opinion.
pub type Decisions = [Option<Decision>; 3];

/// One round of proposals.
#[derive(Debug, Clone, Copy)]
pub struct Round<'a> {
    /// The opinions on each axis, in the order of the proposals' paths.
    pub opinions: [&'a [Opinion]; 3],
    /// What the proposals forbid on each axis, without the mode's own limits.
    pub vetoes: [Caps; 3],
    /// The mode's own limits.
    pub limits: [Caps; 3],
    /// Velocities for words, on each axis.
    pub words: [Words; 3],
    /// Whether an obstacle is nearer than the mode's switching distance.
    pub near: bool,
}

impl Round<'_> {
    /// Decides each axis on its own.
    pub fn by_axis(&self, mut decide: impl FnMut(&[Opinion]) -> Option<Decision>) -> Decisions {
        self.opinions.map(&mut decide)
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// An opinion of action number `action`.
    pub fn opinion(action: usize, value: f64, weight: f64, urgency: f64) -> Opinion {
        Opinion { value, weight, urgency, action, takes_over: false }
    }

    /// A round in which nothing is forbidden: opinions on forward and turn.
    pub fn round<'a>(forward: &'a [Opinion], turn: &'a [Opinion]) -> Round<'a> {
        Round {
            opinions: [forward, &[], turn],
            vetoes: [Caps::FREE; 3],
            limits: [Caps::new(0.5, 0.5), Caps::new(0.0, 0.0), Caps::new(1.0, 1.0)],
            words: [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0.15, 0.35, 0.7]],
            near: false,
        }
    }
}
