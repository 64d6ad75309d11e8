//! What the supervisor tells while a robot runs, to be sent from its thread to the one that shows it.

use supervisor::{Record, Report, RobotState};

/// One thing that the supervisor told.
#[derive(Debug, Clone, PartialEq)]
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
    /// The same as data of its own.
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

    /// What a person wants to hear of it; `None` for what goes without saying.
    pub fn sentence(&self) -> Option<String> {
        match self {
            News::Note(text) => Some(text.clone()),
            News::Incident(record) if record.node.is_empty() => Some(record.message.clone()),
            News::Incident(record) => Some(format!("{}: {}", short(&record.node), record.message)),
            News::Started { .. } | News::Ready { .. } | News::Robot(_) => None,
        }
    }
}

/// `base` of `/drivers/base`: what fits into a narrow column.
pub fn short(instance: &str) -> &str {
    instance.rsplit('/').next().unwrap_or(instance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_death_is_told_and_a_start_goes_without_saying() {
        let record = Record { node: "/drivers/base".into(), message: "killed by SIGKILL".into(), ..Record::default() };
        let incident = News::of(Report::Incident(&record));
        assert_eq!(incident.sentence().as_deref(), Some("base: killed by SIGKILL"));
        assert_eq!(News::of(Report::Started { instance: "a", pid: 1, restarts: 0 }).sentence(), None);
    }
}
