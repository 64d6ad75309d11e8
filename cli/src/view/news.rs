//! What the supervisor tells while a robot runs, in words.

pub use supervisor::News;

/// What a person wants to hear of it; `None` for what goes without saying.
pub fn sentence(news: &News) -> Option<String> {
    match news {
        News::Note(text) => Some(text.clone()),
        News::Incident(record) if record.node.is_empty() => Some(record.message.clone()),
        News::Incident(record) => {
            let told = format!("{}: {}", short(&record.node), record.message);
            // Its own word for what happened, such as a full disk.
            let error = record.last_lines.iter().rfind(|line| line.starts_with("error:"));
            Some(error.map_or_else(|| told.clone(), |error| format!("{told}; {error}")))
        }
        News::Started { .. } | News::Ready { .. } | News::Robot(_) => None,
    }
}

/// `base` of `/drivers/base`: what fits into a narrow column.
pub fn short(instance: &str) -> &str {
    instance.rsplit('/').next().unwrap_or(instance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use supervisor::{Record, Report};

    #[test]
    fn a_death_is_told_and_a_start_goes_without_saying() {
        let record = Record { node: "/drivers/base".into(), message: "killed by SIGKILL".into(), ..Record::default() };
        let incident = News::of(Report::Incident(&record));
        assert_eq!(sentence(&incident).as_deref(), Some("base: killed by SIGKILL"));
        let last_lines = vec!["error: the disk is full".into(), "note: good bye".into()];
        let record = Record { node: "recorder".into(), message: "exited with code 1".into(), last_lines, ..record };
        let incident = News::of(Report::Incident(&record));
        assert_eq!(sentence(&incident).as_deref(), Some("recorder: exited with code 1; error: the disk is full"));
        assert_eq!(sentence(&News::of(Report::Started { instance: "a", pid: 1, restarts: 0 })), None);
    }
}
