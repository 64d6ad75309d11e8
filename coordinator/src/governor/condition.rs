//! Conditions: comparisons of signals with numbers, all of which must hold.
//!
//! ```text
//! condition  = "always" | comparison { "and" comparison }
//! comparison = signal ( "<" | "<=" | ">" | ">=" ) number
//! ```
//!
//! A comparison with a signal that is not known does not hold: nobody decides on what nobody knows. Every condition is
//! a box, an interval for each signal, so that it can be said beforehand which can never hold, and which can never be
//! reached behind another.

use super::signal::{SIGNALS, Signal, Signals};

/// What must hold.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    text: String,
    comparisons: Vec<Comparison>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Comparison {
    signal: Signal,
    order: Order,
    bound: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    Less,
    AtMost,
    Greater,
    AtLeast,
}

impl Order {
    fn holds(self, value: f64, bound: f64) -> bool {
        match self {
            Order::Less => value < bound,
            Order::AtMost => value <= bound,
            Order::Greater => value > bound,
            Order::AtLeast => value >= bound,
        }
    }
}

/// The values of one signal for which a condition holds: from, to, and whether the ends themselves count.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Interval {
    from: f64,
    from_open: bool,
    to: f64,
    to_open: bool,
    /// No comparison speaks of the signal: it may as well be unknown.
    free: bool,
}

impl Interval {
    fn is_empty(&self) -> bool {
        self.from > self.to || (self.from == self.to && (self.from_open || self.to_open))
    }

    fn holds_all_of(&self, other: &Interval) -> bool {
        let from = self.from < other.from || (self.from == other.from && (!self.from_open || other.from_open));
        let to = self.to > other.to || (self.to == other.to && (!self.to_open || other.to_open));
        self.free || (!other.free && from && to)
    }

    fn narrow(&mut self, order: Order, bound: f64) {
        self.free = false;
        let open = matches!(order, Order::Less | Order::Greater);
        match order {
            Order::Less | Order::AtMost if bound < self.to || (bound == self.to && open) => {
                (self.to, self.to_open) = (bound, open);
            }
            Order::Greater | Order::AtLeast if bound > self.from || (bound == self.from && open) => {
                (self.from, self.from_open) = (bound, open);
            }
            _ => {}
        }
    }
}

impl Condition {
    /// Reads a condition; else says where it goes wrong and what would do.
    pub fn parse(text: &str) -> Result<Condition, String> {
        let mut comparisons = Vec::new();
        if text.trim() != "always" {
            for part in text.split(" and ") {
                comparisons.push(comparison(part.trim()).map_err(|why| format!("\"{text}\": {why}"))?);
            }
        }
        let condition = Condition { text: text.trim().to_owned(), comparisons };
        match condition.empty() {
            Some(signal) => {
                let (from, to) = signal.range();
                let name = signal.name();
                Err(format!("\"{text}\" can never hold: no {name} is like that ({name} is {from} to {to})"))
            }
            None => Ok(condition),
        }
    }

    /// As it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether it holds.
    pub fn holds(&self, signals: &Signals) -> bool {
        self.comparisons.iter().all(|one| one.order.holds(signals[one.signal], one.bound))
    }

    /// The signals that it speaks of.
    pub fn signals(&self) -> impl Iterator<Item = Signal> + '_ {
        self.comparisons.iter().map(|one| one.signal)
    }

    /// Whether it holds whenever `other` does.
    pub fn covers(&self, other: &Condition) -> bool {
        self.region().iter().zip(&other.region()).all(|(all, part)| all.holds_all_of(part))
    }

    fn empty(&self) -> Option<Signal> {
        self.region().iter().zip(Signal::all()).find(|(interval, _)| interval.is_empty()).map(|(_, signal)| signal)
    }

    fn region(&self) -> [Interval; SIGNALS] {
        let mut signals = Signal::all();
        let mut region = std::array::from_fn(|_| {
            let (from, to) = signals.next().map_or((0.0, 0.0), Signal::range);
            Interval { from, from_open: false, to, to_open: false, free: true }
        });
        for one in &self.comparisons {
            region[one.signal as usize].narrow(one.order, one.bound);
        }
        region
    }
}

fn comparison(text: &str) -> Result<Comparison, String> {
    let form = "write SIGNAL < NUMBER (or <=, >, >=), joined by \"and\", or \"always\"";
    let at = text.find(['<', '>']).ok_or_else(|| format!("\"{text}\" compares nothing: {form}"))?;
    let (name, rest) = (text[..at].trim(), &text[at..]);
    let (order, number) = match rest.as_bytes() {
        [b'<', b'=', ..] => (Order::AtMost, &rest[2..]),
        [b'>', b'=', ..] => (Order::AtLeast, &rest[2..]),
        [b'<', ..] => (Order::Less, &rest[1..]),
        _ => (Order::Greater, &rest[1..]),
    };
    let signal = Signal::named(name).ok_or_else(|| {
        let names: Vec<&str> = Signal::all().map(Signal::name).collect();
        format!("there is no signal \"{name}\"; signals are {}", names.join(", "))
    })?;
    let bound: f64 = number.trim().parse().map_err(|_| format!("\"{}\" is no number: {form}", number.trim()))?;
    if !bound.is_finite() {
        return Err(format!("\"{}\" is no bound: {form}", number.trim()));
    }
    Ok(Comparison { signal, order, bound })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Condition {
        Condition::parse(text).unwrap()
    }

    fn signals(danger: f64, battery_v: f64) -> Signals {
        let mut signals = Signals::default();
        (signals[Signal::Danger], signals[Signal::BatteryV]) = (danger, battery_v);
        signals
    }

    #[test]
    fn all_comparisons_must_hold() {
        let condition = read("danger > 0.6 and battery_v <= 11.5");
        assert!(condition.holds(&signals(0.7, 11.5)));
        assert!(!condition.holds(&signals(0.6, 11.0)));
        assert!(!condition.holds(&signals(0.7, 12.0)));
        assert!(read("always").holds(&Signals::default()));
    }

    #[test]
    fn nothing_holds_of_what_is_not_known() {
        for text in ["danger > 0.1", "danger <= 1", "battery_v < 100"] {
            assert!(!read(text).holds(&Signals::default()), "{text}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_told_with_what_would_do() {
        for (text, why) in [
            ("dagner > 0.6", "no signal \"dagner\"; signals are danger, clear_m"),
            ("danger", "compares nothing"),
            ("danger > much", "\"much\" is no number"),
            ("danger > inf", "is no bound"),
            ("danger > 0.6 and", "is no number"),
            ("", "compares nothing"),
            ("danger > 0.6 or limp > 0", "is no number"),
        ] {
            let said = Condition::parse(text).unwrap_err();
            assert!(said.contains(why), "{text}: {said}");
        }
    }

    #[test]
    fn what_can_never_hold_is_refused() {
        for text in ["danger > 1", "danger > 0.6 and danger < 0.6", "battery_v < 0", "clear_m > 2 and clear_m <= 1.9"] {
            assert!(Condition::parse(text).unwrap_err().contains("can never hold"), "{text}");
        }
        read("danger >= 1");
        read("danger >= 0.6 and danger <= 0.6");
    }

    #[test]
    fn a_wider_condition_covers_a_narrower_one() {
        assert!(read("danger > 0.5").covers(&read("danger > 0.5 and limp > 0")));
        assert!(read("danger >= 0.5").covers(&read("danger > 0.5")));
        assert!(!read("danger > 0.5").covers(&read("danger >= 0.5")));
        assert!(read("always").covers(&read("limp >= 1")));
        // The range itself, but a danger that is not known is another thing.
        assert!(!read("danger >= 0").covers(&read("always")));
    }

    proptest! {
        #[test]
        fn where_one_covers_the_other_it_holds_with_it(
            bounds in prop::array::uniform4(0..8u8), orders in prop::array::uniform4(0..4usize), value in 0.0..1.0f64,
        ) {
            let order = |k: usize| ["<", "<=", ">", ">="][orders[k]];
            let text = |a: usize, b: usize| {
                let bound = |k: usize| f64::from(bounds[k]) / 8.0;
                format!("danger {} {} and danger {} {}", order(a), bound(a), order(b), bound(b))
            };
            if let (Ok(one), Ok(other)) = (Condition::parse(&text(0, 1)), Condition::parse(&text(2, 3))) {
                let grid = [value, f64::from(bounds[0]) / 8.0, f64::from(bounds[2]) / 8.0];
                for danger in grid {
                    let at = signals(danger, f64::NAN);
                    prop_assert!(!one.covers(&other) || !other.holds(&at) || one.holds(&at));
                }
            }
        }
    }
}
