//! Ways out of where small turns do not help, without odometry: only the readings tell whether the robot moves.
//!
//! Begins when the robot is boxed in, when the readings stay as they are although turns are asked for, or when more
//! turns than a full circle needs have not led out. Tries in turn: back while turning to the roomier side,
//! back while turning to the other, on while turning to the roomier, a turn on the spot to the other, straight back. A
//! try that moves nothing gives way to the next at once; one that does lasts longer each time.

use crate::sectors::{Forces, MAX_SECTORS};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of an escape.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EscapeConfig {
    /// Packets with the same readings after which the robot counts as held up.
    pub still_packets: u32,
    /// The same while a way out is being tried.
    pub futile_packets: u32,
    /// A reading has changed when it differs by more than this [m].
    pub changed_m: f64,
    /// Packets with something to turn away from, less those without, after which turning has not helped.
    pub patience_packets: u32,
    /// Packets that the first try lasts; each further one lasts longer by as many.
    pub packets: u32,
    /// Packets that no try is longer than.
    pub most_packets: u32,
    /// Packets after a try in which the robot does not go on while something is straight ahead.
    pub hold_packets: u32,
}

impl Default for EscapeConfig {
    fn default() -> EscapeConfig {
        EscapeConfig {
            still_packets: 20,
            futile_packets: 8,
            changed_m: 0.04,
            patience_packets: 130,
            packets: 12,
            most_packets: 60,
            hold_packets: 40,
        }
    }
}

/// A side to turn to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Counter-clockwise.
    Left,
    /// Clockwise.
    Right,
}

impl Side {
    /// Sign of a turn to this side.
    pub fn sign(self) -> f64 {
        match self {
            Side::Left => 1.0,
            Side::Right => -1.0,
        }
    }

    /// The other one.
    pub fn other(self) -> Side {
        match self {
            Side::Left => Side::Right,
            Side::Right => Side::Left,
        }
    }
}

/// Where a try leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Backwards.
    Back,
    /// Nowhere: it turns on the spot.
    Nowhere,
    /// On, if others want to.
    On,
}

/// One try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WayOut {
    /// Where it leads.
    pub way: Way,
    /// The side to turn to.
    pub side: Option<Side>,
}

/// What is remembered of tries.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Escape {
    /// The try under way, and packets that it still lasts.
    now: Option<(WayOut, u32)>,
    tries: u32,
    /// Packets in which the robot still does not go on.
    hold: u32,
    /// Nearest distance per sector when they last changed, and packets since.
    mark_m: [f64; MAX_SECTORS],
    still: u32,
    /// Packets with something to turn away from, less those without, since the last try.
    turning: u32,
}

impl Escape {
    /// The try under way.
    pub fn way_out(&self) -> Option<WayOut> {
        self.now.map(|(way_out, _)| way_out)
    }

    /// Whether the robot should not go on yet while something is straight ahead, lest it go back into what it just
    /// backed out of.
    pub fn holds(&self) -> bool {
        self.hold > 0
    }

    /// Takes in one packet. `acts`: something is acted upon; `boxed_in`: all round; `side`: the better one to turn to.
    pub fn take_in(&mut self, forces: &Forces, acts: bool, boxed_in: bool, side: Side, config: &EscapeConfig) {
        self.watch(forces, config.changed_m);
        self.hold = self.hold.saturating_sub(1);
        if let Some((way_out, left)) = self.now {
            self.hold = config.hold_packets;
            if self.still >= config.futile_packets {
                self.begin(side, config);
            } else {
                self.now = (left > 1).then_some((way_out, left - 1));
            }
            return;
        }
        if !acts {
            // Nobody asks for a turn: standing still is somebody else's wish.
            self.still = 0;
        }
        self.turning = if acts { self.turning + 1 } else { self.turning.saturating_sub(1) };
        if boxed_in || self.still >= config.still_packets || self.turning > config.patience_packets {
            self.begin(side, config);
        }
    }

    /// Counts packets in which no more than one sector changed: a lost echo is no motion.
    fn watch(&mut self, forces: &Forces, changed_m: f64) {
        let nearest_m = &forces.nearest_m[..forces.count];
        let changed = nearest_m.iter().zip(&self.mark_m).filter(|(is, was)| (*is - *was).abs() > changed_m).count();
        if changed >= 2 {
            self.mark_m[..forces.count].copy_from_slice(nearest_m);
            self.still = 0;
        } else {
            self.still = self.still.saturating_add(1);
        }
    }

    fn begin(&mut self, side: Side, config: &EscapeConfig) {
        let (way, side) = match self.tries % 5 {
            0 => (Way::Back, Some(side)),
            1 => (Way::Back, Some(side.other())),
            2 => (Way::On, Some(side)),
            3 => (Way::Nowhere, Some(side.other())),
            _ => (Way::Back, None),
        };
        let way_out = WayOut { way, side };
        self.tries = self.tries.saturating_add(1);
        let packets = config.packets.saturating_mul(self.tries).min(config.most_packets).max(1);
        self.now = Some((way_out, packets));
        self.still = 0;
        self.turning = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: EscapeConfig = EscapeConfig {
        still_packets: 20,
        futile_packets: 8,
        changed_m: 0.04,
        patience_packets: 130,
        packets: 12,
        most_packets: 60,
        hold_packets: 40,
    };

    fn forces(nearest_m: [f64; 3]) -> Forces {
        let mut forces = Forces {
            force: [0.0; MAX_SECTORS],
            known: [true; MAX_SECTORS],
            age_s: [0.0; MAX_SECTORS],
            nearest_m: [0.0; MAX_SECTORS],
            count: 3,
        };
        forces.nearest_m[..3].copy_from_slice(&nearest_m);
        forces
    }

    /// The tries that come up in `packets` packets, each with its length; readings change as `nearest_m` says.
    fn tries(packets: u32, mut nearest_m: impl FnMut(u32) -> [f64; 3]) -> Vec<(WayOut, u32)> {
        let mut escape = Escape::default();
        let mut all: Vec<(WayOut, u32)> = Vec::new();
        let mut before = 0;
        for k in 0..packets {
            escape.take_in(&forces(nearest_m(k)), true, false, Side::Left, &CONFIG);
            if let Some(way_out) = escape.way_out() {
                if escape.tries > before {
                    before = escape.tries;
                    all.push((way_out, 0));
                }
                if let Some(last) = all.last_mut() {
                    last.1 += 1;
                }
            }
        }
        all
    }

    #[test]
    fn where_nothing_changes_each_try_gives_way_to_the_next() {
        let all = tries(70, |_| [0.3; 3]);
        let kinds: Vec<(Way, Option<Side>)> = all.iter().take(5).map(|(try_, _)| (try_.way, try_.side)).collect();
        assert_eq!(
            kinds,
            [
                (Way::Back, Some(Side::Left)),
                (Way::Back, Some(Side::Right)),
                (Way::On, Some(Side::Left)),
                (Way::Nowhere, Some(Side::Right)),
                (Way::Back, None)
            ]
        );
        assert!(all.iter().take(4).all(|(_, length)| *length <= CONFIG.futile_packets));
    }

    #[test]
    fn tries_that_move_the_robot_grow() {
        let moving = |k: u32| [0.3 + 0.1 * f64::from(k % 2), 0.5 - 0.1 * f64::from(k % 2), 1.0];
        let all = tries(900, moving);
        assert!(all.len() >= 3 && all[0].1 == 12 && all[1].1 == 24 && all[2].1 == 36, "{all:?}");
    }

    #[test]
    fn a_lost_echo_is_no_motion_and_a_turn_is() {
        assert!(!tries(40, |k| [0.3, if k % 3 == 0 { 3.0 } else { 0.4 }, 0.5]).is_empty());
        assert!(tries(40, |k| [0.3 + 0.03 * f64::from(k), 0.4, 3.0 - 0.03 * f64::from(k)]).is_empty());
    }

    #[test]
    fn a_robot_that_has_nothing_to_turn_away_from_may_stand_as_long_as_it_likes() {
        let mut escape = Escape::default();
        for _ in 0..500 {
            escape.take_in(&forces([2.0; 3]), false, false, Side::Left, &CONFIG);
        }
        assert_eq!(escape.way_out(), None);
    }
}
