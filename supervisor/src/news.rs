//! A report that owns what it tells, to be sent to another thread or another process.

use serde::{Deserialize, Serialize};

use crate::incidents::Record;
use crate::observer::Report;
use crate::state::RobotState;

/// One thing that the supervisor told: see [`Report`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum News {
    /// A line for people.
    Note(String),
    /// A process runs.
    Started {
        /// Its name in the plan: a node's path, or the word of a group of nodes.
        instance: String,
        /// The process.
        pid: i32,
        /// How many came before.
        restarts: u32,
    },
    /// A process says that it is ready.
    Ready {
        /// Its name in the plan.
        instance: String,
    },
    /// Something went wrong, or right again.
    Incident(Box<Record>),
    /// The robot's state has changed.
    Robot(RobotState),
}

impl News {
    /// The report as data of its own.
    pub fn of(report: Report<'_>) -> News {
        match report {
            Report::Note(text) => News::Note(text.to_owned()),
            Report::Started { instance, pid, restarts } => {
                News::Started { instance: instance.to_owned(), pid, restarts }
            }
            Report::Ready { instance } => News::Ready { instance: instance.to_owned() },
            Report::Incident(record) => News::Incident(Box::new(record.clone())),
            Report::Robot(state) => News::Robot(state),
        }
    }

    /// The same as a report again.
    pub fn report(&self) -> Report<'_> {
        match self {
            News::Note(text) => Report::Note(text),
            News::Started { instance, pid, restarts } => Report::Started { instance, pid: *pid, restarts: *restarts },
            News::Ready { instance } => Report::Ready { instance },
            News::Incident(record) => Report::Incident(record),
            News::Robot(state) => Report::Robot(*state),
        }
    }
}
