//! Which keys are held, and until when that may be believed.
//!
//! Terminals mostly tell of presses and repeats only: there a key counts as held for [`DEAD_MAN_S`] after its last
//! repeat. Terminals with the kitty keyboard protocol tell of releases; there a key is held until its release, or until
//! the terminal itself has given no sign of life for as long: a broken connection tells of no release.

use runtime::Time;

/// Without a sign of the person for this long the robot stops [s].
pub const DEAD_MAN_S: f64 = 0.4;

/// How the terminal tells that a key is no longer held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// It reports the release.
    Releases,
    /// Its repeats end.
    Repeats,
}

/// What a key wants: parts of the greatest speeds, −1…1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push {
    /// Ahead.
    pub forward: f64,
    /// Counter-clockwise.
    pub turn: f64,
}

/// A wish, and until when it counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// The sum of the held keys, −1…1 on each axis.
    pub push: Push,
    /// Afterwards it counts as no wish.
    pub until: Time,
}

/// The held keys.
#[derive(Debug)]
pub struct Hold {
    way: Way,
    keys: Vec<Held>,
    /// When the terminal last gave a sign of life.
    alive: Time,
}

#[derive(Debug)]
struct Held {
    key: char,
    push: Push,
    last: Time,
}

impl Hold {
    /// No key is held.
    pub fn new(way: Way) -> Hold {
        Hold { way, keys: Vec::new(), alive: Time::ZERO }
    }

    /// How the terminal tells of releases.
    pub fn way(&self) -> Way {
        self.way
    }

    /// The key was pressed, or repeats.
    pub fn press(&mut self, key: char, push: Push, now: Time) {
        self.sign_of_life(now);
        match self.keys.iter_mut().find(|held| held.key == key) {
            Some(held) => held.last = now,
            None => self.keys.push(Held { key, push, last: now }),
        }
    }

    /// The key was released.
    pub fn release(&mut self, key: char, now: Time) {
        self.sign_of_life(now);
        self.keys.retain(|held| held.key != key);
    }

    /// The terminal answered.
    pub fn sign_of_life(&mut self, now: Time) {
        self.alive = now;
    }

    /// All keys count as released: the person looks elsewhere, or said stop.
    pub fn let_go(&mut self) {
        self.keys.clear();
    }

    /// What the held keys want at `now`; `None` when none is held.
    pub fn wanted(&mut self, now: Time) -> Option<Wanted> {
        let (way, alive) = (self.way, self.alive);
        let end = |held: &Held| match way {
            Way::Releases => alive.after_s(DEAD_MAN_S),
            Way::Repeats => held.last.after_s(DEAD_MAN_S),
        };
        // A key that was not believed any more must be pressed anew: the robot never sets off by itself.
        self.keys.retain(|held| end(held) > now);
        let until = self.keys.iter().map(end).min()?;
        let sum = |axis: fn(&Push) -> f64| self.keys.iter().map(|held| axis(&held.push)).sum::<f64>().clamp(-1.0, 1.0);
        Some(Wanted { push: Push { forward: sum(|p| p.forward), turn: sum(|p| p.turn) }, until })
    }
}

/// What the key `key` wants; arrows come as ↑ ↓ ← →.
pub fn push_of(key: char) -> Option<Push> {
    let (forward, turn) = match key.to_ascii_lowercase() {
        '↑' | 'w' | 'i' => (1.0, 0.0),
        '↓' | 's' | ',' => (-1.0, 0.0),
        '←' | 'a' | 'j' => (0.0, 1.0),
        '→' | 'd' | 'l' => (0.0, -1.0),
        'u' => (1.0, 1.0),
        'o' => (1.0, -1.0),
        _ => return None,
    };
    Some(Push { forward, turn })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Time {
        Time::from_seconds(10.0 + seconds)
    }

    fn press(hold: &mut Hold, key: char, seconds: f64) {
        hold.press(key, push_of(key).unwrap(), at(seconds));
    }

    fn forward(hold: &mut Hold, seconds: f64) -> Option<f64> {
        hold.wanted(at(seconds)).map(|wanted| wanted.push.forward)
    }

    #[test]
    fn without_releases_a_key_counts_until_its_repeats_end() {
        let mut hold = Hold::new(Way::Repeats);
        for k in 0..20 {
            press(&mut hold, 'w', 0.04 * f64::from(k));
            assert_eq!(forward(&mut hold, 0.04 * f64::from(k) + 0.02), Some(1.0));
        }
        assert_eq!(forward(&mut hold, 0.76 + 0.39), Some(1.0));
        assert_eq!(forward(&mut hold, 0.76 + 0.4), None);
    }

    #[test]
    fn with_releases_a_key_counts_until_it_is_released() {
        let mut hold = Hold::new(Way::Releases);
        press(&mut hold, '↑', 0.0);
        for k in 1..50 {
            hold.sign_of_life(at(0.1 * f64::from(k)));
            assert_eq!(forward(&mut hold, 0.1 * f64::from(k)), Some(1.0));
        }
        hold.release('↑', at(5.0));
        assert_eq!(forward(&mut hold, 5.0), None);
    }

    #[test]
    fn a_terminal_that_fell_silent_holds_no_key_and_does_not_hold_it_again() {
        let mut hold = Hold::new(Way::Releases);
        press(&mut hold, '↑', 0.0);
        assert_eq!(forward(&mut hold, 0.41), None);
        hold.sign_of_life(at(0.5));
        assert_eq!(forward(&mut hold, 0.5), None);
    }

    #[test]
    fn two_keys_make_an_arc_and_opposite_ones_nothing() {
        let mut hold = Hold::new(Way::Releases);
        press(&mut hold, 'w', 0.0);
        press(&mut hold, 'a', 0.0);
        assert_eq!(hold.wanted(at(0.1)).map(|w| w.push), Some(Push { forward: 1.0, turn: 1.0 }));
        press(&mut hold, 's', 0.1);
        assert_eq!(hold.wanted(at(0.1)).map(|w| w.push), Some(Push { forward: 0.0, turn: 1.0 }));
    }

    #[test]
    fn looking_elsewhere_lets_all_keys_go() {
        let mut hold = Hold::new(Way::Releases);
        press(&mut hold, 'w', 0.0);
        hold.let_go();
        assert_eq!(hold.wanted(at(0.0)), None);
    }

    #[test]
    fn a_wish_ends_before_the_dead_man_does() {
        let mut hold = Hold::new(Way::Repeats);
        press(&mut hold, 'w', 0.0);
        assert_eq!(hold.wanted(at(0.1)).map(|w| w.until), Some(at(DEAD_MAN_S)));
    }
}
