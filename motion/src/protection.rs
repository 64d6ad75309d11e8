//! Protective stops: what touches or blocks the body bars the direction it came from.
//!
//! A bumper bars motion towards its side, and turning, which would scrape; a stalled wheel bars the direction that the
//! body was told to move in. The way out stays open, slowly. A bar ends by itself once its cause has been gone for a
//! while, or, where the robot file says so, only after the wanted velocity has been zero too.

use crate::footprint::Velocity;
use messages::{BaseState, Stop};
use runtime::Time;

/// When a protective stop ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Release {
    /// The cause must have been gone for this long [s].
    pub after_s: f64,
    /// Whether that is enough; otherwise somebody must also have wanted to stand still.
    pub by_itself: bool,
}

/// One barred direction.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bar {
    cause: Stop,
    seen: Time,
    let_go: bool,
}

/// Directions that are barred now.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Protection {
    forward: Option<Bar>,
    backward: Option<Bar>,
    left: Option<Bar>,
    right: Option<Bar>,
}

impl Protection {
    /// Takes in the base's state; `sent` is the velocity last sent to it, `wanted` what the coordinator wants now.
    pub fn update(&mut self, now: Time, base: &BaseState, sent: Velocity, wanted: Velocity, release: Release) {
        let stall = base.stall_left != 0 || base.stall_right != 0;
        let bumped = base.front_bumpers != 0 || base.rear_bumpers != 0;
        // A wheel that stalled goes on doing so while nothing is sent to it.
        let cause = |bumper: bool, moving: bool, already: Option<Bar>| {
            let stalls = stall && (moving || already.is_some_and(|bar| bar.cause == Stop::Stall));
            if bumper { Some(Stop::Bumper) } else { stalls.then_some(Stop::Stall) }
        };
        let (v, w) = (sent.forward_m_s, sent.turn_rad_s);
        let on_the_spot = v == 0.0;
        let resting = wanted == Velocity::ZERO;
        for (bar, bumper, moving) in [
            (&mut self.forward, base.front_bumpers != 0, v > 0.0),
            (&mut self.backward, base.rear_bumpers != 0, v < 0.0),
            (&mut self.left, bumped, on_the_spot && w > 0.0),
            (&mut self.right, bumped, on_the_spot && w < 0.0),
        ] {
            if let Some(cause) = cause(bumper, moving, *bar) {
                *bar = Some(Bar { cause, seen: now, let_go: false });
            } else if let Some(old) = bar {
                old.let_go |= resting;
                if now.since(old.seen) >= release.after_s && (release.by_itself || old.let_go) {
                    *bar = None;
                }
            }
        }
    }

    /// `wanted` without what is barred and no faster than `slow_m_s` on the way out, and why it was changed.
    pub fn hold(&self, wanted: Velocity, slow_m_s: f64) -> (Velocity, Option<Stop>) {
        let any = self.forward.or(self.backward).or(self.left).or(self.right);
        let Some(any) = any else { return (wanted, None) };
        let mut held = wanted;
        let mut why = None;
        let mut bar = |axis: &mut f64, barred: Option<Bar>| {
            if let Some(bar) = barred {
                *axis = 0.0;
                why = Some(bar.cause);
            }
        };
        if held.forward_m_s > 0.0 {
            bar(&mut held.forward_m_s, self.forward);
        } else if held.forward_m_s < 0.0 {
            bar(&mut held.forward_m_s, self.backward);
        }
        if held.turn_rad_s > 0.0 {
            bar(&mut held.turn_rad_s, self.left);
        } else if held.turn_rad_s < 0.0 {
            bar(&mut held.turn_rad_s, self.right);
        }
        if held.forward_m_s.abs() > slow_m_s {
            held.forward_m_s = slow_m_s * held.forward_m_s.signum();
            why = why.or(Some(any.cause));
        }
        (held, why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RELEASE: Release = Release { after_s: 0.5, by_itself: true };
    const FAST: Velocity = Velocity::new(0.3, 0.4);

    fn bumped() -> BaseState {
        BaseState { front_bumpers: 1, ..BaseState::default() }
    }

    fn second(s: f64) -> Time {
        Time::from_seconds(s)
    }

    #[test]
    fn a_front_bumper_bars_forward_and_turning_and_lets_the_body_back_out_slowly() {
        let mut protection = Protection::default();
        protection.update(second(1.0), &bumped(), FAST, FAST, RELEASE);
        assert_eq!(protection.hold(FAST, 0.05), (Velocity::ZERO, Some(Stop::Bumper)));
        assert_eq!(protection.hold(Velocity::new(-0.2, 0.0), 0.05).0, Velocity::new(-0.05, 0.0));
    }

    #[test]
    fn a_protective_stop_ends_by_itself_when_its_cause_has_been_gone_for_a_while() {
        let mut protection = Protection::default();
        protection.update(second(1.0), &bumped(), FAST, FAST, RELEASE);
        protection.update(second(1.4), &BaseState::default(), FAST, FAST, RELEASE);
        assert_eq!(protection.hold(FAST, 0.05).0, Velocity::ZERO);
        protection.update(second(1.6), &BaseState::default(), FAST, FAST, RELEASE);
        assert_eq!(protection.hold(FAST, 0.05), (FAST, None));
    }

    #[test]
    fn where_the_robot_file_says_so_it_waits_until_nobody_pushes_on() {
        let mut protection = Protection::default();
        let release = Release { by_itself: false, ..RELEASE };
        protection.update(second(1.0), &bumped(), FAST, FAST, release);
        protection.update(second(9.0), &BaseState::default(), FAST, FAST, release);
        assert_eq!(protection.hold(FAST, 0.05).0, Velocity::ZERO);
        protection.update(second(9.1), &BaseState::default(), FAST, Velocity::ZERO, release);
        assert_eq!(protection.hold(FAST, 0.05), (FAST, None));
    }

    #[test]
    fn a_stall_bars_the_direction_of_motion_and_no_other() {
        let stalled = BaseState { stall_left: 1, ..BaseState::default() };
        let mut protection = Protection::default();
        protection.update(second(1.0), &stalled, Velocity::new(-0.1, 0.0), Velocity::ZERO, RELEASE);
        assert_eq!(protection.hold(Velocity::new(-0.1, 0.2), 0.3).0, Velocity::new(0.0, 0.2));
        assert_eq!(protection.hold(FAST, 0.3), (FAST, None));
        // The wheel still stalls while nothing is sent: the bar stays.
        protection.update(second(3.0), &stalled, Velocity::ZERO, Velocity::ZERO, RELEASE);
        assert_eq!(protection.hold(Velocity::new(-0.1, 0.0), 0.3).0, Velocity::ZERO);
    }
}
