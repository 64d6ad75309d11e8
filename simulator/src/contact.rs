//! Contacts: who is to blame, and when two touches are two contacts.
//!
//! At the instant of contact let n be the normal from the body to the thing, u the speed of the body's touching point
//! along n (positive: the body closes in), w the thing's speed against n (positive: the thing closes in).
//!
//! | cause | when |
//! |---|---|
//! | suffered | w > u: the thing closed in faster than the body, a standing body among them |
//! | reversed blind | otherwise, when the body was moving backwards and the point lies behind its axle |
//! | drove | otherwise: ahead in forward motion, a corner or the tail swung into something, and so on |
//!
//! A standing thing has w = 0 and is never to blame. Between two bodies each side is judged by itself.
//!
//! One contact lasts until the gap to the thing has been wider than [`BROKEN_GAP_M`], or nothing has touched for
//! [`BROKEN_FOR_S`]; a new touch after that is a new contact. All that stands still counts as one thing.

use crate::geometry::Point;
use messages::ContactCause;
use runtime::Time;

/// A gap so wide ends a contact [m].
pub const BROKEN_GAP_M: f64 = 0.02;
/// A time so long without touch ends a contact [s].
pub const BROKEN_FOR_S: f64 = 0.5;

/// How two things met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Meeting {
    /// From the body to the thing; unit vector.
    pub normal: Point,
    /// Velocity of the body's touching point [m/s].
    pub body_velocity: Point,
    /// Velocity of the thing [m/s].
    pub thing_velocity: Point,
    /// Forward speed of the body [m/s].
    pub forward_m_s: f64,
    /// Where the touching point lies ahead of the axle [m].
    pub ahead_m: f64,
}

impl Meeting {
    /// Speed at which the gap closed [m/s].
    pub fn closing_m_s(&self) -> f64 {
        (self.body_velocity - self.thing_velocity).dot(self.normal)
    }

    /// Who is to blame; see the module's text.
    pub fn cause(&self) -> ContactCause {
        let body_m_s = self.body_velocity.dot(self.normal);
        let thing_m_s = -self.thing_velocity.dot(self.normal);
        if thing_m_s > body_m_s {
            ContactCause::Suffered
        } else if self.forward_m_s < 0.0 && self.ahead_m < 0.0 {
            ContactCause::ReversedBlind
        } else {
            ContactCause::Drove
        }
    }

    /// The same meeting as the other body sees it; `ahead_m` and `forward_m_s` are the other's.
    pub fn seen_by_other(&self, forward_m_s: f64, ahead_m: f64) -> Meeting {
        Meeting {
            normal: -self.normal,
            body_velocity: self.thing_velocity,
            thing_velocity: self.body_velocity,
            forward_m_s,
            ahead_m,
        }
    }
}

/// Remembers whether a body and one thing are in contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Latch {
    last_touch: Option<Time>,
}

impl Latch {
    /// Takes note of a touch; answers whether it begins a new contact.
    pub fn touch(&mut self, now: Time) -> bool {
        self.last_touch.replace(now).is_none()
    }

    pub fn is_closed(&self) -> bool {
        self.last_touch.is_some()
    }

    /// Takes note of the gap to the thing while they do not touch.
    pub fn observe_gap(&mut self, now: Time, gap_m: f64) {
        if self.last_touch.is_some_and(|touch| gap_m > BROKEN_GAP_M || now.since(touch) > BROKEN_FOR_S) {
            self.last_touch = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AHEAD: Point = Point::new(1.0, 0.0);

    fn meeting(body_m_s: f64, thing_m_s: f64) -> Meeting {
        Meeting {
            normal: AHEAD,
            body_velocity: AHEAD * body_m_s,
            thing_velocity: AHEAD * thing_m_s,
            forward_m_s: body_m_s,
            ahead_m: 0.2,
        }
    }

    #[test]
    fn a_robot_that_runs_into_something_drove() {
        assert_eq!(meeting(0.3, 0.0).cause(), ContactCause::Drove);
        assert_eq!(meeting(0.3, 0.1).cause(), ContactCause::Drove, "into somebody who walks away");
        assert_eq!(meeting(0.3, -0.2).cause(), ContactCause::Drove, "the robot closed in faster");
        assert_eq!(meeting(0.3, -0.2).closing_m_s(), 0.5);
    }

    #[test]
    fn what_closes_in_faster_than_the_robot_is_to_blame() {
        assert_eq!(meeting(0.0, -0.8).cause(), ContactCause::Suffered);
        assert_eq!(meeting(0.3, -0.8).cause(), ContactCause::Suffered);
        assert_eq!(meeting(-0.1, -0.8).cause(), ContactCause::Suffered, "it caught up from ahead while backing off");
    }

    #[test]
    fn backing_into_something_behind_the_axle_is_reversing_blind() {
        let behind = Meeting {
            normal: -AHEAD,
            body_velocity: -AHEAD * 0.2,
            thing_velocity: Point::ZERO,
            forward_m_s: -0.2,
            ahead_m: -0.3,
        };
        assert_eq!(behind.cause(), ContactCause::ReversedBlind);
        let front_corner = Meeting { ahead_m: 0.2, ..behind };
        assert_eq!(front_corner.cause(), ContactCause::Drove, "a front corner swung into it is seen");
        let tail = Meeting { forward_m_s: 0.0, ..behind };
        assert_eq!(tail.cause(), ContactCause::Drove, "the tail swung into it while turning in place");
        let walker = Meeting { thing_velocity: AHEAD * 0.5, ..behind };
        assert_eq!(walker.cause(), ContactCause::Suffered, "somebody ran into it from behind");
    }

    #[test]
    fn a_contact_counts_once_until_a_gap_or_a_pause_has_broken_it() {
        let at = Time::from_seconds;
        let mut latch = Latch::default();
        assert!(latch.touch(at(1.0)));
        assert!(!latch.touch(at(1.1)));
        latch.observe_gap(at(1.2), 0.01);
        assert!(!latch.touch(at(1.3)), "a small gap for a moment breaks nothing");
        latch.observe_gap(at(1.4), 0.03);
        assert!(latch.touch(at(1.5)), "a wide gap breaks it");
        latch.observe_gap(at(2.1), 0.001);
        assert!(!latch.is_closed() && latch.touch(at(2.2)), "half a second without touch breaks it");
    }
}
