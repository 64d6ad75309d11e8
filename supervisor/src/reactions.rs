//! Reactions of the robot file under way: which act of which list each one stands at, and what it waits for.

use runtime::Time;

use crate::care::{Act, Condition, Reaction};

/// One reaction under way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Course {
    reaction: usize,
    node: usize,
    in_fallback: bool,
    next: usize,
    waits: Option<Waits>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Waits {
    Until(Time),
    For { ticket: u32, until: Option<Time> },
}

/// An act that is due now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Due {
    /// The reaction.
    pub reaction: usize,
    /// The node whose condition set it off.
    pub node: usize,
    /// Number of the act in its list.
    pub index: usize,
    /// What is to be done.
    pub act: Act,
    /// For `Execute` and `Await`: the outcome bears it.
    pub ticket: u32,
}

/// An act that failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Failed {
    pub reaction: usize,
    pub node: usize,
    pub index: usize,
}

/// How long a path that never comes is waited for beyond what the host was told, s: a host that dies answers nothing.
const ANSWER_S: f64 = 1.0;
/// No command may take longer, s.
const COMMAND_S: f64 = 60.0;

/// All reactions, and those under way.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reactions {
    all: Vec<Reaction>,
    spent: Vec<bool>,
    courses: Vec<Course>,
    tickets: u32,
}

impl Reactions {
    pub fn new(all: Vec<Reaction>) -> Reactions {
        Reactions { spent: vec![false; all.len()], all, courses: Vec::new(), tickets: 0 }
    }

    pub fn get(&self, reaction: usize) -> &Reaction {
        &self.all[reaction]
    }

    /// Something happened to `node`: what follows begins, unless it is under way for this node already.
    pub fn happened(&mut self, node: usize, condition: Condition) {
        for (reaction, rule) in self.all.iter().enumerate() {
            let under_way = self.courses.iter().any(|course| course.reaction == reaction && course.node == node);
            if rule.follows(node, condition) && !under_way && !self.spent[reaction] {
                self.spent[reaction] = !rule.again;
                self.courses.push(Course { reaction, node, in_fallback: false, next: 0, waits: None });
            }
        }
    }

    /// The next act that is due.
    pub fn take_due(&mut self, now: Time) -> Option<Due> {
        loop {
            let position = self.courses.iter().position(|course| match course.waits {
                None => true,
                Some(Waits::Until(until)) => until <= now,
                Some(Waits::For { .. }) => false,
            })?;
            let course = &mut self.courses[position];
            course.waits = None;
            let rule = &self.all[course.reaction];
            let list = if course.in_fallback { &rule.fallback } else { &rule.acts };
            let Some(&act) = list.get(course.next) else {
                self.courses.remove(position);
                continue;
            };
            let due =
                Due { reaction: course.reaction, node: course.node, index: course.next, act, ticket: self.tickets };
            course.next += 1;
            match act {
                Act::Wait(seconds) => {
                    course.waits = Some(Waits::Until(now.after_s(seconds).max(now.after_ns(1))));
                    continue;
                }
                Act::Execute { .. } | Act::Await { .. } => {
                    let within_s = if let Act::Await { within_s, .. } = act { within_s } else { COMMAND_S };
                    let until = Some(now.after_s(within_s + ANSWER_S));
                    course.waits = Some(Waits::For { ticket: self.tickets, until });
                    self.tickets = self.tickets.wrapping_add(1);
                }
                _ => {}
            }
            return Some(due);
        }
    }

    /// How an act ended; a failed one is told, and its fallback begins.
    pub fn outcome(&mut self, ticket: u32, success: bool) -> Option<Failed> {
        let waits = |course: &Course| matches!(course.waits, Some(Waits::For { ticket: of, .. }) if of == ticket);
        let position = self.courses.iter().position(waits)?;
        self.courses[position].waits = None;
        if success { None } else { Some(self.fail(position)) }
    }

    /// The next act whose answer is overdue: it counts as failed.
    pub fn take_overdue(&mut self, now: Time) -> Option<Failed> {
        let overdue = |course: &Course| matches!(course.waits, Some(Waits::For { until: Some(at), .. }) if at <= now);
        let position = self.courses.iter().position(overdue)?;
        self.courses[position].waits = None;
        Some(self.fail(position))
    }

    fn fail(&mut self, position: usize) -> Failed {
        let course = &mut self.courses[position];
        let failed = Failed { reaction: course.reaction, node: course.node, index: course.next.saturating_sub(1) };
        if course.in_fallback {
            self.courses.remove(position);
        } else {
            (course.in_fallback, course.next) = (true, 0);
        }
        failed
    }

    /// When to look again.
    pub fn timer(&self) -> Option<Time> {
        let at = |course: &Course| match course.waits {
            Some(Waits::Until(at)) | Some(Waits::For { until: Some(at), .. }) => Some(at),
            _ => None,
        };
        self.courses.iter().filter_map(at).min()
    }
}
