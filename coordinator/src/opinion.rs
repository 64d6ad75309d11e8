//! What one proposal says about one axis, after words have become numbers; and the caps of all.

use messages::{Axis, Wish};

/// A wanted velocity on one axis, with what speaks for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Opinion {
    /// Wanted velocity [m/s or rad/s]; finite.
    pub value: f64,
    /// Weight of the action in this mode; positive.
    pub weight: f64,
    /// How pressing it is: 0 idle … 1 must.
    pub urgency: f64,
    /// Number of the proposal in this round; the opinions of one proposal share it.
    pub action: usize,
    /// Whether its action takes over near obstacles.
    pub takes_over: bool,
}

/// What an algorithm made of all opinions on one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Velocity [m/s or rad/s].
    pub value: f64,
    /// Part of it that the strongest opinion had, 0…1.
    pub share: f64,
}

/// Velocities for the words 1 "a little", 2 "some", 3 "much"; negative words mirror them [m/s or rad/s].
pub type Words = [f64; 3];

impl Opinion {
    /// The opinion that `axis` holds, if any: numbers that are none, weightless actions and idle proposals have none.
    pub fn of(axis: &Axis, weight: f64, urgency: f64, words: &Words) -> Option<Opinion> {
        let value = match axis.wish {
            wish if wish == Wish::Exact as u32 => axis.value,
            wish if wish == Wish::Word as u32 => in_numbers(axis.word, words),
            _ => return None,
        };
        let counts = value.is_finite() && weight > 0.0 && weight.is_finite() && urgency > 0.0;
        counts.then_some(Opinion { value, weight, urgency: urgency.min(1.0), action: 0, takes_over: false })
    }

    /// Whether it must be obeyed: on its axis, proposals that merely wish do not count beside it.
    pub fn must(&self) -> bool {
        self.urgency >= 1.0
    }
}

fn in_numbers(word: i32, words: &Words) -> f64 {
    match word.unsigned_abs() {
        0 => 0.0,
        size => f64::from(word.signum()) * words[(size.min(3) - 1) as usize],
    }
}

/// The tightest caps of all proposals on one axis. They apply whatever the weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Caps {
    positive: f64,
    negative: f64,
}

impl Caps {
    /// No cap at all.
    pub const FREE: Caps = Caps { positive: f64::INFINITY, negative: f64::INFINITY };

    /// No cap but `positive` and `negative`, the mode's own.
    pub fn new(positive: f64, negative: f64) -> Caps {
        Caps { positive, negative }
    }

    /// Adds the caps of one proposal's axis. A cap that is negative or no number forbids all: whoever wrote it meant
    /// to hold back.
    pub fn tighten(&mut self, axis: &Axis) {
        self.positive = self.positive.min(usable(axis.cap_positive));
        self.negative = self.negative.min(usable(axis.cap_negative));
    }

    /// The tighter of two.
    pub fn and(&self, other: &Caps) -> Caps {
        Caps { positive: self.positive.min(other.positive), negative: self.negative.min(other.negative) }
    }

    /// `value` within the caps.
    pub fn apply(&self, value: f64) -> f64 {
        value.clamp(-self.negative, self.positive)
    }
}

fn usable(cap: f64) -> f64 {
    if cap >= 0.0 { cap } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORDS: Words = [0.1, 0.2, 0.3];

    fn word(word: i32) -> Axis {
        Axis { wish: Wish::Word as u32, word, ..Axis::NONE }
    }

    #[test]
    fn words_become_numbers_by_the_table() {
        let value = |w| Opinion::of(&word(w), 1.0, 0.5, &WORDS).map(|o| o.value);
        assert_eq!(value(0), Some(0.0));
        assert_eq!(value(1), Some(0.1));
        assert_eq!(value(-3), Some(-0.3));
        assert_eq!(value(i32::MIN), Some(-0.3));
    }

    #[test]
    fn what_is_no_number_or_has_no_weight_is_no_opinion() {
        assert_eq!(Opinion::of(&Axis::exact(f64::NAN), 1.0, 0.5, &WORDS), None);
        assert_eq!(Opinion::of(&Axis::exact(f64::INFINITY), 1.0, 0.5, &WORDS), None);
        assert_eq!(Opinion::of(&Axis::exact(1.0), 0.0, 0.5, &WORDS), None);
        assert_eq!(Opinion::of(&Axis::exact(1.0), 1.0, f64::NAN, &WORDS), None);
        assert_eq!(Opinion::of(&Axis::NONE, 1.0, 0.5, &WORDS), None);
    }

    #[test]
    fn a_cap_that_is_no_number_forbids_all() {
        let mut caps = Caps::new(f64::INFINITY, f64::INFINITY);
        caps.tighten(&Axis { cap_positive: f64::NAN, cap_negative: 0.2, ..Axis::NONE });
        assert_eq!(caps.apply(1.0), 0.0);
        assert_eq!(caps.apply(-1.0), -0.2);
    }
}
