//! What a run tells while it lasts, and at its end.

use serde::{Deserialize, Serialize};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use crate::exit::signal_name;
use crate::incidents::Record;
use crate::state::RobotState;

/// Is told what happens. Called by the supervising thread between a death and the next look: be quick, never block. A
/// panic ends the run in order, and goes on after it.
pub trait Observer {
    /// Something has happened.
    fn report(&mut self, report: Report<'_>);
}

impl<F: FnMut(Report<'_>)> Observer for F {
    fn report(&mut self, report: Report<'_>) {
        self(report);
    }
}

/// An observer that may panic (a terminal that is gone, a pipe that nobody reads) without taking the robot with it: it
/// is told nothing more, and the panic goes on when the robot has stopped in order.
pub(crate) struct Guarded<'a> {
    observer: &'a mut dyn Observer,
    panic: Option<Box<dyn Any + Send>>,
}

impl<'a> Guarded<'a> {
    pub fn new(observer: &'a mut dyn Observer) -> Self {
        Guarded { observer, panic: None }
    }

    pub fn report(&mut self, report: Report<'_>) {
        if self.panic.is_none() {
            // It is never used again after a panic, so nobody sees what that left half done.
            self.panic = catch_unwind(AssertUnwindSafe(|| self.observer.report(report))).err();
        }
    }

    pub fn has_panicked(&self) -> bool {
        self.panic.is_some()
    }

    /// Lets the panic go on, if there was one.
    pub fn resume(self) {
        if let Some(panic) = self.panic {
            resume_unwind(panic);
        }
    }
}

/// One thing to tell.
#[derive(Debug, Clone, Copy)]
pub enum Report<'a> {
    /// A line for people.
    Note(&'a str),
    /// A process runs.
    Started {
        /// Node.
        instance: &'a str,
        /// Its process.
        pid: i32,
        /// How many processes of the node came before.
        restarts: u32,
    },
    /// The node says that it is ready.
    Ready {
        /// Node.
        instance: &'a str,
    },
    /// Something went wrong, or right again.
    Incident(&'a Record),
    /// The robot's state has changed.
    Robot(RobotState),
}

/// What ended a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum StopCause {
    /// A signal, by number.
    Signal(i32),
    /// `sinew down`.
    Down,
    /// The program around it, by a `StopHandle`.
    Program,
    /// All nodes had ended or been given up.
    NothingLeft,
}

impl std::fmt::Display for StopCause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            StopCause::Signal(signal) => f.write_str(&signal_name(signal)),
            StopCause::Down => f.write_str("sinew down"),
            StopCause::Program => f.write_str("the program's wish"),
            StopCause::NothingLeft => f.write_str("no node was left"),
        }
    }
}

/// How a run ended: no process and no file of it is left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// What ended it.
    pub stopped_by: StopCause,
    /// How long it lasted, s.
    pub ran_s: f64,
    /// Nodes that were given up, or had failed and were not to be restarted.
    pub lost: Vec<String>,
    /// Restarts of all nodes.
    pub restarts: u32,
    /// The last 1024 incidents, oldest first.
    pub incidents: Vec<Record>,
}
