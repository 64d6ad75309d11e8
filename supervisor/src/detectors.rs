//! Silence and lateness on a live robot, from the nodes' own channels: the age of the newest sample of every path that
//! the robot file wants fresh, and the deadlines that each node says it missed.

use std::path::Path;

use messages::{Message, NodeStatistics, bytemuck};
use runtime::Time;
use runtime::channel::{Expect, SampleBuffer, Tree};

use crate::event::Event;
use crate::ring::Ring;
use crate::robot_plan::Crew;

/// How often ages are looked at [s].
const AGES_S: f64 = 0.05;
/// How often deadlines are: nodes publish once a second [s].
const DEADLINES_S: f64 = 1.0;

/// What the detectors look at.
pub(crate) struct Detectors {
    tree: Option<Tree>,
    crews: Vec<Watched>,
    next_ages: Time,
    next_deadlines: Time,
    /// Busy and all time of the processors when they were last looked at [ticks].
    processors: Option<(u64, u64)>,
}

#[derive(Default)]
struct Watched {
    fresh: Vec<(Ring, u64)>,
    statistics: Vec<(Ring, u64)>,
    stale: bool,
}

impl Detectors {
    /// For runs without a robot.
    pub fn none() -> Detectors {
        Detectors { tree: None, crews: Vec::new(), next_ages: Time::ZERO, next_deadlines: Time::ZERO, processors: None }
    }

    /// For these processes of the robot below `root`; `nodes` are the paths of each one's nodes.
    pub fn of(root: &Path, crews: &[Crew]) -> Detectors {
        let expect =
            || Some(Expect { type_name: NodeStatistics::NAME.into(), layout_hash: NodeStatistics::layout_hash() });
        let watched = |crew: &Crew| Watched {
            fresh: crew.fresh.iter().map(|(path, age_ns)| (Ring::new(path.clone(), None), *age_ns)).collect(),
            statistics: crew.paths.iter().map(|node| (Ring::new(format!("{node}/statistics"), expect()), 0)).collect(),
            stale: false,
        };
        Detectors { tree: Tree::shared(root).ok(), crews: crews.iter().map(watched).collect(), ..Detectors::none() }
    }

    /// The node was silent when it was last looked at, by somebody else.
    pub fn believe_silent(&mut self, node: usize) {
        if let Some(crew) = self.crews.get_mut(node) {
            crew.stale = true;
        }
    }

    /// Looks at one process more, of the single node `path`.
    pub fn add(&mut self, path: &str) {
        let expect = Expect { type_name: NodeStatistics::NAME.into(), layout_hash: NodeStatistics::layout_hash() };
        let statistics = Ring::new(format!("{path}/statistics"), Some(expect));
        self.crews.push(Watched { statistics: vec![(statistics, 0)], ..Watched::default() });
    }

    /// What there is to tell of the nodes that run since `running` says.
    pub fn look(&mut self, now: Time, running: &dyn Fn(usize) -> Option<Time>) -> Vec<Event> {
        let mut events = Vec::new();
        let Some(tree) = &self.tree else { return events };
        if self.next_ages <= now {
            self.next_ages = now.after_s(AGES_S);
            for (node, crew) in self.crews.iter_mut().enumerate() {
                if let Some(since) = running(node) {
                    events.extend(crew.age(node, now, since, tree));
                }
            }
        }
        if self.next_deadlines <= now {
            self.next_deadlines = now.after_s(DEADLINES_S);
            let before = std::mem::replace(&mut self.processors, processors());
            let idle = before.zip(self.processors).map_or(0.0, |(before, now)| idle(before, now));
            for (node, crew) in self.crews.iter_mut().enumerate() {
                let misses = crew.misses(tree);
                if misses > 0 && running(node).is_some() {
                    events.push(Event::Late { node, misses, idle });
                }
            }
        }
        events
    }
}

impl Watched {
    /// Whether the node has become silent, or speaks again. One that has just begun has its time to speak.
    fn age(&mut self, node: usize, now: Time, since: Time, tree: &Tree) -> Option<Event> {
        let mut oldest_ns = None;
        for (ring, age_ns) in &mut self.fresh {
            let newest = ring.newest(tree).unwrap_or(Time::ZERO).max(since);
            let age = now.nanos_since(newest);
            if age > *age_ns {
                oldest_ns = oldest_ns.max(Some(age));
            }
        }
        match oldest_ns {
            Some(age_ns) if !std::mem::replace(&mut self.stale, true) => {
                Some(Event::Stale { node, age_s: age_ns as f64 / 1e9 })
            }
            None if std::mem::replace(&mut self.stale, false) => Some(Event::Fresh { node }),
            _ => None,
        }
    }

    /// Deadlines missed since the last look; a node that began anew counts from nothing.
    fn misses(&mut self, tree: &Tree) -> u32 {
        let mut sum = 0;
        for (ring, before) in &mut self.statistics {
            let Some(reader) = ring.reader(tree) else { continue };
            let mut buffer = SampleBuffer::new(reader.geometry());
            if reader.read(reader.head(), &mut buffer).is_err() {
                continue;
            }
            let missed = bytemuck::from_bytes::<NodeStatistics>(buffer.fixed()).missed_deadlines;
            sum += missed.saturating_sub(if missed < *before { 0 } else { *before });
            *before = missed;
        }
        sum.min(u64::from(u32::MAX)) as u32
    }
}

/// Busy and all time of all processors, from /proc/stat (proc_stat(5)) [ticks].
fn processors() -> Option<(u64, u64)> {
    let text = std::fs::read_to_string("/proc/stat").ok()?;
    parse_processors(text.lines().next()?)
}

fn parse_processors(line: &str) -> Option<(u64, u64)> {
    let ticks: Vec<u64> = line.strip_prefix("cpu ")?.split_whitespace().map_while(|word| word.parse().ok()).collect();
    // user nice system idle iowait irq softirq steal; guest time is part of user time.
    let all: u64 = ticks.iter().take(8).sum();
    let idle = ticks.get(3)? + ticks.get(4)?;
    Some((all - idle, all))
}

fn idle(before: (u64, u64), now: (u64, u64)) -> f64 {
    let (busy, all) = (now.0.saturating_sub(before.0), now.1.saturating_sub(before.1));
    if all == 0 { 0.0 } else { 1.0 - busy as f64 / all as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn idle_is_what_nobody_used() {
        let before = parse_processors("cpu  100 0 100 700 100 0 0 0 0 0").unwrap();
        let now = parse_processors("cpu  150 0 150 850 150 0 0 0 0 0").unwrap();
        assert_eq!((before, now), ((200, 1000), (300, 1300)));
        assert!((idle(before, now) - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!(parse_processors("intr 5"), None);
        assert_eq!(idle(now, now), 0.0);
    }

    #[test]
    fn a_silent_node_is_told_once_and_again_when_it_speaks() {
        use messages::Twist;
        use runtime::channel::{Claim, Geometry};
        let tree = Tree::local();
        let mut writer = tree.writer("/drivers/a/out", &Geometry::of::<Twist>(0, 8), Claim::Continue).unwrap();
        let crew = Crew {
            name: "a".into(),
            nodes: vec![0],
            paths: vec![],
            fresh: vec![("/drivers/a/out".into(), 200_000_000)],
        };
        let mut detectors = Detectors { tree: Some(tree), ..Detectors::of(Path::new("/nonexistent"), &[crew]) };
        let at = Time::from_seconds;
        let mut look = |s: f64, running: Option<f64>| detectors.look(at(s), &|_| running.map(at));
        assert_eq!(look(10.0, Some(9.9)), [], "it has just begun");
        assert!(matches!(look(10.2, Some(9.9))[..], [Event::Stale { node: 0, age_s }] if (age_s - 0.3).abs() < 1e-6));
        assert_eq!(look(10.3, Some(9.9)), []);
        writer.publish(at(10.35).nanos(), bytemuck::bytes_of(&Twist::default()), &[]);
        assert_eq!(look(10.4, Some(9.9)), [Event::Fresh { node: 0 }]);
        assert_eq!(look(20.0, None), [], "the dead are not silent");
    }
}
