//! The nodes of a run: what the supervisor says of their processes, and what they say of their own timing.

use super::news::{News, sentence, short};
use super::source::Source;
use messages::NodeStatistics;
use runtime::Time;
use runtime::channel::Tree;
use runtime::robot::Robot;
use supervisor::RobotState;

/// Messages kept for the screen.
const MESSAGES: usize = 50;

/// All nodes, and what was said of them.
pub struct Nodes {
    /// In flow order.
    pub rows: Vec<NodeRow>,
    /// State of the robot.
    pub robot: Option<RobotState>,
    /// What people were told, oldest first.
    pub messages: Vec<String>,
}

/// One node.
pub struct NodeRow {
    /// `/layer/instance`.
    pub path: String,
    /// Its process in the plan.
    program: String,
    /// In one word.
    pub state: State,
    /// How often it was started again.
    pub restarts: u32,
    /// How it last ended, if it did.
    pub last_end: Option<String>,
    /// Steps per second; none before the second report.
    pub rate_hz: Option<f64>,
    /// Release lateness, 99 % [s].
    pub lateness_p99_s: Option<f64>,
    /// Its newest report.
    pub statistics: Option<NodeStatistics>,
    source: Source<NodeStatistics>,
    reported: Option<(Time, u64)>,
}

/// State of a node's process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Not started yet.
    Waiting,
    /// Started, not ready.
    Starting,
    /// Ready.
    Up,
    /// Dead.
    Down,
    /// Dead, and not to be started again.
    Lost,
}

impl State {
    /// In one word.
    pub fn word(self) -> &'static str {
        match self {
            State::Waiting => "waiting",
            State::Starting => "starting",
            State::Up => "up",
            State::Down => "down",
            State::Lost => "lost",
        }
    }
}

impl NodeRow {
    /// The instance alone.
    pub fn name(&self) -> &str {
        short(&self.path)
    }
}

impl Nodes {
    /// The nodes of `robot`, of which nothing is known yet.
    pub fn new(robot: &Robot) -> Nodes {
        let row = |spec: &runtime::robot::NodeSpec| NodeRow {
            path: spec.path(),
            program: spec.process.clone().unwrap_or_else(|| spec.path()),
            state: State::Waiting,
            restarts: 0,
            last_end: None,
            rate_hz: None,
            lateness_p99_s: None,
            statistics: None,
            source: Source::new(&spec.port_path("statistics")),
            reported: None,
        };
        Nodes { rows: robot.nodes.iter().map(row).collect(), robot: None, messages: Vec::new() }
    }

    /// Takes in what the supervisor told.
    pub fn hear(&mut self, news: &[News]) {
        for one in news {
            match one {
                News::Started { instance, restarts, .. } => {
                    for row in self.of(instance) {
                        (row.state, row.restarts) = (State::Starting, *restarts);
                    }
                }
                News::Ready { instance } => self.of(instance).for_each(|row| row.state = State::Up),
                News::Incident(record) => self.incident(&record.node, &record.event, &record.message),
                News::Robot(state) => self.robot = Some(*state),
                News::Note(_) => {}
            }
            self.messages.extend(sentence(one));
        }
        let surplus = self.messages.len().saturating_sub(MESSAGES);
        self.messages.drain(..surplus);
    }

    fn incident(&mut self, node: &str, event: &str, message: &str) {
        let given_up = ["given up", "not to be restarted"].iter().any(|words| message.contains(words));
        for row in self.of(node) {
            match event {
                "died" => {
                    row.state = if given_up { State::Lost } else { State::Down };
                    row.last_end = Some(message.to_owned());
                }
                "recovered" => row.state = State::Up,
                _ => {}
            }
        }
    }

    fn of<'a>(&'a mut self, program: &'a str) -> impl Iterator<Item = &'a mut NodeRow> {
        self.rows.iter_mut().filter(move |row| row.program == program)
    }

    /// Reads what the nodes say of their timing. About once a second.
    pub fn read(&mut self, tree: &Tree, now: Time) {
        for row in &mut self.rows {
            row.source.look(tree);
            let reported = &mut row.reported;
            let (mut rate_hz, mut newest) = (None, None);
            row.source.newest(|stamp, statistics, _| {
                // A node that was started again counts from nothing.
                rate_hz = reported.filter(|(_, steps)| *steps <= statistics.steps).and_then(|(before, steps)| {
                    let span_s = stamp.since(before);
                    (span_s > 0.0).then(|| (statistics.steps - steps) as f64 / span_s)
                });
                *reported = Some((stamp, statistics.steps));
                newest = Some(*statistics);
            });
            if let Some(statistics) = newest {
                row.rate_hz = rate_hz;
                row.lateness_p99_s = (statistics.steps > 0).then_some(statistics.lateness_s[1]);
                row.statistics = Some(statistics);
            }
            if row.reported.is_some_and(|(stamp, _)| now.since(stamp) > 3.0) {
                row.rate_hz = None;
            }
        }
    }

    /// Nodes whose process is ready.
    pub fn up(&self) -> usize {
        self.rows.iter().filter(|row| row.state == State::Up).count()
    }

    /// Restarts of all processes.
    pub fn restarts(&self) -> u32 {
        let mut seen: Vec<&str> = Vec::new();
        let mut sum = 0;
        for row in &self.rows {
            if !seen.contains(&row.program.as_str()) {
                seen.push(&row.program);
                sum += row.restarts;
            }
        }
        sum
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use supervisor::Record;

    /// Nodes of these paths, all up.
    pub fn nodes(paths: &[&str]) -> Nodes {
        let row = |path: &&str| NodeRow {
            path: (*path).into(),
            program: (*path).into(),
            state: State::Up,
            restarts: 0,
            last_end: None,
            rate_hz: Some(10.0),
            lateness_p99_s: Some(120e-6),
            statistics: None,
            source: Source::new(&format!("{path}/statistics")),
            reported: None,
        };
        Nodes { rows: paths.iter().map(row).collect(), robot: Some(RobotState::Running), messages: Vec::new() }
    }

    fn incident(node: &str, event: &str, message: &str) -> News {
        let record = Record { node: node.into(), event: event.into(), message: message.into(), ..Record::default() };
        News::Incident(Box::new(record))
    }

    #[test]
    fn a_node_goes_down_and_comes_back_in_the_supervisors_words() {
        let mut nodes = nodes(&["/drivers/base", "/actions/forward"]);
        nodes.hear(&[incident("/drivers/base", "died", "killed by SIGKILL after 3.0 s; restarted at once")]);
        assert_eq!((nodes.rows[0].state, nodes.up()), (State::Down, 1));
        nodes.hear(&[News::Started { instance: "/drivers/base".into(), pid: 7, restarts: 1 }]);
        assert_eq!(nodes.rows[0].state, State::Starting);
        nodes.hear(&[News::Ready { instance: "/drivers/base".into() }]);
        assert_eq!((nodes.rows[0].state, nodes.restarts()), (State::Up, 1));
        assert_eq!(nodes.messages, ["base: killed by SIGKILL after 3.0 s; restarted at once"]);
    }

    #[test]
    fn a_node_that_was_given_up_is_lost() {
        let mut nodes = nodes(&["/drivers/base"]);
        nodes.hear(&[incident("/drivers/base", "died", "exit code 1; given up: 10 restarts within 60 s")]);
        assert_eq!(nodes.rows[0].state, State::Lost);
    }
}
